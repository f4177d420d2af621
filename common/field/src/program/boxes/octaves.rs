//! Noises and cascades of them over boxes: what one evaluation in the middle says of all of a box.

use fearless_simd::Simd;

use super::linear::{Linear, Linears, choose};
use crate::cascade::{self, Carried, Cascade, Model, Term, Weight};
use crate::lanes::{self, Cells, Lanes};
use crate::noise::{Lattice, Limits, Noise, batch};
use crate::number::Number;
use crate::op::Basis;
use crate::points::BATCH;
use crate::program::machine;
use crate::range::DEPTH_ROUNDING;
use crate::range::noise::OFFSETS;

/// Rounding of a place in an octave's lattice, relative to the argument's magnitude there: in the middle and wherever else it is asked.
const PLACE_ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Relative room for the rounding of distances.
const ROOM: f64 = 1.0 + 1e-12;

/// Where its bend takes more of a noise's range than this share, a line says too little of it.
const BEND_MAX: f64 = 0.5;

/// Room for the octaves of one cascade.
#[derive(Debug)]
#[repr(align(64))]
pub(super) struct Octaves {
    /// The least and the greatest footprints.
    pub(super) footprint: [Lanes; 2],
    samples: Samples,
    /// The least and the greatest depths.
    depths: [Lanes; 2],
    noise: Linears,
    rest: Linears,
}

/// A noise in the middles of boxes.
#[derive(Debug)]
#[repr(align(64))]
struct Samples {
    cells: Cells,
    value: [f32; BATCH],
    gradient: [[f32; BATCH]; 3],
    /// How far its argument goes from the middle, and how large it is.
    reach: Lanes,
    size: Lanes,
}

/// What turns an octave's coordinates into its argument's.
#[derive(Clone, Copy)]
struct Frame<'a> {
    matrix: &'a [[f64; 3]; 3],
    frequency: f64,
}

const IDENTITY: Frame<'_> = Frame {
    matrix: &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    frequency: 1.0,
};

/// A range of weights.
#[derive(Clone, Copy)]
struct Weights {
    low: f64,
    high: f64,
}

impl Weight<Linear> for Weights {
    #[inline(always)]
    fn weigh(self, octave: Linear, amplitude: f64) -> Linear {
        let (middle, half) = (0.5 * (self.low + self.high), 0.5 * (self.high - self.low));
        let weighed = octave.times(middle * amplitude);
        Linear {
            error: weighed.error + half * amplitude * octave.size() * ROOM,
            ..weighed
        }
    }
}

impl Samples {
    /// How far the argument goes from its middle: the most that three edges make of ‖Σ ±edge‖, and its errors.
    #[inline(always)]
    fn argument(&mut self, n: usize, [a, b, c]: [&Linears; 3]) {
        assert!(n <= BATCH);
        for i in 0..n {
            let at = [a.at(i), b.at(i), c.at(i)];
            let edge = |axis: usize| [at[0].along[axis], at[1].along[axis], at[2].along[axis]];
            let (x, y, z) = (edge(0), edge(1), edge(2));
            let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
            let across = dot(x, y).abs() + dot(y, z).abs() + dot(z, x).abs();
            let square = dot(x, x) + dot(y, y) + dot(z, z) + 2.0 * across;
            let errors = [at[0].error, at[1].error, at[2].error];
            self.reach[i] = (square.sqrt() + dot(errors, errors).sqrt()) * ROOM;
            self.size[i] = at[0].size() + at[1].size() + at[2].size() + 1.0;
        }
    }

    /// Gradient noise where the cells are.
    #[inline(always)]
    fn gradient<S: Simd>(&mut self, simd: S, lattice: Lattice, n: usize) {
        let [x, y, z] = &mut self.gradient;
        lanes::values_gradients(
            simd,
            n,
            lattice,
            &mut self.cells,
            &mut self.value,
            [x, y, z],
        );
    }

    /// Any other noise where the cells are.
    #[inline(always)]
    fn any<S: Simd>(&mut self, simd: S, noise: &Noise, n: usize) {
        let (value, gradient) = (&mut self.value, &mut self.gradient);
        batch::values_gradients(simd, n, noise, &self.cells, value, gradient);
    }

    /// The noise over the boxes.
    #[inline(always)]
    fn around(
        &self,
        n: usize,
        limits: Limits,
        Frame { matrix, frequency }: Frame<'_>,
        [a, b, c]: [&Linears; 3],
        out: &mut Linears,
    ) {
        assert!(n <= BATCH);
        let [gx, gy, gz] = &self.gradient;
        for i in 0..n {
            let blur = frequency * self.size[i] * PLACE_ROUNDING + OFFSETS;
            let reach = frequency * self.reach[i] + blur;
            let bend = 0.5 * limits.bend * reach * reach * ROOM;
            let steep = limits.slope * reach * ROOM;
            let rounding =
                2.0 * (limits.rounding + limits.slope * blur + limits.slope_rounding * reach);
            let gradient = [f64::from(gx[i]), f64::from(gy[i]), f64::from(gz[i])];
            let [p, q, r] = cascade::pull(matrix, gradient);
            let (a, b, c) = (a.at(i), b.at(i), c.at(i));
            let along = |axis: usize| p * a.along[axis] + q * b.along[axis] + r * c.along[axis];
            let inherited = p.abs() * a.error + q.abs() * b.error + r.abs() * c.error;
            let value = f64::from(self.value[i]);
            let line = Linear {
                centre: value,
                along: [along(0), along(1), along(2)],
                error: (inherited + bend) * ROOM + rounding,
            };
            let still = |centre: f64, error: f64| Linear {
                centre,
                along: [0.0; 3],
                error,
            };
            let near = still(value, steep + rounding);
            let anywhere = still(limits.middle, limits.range);
            // Nothing that is no number is less.
            let is_line = (bend < BEND_MAX * limits.range) & (bend < steep);
            let least = choose(steep < limits.range, near, anywhere);
            out.set(i, choose(is_line, line, least));
        }
    }
}

impl Octaves {
    pub(super) fn new() -> Box<Self> {
        Box::new(Self {
            footprint: [[0.0; BATCH]; 2],
            samples: Samples {
                cells: Cells::new(),
                value: [0.0; BATCH],
                gradient: [[0.0; BATCH]; 3],
                reach: [0.0; BATCH],
                size: [0.0; BATCH],
            },
            depths: [[0.0; BATCH]; 2],
            noise: *Linears::new(),
            rest: *Linears::new(),
        })
    }

    #[inline(always)]
    pub(super) fn noise<S: Simd>(
        &mut self,
        simd: S,
        lattice: Lattice,
        n: usize,
        at: [&Linears; 3],
        out: &mut Linears,
    ) {
        let samples = &mut self.samples;
        lanes::split(simd, n, at.map(|part| &part.centre), &mut samples.cells);
        samples.gradient(simd, lattice, n);
        simd.vectorize(
            #[inline(always)]
            || {
                samples.argument(n, at);
                samples.around(n, Limits::GRADIENT, IDENTITY, at, out);
            },
        );
    }

    #[inline(always)]
    pub(super) fn any_noise<S: Simd>(
        &mut self,
        simd: S,
        noise: &Noise,
        n: usize,
        at: [&Linears; 3],
        out: &mut Linears,
    ) {
        let samples = &mut self.samples;
        lanes::split(simd, n, at.map(|part| &part.centre), &mut samples.cells);
        samples.any(simd, noise, n);
        simd.vectorize(
            #[inline(always)]
            || {
                samples.argument(n, at);
                samples.around(n, Limits::of(noise), IDENTITY, at, out);
            },
        );
    }

    #[inline(always)]
    pub(super) fn run<S: Simd>(
        &mut self,
        simd: S,
        cascade: &Cascade,
        n: usize,
        at: [&Linears; 3],
        total: &mut Linears,
    ) {
        assert!(n <= BATCH);
        let Self {
            footprint,
            samples,
            depths: [shallow, deep],
            noise,
            rest,
        } = self;
        simd.vectorize(
            #[inline(always)]
            || samples.argument(n, at),
        );
        let [low, high] = footprint;
        machine::depths(cascade, n, high, shallow);
        machine::depths(cascade, n, low, deep);
        total.clear(n);
        rest.clear(n);
        let middles = at.map(|part| &part.centre);
        for (k, octave) in cascade.octaves.iter().enumerate() {
            let i = cascade::index(k);
            if !deep[..n].iter().any(|deep| *deep + DEPTH_ROUNDING > i) {
                break;
            }
            lanes::place(simd, n, octave, middles, &mut samples.cells);
            let limits = match &octave.noise {
                None => {
                    samples.gradient(simd, octave.lattice, n);
                    Limits::GRADIENT
                }
                Some(any) => {
                    samples.any(simd, any, n);
                    Limits::of(any)
                }
            };
            let frame = Frame {
                matrix: &octave.matrix,
                frequency: octave.frequency,
            };
            let place = Place {
                n,
                i,
                amplitude: octave.amplitude,
                depths: [shallow, deep],
            };
            simd.vectorize(
                #[inline(always)]
                || {
                    samples.around(n, limits, frame, at, noise);
                    add(cascade.model, place, noise, total, rest);
                },
            );
        }
    }
}

/// Which octave.
#[derive(Clone, Copy)]
struct Place<'a> {
    n: usize,
    i: f64,
    amplitude: f64,
    depths: [&'a Lanes; 2],
}

/// Adds an octave's noise. Models have loops of their own, so that none of them decides anything.
#[inline(always)]
fn add(model: Model, at: Place<'_>, noise: &Linears, total: &mut Linears, rest: &mut Linears) {
    macro_rules! each {
        ($add:expr) => {
            each(
                at,
                noise,
                total,
                rest,
                #[inline(always)]
                |t, n, c| $add(t, n, c),
            )
        };
    }
    macro_rules! shapes {
        ($basis:expr, |$shape:ident| $add:expr) => {
            match $basis {
                Basis::Plain => {
                    const $shape: Basis = Basis::Plain;
                    each!($add)
                }
                Basis::Absolute => {
                    const $shape: Basis = Basis::Absolute;
                    each!($add)
                }
                Basis::Ridged => {
                    const $shape: Basis = Basis::Ridged;
                    each!($add)
                }
            }
        };
    }
    match model {
        Model::Sum(basis) => shapes!(basis, |SHAPE| |t, n, c| cascade::sum(SHAPE, t, n, c)),
        Model::AltitudeOne { basis, xi } => {
            shapes!(basis, |SHAPE| |t, n, c| cascade::altitude_one(
                SHAPE, xi, t, n, c
            ))
        }
        Model::AltitudeTwo { basis, xi } => {
            shapes!(basis, |SHAPE| |t, n, c| cascade::altitude_two(
                SHAPE, xi, t, n, c
            ))
        }
        Model::Ridged { offset, gain } => {
            each!(|t, n, c| cascade::ridged(offset, gain, t, n, c))
        }
    }
}

#[inline(always)]
fn each(
    Place {
        n,
        i,
        amplitude,
        depths: [shallow, deep],
    }: Place<'_>,
    noise: &Linears,
    total: &mut Linears,
    rest: &mut Linears,
    add: impl Fn(Term<Weights>, Linear, Carried<Linear>) -> Carried<Linear>,
) {
    assert!(n <= BATCH);
    for lane in 0..n {
        let term = Term {
            first: i == 0.0,
            amplitude,
            weight: Weights {
                low: cascade::weight(shallow[lane] - DEPTH_ROUNDING, i),
                high: cascade::weight(deep[lane] + DEPTH_ROUNDING, i),
            },
        };
        let carried = (total.at(lane), rest.at(lane));
        let (sum, handed) = add(term, noise.at(lane), carried);
        total.set(lane, sum);
        rest.set(lane, handed);
    }
}
