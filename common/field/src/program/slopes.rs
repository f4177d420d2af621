//! The machine that evaluates code with gradients, by the chain rule of thesis eq. (2.17).
//!
//! Registers hold duals: a value and its derivatives, either by the world's x, y, z (`N` = 3) or along
//! one direction of each lane's own (`N` = 1). Footprint and time count as constants.

use fearless_simd::Simd;

use crate::arithmetic::{self, Binary, Unary};
use crate::cascade::{self, Carried, Cascade, Model, Octave, Term};
use crate::lanes::{self, Cells, Lanes};
use crate::noise::{Lattice, batch};
use crate::number::{Dual, Number};
use crate::op::Basis;
use crate::points::{BATCH, Points};
use crate::program::code::{Code, FOOTPRINT, Instruction, Operation};
use crate::program::machine::{self, Count};

/// Duals, one per lane, as structure of arrays.
#[derive(Debug)]
pub(crate) struct Duals<const N: usize> {
    pub(crate) value: Lanes,
    pub(crate) gradient: [Lanes; N],
}

impl<const N: usize> Duals<N> {
    fn new() -> Box<Self> {
        Box::new(Self {
            value: [0.0; BATCH],
            gradient: [[0.0; BATCH]; N],
        })
    }

    #[inline(always)]
    fn at(&self, i: usize) -> Dual<N> {
        let mut gradient = [0.0; N];
        for (part, lanes) in gradient.iter_mut().zip(&self.gradient) {
            *part = lanes[i];
        }
        Dual {
            value: self.value[i],
            gradient,
        }
    }

    #[inline(always)]
    fn set(&mut self, i: usize, dual: Dual<N>) {
        self.value[i] = dual.value;
        for (lanes, part) in self.gradient.iter_mut().zip(dual.gradient) {
            lanes[i] = part;
        }
    }

    fn clear(&mut self, n: usize) {
        self.value[..n].fill(0.0);
        for lanes in &mut self.gradient {
            lanes[..n].fill(0.0);
        }
    }

    fn set_constant(&mut self, value: f64) {
        self.value.fill(value);
        for lanes in &mut self.gradient {
            lanes.fill(0.0);
        }
    }
}

/// The registers of duals.
#[derive(Debug)]
pub(crate) struct Slopes<const N: usize> {
    registers: Vec<Box<Duals<N>>>,
    constants: Vec<f64>,
    result: Box<Duals<N>>,
    octaves: Box<Octaves<N>>,
    pub(crate) tape: Tape<N>,
}

/// What noises gave, in the order in which the code asks for them.
#[derive(Debug, Default)]
pub(crate) struct Tape<const N: usize> {
    /// Whether every noise is kept; else each takes the place of the last.
    keeps: bool,
    samples: Vec<Box<Sample<N>>>,
    /// The next sample's place.
    next: usize,
    /// Of every cascade, how many octaves it has evaluated and its depths.
    cascades: Vec<(usize, Box<Lanes>)>,
    next_cascade: usize,
}

impl<const N: usize> Tape<N> {
    fn rewind(&mut self) {
        (self.next, self.next_cascade) = (0, 0);
    }

    /// Where the next noise goes.
    #[inline(always)]
    fn sample(&mut self) -> &mut Sample<N> {
        let place = if self.keeps { self.next } else { 0 };
        self.next += 1;
        if place == self.samples.len() {
            self.samples.push(Box::new(Sample {
                noise: [0.0; BATCH],
                gradient: [[0.0; BATCH]; N],
            }));
        }
        &mut self.samples[place]
    }

    fn keep_cascade(&mut self, n: usize, octaves: usize, depth: &Lanes) {
        if !self.keeps {
            return;
        }
        if self.next_cascade == self.cascades.len() {
            self.cascades.push((0, Box::new([0.0; BATCH])));
        }
        let (count, kept) = &mut self.cascades[self.next_cascade];
        *count = octaves;
        kept[..n].copy_from_slice(&depth[..n]);
        self.next_cascade += 1;
    }

    /// The noise that was asked for as number `i`.
    pub(crate) fn sample_at(&self, i: usize) -> &Sample<N> {
        &self.samples[i]
    }

    /// The cascade that was asked for as number `i`: how many octaves it evaluated, and its depths.
    pub(crate) fn cascade_at(&self, i: usize) -> (usize, &Lanes) {
        let (octaves, depth) = &self.cascades[i];
        (*octaves, depth)
    }
}

/// Room for the octaves of one cascade.
#[derive(Debug)]
struct Octaves<const N: usize> {
    cells: Cells,
    /// Directions in the octave's lattice; of use where `N` is 1.
    along: [[f32; BATCH]; 3],
    /// All three derivatives of a noise that is not asked along a direction itself.
    full: [[f32; BATCH]; 3],
    depth: Lanes,
    total: Box<Duals<N>>,
    rest: Box<Duals<N>>,
}

/// One octave's noise over the lanes.
#[derive(Debug)]
pub(crate) struct Sample<const N: usize> {
    pub(crate) noise: [f32; BATCH],
    pub(crate) gradient: [[f32; BATCH]; N],
}

/// Which octave.
#[derive(Clone, Copy)]
struct Place<'a> {
    n: usize,
    i: f64,
    octave: &'a Octave,
    depth: &'a Lanes,
}

impl<const N: usize> Default for Slopes<N> {
    fn default() -> Self {
        Self {
            registers: Vec::new(),
            constants: Vec::new(),
            result: Duals::new(),
            tape: Tape::default(),
            octaves: Box::new(Octaves {
                cells: Cells::new(),
                along: [[0.0; BATCH]; 3],
                full: [[0.0; BATCH]; 3],
                depth: [0.0; BATCH],
                total: Duals::new(),
                rest: Duals::new(),
            }),
        }
    }
}

impl<const N: usize> Slopes<N> {
    /// Makes room for the code, sets its constants and the gradients of its inputs.
    pub(crate) fn prepare(&mut self, code: &Code) {
        let (registers, constants) = (&mut self.registers, &mut self.constants);
        let set = Duals::set_constant;
        let grown = machine::prepare(registers, constants, code, Duals::new, set);
        if grown && N == 3 {
            for axis in 0..N {
                self.registers[axis].gradient[axis].fill(1.0);
            }
        }
    }

    /// Sets the directions along which the derivatives of the points from `start` on are wanted.
    pub(crate) fn aim(&mut self, direction: [&[f64]; 3], start: usize) {
        const { assert!(N == 1, "a gradient by coordinates needs no direction") }
        for (register, parts) in self.registers.iter_mut().zip(direction) {
            let parts = &parts[start..];
            let n = parts.len().min(BATCH);
            let lanes = &mut register.gradient[0];
            lanes[..n].copy_from_slice(&parts[..n]);
            // Lanes without a point compute the last one again.
            lanes[n..].fill(parts[n - 1]);
        }
    }

    /// Whether the noises of the runs to come are kept on the tape, each run's in place of the last one's.
    pub(crate) fn keep_noises(&mut self, keeps: bool) {
        self.tape.keeps = keeps;
    }

    /// Evaluates the points from `start` on, as many as a batch holds.
    #[inline(always)]
    pub(crate) fn run<S: Simd>(
        &mut self,
        simd: S,
        code: &Code,
        points: &Points<'_>,
        start: usize,
        noises: &mut u64,
    ) -> Count {
        self.tape.rewind();
        let mut inputs = self.registers.iter_mut();
        let count = machine::load(points, start, |_| {
            &mut inputs
                .next()
                .expect("there is a register for each input")
                .value
        });
        for instruction in &code.instructions {
            *noises += self.step(simd, instruction, count);
            std::mem::swap(&mut self.registers[instruction.result], &mut self.result);
        }
        count
    }

    /// The duals of a register.
    pub(crate) fn register(&self, register: usize) -> &Duals<N> {
        &self.registers[register]
    }

    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, instruction: &Instruction, count: Count) -> u64 {
        let n = count.lanes;
        assert!(n <= BATCH);
        let [a, b, c] = instruction.args.map(|arg| &*self.registers[arg]);
        let out = &mut *self.result;
        match &instruction.act {
            Operation::Unary(unary) => unary_lanes(*unary, n, a, out),
            Operation::Binary(binary) => binary_lanes(*binary, n, a, b, out),
            Operation::Select => each3(
                n,
                [a, b, c],
                out,
                #[inline(always)]
                |a, b, c| Dual {
                    value: arithmetic::select(a.value, b.value, c.value),
                    gradient: if a.value < 0.0 {
                        b.gradient
                    } else {
                        c.gradient
                    },
                },
            ),
            Operation::Length => each3(n, [a, b, c], out, length),
            Operation::OntoSphere(radius) => each(
                n,
                a,
                out,
                #[inline(always)]
                |a| {
                    let factor = arithmetic::onto_sphere(*radius, a.value);
                    a.chain(factor, -factor * arithmetic::inverse(a.value))
                },
            ),
            Operation::Power(exponent) => each(
                n,
                a,
                out,
                #[inline(always)]
                |a| {
                    let value = arithmetic::power(*exponent, a.value);
                    a.chain(value, arithmetic::power_slope(*exponent, a.value, value))
                },
            ),
            Operation::SmoothStep(low, high) => each(
                n,
                a,
                out,
                #[inline(always)]
                |a| {
                    a.chain(
                        arithmetic::smoothstep(*low, *high, a.value),
                        arithmetic::smoothstep_slope(*low, *high, a.value),
                    )
                },
            ),
            Operation::Curve(curve) => each(
                n,
                a,
                out,
                #[inline(always)]
                |a| {
                    let (value, slope) = curve.value_slope(a.value);
                    a.chain(value, slope)
                },
            ),
            Operation::Shape(shape) => each3(n, [a, b, c], out, |a, b, c| shape.value([a, b, c])),
            Operation::Grid(surface) => each3(
                n,
                [a, b, c],
                out,
                #[inline(always)]
                |a, b, c| {
                    let (value, slopes) = surface.value_gradient([a.value, b.value, c.value]);
                    pull(slopes, [a, b, c], value)
                },
            ),
            Operation::Noise(lattice) => {
                let Octaves { cells, along, .. } = &mut *self.octaves;
                let sample = self.tape.sample();
                lanes::split(simd, n, [&a.value, &b.value, &c.value], cells);
                if N == 1 {
                    directions(n, &IDENTITY, [a, b, c], along);
                }
                sample.fill(simd, n, *lattice, cells, along);
                for i in 0..n {
                    let noise = f64::from(sample.noise[i]);
                    out.set(i, sample.pulled(i, [a, b, c], noise));
                }
                return count.points as u64;
            }
            Operation::AnyNoise(_) | Operation::Slope(..) => {
                let Octaves {
                    cells,
                    full: gradient,
                    ..
                } = &mut *self.octaves;
                let Sample { noise, .. } = self.tape.sample();
                lanes::split(simd, n, [&a.value, &b.value, &c.value], cells);
                match &instruction.act {
                    Operation::Slope(any, axis) => {
                        batch::slopes_gradients(n, any, *axis, cells, noise, gradient);
                    }
                    Operation::AnyNoise(any) => {
                        batch::values_gradients(simd, n, any, cells, noise, gradient);
                    }
                    _ => unreachable!("the arm takes no other"),
                }
                let [gx, gy, gz] = gradient;
                for i in 0..n {
                    let slopes = [f64::from(gx[i]), f64::from(gy[i]), f64::from(gz[i])];
                    let at = [a.at(i), b.at(i), c.at(i)];
                    out.set(i, pull(slopes, at, f64::from(noise[i])));
                }
                return count.points as u64;
            }
            Operation::Cascade(cascade) => {
                let footprint = &self.registers[FOOTPRINT].value;
                let tape = &mut self.tape;
                let noises = self
                    .octaves
                    .run(simd, cascade, count, [a, b, c], footprint, tape);
                let total = &self.octaves.total;
                for i in 0..n {
                    let total = total.at(i);
                    // Along a direction the octaves have it already.
                    let dual = if N == 1 {
                        total
                    } else {
                        pull(
                            triple(total.gradient),
                            [a.at(i), b.at(i), c.at(i)],
                            total.value,
                        )
                    };
                    out.set(i, dual);
                }
                return noises;
            }
        }
        0
    }
}

const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The three derivatives by coordinates; not to be asked of others.
#[inline(always)]
fn triple<const N: usize>(gradient: [f64; N]) -> [f64; 3] {
    let mut three = [0.0; 3];
    for (part, given) in three.iter_mut().zip(gradient) {
        *part = given;
    }
    three
}

/// The directions of a place's way, turned by an octave's matrix.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    reason = "derivatives are f32 as the noise's own"
)]
fn directions<const N: usize>(
    n: usize,
    [p, q, r]: &[[f64; 3]; 3],
    [a, b, c]: [&Duals<N>; 3],
    along: &mut [[f32; BATCH]; 3],
) {
    assert!(n <= BATCH);
    let (x, y, z) = (&a.gradient[0], &b.gradient[0], &c.gradient[0]);
    let [s, t, u] = along;
    for i in 0..n {
        s[i] = (p[0] * x[i] + p[1] * y[i] + p[2] * z[i]) as f32;
        t[i] = (q[0] * x[i] + q[1] * y[i] + q[2] * z[i]) as f32;
        u[i] = (r[0] * x[i] + r[1] * y[i] + r[2] * z[i]) as f32;
    }
}

impl<const N: usize> Sample<N> {
    /// The noise in `cells`: with its gradient, or its derivative along `along`.
    #[inline(always)]
    fn fill<S: Simd>(
        &mut self,
        simd: S,
        n: usize,
        lattice: Lattice,
        cells: &mut Cells,
        along: &[[f32; BATCH]; 3],
    ) {
        let Self {
            noise, gradient, ..
        } = self;
        match gradient.as_mut_slice() {
            [slope] => lanes::values_along(simd, n, lattice, cells, along, noise, slope),
            [x, y, z] => lanes::values_gradients(simd, n, lattice, cells, noise, [x, y, z]),
            _ => unreachable!("derivatives are by one or three variables"),
        }
    }

    /// Takes a noise's gradient, or its derivative along `along`.
    #[inline(always)]
    fn take(&mut self, n: usize, [x, y, z]: &[[f32; BATCH]; 3], along: &[[f32; BATCH]; 3]) {
        let [p, q, r] = along;
        match self.gradient.as_mut_slice() {
            [slope] => {
                for (i, slope) in slope[..n].iter_mut().enumerate() {
                    *slope = x[i] * p[i] + y[i] * q[i] + z[i] * r[i];
                }
            }
            parts => {
                for (part, given) in parts.iter_mut().zip([x, y, z]) {
                    part[..n].copy_from_slice(&given[..n]);
                }
            }
        }
    }

    #[inline(always)]
    fn slopes(&self, i: usize) -> [f64; N] {
        let mut slopes = [0.0; N];
        for (slope, lanes) in slopes.iter_mut().zip(&self.gradient) {
            *slope = f64::from(lanes[i]);
        }
        slopes
    }

    /// A value with these derivatives at a place that has its own.
    #[inline(always)]
    fn pulled(&self, i: usize, [a, b, c]: [&Duals<N>; 3], value: f64) -> Dual<N> {
        let gradient = self.slopes(i);
        if N == 1 {
            return Dual { value, gradient };
        }
        pull(triple(gradient), [a.at(i), b.at(i), c.at(i)], value)
    }
}

/// A function of a place, given its slopes there and the place's own gradients.
#[inline(always)]
fn pull<const N: usize>([s, t, u]: [f64; 3], [a, b, c]: [Dual<N>; 3], value: f64) -> Dual<N> {
    let mut gradient = a.gradient;
    for (i, part) in gradient.iter_mut().enumerate() {
        *part = s * *part + t * b.gradient[i] + u * c.gradient[i];
    }
    Dual { value, gradient }
}

#[inline(always)]
fn length<const N: usize>(a: Dual<N>, b: Dual<N>, c: Dual<N>) -> Dual<N> {
    let length = arithmetic::length([a.value, b.value, c.value]);
    let inverse = arithmetic::inverse(length);
    pull(
        [a.value * inverse, b.value * inverse, c.value * inverse],
        [a, b, c],
        length,
    )
}

impl<const N: usize> Octaves<N> {
    #[inline(always)]
    fn run<S: Simd>(
        &mut self,
        simd: S,
        cascade: &Cascade,
        count: Count,
        at: [&Duals<N>; 3],
        footprint: &Lanes,
        tape: &mut Tape<N>,
    ) -> u64 {
        let n = count.lanes;
        let mut noises = 0;
        let place = at.map(|part| &part.value);
        let Self {
            cells,
            along,
            full,
            depth,
            total,
            rest,
        } = self;
        machine::depths(cascade, n, footprint, depth);
        let mut octaves = 0;
        total.clear(n);
        rest.clear(n);
        for (i, octave) in cascade.octaves.iter().enumerate() {
            let i = cascade::index(i);
            let live = machine::live(depth, count.points, i);
            if live == 0 {
                break;
            }
            noises += live;
            octaves += 1;
            let sample = tape.sample();
            lanes::place(simd, n, octave, place, cells);
            if N == 1 {
                directions(n, &octave.matrix, at, along);
            }
            match &octave.noise {
                None => sample.fill(simd, n, octave.lattice, cells, along),
                Some(any) => {
                    batch::values_gradients(simd, n, any, cells, &mut sample.noise, full);
                    sample.take(n, full, along);
                }
            }
            let place = Place {
                n,
                i,
                octave,
                depth,
            };
            add(cascade.model, place, sample, total, rest);
        }
        tape.keep_cascade(n, octaves, depth);
        noises
    }
}

#[inline(always)]
fn add<const N: usize>(
    model: Model,
    at: Place<'_>,
    sample: &Sample<N>,
    total: &mut Duals<N>,
    rest: &mut Duals<N>,
) {
    match model {
        Model::Sum(Basis::Plain) => add_each(
            at,
            sample,
            total,
            rest,
            #[inline(always)]
            |t, n, c| cascade::sum(Basis::Plain, t, n, c),
        ),
        Model::Sum(Basis::Absolute) => add_each(
            at,
            sample,
            total,
            rest,
            #[inline(always)]
            |t, n, c| cascade::sum(Basis::Absolute, t, n, c),
        ),
        Model::Sum(Basis::Ridged) => add_each(
            at,
            sample,
            total,
            rest,
            #[inline(always)]
            |t, n, c| cascade::sum(Basis::Ridged, t, n, c),
        ),
        Model::AltitudeOne { basis, xi } => {
            add_each(
                at,
                sample,
                total,
                rest,
                #[inline(always)]
                |t, n, c| cascade::altitude_one(basis, xi, t, n, c),
            );
        }
        Model::AltitudeTwo { basis, xi } => {
            add_each(
                at,
                sample,
                total,
                rest,
                #[inline(always)]
                |t, n, c| cascade::altitude_two(basis, xi, t, n, c),
            );
        }
        Model::Ridged { offset, gain } => {
            add_each(
                at,
                sample,
                total,
                rest,
                #[inline(always)]
                |t, n, c| cascade::ridged(offset, gain, t, n, c),
            );
        }
    }
}

#[inline(always)]
fn add_each<const N: usize>(
    Place {
        n,
        i,
        octave,
        depth,
    }: Place<'_>,
    sample: &Sample<N>,
    total: &mut Duals<N>,
    rest: &mut Duals<N>,
    add: impl Fn(Term, Dual<N>, Carried<Dual<N>>) -> Carried<Dual<N>>,
) {
    let (matrix, amplitude) = (octave.matrix, octave.amplitude);
    for (lane, depth) in depth[..n].iter().copied().enumerate() {
        let term = Term {
            first: i == 0.0,
            amplitude,
            weight: cascade::weight(depth, i),
        };
        let mut gradient = sample.slopes(lane);
        if N == 3 {
            let pulled = cascade::pull(&matrix, triple(gradient));
            gradient.copy_from_slice(&pulled);
        }
        let noise = Dual {
            value: f64::from(sample.noise[lane]),
            gradient,
        };
        let (sum, handed) = add(term, noise, (total.at(lane), rest.at(lane)));
        total.set(lane, sum);
        rest.set(lane, handed);
    }
}

#[inline(always)]
fn each<const N: usize>(
    n: usize,
    a: &Duals<N>,
    out: &mut Duals<N>,
    f: impl Fn(Dual<N>) -> Dual<N>,
) {
    assert!(n <= BATCH);
    for i in 0..n {
        out.set(i, f(a.at(i)));
    }
}

#[inline(always)]
fn each2<const N: usize>(
    n: usize,
    [a, b]: [&Duals<N>; 2],
    out: &mut Duals<N>,
    f: impl Fn(Dual<N>, Dual<N>) -> Dual<N>,
) {
    assert!(n <= BATCH);
    for i in 0..n {
        out.set(i, f(a.at(i), b.at(i)));
    }
}

#[inline(always)]
fn each3<const N: usize>(
    n: usize,
    [a, b, c]: [&Duals<N>; 3],
    out: &mut Duals<N>,
    f: impl Fn(Dual<N>, Dual<N>, Dual<N>) -> Dual<N>,
) {
    assert!(n <= BATCH);
    for i in 0..n {
        out.set(i, f(a.at(i), b.at(i), c.at(i)));
    }
}

/// One loop per function, so that none of them decides anything.
#[inline(always)]
fn unary_lanes<const N: usize>(unary: Unary, n: usize, a: &Duals<N>, out: &mut Duals<N>) {
    macro_rules! lanes {
        ($($unary:ident)+) => {
            match unary {
                $(Unary::$unary => each(
                    n,
                    a,
                    out,
                    #[inline(always)]
                    |a| a.unary(Unary::$unary),
                ),)+
            }
        };
    }
    lanes!(Neg Abs Sqrt Sin Cos Exp);
}

#[inline(always)]
fn binary_lanes<const N: usize>(
    binary: Binary,
    n: usize,
    a: &Duals<N>,
    b: &Duals<N>,
    out: &mut Duals<N>,
) {
    macro_rules! lanes {
        ($($binary:ident)+) => {
            match binary {
                $(Binary::$binary => each2(
                    n,
                    [a, b],
                    out,
                    #[inline(always)]
                    |a, b| a.binary(b, Binary::$binary),
                ),)+
            }
        };
    }
    lanes!(Add Sub Mul Div Min Max);
}
