//! The machine that evaluates code with gradients, by the chain rule of thesis eq. (2.17).
//!
//! Registers hold duals: a value and its gradient by the world's x, y, z. Footprint and time count as constants.

use fearless_simd::Simd;

use crate::arithmetic::{self, Binary, Unary};
use crate::cascade::{self, Carried, Cascade, Model, Octave, Term};
use crate::lanes::{self, Cells, Lanes};
use crate::number::Dual;
use crate::points::{BATCH, Points};
use crate::program::code::{Code, FOOTPRINT, INPUTS, Instruction, Operation};
use crate::program::machine::{self, Count};

/// Duals, one per lane, as structure of arrays.
#[derive(Debug)]
pub(crate) struct Duals {
    pub(crate) value: Lanes,
    pub(crate) gradient: [Lanes; 3],
}

impl Duals {
    fn new() -> Box<Self> {
        Box::new(Self {
            value: [0.0; BATCH],
            gradient: [[0.0; BATCH]; 3],
        })
    }

    #[inline(always)]
    fn at(&self, i: usize) -> Dual {
        let [x, y, z] = &self.gradient;
        Dual {
            value: self.value[i],
            gradient: [x[i], y[i], z[i]],
        }
    }

    #[inline(always)]
    fn set(&mut self, i: usize, dual: Dual) {
        let ([x, y, z], [a, b, c]) = (&mut self.gradient, dual.gradient);
        self.value[i] = dual.value;
        x[i] = a;
        y[i] = b;
        z[i] = c;
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
pub(crate) struct Slopes {
    registers: Vec<Box<Duals>>,
    constants: Vec<f64>,
    result: Box<Duals>,
    octaves: Box<Octaves>,
}

/// Room for the octaves of one cascade.
#[derive(Debug)]
struct Octaves {
    cells: Cells,
    sample: Sample,
    total: Box<Duals>,
    rest: Box<Duals>,
}

/// One octave's noise over the lanes.
#[derive(Debug)]
struct Sample {
    noise: [f32; BATCH],
    gradient: [[f32; BATCH]; 3],
    depth: Lanes,
}

/// Which octave.
#[derive(Clone, Copy)]
struct Place<'a> {
    n: usize,
    i: f64,
    octave: &'a Octave,
}

impl Default for Slopes {
    fn default() -> Self {
        Self {
            registers: Vec::new(),
            constants: Vec::new(),
            result: Duals::new(),
            octaves: Box::new(Octaves {
                cells: Cells::new(),
                sample: Sample {
                    noise: [0.0; BATCH],
                    gradient: [[0.0; BATCH]; 3],
                    depth: [0.0; BATCH],
                },
                total: Duals::new(),
                rest: Duals::new(),
            }),
        }
    }
}

impl Slopes {
    /// Makes room for the code, sets its constants and the gradients of its inputs.
    pub(crate) fn prepare(&mut self, code: &Code) {
        let grown = self.registers.len() < code.registers;
        if grown {
            self.registers.resize_with(code.registers, Duals::new);
            for axis in 0..3 {
                self.registers[axis].gradient[axis].fill(1.0);
            }
        }
        let same = self.constants.len() == code.constants.len()
            && self
                .constants
                .iter()
                .zip(&code.constants)
                .all(|(a, b)| a.to_bits() == b.to_bits());
        if grown || !same {
            for (register, constant) in self.registers[INPUTS..].iter_mut().zip(&code.constants) {
                register.set_constant(*constant);
            }
            self.constants.clone_from(&code.constants);
        }
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
    pub(crate) fn register(&self, register: usize) -> &Duals {
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
                    gradient: [0, 1, 2].map(
                        #[inline(always)]
                        |i| arithmetic::select(a.value, b.gradient[i], c.gradient[i]),
                    ),
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
                let Octaves { cells, sample, .. } = &mut *self.octaves;
                let Sample {
                    noise, gradient, ..
                } = sample;
                lanes::split(simd, n, [&a.value, &b.value, &c.value], cells);
                lanes::values_gradients(simd, n, *lattice, cells, noise, gradient);
                let [gx, gy, gz] = gradient;
                for i in 0..n {
                    let slopes = [f64::from(gx[i]), f64::from(gy[i]), f64::from(gz[i])];
                    out.set(
                        i,
                        pull(slopes, [a.at(i), b.at(i), c.at(i)], f64::from(noise[i])),
                    );
                }
                return count.points as u64;
            }
            Operation::Cascade(cascade) => {
                let footprint = &self.registers[FOOTPRINT].value;
                let noises = self.octaves.run(
                    simd,
                    cascade,
                    count,
                    [&a.value, &b.value, &c.value],
                    footprint,
                );
                let total = &self.octaves.total;
                for i in 0..n {
                    let Dual { value, gradient } = total.at(i);
                    out.set(i, pull(gradient, [a.at(i), b.at(i), c.at(i)], value));
                }
                return noises;
            }
        }
        0
    }
}

/// A function of a place, given its slopes there and the place's own gradients.
#[inline(always)]
fn pull([s, t, u]: [f64; 3], [a, b, c]: [Dual; 3], value: f64) -> Dual {
    let (a, b, c) = (a.gradient, b.gradient, c.gradient);
    Dual {
        value,
        gradient: [
            s * a[0] + t * b[0] + u * c[0],
            s * a[1] + t * b[1] + u * c[1],
            s * a[2] + t * b[2] + u * c[2],
        ],
    }
}

#[inline(always)]
fn length(a: Dual, b: Dual, c: Dual) -> Dual {
    let length = arithmetic::length([a.value, b.value, c.value]);
    let inverse = arithmetic::inverse(length);
    pull(
        [a.value * inverse, b.value * inverse, c.value * inverse],
        [a, b, c],
        length,
    )
}

impl Octaves {
    #[inline(always)]
    fn run<S: Simd>(
        &mut self,
        simd: S,
        cascade: &Cascade,
        count: Count,
        at: [&Lanes; 3],
        footprint: &Lanes,
    ) -> u64 {
        let n = count.lanes;
        let mut noises = 0;
        let Self {
            cells,
            sample,
            total,
            rest,
        } = self;
        machine::depths(cascade, n, footprint, &mut sample.depth);
        total.set_constant(0.0);
        rest.set_constant(0.0);
        for (i, octave) in cascade.octaves.iter().enumerate() {
            let i = cascade::index(i);
            let live = machine::live(&sample.depth, count.points, i);
            if live == 0 {
                break;
            }
            noises += live;
            lanes::place(simd, n, octave, at, cells);
            lanes::values_gradients(
                simd,
                n,
                octave.lattice,
                cells,
                &mut sample.noise,
                &mut sample.gradient,
            );
            add(cascade.model, Place { n, i, octave }, sample, total, rest);
        }
        noises
    }
}

#[inline(always)]
fn add(model: Model, at: Place<'_>, sample: &Sample, total: &mut Duals, rest: &mut Duals) {
    match model {
        Model::Sum(basis) => add_each(
            at,
            sample,
            total,
            rest,
            #[inline(always)]
            |t, n, c| cascade::sum(basis, t, n, c),
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
fn add_each(
    Place { n, i, octave }: Place<'_>,
    sample: &Sample,
    total: &mut Duals,
    rest: &mut Duals,
    add: impl Fn(Term, Dual, Carried<Dual>) -> Carried<Dual>,
) {
    let [gx, gy, gz] = &sample.gradient;
    let (matrix, amplitude) = (octave.matrix, octave.amplitude);
    assert!(n <= BATCH);
    for lane in 0..n {
        let term = Term {
            first: i == 0.0,
            amplitude,
            weight: cascade::weight(sample.depth[lane], i),
        };
        let slopes = [
            f64::from(gx[lane]),
            f64::from(gy[lane]),
            f64::from(gz[lane]),
        ];
        let noise = Dual {
            value: f64::from(sample.noise[lane]),
            gradient: cascade::pull(&matrix, slopes),
        };
        let (sum, handed) = add(term, noise, (total.at(lane), rest.at(lane)));
        total.set(lane, sum);
        rest.set(lane, handed);
    }
}

#[inline(always)]
fn each(n: usize, a: &Duals, out: &mut Duals, f: impl Fn(Dual) -> Dual) {
    assert!(n <= BATCH);
    for i in 0..n {
        out.set(i, f(a.at(i)));
    }
}

#[inline(always)]
fn each3(n: usize, [a, b, c]: [&Duals; 3], out: &mut Duals, f: impl Fn(Dual, Dual, Dual) -> Dual) {
    assert!(n <= BATCH);
    for i in 0..n {
        out.set(i, f(a.at(i), b.at(i), c.at(i)));
    }
}

#[inline(always)]
fn unary_lanes(unary: Unary, n: usize, a: &Duals, out: &mut Duals) {
    each(
        n,
        a,
        out,
        #[inline(always)]
        |a| {
            let value = unary.value(a.value);
            a.chain(value, unary.slope(a.value, value))
        },
    );
}

#[inline(always)]
fn binary_lanes(binary: Binary, n: usize, a: &Duals, b: &Duals, out: &mut Duals) {
    assert!(n <= BATCH);
    for i in 0..n {
        let (a, b) = (a.at(i), b.at(i));
        let value = binary.value(a.value, b.value);
        out.set(
            i,
            a.chain2(b, value, binary.slopes(a.value, b.value, value)),
        );
    }
}
