//! The machine that evaluates code over the lanes of a batch, generic over the SIMD level.
//!
//! Every loop runs over whole registers; a lane never looks at another. What a lane computes is
//! written once, in `arithmetic`, `noise` and `cascade`; here are only the loops around it.

use fearless_simd::Simd;

use crate::arithmetic::{self, Binary, Unary};
use crate::cascade::{self, Carried, Cascade, Model, Term};
use crate::lanes::{self, Aligned, Cells, Lanes};
use crate::noise::batch;
use crate::op::Basis;
use crate::points::{BATCH, Points};
use crate::program::code::{Code, FOOTPRINT, INPUTS, Instruction, Operation};

/// Lanes are computed in multiples of this, so that vector loops have no scalar rest.
pub(crate) const STEP: usize = 16;

/// The registers of values.
#[derive(Debug)]
#[expect(clippy::vec_box, reason = "results take their places by pointer")]
pub(crate) struct Machine {
    registers: Vec<Box<Aligned<Lanes>>>,
    /// What the constant registers hold.
    constants: Vec<f64>,
    /// Where a result is computed before it takes its register's place.
    result: Box<Aligned<Lanes>>,
    octaves: Box<Octaves>,
}

/// Room for the octaves of one cascade.
#[derive(Debug)]
#[repr(align(64))]
struct Octaves {
    cells: Cells,
    noise: [f32; BATCH],
    depth: Lanes,
    rest: Lanes,
}

impl Default for Machine {
    fn default() -> Self {
        Self {
            registers: Vec::new(),
            constants: Vec::new(),
            result: Box::new(Aligned([0.0; BATCH])),
            octaves: Box::new(Octaves {
                cells: Cells::new(),
                noise: [0.0; BATCH],
                depth: [0.0; BATCH],
                rest: [0.0; BATCH],
            }),
        }
    }
}

/// The lanes of a piece of a batch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Count {
    /// Those that hold points.
    pub(crate) points: usize,
    /// Those that are computed: the last point again and again.
    pub(crate) lanes: usize,
}

impl Count {
    fn new(points: usize) -> Self {
        Self {
            points,
            lanes: points.next_multiple_of(STEP),
        }
    }
}

/// Makes room for the code among a machine's registers and sets those of its constants; returns whether there are new ones.
pub(crate) fn prepare<R>(
    registers: &mut Vec<Box<R>>,
    constants: &mut Vec<f64>,
    code: &Code,
    new: impl FnMut() -> Box<R>,
    set: impl Fn(&mut R, f64),
) -> bool {
    let grown = registers.len() < code.registers;
    if grown {
        registers.resize_with(code.registers, new);
    }
    let same = constants.len() == code.constants.len()
        && constants
            .iter()
            .zip(&code.constants)
            .all(|(a, b)| a.to_bits() == b.to_bits());
    if grown || !same {
        for (register, constant) in registers[INPUTS..].iter_mut().zip(&code.constants) {
            set(register, *constant);
        }
        constants.clone_from(&code.constants);
    }
    grown
}

/// Copies the points from `start` on into input registers, as many as fit.
pub(crate) fn load<'r>(
    points: &Points<'_>,
    start: usize,
    mut register: impl FnMut(usize) -> &'r mut Lanes,
) -> Count {
    let inputs = [points.x, points.y, points.z, points.footprint, points.time];
    let left = points.x.len() - start;
    let count = Count::new(if left < BATCH { left } else { BATCH });
    for (i, input) in inputs.into_iter().enumerate() {
        let lanes = register(i);
        lanes[..count.points].copy_from_slice(&input[start..start + count.points]);
        lanes[count.points..count.lanes].fill(input[start + count.points - 1]);
    }
    count
}

impl Machine {
    /// Makes room for the code and sets its constants.
    pub(crate) fn prepare(&mut self, code: &Code) {
        let new = || Box::new(Aligned([0.0; BATCH]));
        let (registers, constants) = (&mut self.registers, &mut self.constants);
        prepare(registers, constants, code, new, |lanes, value| {
            lanes.fill(value);
        });
    }

    /// Evaluates the points from `start` on, as many as a batch holds, and adds to `noises` how many noises that took.
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
        let count = load(points, start, |_| {
            inputs.next().expect("there is a register for each input")
        });
        for instruction in &code.instructions {
            *noises += self.step(simd, instruction, count);
            std::mem::swap(&mut self.registers[instruction.result], &mut self.result);
        }
        count
    }

    /// The values of a register.
    pub(crate) fn register(&self, register: usize) -> &Lanes {
        &self.registers[register]
    }

    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, instruction: &Instruction, count: Count) -> u64 {
        let n = count.lanes;
        assert!(n <= BATCH);
        let [a, b, c] = instruction.args.map(|arg| &**self.registers[arg]);
        let out = &mut **self.result;
        match &instruction.act {
            Operation::Unary(unary) => unary_lanes(*unary, n, a, out),
            Operation::Binary(binary) => binary_lanes(*binary, n, a, b, out),
            Operation::Select => each3(n, [a, b, c], out, arithmetic::select),
            Operation::Length => each3(
                n,
                [a, b, c],
                out,
                #[inline(always)]
                |a, b, c| arithmetic::length([a, b, c]),
            ),
            Operation::OntoSphere(radius) => each(
                n,
                a,
                out,
                #[inline(always)]
                |a| arithmetic::onto_sphere(*radius, a),
            ),
            Operation::Power(exponent) => each(
                n,
                a,
                out,
                #[inline(always)]
                |a| arithmetic::power(*exponent, a),
            ),
            Operation::SmoothStep(low, high) => each(
                n,
                a,
                out,
                #[inline(always)]
                |a| arithmetic::smoothstep(*low, *high, a),
            ),
            Operation::Curve(curve) => each(
                n,
                a,
                out,
                #[inline(always)]
                |a| curve.value(a),
            ),
            Operation::Shape(shape) => shape.values(simd, n, [a, b, c], out),
            Operation::Grid(surface) => each3(
                n,
                [a, b, c],
                out,
                #[inline(always)]
                |a, b, c| surface.value([a, b, c]),
            ),
            Operation::Noise(lattice) => {
                let Octaves { cells, noise, .. } = &mut *self.octaves;
                lanes::split(simd, n, [a, b, c], cells);
                lanes::values(simd, n, *lattice, cells, noise);
                for (out, noise) in out[..n].iter_mut().zip(&noise[..n]) {
                    *out = f64::from(*noise);
                }
                return count.points as u64;
            }
            Operation::AnyNoise(any) => {
                let Octaves { cells, noise, .. } = &mut *self.octaves;
                lanes::split(simd, n, [a, b, c], cells);
                batch::values(simd, n, any, cells, noise);
                widen(n, noise, out);
                return count.points as u64;
            }
            Operation::Slope(any, axis) => {
                let Octaves { cells, noise, .. } = &mut *self.octaves;
                lanes::split(simd, n, [a, b, c], cells);
                batch::slopes(n, any, *axis, cells, noise);
                widen(n, noise, out);
                return count.points as u64;
            }
            Operation::Cascade(cascade) => {
                let footprint = &*self.registers[FOOTPRINT];
                return self
                    .octaves
                    .run(simd, cascade, count, [a, b, c], footprint, out);
            }
        }
        0
    }
}

/// A noise's values as the registers hold them.
#[inline(always)]
fn widen(n: usize, noise: &[f32; BATCH], out: &mut Lanes) {
    for (out, noise) in out[..n].iter_mut().zip(&noise[..n]) {
        *out = f64::from(*noise);
    }
}

/// The depths of a cascade at the footprints of a batch.
#[inline(always)]
pub(crate) fn depths(cascade: &Cascade, n: usize, footprint: &Lanes, depth: &mut Lanes) {
    if cascade.detail.is_some() {
        each(
            n,
            footprint,
            depth,
            #[inline(always)]
            |footprint| cascade.depth(footprint),
        );
    } else {
        depth[..n].fill(f64::INFINITY);
    }
}

/// How many points have a weight for octave `i`.
#[inline(always)]
pub(crate) fn live(depth: &Lanes, points: usize, i: f64) -> u64 {
    let mut live = 0;
    for depth in &depth[..points] {
        live += u64::from(*depth > i);
    }
    live
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
        total: &mut Lanes,
    ) -> u64 {
        let n = count.lanes;
        let mut noises = 0;
        depths(cascade, n, footprint, &mut self.depth);
        total[..n].fill(0.0);
        self.rest[..n].fill(0.0);
        for (i, octave) in cascade.octaves.iter().enumerate() {
            // Weights fall from octave to octave: where one is 0 for all, so are the rest.
            let live = live(&self.depth, count.points, cascade::index(i));
            if live == 0 {
                break;
            }
            noises += live;
            lanes::place(simd, n, octave, at, &mut self.cells);
            match &octave.noise {
                None => lanes::values(simd, n, octave.lattice, &mut self.cells, &mut self.noise),
                Some(any) => batch::values(simd, n, any, &self.cells, &mut self.noise),
            }
            let place = Place {
                n,
                i: cascade::index(i),
                amplitude: octave.amplitude,
            };
            self.add(cascade.model, place, total);
        }
        noises
    }

    #[inline(always)]
    fn add(&mut self, model: Model, place: Place, total: &mut Lanes) {
        match model {
            Model::Sum(Basis::Plain) => self.each(
                place,
                total,
                #[inline(always)]
                |t, n, c| cascade::sum(Basis::Plain, t, n, c),
            ),
            Model::Sum(Basis::Absolute) => self.each(
                place,
                total,
                #[inline(always)]
                |t, n, c| cascade::sum(Basis::Absolute, t, n, c),
            ),
            Model::Sum(Basis::Ridged) => self.each(
                place,
                total,
                #[inline(always)]
                |t, n, c| cascade::sum(Basis::Ridged, t, n, c),
            ),
            Model::AltitudeOne { basis, xi } => {
                self.each(
                    place,
                    total,
                    #[inline(always)]
                    |t, n, c| cascade::altitude_one(basis, xi, t, n, c),
                );
            }
            Model::AltitudeTwo { basis, xi } => {
                self.each(
                    place,
                    total,
                    #[inline(always)]
                    |t, n, c| cascade::altitude_two(basis, xi, t, n, c),
                );
            }
            Model::Ridged { offset, gain } => {
                self.each(
                    place,
                    total,
                    #[inline(always)]
                    |t, n, c| cascade::ridged(offset, gain, t, n, c),
                );
            }
        }
    }

    #[inline(always)]
    fn each(
        &mut self,
        Place { n, i, amplitude }: Place,
        total: &mut Lanes,
        add: impl Fn(Term, f64, Carried<f64>) -> Carried<f64>,
    ) {
        let (total, rest) = (&mut total[..n], &mut self.rest[..n]);
        let (noise, depth) = (&self.noise[..n], &self.depth[..n]);
        for lane in 0..n {
            let term = Term {
                first: i == 0.0,
                amplitude,
                weight: cascade::weight(depth[lane], i),
            };
            (total[lane], rest[lane]) =
                add(term, f64::from(noise[lane]), (total[lane], rest[lane]));
        }
    }
}

/// An octave's part of a batch.
#[derive(Clone, Copy)]
struct Place {
    n: usize,
    i: f64,
    amplitude: f64,
}

#[inline(always)]
fn each(n: usize, a: &Lanes, out: &mut Lanes, f: impl Fn(f64) -> f64) {
    for (out, a) in out[..n].iter_mut().zip(&a[..n]) {
        *out = f(*a);
    }
}

#[inline(always)]
fn each2(n: usize, a: &Lanes, b: &Lanes, out: &mut Lanes, f: impl Fn(f64, f64) -> f64) {
    for ((out, a), b) in out[..n].iter_mut().zip(&a[..n]).zip(&b[..n]) {
        *out = f(*a, *b);
    }
}

#[inline(always)]
fn each3(n: usize, [a, b, c]: [&Lanes; 3], out: &mut Lanes, f: impl Fn(f64, f64, f64) -> f64) {
    let (a, b, c) = (&a[..n], &b[..n], &c[..n]);
    for (i, out) in out[..n].iter_mut().enumerate() {
        *out = f(a[i], b[i], c[i]);
    }
}

/// One loop per function, so that none of them decides anything.
#[inline(always)]
fn unary_lanes(unary: Unary, n: usize, a: &Lanes, out: &mut Lanes) {
    match unary {
        Unary::Neg => each(
            n,
            a,
            out,
            #[inline(always)]
            |a| Unary::Neg.value(a),
        ),
        Unary::Abs => each(
            n,
            a,
            out,
            #[inline(always)]
            |a| Unary::Abs.value(a),
        ),
        Unary::Sqrt => each(
            n,
            a,
            out,
            #[inline(always)]
            |a| Unary::Sqrt.value(a),
        ),
        Unary::Sin => each(
            n,
            a,
            out,
            #[inline(always)]
            |a| Unary::Sin.value(a),
        ),
        Unary::Cos => each(
            n,
            a,
            out,
            #[inline(always)]
            |a| Unary::Cos.value(a),
        ),
        Unary::Exp => each(
            n,
            a,
            out,
            #[inline(always)]
            |a| Unary::Exp.value(a),
        ),
    }
}

#[inline(always)]
fn binary_lanes(binary: Binary, n: usize, a: &Lanes, b: &Lanes, out: &mut Lanes) {
    match binary {
        Binary::Add => each2(
            n,
            a,
            b,
            out,
            #[inline(always)]
            |a, b| Binary::Add.value(a, b),
        ),
        Binary::Sub => each2(
            n,
            a,
            b,
            out,
            #[inline(always)]
            |a, b| Binary::Sub.value(a, b),
        ),
        Binary::Mul => each2(
            n,
            a,
            b,
            out,
            #[inline(always)]
            |a, b| Binary::Mul.value(a, b),
        ),
        Binary::Div => each2(
            n,
            a,
            b,
            out,
            #[inline(always)]
            |a, b| Binary::Div.value(a, b),
        ),
        Binary::Min => each2(
            n,
            a,
            b,
            out,
            #[inline(always)]
            |a, b| Binary::Min.value(a, b),
        ),
        Binary::Max => each2(
            n,
            a,
            b,
            out,
            #[inline(always)]
            |a, b| Binary::Max.value(a, b),
        ),
    }
}
