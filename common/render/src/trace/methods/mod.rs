//! The ray-casting methods of thesis chapter 5, each as the thesis has it, with what it counts.
//!
//! The renderer's own search ([`crate::ImageRenderer`]) is faster than any of them; these are for comparison
//! (`flyby bench thesis`), for surfaces that have no Lipschitz constant, and for all roots of a ray.
//!
//! | method | source | guarantee |
//! |---|---|---|
//! | [`SphereTracing`] | eq. (5.8) | with a Lipschitz bound |
//! | [`Speculative`] | eqs. (5.9), (5.10), fig. 5.5 | with a Lipschitz bound |
//! | [`Subdivision::interval`] | fig. 5.8 with §5.3.1 | always |
//! | [`Subdivision::affine`] | fig. 5.8 with §5.3.2 | always |
//! | [`Subdivision::reduced`] | fig. 5.8 with §5.3.3 | always |
//! | [`Optimised`] | fig. 5.8 with eq. (5.27) | always |
//! | [`Mitchell`] | §5.4, with G′ | always |
//!
//! **What is guaranteed.** A root is a change of side: f > 0 is outside, f ≤ 0 inside. A method that is asked for
//! crossings misses none of which either side is longer than its ε; 0 ∈ G(T) alone proves none (fig. 5.8, mended: ERRATA
//! row 1900), so that an interval shorter than ε counts if its ends are on different sides. Of all roots, subdivision
//! leaves out two that are less than ε apart. The test `tests` compares every method with bisection in outward-rounded intervals.

mod along;
mod mitchell;
mod optimised;
mod speculative;
mod sphere;
mod subdivision;

#[cfg(test)]
pub(crate) mod tests;

pub use along::{Along, FieldAlong};
pub use mitchell::Mitchell;
pub use optimised::Optimised;
pub use speculative::Speculative;
pub use sphere::SphereTracing;
pub use subdivision::Subdivision;

use field::Interval;

/// Most evaluations of one search; what is not searched by then is left.
pub const EVALUATIONS_MAX: u64 = 1 << 22;

/// What a search did.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Tally {
    /// Evaluations at a point.
    pub points: u64,
    /// Evaluations over an interval.
    pub ranges: u64,
    /// Steps forward along the ray.
    pub steps: u64,
    /// Steps that went too far and were taken back.
    pub backtracks: u64,
    /// Intervals that were cut in two.
    pub subdivisions: u64,
    /// Searches that were given up for their length.
    pub abandoned: u64,
}

impl Tally {
    /// All evaluations, of whichever kind.
    pub fn evaluations(&self) -> u64 {
        self.points + self.ranges
    }

    /// Adds another search's counts.
    pub fn add(&mut self, other: &Self) {
        self.points += other.points;
        self.ranges += other.ranges;
        self.steps += other.steps;
        self.backtracks += other.backtracks;
        self.subdivisions += other.subdivisions;
        self.abandoned += other.abandoned;
    }

    /// Whether a search that began at `start` evaluations must end.
    fn spent(&mut self, start: u64) -> bool {
        let spent = self.evaluations() - start >= EVALUATIONS_MAX;
        self.abandoned += u64::from(spent);
        spent
    }
}

/// What a search looks for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Wanted {
    /// The first root, and no more of the ray than that takes.
    First,
    /// Every root, in order.
    All,
}

/// When a search has come to a root.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Hit {
    /// As printed in figs 5.5 and 5.8: a step, or an interval that may hold a root, shorter than ε. A near miss counts.
    Converged,
    /// A change of side within ε.
    Crossing,
}

/// A method that finds roots of a field along a ray.
pub trait Method {
    /// Its name in tables.
    fn name(&self) -> &'static str;

    /// The roots with t in `span`, in order: all that are wanted. Each is the near end of an interval shorter than ε.
    fn search(
        &self,
        ray: &dyn Along,
        span: Interval,
        wanted: Wanted,
        tally: &mut Tally,
    ) -> Vec<f64>;

    /// The first root.
    fn first(&self, ray: &dyn Along, span: Interval, tally: &mut Tally) -> Option<f64> {
        self.search(ray, span, Wanted::First, tally)
            .first()
            .copied()
    }
}

/// Which side of the surface a value is on: f ≤ 0 is inside.
fn inside(value: f64) -> bool {
    value <= 0.0
}
