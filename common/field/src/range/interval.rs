//! Intervals among the arithmetics, thesis eqs. (5.14), α − X mended: ERRATA.

use crate::arithmetic::Unary;
use crate::curve::Curve;
use crate::interval::Interval;
use crate::number::Number;
use crate::range::Arithmetic;
use crate::range::function::Function;

impl Number for Interval {
    fn constant(value: f64) -> Self {
        Self::point(value)
    }

    fn plus(self, other: Self) -> Self {
        self.add(other)
    }

    fn minus(self, other: Self) -> Self {
        self.sub(other)
    }

    fn times(self, factor: f64) -> Self {
        Interval::mul(self, Self::point(factor))
    }

    fn mul(self, other: Self) -> Self {
        Interval::mul(self, other)
    }

    fn over(self, other: Self) -> Self {
        self.div(other)
    }

    fn unary(self, unary: Unary) -> Self {
        match unary {
            Unary::Neg => Interval::neg(self),
            Unary::Abs => Interval::abs(self),
            Unary::Sqrt => Interval::sqrt(self),
            _ => Function::Unary(unary).image(self),
        }
    }

    fn min(self, other: Self) -> Self {
        Interval::min(self, other)
    }

    fn max(self, other: Self) -> Self {
        Interval::max(self, other)
    }

    fn power(self, exponent: f64) -> Self {
        Function::Power(exponent).image(self)
    }

    fn clamp01(self) -> Self {
        self.clamp(0.0, 1.0)
    }

    fn select(self, negative: Self, other: Self) -> Self {
        if self.high < 0.0 {
            negative
        } else if self.low >= 0.0 {
            other
        } else {
            Interval::hull(negative, other)
        }
    }

    fn gate(self, live: bool) -> Self {
        if live { self } else { Self::point(0.0) }
    }

    fn square(self) -> Self {
        Interval::square(self)
    }
}

impl Arithmetic for Interval {
    fn any(range: Interval) -> Self {
        range
    }

    fn range(&self) -> Interval {
        *self
    }

    fn within(self, range: Interval) -> Self {
        self.meet(range)
    }

    fn blurred(self, error: f64) -> Self {
        self.expand(error)
    }

    fn hull(self, other: Self) -> Self {
        Interval::hull(self, other)
    }

    fn apply(self, function: Function) -> Self {
        function.image(self)
    }

    fn curve(self, curve: &Curve) -> Self {
        curve_over(curve, self)
    }
}

/// All values of a curve, with room for the rounding of its cubics.
pub(crate) fn curve_over(curve: &Curve, over: Interval) -> Interval {
    let most = curve.range(Interval::ALL).magnitude();
    curve.range(over).expand(32.0 * f64::EPSILON * most)
}
