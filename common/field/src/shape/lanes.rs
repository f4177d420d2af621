//! Lanes of numbers: shapes are evaluated at many places together.

use crate::lanes::Lanes;
use crate::shape::Local;

/// Lanes that look together for the terms of a sum that matter to them; batches are multiples of it.
pub(crate) const WIDTH: usize = 16;

/// One number per lane of a batch.
pub(crate) trait Rows {
    /// What a lane holds.
    type Number: Local + Copy;

    /// The number of a lane.
    fn at(&self, lane: usize) -> Self::Number;

    /// Sets the number of a lane.
    fn set(&mut self, lane: usize, number: Self::Number);
}

impl Rows for Lanes {
    type Number = f64;

    #[inline(always)]
    fn at(&self, lane: usize) -> f64 {
        self[lane]
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, number: f64) {
        self[lane] = number;
    }
}

/// A function of a place, lane by lane.
#[inline]
pub(super) fn each<R: Rows>(
    n: usize,
    [x, y, z]: [&R; 3],
    out: &mut R,
    of: impl Fn([R::Number; 3]) -> R::Number,
) {
    for lane in 0..n {
        out.set(lane, of([x.at(lane), y.at(lane), z.at(lane)]));
    }
}
