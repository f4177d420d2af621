//! Programs that are blobs and nothing else, along straight rays: those are walked to their first root.

use fearless_simd::Simd;

use super::ahead::Outlook;
use super::code::{Code, FOOTPRINT, INPUTS, Operation};
use super::slopes::Slopes;
use crate::arithmetic::{Binary, Unary};
use crate::shape::{Blobs, Shape, Walk};

/// The blobs that the code's root is, and the registers of the place that they are asked about.
pub(crate) fn blobs(code: &Code) -> Option<(&Blobs, [usize; 3])> {
    let last = code.instructions.last()?;
    let Operation::Shape(shape) = &last.act else {
        return None;
    };
    let Shape::Blobs(blobs) = &**shape else {
        return None;
    };
    (code.roots.first() == Some(&last.result)).then_some((blobs, last.args))
}

/// Whether the code is blobs of a place that moves evenly along every straight ray, and walking pays.
pub(crate) fn is_walked(code: &Code) -> bool {
    let Some((blobs, place)) = blobs(code) else {
        return false;
    };
    let mut motions = vec![Motion::Any; code.registers];
    motions[..INPUTS].fill(Motion::Even);
    motions[FOOTPRINT] = Motion::Any;
    motions[INPUTS..INPUTS + code.constants.len()].fill(Motion::None);
    for instruction in &code.instructions {
        let [a, b, _] = instruction.args.map(|arg| motions[arg]);
        motions[instruction.result] = match instruction.act {
            Operation::Binary(Binary::Add | Binary::Sub) => a.and(b),
            Operation::Binary(Binary::Mul) if a == Motion::None || b == Motion::None => a.and(b),
            Operation::Unary(Unary::Neg) => a,
            _ => Motion::Any,
        };
    }
    blobs.is_walked() && place.iter().all(|part| motions[*part] != Motion::Any)
}

/// How a number changes along a straight ray.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Motion {
    None,
    /// By as much everywhere.
    Even,
    Any,
}

impl Motion {
    /// Of a sum.
    fn and(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
}

/// How far ahead of some places no root can be, from `ahead` as a first guess, which it replaces. What the code
/// gave at the places is in `along`.
#[inline(always)]
pub(crate) fn run<S: Simd>(
    simd: S,
    (blobs, args): (&Blobs, [usize; 3]),
    along: &Slopes<1>,
    root: usize,
    outlook: Outlook<'_>,
    ahead: &mut [f64],
) {
    let lanes = args.map(|arg| along.register(arg));
    let walk = Walk {
        place: lanes.map(|part| &part.value),
        direction: lanes.map(|part| &part.gradient[0]),
        world: [0, 1, 2].map(|axis| &along.register(axis).value),
        value: &along.register(root).value,
        offset: outlook.offset,
        limit: outlook.limit,
    };
    blobs.walk(simd, walk, ahead);
}
