//! Arithmetics of ranges: what a field can be over a segment of a ray, over a cell, over a box.
//!
//! | arithmetic | a number is | source |
//! |---|---|---|
//! | [`Interval`] | low … high | thesis §5.3.1, eq. (5.14) |
//! | [`Affine`] | a centre and any number of error symbols, at most 64 | thesis §5.3.2, eqs. (5.15)–(5.18) |
//! | [`Reduced<1>`](Reduced) | centre, the ray's symbol, one of its own | thesis §5.3.3, eqs. (5.19)–(5.22) |
//! | [`Reduced<3>`](Reduced) | centre, the cell's three symbols, one of its own | thesis §7.3, eq. (7.11) |
//! | [`Slope`] | an interval and those of its derivatives | thesis §5.4, Mitchell's G′ |
//! | [`Jet`] | value, gradient, Hessian at a point | thesis eqs. (2.17), (2.18 mended: ERRATA) |
//!
//! **Rounding.** Every range holds the exact result *and* the one that evaluation computes. Nothing touches
//! the processor's rounding mode (thesis §5.3.1 calls that slow, and leaves it out): an interval is widened by
//! eight units in the last place after each operation, which costs two multiplications and two additions; an
//! affine form adds a few units of the magnitudes that went into the operation to its own symbol, whose
//! coefficient is a sum anyway. Eight units are far more than one operation's error, so that the rounding of
//! the bound's own computation is covered too. Noises are evaluated in f32 ([`crate::noise::ROUNDING`]);
//! their ranges have that much room besides.
//!
//! What each operation is stands once per arithmetic, in its `Number` and `Arithmetic`; functions of one
//! number stand once for all of them, in `function`. What is written over these traits (cascades, shapes,
//! noises) has all arithmetics at once. `tests` is the conformance suite.

pub(crate) mod affine;
mod evaluate;
mod form;
pub(crate) mod function;
mod grid;
mod interval;
mod jet;
pub(crate) mod noise;
mod points;
pub(crate) mod profile;
mod reduced;
mod slope;

#[cfg(test)]
mod tests;

pub use affine::Affine;
pub(crate) use evaluate::DEPTH_ROUNDING;
pub use evaluate::{Cell, Place, Segment};
pub(crate) use form::{ROUNDING, TINY};
pub use jet::Jet;
pub use reduced::Reduced;
pub use slope::Slope;

use crate::curve::Curve;
use crate::grid::Surface;
use crate::interval::Interval;
use crate::noise::cellular::Cellular;
use crate::noise::lattice::Corner;
use crate::noise::{Lattice, Noise};
use crate::number::Number;
use crate::shape::Shape;
use function::Function;
use noise::Near;

/// An arithmetic in which a whole field can be evaluated.
pub(crate) trait Arithmetic: Number {
    /// Some number of `range`, related to nothing else. Point arithmetics take its middle.
    fn any(range: Interval) -> Self;

    /// All values it may have; at a point, the value.
    fn range(&self) -> Interval;

    /// The same number, now that it is also known to lie in `range`.
    fn within(self, range: Interval) -> Self;

    /// The same number, with room for an error; at a point, the same.
    fn blurred(self, error: f64) -> Self;

    /// The same number, with room for how far what is computed in f32 may be from it.
    fn computed(self, error: f64) -> Self {
        self.blurred(error)
    }

    /// Any number between the two; a point arithmetic is never asked and answers the first.
    fn hull(self, other: Self) -> Self;

    /// φ of it.
    fn apply(self, function: Function) -> Self;

    /// A curve over it.
    fn curve(self, curve: &Curve) -> Self;

    /// What is left of it once its own parts are done with, `inputs` excepted: standard affine forms
    /// condense what no input knows, thesis eq. (5.18) and §5.4.2.
    fn settled(self, _inputs: &[Self; 3]) -> Self {
        self
    }

    /// A shape of thesis chapter 2 at a place, or two numbers joined.
    fn shape(shape: &Shape, at: [Self; 3]) -> Self {
        shape.enclosed(at)
    }

    /// Gradient noise at a place, thesis eq. (4.9).
    fn noise(lattice: Lattice, at: [Self; 3]) -> Self {
        noise::lattice::gradient_noise(lattice, at)
    }

    /// The exact sum of a lattice noise's kernels; `None` where a place is too far or too wide.
    fn kernels(corner: Corner, lattice: Lattice, at: &[Self; 3]) -> Option<Self> {
        noise::lattice::sum(corner, lattice, at)
    }

    /// A cellular noise's distances, or their squares, sorted into `sorted`, which begins with the greatest there can be.
    fn nearest(cellular: &Cellular, near: &Near<Self>, sorted: &mut [Self]) {
        noise::cellular::nearest(cellular, near, sorted);
    }

    /// A discrete surface at a place.
    fn grid(surface: &Surface, at: [Self; 3]) -> Self {
        grid::mean_value(surface, at)
    }

    /// The Euclidean length of a vector.
    fn distance([x, y, z]: [Self; 3]) -> Self {
        x.square().plus(y.square()).plus(z.square()).sqrt()
    }

    /// Any other noise, by skewed coordinates if it is skewed.
    fn any_noise(noise: &Noise, at: [Self; 3]) -> Self {
        noise::any(noise, at)
    }

    /// The gradient of a noise, by skewed coordinates if it is skewed: what its kernels' slopes say of it.
    fn noise_slopes(noise: &Noise, at: [Self; 3]) -> [Self; 3] {
        slope::slopes_over(noise, at.each_ref().map(Self::range)).map(Self::any)
    }
}
