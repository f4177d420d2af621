//! Closed intervals of numbers, rounded outward.
//!
//! Every operation encloses the exact result *and* the one that evaluation
//! computes: rounding is monotone, so the results at the ends enclose all
//! computed ones, and [`Interval::widen`] adds eight units in the last place
//! for the exact ones and for `libm`, whose functions are good to one.

/// All numbers from `low` to `high`, both included; either may be infinite.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Interval {
    /// The least.
    pub low: f64,
    /// The greatest.
    pub high: f64,
}

/// Relative slack of one operation: eight times the rounding error of f64.
const SLACK: f64 = 8.0 * f64::EPSILON;

/// Absolute slack, for results so small that relative rounding no longer holds.
const TINY: f64 = 1e-300;

impl Interval {
    /// Every number.
    pub const ALL: Self = Self::new(f64::NEG_INFINITY, f64::INFINITY);

    /// From `low` to `high`.
    pub const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// Just `value`.
    pub const fn point(value: f64) -> Self {
        Self::new(value, value)
    }
}
