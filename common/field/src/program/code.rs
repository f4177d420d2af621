//! The machine's code: a plan taken apart into operations on registers of lanes.

use std::collections::HashMap;
use std::sync::Arc;

use crate::arithmetic::{Binary, Unary};
use crate::cascade::Cascade;
use crate::curve::Curve;
use crate::grid::Surface;
use crate::noise::{Lattice, Noise, simplex};
use crate::op::Kind;
use crate::program::CompileError;
use crate::program::plan::{Act, Plan, Step};
use crate::shape::Shape;

/// Most registers of a program, so that its scratch memory stays below 16 MiB.
pub(crate) const REGISTERS_MAX: usize = 4096;

/// The registers of a batch's x, y, z, footprint and time; those of constants follow.
pub(crate) const INPUTS: usize = 5;
pub(crate) const FOOTPRINT: usize = 3;
pub(crate) const TIME: usize = 4;

/// What an instruction computes from its arguments.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Operation {
    Unary(Unary),
    Binary(Binary),
    Power(f64),
    SmoothStep(f64, f64),
    Curve(Curve),
    Select,
    Length,
    /// radius/‖v‖ from ‖v‖.
    OntoSphere(f64),
    Noise(Lattice),
    /// By skewed coordinates if the noise is skewed.
    AnyNoise(Noise),
    /// The component of the noise's gradient along that axis, by skewed coordinates if it is skewed.
    Slope(Noise, usize),
    Cascade(Cascade),
    Shape(Arc<Shape>),
    Grid(Arc<Surface>),
}

/// One operation: unused arguments are 0, the result's register is none of the arguments'.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Instruction {
    pub(crate) act: Operation,
    pub(crate) args: [usize; 3],
    pub(crate) result: usize,
}

/// A program for the machine.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Code {
    pub(crate) constants: Vec<f64>,
    pub(crate) instructions: Vec<Instruction>,
    pub(crate) roots: Vec<usize>,
    /// Registers in all.
    pub(crate) registers: usize,
}

/// A result before registers are dealt out.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Slot {
    Input(usize),
    Constant(usize),
    Result(usize),
}

#[derive(Clone, Copy)]
enum Place {
    Scalar(Slot),
    Vector([Slot; 3]),
}

#[derive(Default)]
struct Lowering {
    constants: Vec<f64>,
    known: HashMap<u64, usize>,
    /// Instruction i gives result i.
    instructions: Vec<(Operation, Vec<Slot>)>,
}

impl Code {
    pub(crate) fn new(plan: &Plan) -> Result<Self, CompileError> {
        let mut lowering = Lowering::default();
        let mut places: Vec<Place> = Vec::with_capacity(plan.steps.len());
        for step in &plan.steps {
            let place = lowering.step(step, &places);
            places.push(place);
        }
        let roots: Vec<Slot> = plan
            .roots
            .iter()
            .map(|&root| scalar(places[root]))
            .collect();
        allocate(lowering, &roots)
    }
}

fn scalar(place: Place) -> Slot {
    match place {
        Place::Scalar(slot) | Place::Vector([slot, ..]) => slot,
    }
}

fn vector(place: Place) -> [Slot; 3] {
    match place {
        Place::Vector(slots) => slots,
        Place::Scalar(slot) => [slot; 3],
    }
}

impl Lowering {
    fn step(&mut self, step: &Step, places: &[Place]) -> Place {
        let s = |i: usize| scalar(places[step.args[i]]);
        let v = |i: usize| vector(places[step.args[i]]);
        let all = || {
            step.args
                .iter()
                .map(|&arg| scalar(places[arg]))
                .collect::<Vec<_>>()
        };
        let act = match &step.act {
            Act::Constant(value) => return Place::Scalar(self.constant(*value)),
            Act::ConstantVector(value) => {
                return Place::Vector(value.map(|part| self.constant(part)));
            }
            Act::Position => return Place::Vector([0, 1, 2].map(Slot::Input)),
            Act::Time => return Place::Scalar(Slot::Input(TIME)),
            Act::Vector => return Place::Vector([s(0), s(1), s(2)]),
            Act::Component(i) => return Place::Scalar(v(0)[*i]),
            Act::VectorAdd => return self.parts(Binary::Add, v(0), v(1)),
            Act::VectorSub => return self.parts(Binary::Sub, v(0), v(1)),
            Act::Scale => return self.parts(Binary::Mul, v(0), [s(1); 3]),
            Act::Dot => {
                let Place::Vector([x, y, z]) = self.parts(Binary::Mul, v(0), v(1)) else {
                    unreachable!("parts of vectors are a vector")
                };
                let xy = self.push(Operation::Binary(Binary::Add), &[x, y]);
                return Place::Scalar(self.push(Operation::Binary(Binary::Add), &[xy, z]));
            }
            Act::OntoSphere(radius) => {
                let length = self.push(Operation::Length, &v(0));
                let factor = self.push(Operation::OntoSphere(*radius), &[length]);
                return self.parts(Binary::Mul, v(0), [factor; 3]);
            }
            Act::OntoPlane => {
                let [x, y, _] = v(0);
                return Place::Vector([x, y, self.constant(0.0)]);
            }
            Act::Length => return Place::Scalar(self.push(Operation::Length, &v(0))),
            Act::Noise(lattice) => {
                return Place::Scalar(self.push(Operation::Noise(*lattice), &v(0)));
            }
            Act::AnyNoise(noise) => {
                let at = self.skewed(noise, v(0));
                return Place::Scalar(self.push(Operation::AnyNoise(noise.clone()), &at));
            }
            Act::NoiseGradient(noise) => {
                let at = self.skewed(noise, v(0));
                let slopes =
                    [0, 1, 2].map(|axis| self.push(Operation::Slope(noise.clone(), axis), &at));
                // The skewing is symmetric: it is its own transpose.
                return Place::Vector(self.skewed(noise, slopes));
            }
            Act::Cascade(cascade) => {
                return Place::Scalar(self.push(Operation::Cascade(cascade.clone()), &v(0)));
            }
            Act::Shape(shape) => {
                let args = match step.args[..] {
                    [_, _] => vec![s(0), s(1)],
                    _ => v(0).to_vec(),
                };
                return Place::Scalar(self.push(Operation::Shape(shape.clone()), &args));
            }
            Act::Grid(surface) => {
                return Place::Scalar(self.push(Operation::Grid(surface.clone()), &v(0)));
            }
            Act::Unary(unary) => Operation::Unary(*unary),
            Act::Binary(binary) => Operation::Binary(*binary),
            Act::Power(exponent) => Operation::Power(*exponent),
            Act::SmoothStep(low, high) => Operation::SmoothStep(*low, *high),
            Act::Curve(curve) => Operation::Curve(curve.clone()),
            Act::Select => Operation::Select,
        };
        debug_assert!(step.kind == Kind::Scalar, "vectors are taken apart above");
        let args = all();
        Place::Scalar(self.push(act, &args))
    }

    fn constant(&mut self, value: f64) -> Slot {
        let next = self.constants.len();
        let index = *self.known.entry(value.to_bits()).or_insert(next);
        if index == next {
            self.constants.push(value);
        }
        Slot::Constant(index)
    }

    fn push(&mut self, act: Operation, args: &[Slot]) -> Slot {
        self.instructions.push((act, args.to_vec()));
        Slot::Result(self.instructions.len() - 1)
    }

    /// The coordinates that a noise is a function of, as `simplex::skew` computes them.
    fn skewed(&mut self, noise: &Noise, [x, y, z]: [Slot; 3]) -> [Slot; 3] {
        if !noise.is_skewed() {
            return [x, y, z];
        }
        let add = Operation::Binary(Binary::Add);
        let xy = self.push(add.clone(), &[x, y]);
        let sum = self.push(add.clone(), &[xy, z]);
        let factor = self.constant(simplex::SKEW);
        let s = self.push(Operation::Binary(Binary::Mul), &[sum, factor]);
        [x, y, z].map(|part| self.push(add.clone(), &[part, s]))
    }

    fn parts(&mut self, binary: Binary, a: [Slot; 3], b: [Slot; 3]) -> Place {
        Place::Vector([0, 1, 2].map(|i| self.push(Operation::Binary(binary), &[a[i], b[i]])))
    }
}

/// Drops what no root needs and deals out registers, each free again after its last reader.
fn allocate(lowering: Lowering, roots: &[Slot]) -> Result<Code, CompileError> {
    let Lowering {
        constants,
        instructions,
        ..
    } = lowering;
    let never = usize::MAX;
    let mut last = vec![None; instructions.len()];
    for root in roots {
        if let Slot::Result(result) = root {
            last[*result] = Some(never);
        }
    }
    for (i, (_, args)) in instructions.iter().enumerate().rev() {
        if last[i].is_none() {
            continue;
        }
        for arg in args {
            if let Slot::Result(result) = arg {
                last[*result] = last[*result].or(Some(i));
            }
        }
    }
    let first = INPUTS + constants.len();
    let mut registers = first;
    let mut free: Vec<usize> = Vec::new();
    let mut home = vec![0; instructions.len()];
    let place = |slot: &Slot, home: &[usize]| match slot {
        Slot::Input(input) => *input,
        Slot::Constant(constant) => INPUTS + constant,
        Slot::Result(result) => home[*result],
    };
    let mut code = Vec::new();
    for (i, (act, slots)) in instructions.into_iter().enumerate() {
        if last[i].is_none() {
            continue;
        }
        // The result's register is taken before the arguments' are given back, so it is none of theirs.
        home[i] = free.pop().unwrap_or_else(|| {
            registers += 1;
            registers - 1
        });
        let mut args = [0; 3];
        for (arg, slot) in args.iter_mut().zip(&slots) {
            *arg = place(slot, &home);
        }
        for (k, slot) in slots.iter().enumerate() {
            if let Slot::Result(result) = slot
                && last[*result] == Some(i)
                && !slots[..k].contains(slot)
            {
                free.push(home[*result]);
            }
        }
        code.push(Instruction {
            act,
            args,
            result: home[i],
        });
    }
    if registers > REGISTERS_MAX {
        return Err(CompileError::TooWide(registers));
    }
    let roots = roots.iter().map(|root| place(root, &home)).collect();
    Ok(Code {
        constants,
        instructions: code,
        roots,
        registers,
    })
}
