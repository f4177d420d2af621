//! Programs that are blobs and nothing else, along straight rays: those are walked to their first root.

use fearless_simd::Simd;

use super::code::{Code, FOOTPRINT, INPUTS, Operation};
use super::slopes::Slopes;
use crate::arithmetic::{Binary, Unary};
use crate::shape::{Blobs, Met, Shape, Walk};

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

/// What is known of the field and wanted of the rays, lane by lane.
#[derive(Clone, Copy, Debug)]
pub struct Prospect<'a> {
    /// What values may be wrong by, in the field's unit: rounding; of [`crate::Taylor`].
    pub offset: &'a [f64],
    /// How far ahead anything is worth knowing, metres.
    pub limit: &'a [f64],
}

/// How far ahead of some places no root can be. What the code that makes the blobs' place gave there is in `along`.
#[inline(always)]
pub(crate) fn run<S: Simd>(
    simd: S,
    (blobs, args): (&Blobs, [usize; 3]),
    along: &Slopes<1>,
    prospect: Prospect<'_>,
    met: &mut Met,
    clear: &mut [f64],
) {
    let lanes = args.map(|arg| along.register(arg));
    let walk = Walk {
        place: lanes.map(|part| &part.value),
        direction: lanes.map(|part| &part.gradient[0]),
        world: [0, 1, 2].map(|axis| &along.register(axis).value),
        offset: prospect.offset,
        limit: prospect.limit,
    };
    blobs.walk(simd, walk, met, clear);
}
