//! A program over many boxes at once: over each a linear function of the place that the field stays close to.
//!
//! This is the arithmetic of [`Reduced<3>`] in lanes, so that an image can ask about a box per pixel. It has no branches, and
//! knows of a noise what one evaluation gives: with value v and gradient g in the middle and a bound B of its second
//! derivatives, the noise is v + g·d ± ½B‖d‖² at a way d from there. [`Program::over_cell`](crate::Program::over_cell) goes through
//! every kernel instead, which is two or three times as narrow and takes some hundred times as long.
//!
//! Forms hold what is exact and what evaluation computes, as those of `range` do: every operation adds a few units of
//! the magnitudes that go into it.

mod linear;
mod octaves;

use fearless_simd::Simd;

use crate::arithmetic::{Binary, Unary};
use crate::interval::Interval;
use crate::lanes::Lanes;
use crate::number::Number;
use crate::points::BATCH;
use crate::program::code::{Code, Instruction, Operation, TIME};
use crate::program::machine;
use crate::range::{Cell, Reduced};
use linear::{Linear, Linears};
use octaves::Octaves;

/// Boxes that go through the code together: their registers stay in the processor's nearest caches.
const WIDTH: usize = 32;

/// Boxes along the same axes, as structure of arrays. All slices have the same length.
#[derive(Clone, Copy, Debug)]
pub struct Boxes<'a> {
    /// Their middles, world metres.
    pub centre: [&'a [f64]; 3],
    /// The directions of their edges, by the world's axes.
    pub axes: [[f64; 3]; 3],
    /// Half of their edges, in lengths of those.
    pub half: [&'a [f64]; 3],
    /// The least and the greatest footprint in each, metres.
    pub footprint: [&'a [f64]; 2],
    /// The instants of all, seconds from image 0.
    pub time: Interval,
}

impl Boxes<'_> {
    /// How many.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub(crate) fn len(&self) -> usize {
        let n = self.centre[0].len();
        let mut all = self.centre.iter().chain(&self.half).chain(&self.footprint);
        assert!(
            all.all(|slice| slice.len() == n),
            "the slices of boxes have one length"
        );
        n
    }

    /// One of them.
    pub(crate) fn cell(&self, i: usize) -> Cell {
        let edge = |k: usize| self.axes[k].map(|part| part * self.half[k][i]);
        let edges = [edge(0), edge(1), edge(2)];
        let mut cell = Cell::of_edges(self.centre.map(|centre| centre[i]), edges);
        cell.footprint = Interval::new(self.footprint[0][i], self.footprint[1][i]);
        cell.time = self.time;
        cell
    }
}

/// The registers of linear functions.
#[derive(Debug)]
pub(crate) struct OverBoxes {
    registers: Vec<Box<Linears>>,
    constants: Vec<f64>,
    result: Box<Linears>,
    octaves: Box<Octaves>,
}

impl Default for OverBoxes {
    fn default() -> Self {
        Self {
            registers: Vec::new(),
            constants: Vec::new(),
            result: Linears::new(),
            octaves: Octaves::new(),
        }
    }
}

/// Whether these operations have linear functions in lanes.
pub(crate) fn bounds(code: &Code) -> bool {
    code.instructions.iter().all(|instruction| {
        !matches!(
            instruction.act,
            Operation::Slope(..) | Operation::Shape(_) | Operation::Grid(_)
        )
    })
}

impl OverBoxes {
    /// Makes room for the code and sets its constants.
    pub(crate) fn prepare(&mut self, code: &Code) {
        let (registers, constants) = (&mut self.registers, &mut self.constants);
        let set = |lanes: &mut Linears, value| lanes.fill(Linear::constant(value));
        machine::prepare(registers, constants, code, Linears::new, set);
    }

    /// What a root is over the boxes from `start` on, as many as go together; returns how many those were.
    #[inline(always)]
    pub(crate) fn run<S: Simd>(
        &mut self,
        simd: S,
        code: &Code,
        boxes: &Boxes<'_>,
        start: usize,
        root: usize,
        out: &mut [Reduced<3>],
    ) -> usize {
        let left = out.len() - start;
        let n = if left < WIDTH { left } else { WIDTH };
        let lanes = self.load(boxes, start, n);
        for instruction in &code.instructions {
            self.step(simd, instruction, lanes);
            std::mem::swap(&mut self.registers[instruction.result], &mut self.result);
        }
        let root = &self.registers[root];
        for (i, out) in out[start..start + n].iter_mut().enumerate() {
            let Linear {
                centre,
                along,
                error,
            } = root.at(i);
            *out = Reduced {
                centre,
                along,
                error,
            }
            .checked();
        }
        n
    }

    /// The inputs' functions; lanes without a box compute the last one again.
    fn load(&mut self, boxes: &Boxes<'_>, start: usize, n: usize) -> usize {
        let lanes = n.next_multiple_of(machine::STEP);
        let copy = |to: &mut Lanes, from: &[f64]| {
            to[..n].copy_from_slice(&from[start..start + n]);
            to[n..lanes].fill(from[start + n - 1]);
        };
        for axis in 0..3 {
            let register = &mut self.registers[axis];
            register.clear(lanes);
            copy(&mut register.centre, boxes.centre[axis]);
            for (k, along) in register.along.iter_mut().enumerate() {
                copy(along, boxes.half[k]);
                for along in &mut along[..lanes] {
                    *along *= boxes.axes[k][axis];
                }
            }
            for i in 0..lanes {
                register.set(i, register.at(i).placed());
            }
        }
        // The footprint is no argument of anything but cascades.
        let [low, high] = &mut self.octaves.footprint;
        copy(low, boxes.footprint[0]);
        copy(high, boxes.footprint[1]);
        let Interval { low, high } = boxes.time;
        self.registers[TIME].fill(Linear::somewhere(low, high));
        lanes
    }

    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, instruction: &Instruction, n: usize) {
        let [a, b, c] = instruction.args.map(|arg| &*self.registers[arg]);
        let out = &mut *self.result;
        match &instruction.act {
            Operation::Unary(unary) => unary_lanes(*unary, n, a, out),
            Operation::Binary(binary) => binary_lanes(*binary, n, [a, b], out),
            Operation::Select => each3(n, [a, b, c], out, Linear::select),
            Operation::Length => each3(
                n,
                [a, b, c],
                out,
                #[inline(always)]
                |a, b, c| a.square().plus(b.square()).plus(c.square()).sqrt(),
            ),
            Operation::OntoSphere(radius) => each(
                n,
                a,
                out,
                #[inline(always)]
                |a| a.inverse(*radius),
            ),
            Operation::Power(exponent) => each(n, a, out, |a| a.power(*exponent)),
            Operation::SmoothStep(low, high) => each(
                n,
                a,
                out,
                #[inline(always)]
                |a| a.smoothstep(*low, *high),
            ),
            Operation::Curve(curve) => each(n, a, out, |a| a.curve(curve)),
            Operation::Noise(lattice) => self.octaves.noise(simd, *lattice, n, [a, b, c], out),
            Operation::AnyNoise(noise) => self.octaves.any_noise(simd, noise, n, [a, b, c], out),
            Operation::Cascade(cascade) => self.octaves.run(simd, cascade, n, [a, b, c], out),
            Operation::Slope(..) | Operation::Shape(_) | Operation::Grid(_) => {
                unreachable!("they have no functions in lanes")
            }
        }
    }
}

#[inline(always)]
fn each(n: usize, a: &Linears, out: &mut Linears, f: impl Fn(Linear) -> Linear) {
    assert!(n <= BATCH);
    for i in 0..n {
        out.set(i, f(a.at(i)));
    }
}

#[inline(always)]
fn each2(n: usize, [a, b]: [&Linears; 2], out: &mut Linears, f: impl Fn(Linear, Linear) -> Linear) {
    assert!(n <= BATCH);
    for i in 0..n {
        out.set(i, f(a.at(i), b.at(i)));
    }
}

#[inline(always)]
fn each3(
    n: usize,
    [a, b, c]: [&Linears; 3],
    out: &mut Linears,
    f: impl Fn(Linear, Linear, Linear) -> Linear,
) {
    assert!(n <= BATCH);
    for i in 0..n {
        out.set(i, f(a.at(i), b.at(i), c.at(i)));
    }
}

/// One loop per function, so that none of them decides anything.
#[inline(always)]
fn unary_lanes(unary: Unary, n: usize, a: &Linears, out: &mut Linears) {
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
fn binary_lanes(binary: Binary, n: usize, args: [&Linears; 2], out: &mut Linears) {
    macro_rules! lanes {
        ($($binary:ident)+) => {
            match binary {
                $(Binary::$binary => each2(
                    n,
                    args,
                    out,
                    #[inline(always)]
                    |a, b| Binary::$binary.of_numbers(a, b),
                ),)+
            }
        };
    }
    lanes!(Add Sub Mul Div Min Max);
}
