//! Where a program is evaluated, and the memory it is evaluated in.

use crate::program::{Ahead, Machine, OverBoxes, Slopes};
use crate::shape::Met;

/// Points of one chunk of work: longer batches are cut into pieces of this length.
pub const BATCH: usize = 128;

/// A batch of places, as structure of arrays. All slices have the same length.
#[derive(Clone, Copy, Debug)]
pub struct Points<'a> {
    /// World x, metres.
    pub x: &'a [f64],
    /// World y, metres.
    pub y: &'a [f64],
    /// World z, up, metres.
    pub z: &'a [f64],
    /// Metres that a pixel covers there: pixel angle times distance to the eye. 0: all detail.
    pub footprint: &'a [f64],
    /// Seconds from image 0.
    pub time: &'a [f64],
}

impl Points<'_> {
    /// How many places.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn len(&self) -> usize {
        let n = self.x.len();
        assert!(
            [self.y, self.z, self.footprint, self.time]
                .iter()
                .all(|slice| slice.len() == n),
            "the slices of a batch have one length"
        );
        n
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Memory that evaluations reuse: one per thread, for any number of programs.
#[derive(Default, Debug)]
pub struct Scratch {
    /// Noises evaluated so far, see [`crate::Program::noise_evaluations`].
    pub noise_evaluations: u64,
    pub(crate) machine: Machine,
    pub(crate) slopes: Slopes<3>,
    pub(crate) along: Slopes<1>,
    pub(crate) stretches: Ahead,
    pub(crate) boxes: OverBoxes,
    pub(crate) met: Met,
}

impl Scratch {
    /// Empty memory; it grows with the first evaluation.
    pub fn new() -> Self {
        Self::default()
    }
}
