//! The machine that evaluates code with gradients, by the chain rule of thesis eq. (2.17).
//!
//! Registers hold duals: a value and its derivatives, either by the world's x, y, z (`N` = 3) or along
//! one direction of each lane's own (`N` = 1). Footprint and time count as constants.

mod duals;
mod octaves;
mod tape;

use fearless_simd::Simd;

use crate::arithmetic::{self, Binary, Unary};
use crate::lanes;
use crate::noise::batch;
use crate::number::{Dual, Number};
use crate::points::{BATCH, Points};
use crate::program::code::{Code, FOOTPRINT, INPUTS, Instruction, Operation};
use crate::program::machine::{self, Count};
use duals::Duals;
use octaves::Octaves;
pub(crate) use tape::{Sample, Tape};

/// The registers of duals.
#[derive(Debug)]
pub(crate) struct Slopes<const N: usize> {
    registers: Vec<Box<Duals<N>>>,
    constants: Vec<f64>,
    result: Box<Duals<N>>,
    octaves: Box<Octaves<N>>,
    pub(crate) tape: Tape<N>,
}

impl<const N: usize> Default for Slopes<N> {
    fn default() -> Self {
        Self {
            registers: Vec::new(),
            constants: Vec::new(),
            result: Duals::new(),
            tape: Tape::default(),
            octaves: Box::new(Octaves::new()),
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

    /// Evaluates instructions at the points from `start` on, as many as a batch holds.
    #[inline(always)]
    pub(crate) fn run<S: Simd>(
        &mut self,
        simd: S,
        instructions: &[Instruction],
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
        for instruction in instructions {
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
            Operation::Binary(binary) => {
                let [first, second, _] = instruction.args;
                let constants = [first, second].map(|register| constant(&self.constants, register));
                binary_lanes(*binary, n, [a, b], constants, out);
            }
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
            Operation::Shape(shape) => shape.values(simd, n, [a, b, c], out),
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
                    along,
                    ..
                } = &mut *self.octaves;
                let sample = self.tape.sample();
                let noise = &mut sample.noise;
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
                let [gx, gy, gz] = &*gradient;
                for i in 0..n {
                    let slopes = [f64::from(gx[i]), f64::from(gy[i]), f64::from(gz[i])];
                    let at = [a.at(i), b.at(i), c.at(i)];
                    out.set(i, pull(slopes, at, f64::from(noise[i])));
                }
                // For whoever goes through the code again.
                if N == 1 && self.tape.keeps {
                    directions(n, &IDENTITY, [a, b, c], along);
                    self.tape.last().take(n, gradient, along);
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

/// What a register holds whose number is the same at all points.
#[inline(always)]
fn constant(constants: &[f64], register: usize) -> Option<f64> {
    constants.get(register.checked_sub(INPUTS)?).copied()
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

/// The same; numbers that are `constants` have no derivatives to reckon with.
#[inline(always)]
fn binary_lanes<const N: usize>(
    binary: Binary,
    n: usize,
    [a, b]: [&Duals<N>; 2],
    constants: [Option<f64>; 2],
    out: &mut Duals<N>,
) {
    macro_rules! lanes {
        ($($binary:ident)+) => {
            match binary {
                $(Binary::$binary => match constants {
                    [_, Some(constant)] => each(
                        n,
                        a,
                        out,
                        #[inline(always)]
                        |a| a.binary_with(constant, Binary::$binary),
                    ),
                    [Some(constant), None] => each(
                        n,
                        b,
                        out,
                        #[inline(always)]
                        |b| b.binary_after(constant, Binary::$binary),
                    ),
                    [None, None] => each2(
                        n,
                        [a, b],
                        out,
                        #[inline(always)]
                        |a, b| a.binary(b, Binary::$binary),
                    ),
                },)+
            }
        };
    }
    lanes!(Add Sub Mul Div Min Max);
}
