//! Closed intervals of numbers, rounded outward.
//!
//! Every operation encloses the exact result *and* the one that evaluation
//! computes: rounding is monotone, so the results at the ends enclose all
//! computed ones, and outward rounding adds eight units in the last place
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

impl Interval {
    /// The greatest distance from 0.
    pub fn magnitude(self) -> f64 {
        larger(self.low.abs(), self.high.abs())
    }

    /// The number in its middle, or next to it.
    pub fn middle(self) -> f64 {
        0.5 * self.low + 0.5 * self.high
    }

    /// high − low.
    pub fn width(self) -> f64 {
        self.high - self.low
    }

    /// Whether `value` lies within.
    pub fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// The least interval around both.
    pub fn hull(self, other: Self) -> Self {
        Self::new(smaller(self.low, other.low), larger(self.high, other.high))
    }

    /// What both hold; either of them may enclose the value, so an empty result means slack and gives `self`.
    pub(crate) fn meet(self, other: Self) -> Self {
        let met = Self::new(larger(self.low, other.low), smaller(self.high, other.high));
        if met.low <= met.high { met } else { self }
    }

    /// With room for eight rounding errors at either end. An end that is not a number becomes infinite.
    pub(crate) fn widen(self) -> Self {
        let low = self.low - (self.low.abs() * SLACK + TINY);
        let high = self.high + (self.high.abs() * SLACK + TINY);
        Self::new(
            if low.is_nan() { f64::NEG_INFINITY } else { low },
            if high.is_nan() { f64::INFINITY } else { high },
        )
    }

    /// With `margin` at either end.
    pub(crate) fn expand(self, margin: f64) -> Self {
        Self::new(self.low - margin, self.high + margin).widen()
    }

    pub(crate) fn add(self, other: Self) -> Self {
        Self::new(self.low + other.low, self.high + other.high).widen()
    }

    pub(crate) fn sub(self, other: Self) -> Self {
        self.add(other.neg())
    }

    pub(crate) fn neg(self) -> Self {
        Self::new(-self.high, -self.low)
    }

    #[inline]
    pub(crate) fn mul(self, other: Self) -> Self {
        let [a, b] = [self.low * other.low, self.low * other.high];
        let [c, d] = [self.high * other.low, self.high * other.high];
        // Finite products need no rule for 0 · ∞.
        if (a + b + c + d).is_finite() {
            let low = smaller(smaller(a, b), smaller(c, d));
            let high = larger(larger(a, b), larger(c, d));
            return Self::new(low, high).widen();
        }
        self.mul_unbounded(other)
    }

    /// The product where an end is infinite, or a product too large for a sum.
    #[cold]
    fn mul_unbounded(self, other: Self) -> Self {
        let products = [
            product(self.low, other.low),
            product(self.low, other.high),
            product(self.high, other.low),
            product(self.high, other.high),
        ];
        let low = products.into_iter().fold(f64::INFINITY, smaller);
        Self::new(low, products.into_iter().fold(f64::NEG_INFINITY, larger)).widen()
    }

    /// All quotients; everything if 0 is among the divisors.
    pub(crate) fn div(self, other: Self) -> Self {
        if other.low <= 0.0 && other.high >= 0.0 {
            return Self::ALL;
        }
        self.mul(Self::new(1.0 / other.high, 1.0 / other.low).widen())
    }

    pub(crate) fn abs(self) -> Self {
        if self.low >= 0.0 {
            self
        } else if self.high <= 0.0 {
            self.neg()
        } else {
            Self::new(0.0, self.magnitude())
        }
    }

    pub(crate) fn min(self, other: Self) -> Self {
        Self::new(smaller(self.low, other.low), smaller(self.high, other.high))
    }

    pub(crate) fn max(self, other: Self) -> Self {
        Self::new(larger(self.low, other.low), larger(self.high, other.high))
    }

    pub(crate) fn clamp(self, low: f64, high: f64) -> Self {
        self.max(Self::point(low)).min(Self::point(high))
    }

    pub(crate) fn square(self) -> Self {
        let Self { low, high } = self.abs();
        let squared = Self::new(low * low, high * high).widen();
        Self::new(larger(squared.low, 0.0), squared.high)
    }

    pub(crate) fn sqrt(self) -> Self {
        let root = |a: f64| if a > 0.0 { a.sqrt() } else { 0.0 };
        let rooted = Self::new(root(self.low), root(self.high)).widen();
        Self::new(larger(rooted.low, 0.0), rooted.high)
    }

    /// The image under a rising function that `libm` computes to a few units in the last place.
    pub(crate) fn map_rising(self, f: impl Fn(f64) -> f64) -> Self {
        Self::new(f(self.low), f(self.high)).widen()
    }
}

/// The product, 0 if a factor is 0: the other stands for numbers that are finite.
fn product(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 { 0.0 } else { a * b }
}

/// The smaller of two ends; NaN if the second is.
pub(crate) fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The larger of two ends; NaN if the second is.
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::{hash, unit};

    #[test]
    fn operations_enclose_what_points_give() {
        let number = |i: u32| unit(hash(&[i])) * 20.0 - 10.0;
        for i in 0..20_000 {
            let part = |k: u32| number(9 * i + k);
            let ordered = |a: f64, b: f64| Interval::new(smaller(a, b), larger(a, b));
            let (a, b) = (ordered(part(0), part(1)), ordered(part(2), part(3)));
            let within = |i: Interval, t: f64| i.low + (t + 10.0) / 20.0 * i.width();
            let (x, y) = (within(a, part(4)), within(b, part(5)));
            let (x, y) = (smaller(x, a.high), smaller(y, b.high));
            assert!(a.add(b).contains(x + y));
            assert!(a.sub(b).contains(x - y));
            assert!(a.mul(b).contains(x * y));
            assert!(a.div(b).contains(x / y));
            assert!(a.abs().contains(x.abs()));
            assert!(a.square().contains(x * x));
            assert!(a.min(b).contains(smaller(x, y)));
            assert!(a.max(b).contains(larger(x, y)));
            assert!(a.sqrt().contains(if x > 0.0 { x.sqrt() } else { 0.0 }));
            assert!(a.map_rising(libm::exp).contains(libm::exp(x)));
        }
    }

    #[test]
    fn infinite_ends_stay_honest() {
        let zero = Interval::point(0.0);
        assert_eq!(Interval::ALL.mul(zero).width().max(1e-9), 1e-9);
        let sum = Interval::ALL.add(Interval::ALL);
        assert_eq!((sum.low, sum.high), (f64::NEG_INFINITY, f64::INFINITY));
        let over = Interval::new(1.0, 2.0).div(Interval::new(0.0, 1.0));
        assert_eq!(over, Interval::ALL);
    }
}
