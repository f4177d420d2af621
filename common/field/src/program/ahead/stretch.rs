//! A number along a stretch of a ray: all its values, and all its derivatives along the ray.
//!
//! Interval arithmetic made for vector loops: no branches, comparisons and selections alone, never infinite or NaN.
//! It rounds to nearest: what it is used for allows for a share of every slope, far above its rounding.

use crate::arithmetic::{self, Unary};
use crate::curve::Curve;
use crate::interval::Interval;
use crate::number::Number;

/// Stands for no bound: products of two are still finite.
const MOST: f64 = 1e60;

/// All values of a number on a stretch of a ray, and all its derivatives along it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Stretch {
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// The least derivative.
    pub(crate) fall: f64,
    /// The greatest.
    pub(crate) rise: f64,
}

#[inline(always)]
pub(crate) fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(crate) fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
fn held(a: f64) -> f64 {
    most(least(a, MOST), -MOST)
}

type Pair = (f64, f64);

/// All products of two ranges' numbers.
#[inline(always)]
fn product((a, b): Pair, (c, d): Pair) -> Pair {
    let (p, q, r, s) = (a * c, a * d, b * c, b * d);
    (
        least(least(p, q), least(r, s)),
        most(most(p, q), most(r, s)),
    )
}

#[inline(always)]
fn hull((a, b): Pair, (c, d): Pair) -> Pair {
    (least(a, c), most(b, d))
}

#[inline(always)]
fn choose(condition: bool, a: Pair, b: Pair) -> Pair {
    (
        if condition { a.0 } else { b.0 },
        if condition { a.1 } else { b.1 },
    )
}

const ANY: Pair = (-MOST, MOST);

impl Stretch {
    #[inline(always)]
    pub(crate) fn new((low, high): Pair, (fall, rise): Pair) -> Self {
        Self {
            low,
            high,
            fall,
            rise,
        }
    }

    /// Itself, but no wider than what stands for no bound.
    #[inline(always)]
    fn held(self) -> Self {
        Self {
            low: held(self.low),
            high: held(self.high),
            fall: held(self.fall),
            rise: held(self.rise),
        }
    }

    #[inline(always)]
    pub(crate) fn value(self) -> Pair {
        (self.low, self.high)
    }

    #[inline(always)]
    pub(crate) fn slope(self) -> Pair {
        (self.fall, self.rise)
    }

    /// The greatest size of the derivative.
    #[inline(always)]
    pub(crate) fn steepness(self) -> f64 {
        most(self.rise, -self.fall)
    }

    /// A rising or falling function of it: its values, and all its derivatives there.
    #[inline(always)]
    fn chain(self, value: Pair, slope: Pair) -> Self {
        Self::new(value, product(self.slope(), slope)).held()
    }

    /// factor/a for a positive number; no bound where it may be less.
    #[inline(always)]
    pub(crate) fn inverse(self, factor: f64) -> Self {
        let is_positive = self.low > 0.0;
        let (near, far) = (held(1.0 / self.high), held(1.0 / self.low));
        let value = product((near, far), (factor, factor));
        let slope = product((-far * far, -near * near), (factor, factor));
        let bound = self.chain(value, slope);
        Self::new(
            choose(is_positive, bound.value(), ANY),
            choose(is_positive, bound.slope(), ANY),
        )
    }

    /// 3u² − 2u³ over the way from `low` to `high`.
    #[inline(always)]
    pub(crate) fn smoothstep(self, low: f64, high: f64) -> Self {
        let value = |a| arithmetic::smoothstep(low, high, a);
        let slope = |a| arithmetic::smoothstep_slope(low, high, a);
        let (a, b) = (value(self.low), value(self.high));
        let (p, q) = (slope(self.low), slope(self.high));
        // The slope is greatest half-way, and falls off to either side.
        let middle = 0.5 * (low + high);
        let steepest = 1.5 / (high - low);
        let crosses = (self.low < middle) & (self.high > middle);
        let ends = (least(p, q), most(p, q));
        let slopes = choose(crosses, hull(ends, (steepest, steepest)), ends);
        self.chain((least(a, b), most(a, b)), slopes)
    }

    /// A curve over it.
    pub(crate) fn curve(self, curve: &Curve) -> Self {
        let over = Interval::new(self.low, self.high);
        let (range, slope) = (curve.range(over), curve.slope_max(over));
        let size = slope * self.steepness();
        Self::new((range.low, range.high), (-size, size))
    }

    /// ‖(a, b, c)‖.
    #[inline(always)]
    pub(crate) fn length(parts: [Self; 3]) -> Self {
        let (mut low, mut high, mut fall, mut rise) = (0.0, 0.0, 0.0, 0.0);
        for part in parts {
            let square = part.square();
            low += square.low;
            high += square.high;
            fall += 0.5 * square.fall;
            rise += 0.5 * square.rise;
        }
        let steepest = steepness(parts);
        let (low, high) = (low.sqrt(), high.sqrt());
        let inverse = (1.0 / high, if low > 0.0 { 1.0 / low } else { MOST });
        let (fall, rise) = product((held(fall), held(rise)), inverse);
        // Nothing is farther away than the way that it went.
        Self::new((low, high), (most(fall, -steepest), least(rise, steepest)))
    }
}

/// The greatest speed of a place.
#[inline(always)]
pub(crate) fn steepness(parts: [Stretch; 3]) -> f64 {
    let [a, b, c] = parts.map(Stretch::steepness);
    (a * a + b * b + c * c).sqrt()
}

/// How far a place's velocity can be from what it is at the place that the stretch is around.
#[inline(always)]
pub(crate) fn turn(parts: [Stretch; 3]) -> f64 {
    let [a, b, c] = parts.map(|part| part.rise - part.fall);
    (a * a + b * b + c * c).sqrt()
}

impl Number for Stretch {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self {
            low: value,
            high: value,
            fall: 0.0,
            rise: 0.0,
        }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self::new(
            (self.low + other.low, self.high + other.high),
            (self.fall + other.fall, self.rise + other.rise),
        )
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        Self::new(
            (self.low - other.high, self.high - other.low),
            (self.fall - other.rise, self.rise - other.fall),
        )
    }

    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        let scale = |(a, b): Pair| {
            let (p, q) = (a * factor, b * factor);
            (least(p, q), most(p, q))
        };
        Self::new(scale(self.value()), scale(self.slope()))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (
            product(self.slope(), other.value()),
            product(self.value(), other.slope()),
        );
        Self::new(product(self.value(), other.value()), (a.0 + b.0, a.1 + b.1))
    }

    #[inline(always)]
    fn over(self, other: Self) -> Self {
        let is_negative = other.high < 0.0;
        let divisor = choose(is_negative, (-other.high, -other.low), other.value());
        let slope = choose(is_negative, (-other.rise, -other.fall), other.slope());
        let inverse = Self::new(divisor, slope).inverse(1.0);
        let quotient = self.mul(inverse);
        let turned = quotient.times(-1.0);
        Self::new(
            choose(is_negative, turned.value(), quotient.value()),
            choose(is_negative, turned.slope(), quotient.slope()),
        )
    }

    #[inline(always)]
    fn unary(self, unary: Unary) -> Self {
        match unary {
            Unary::Neg => self.times(-1.0),
            Unary::Abs => {
                let size = most(self.high, -self.low);
                let steepest = self.steepness();
                let turned = self.times(-1.0);
                let is_negative = self.high <= 0.0;
                let (value, slope) = (
                    choose(self.low >= 0.0, self.value(), (0.0, size)),
                    choose(self.low >= 0.0, self.slope(), (-steepest, steepest)),
                );
                Self::new(
                    choose(is_negative, turned.value(), value),
                    choose(is_negative, turned.slope(), slope),
                )
            }
            Unary::Sqrt => {
                let root = |a| Unary::Sqrt.value(a);
                let (low, high) = (root(self.low), root(self.high));
                let steepest = if low > 0.0 { 0.5 / low } else { MOST };
                let slowest = if high > 0.0 { 0.5 / high } else { 0.0 };
                // Below 0 it stands still.
                let slowest = if self.low > 0.0 { slowest } else { 0.0 };
                self.chain((low, high), (slowest, steepest))
            }
            Unary::Sin | Unary::Cos => {
                let (middle, half) = (0.5 * (self.low + self.high), 0.5 * (self.high - self.low));
                let around = |a: f64| (most(a - half, -1.0), least(a + half, 1.0));
                let value = unary.value(middle);
                self.chain(around(value), around(unary.slope(middle, value)))
            }
            Unary::Exp => {
                let value = (held(libm::exp(self.low)), held(libm::exp(self.high)));
                self.chain(value, value)
            }
        }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        let both = hull(self.slope(), other.slope());
        let slope = choose(self.high < other.low, self.slope(), both);
        Self::new(
            (least(self.low, other.low), least(self.high, other.high)),
            choose(other.high < self.low, other.slope(), slope),
        )
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        let both = hull(self.slope(), other.slope());
        let slope = choose(self.low > other.high, self.slope(), both);
        Self::new(
            (most(self.low, other.low), most(self.high, other.high)),
            choose(other.low > self.high, other.slope(), slope),
        )
    }

    #[inline(always)]
    fn power(self, exponent: f64) -> Self {
        if exponent <= 0.0 {
            return Self::new(ANY, ANY);
        }
        let rate = |a: f64| held(libm::pow(a.abs(), exponent - 1.0));
        let (p, q) = (rate(self.low), rate(self.high));
        let crosses = (self.low <= 0.0) & (self.high >= 0.0);
        // At 0 the derivative is 0 or has no bound.
        let zero = if exponent > 1.0 {
            0.0
        } else if exponent == 1.0 {
            1.0
        } else {
            MOST
        };
        let ends = (least(p, q), most(p, q));
        let (slowest, fastest) = choose(crosses, hull(ends, (zero, zero)), ends);
        let value = |a: f64, rate: f64| if a == 0.0 { 0.0 } else { a * rate };
        self.chain(
            (value(self.low, p), value(self.high, q)),
            (exponent * slowest, exponent * fastest),
        )
    }

    #[inline(always)]
    fn clamp01(self) -> Self {
        let still = hull(self.slope(), (0.0, 0.0));
        let stays = (self.low >= 0.0) & (self.high <= 1.0);
        let leaves = (self.high <= 0.0) | (self.low >= 1.0);
        let slope = choose(stays, self.slope(), still);
        Self::new(
            (
                arithmetic::clamp01(self.low),
                arithmetic::clamp01(self.high),
            ),
            choose(leaves, (0.0, 0.0), slope),
        )
    }

    #[inline(always)]
    fn select(self, negative: Self, other: Self) -> Self {
        let (is_negative, is_other) = (self.high < 0.0, self.low >= 0.0);
        let value = choose(
            is_other,
            other.value(),
            hull(negative.value(), other.value()),
        );
        // It may jump between them.
        let slope = choose(is_other, other.slope(), ANY);
        Self::new(
            choose(is_negative, negative.value(), value),
            choose(is_negative, negative.slope(), slope),
        )
    }

    #[inline(always)]
    fn gate(self, live: bool) -> Self {
        let none = (0.0, 0.0);
        Self::new(
            choose(live, self.value(), none),
            choose(live, self.slope(), none),
        )
    }

    #[inline(always)]
    fn square(self) -> Self {
        let (a, b) = (self.low * self.low, self.high * self.high);
        let crosses = (self.low < 0.0) & (self.high > 0.0);
        let low = if crosses { 0.0 } else { least(a, b) };
        let slope = product(self.slope(), (2.0 * self.low, 2.0 * self.high));
        Self::new((low, most(a, b)), slope)
    }
}
