//! Numbers of several arithmetics under one set of operations: what is written once for all of them.
//!
//! A shape, a noise's sum or a cascade is written over a [`Number`] and so can be evaluated at
//! points, with gradients, over intervals, and over whatever other arithmetic implements it.

use crate::arithmetic::{self, Binary, Unary};

/// A number of some arithmetic.
///
/// `f64` is the definition: every other arithmetic whose values are single numbers takes the
/// same operations, so that they agree to the bit. What is not smooth (|a|, min, select) takes
/// the derivative of the side on which the value is.
#[allow(dead_code, reason = "shapes and noises are written over all of it")]
pub(crate) trait Number: Clone {
    /// The same everywhere.
    fn constant(value: f64) -> Self;
    /// a + b.
    fn plus(self, other: Self) -> Self;
    /// a − b.
    fn minus(self, other: Self) -> Self;
    /// a times a constant.
    fn times(self, factor: f64) -> Self;
    /// a b.
    fn mul(self, other: Self) -> Self;
    /// a / b.
    fn over(self, other: Self) -> Self;
    /// A function of one number.
    fn unary(self, unary: Unary) -> Self;
    /// The smaller of a and b.
    fn min(self, other: Self) -> Self;
    /// The larger of a and b.
    fn max(self, other: Self) -> Self;
    /// sign(a)·|a|^exponent.
    fn power(self, exponent: f64) -> Self;
    /// 0 below 0, 1 above 1.
    fn clamp01(self) -> Self;
    /// `negative` where a < 0, else `other`.
    fn select(self, negative: Self, other: Self) -> Self;
    /// Itself where `live`, else 0.
    fn gate(self, live: bool) -> Self;

    /// −a.
    #[inline(always)]
    fn neg(self) -> Self {
        self.unary(Unary::Neg)
    }

    /// |a|.
    #[inline(always)]
    fn abs(self) -> Self {
        self.unary(Unary::Abs)
    }

    /// √a, 0 for a < 0.
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.unary(Unary::Sqrt)
    }

    /// eᵃ.
    #[inline(always)]
    fn exp(self) -> Self {
        self.unary(Unary::Exp)
    }

    /// a²; arithmetics of ranges know that it is never negative.
    #[inline(always)]
    fn square(self) -> Self {
        self.clone().mul(self)
    }
}

impl Number for f64 {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self + other
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self - other
    }

    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        self * factor
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }

    #[inline(always)]
    fn over(self, other: Self) -> Self {
        self / other
    }

    #[inline(always)]
    fn unary(self, unary: Unary) -> Self {
        unary.value(self)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Binary::Min.value(self, other)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Binary::Max.value(self, other)
    }

    #[inline(always)]
    fn power(self, exponent: f64) -> Self {
        arithmetic::power(exponent, self)
    }

    #[inline(always)]
    fn clamp01(self) -> Self {
        arithmetic::clamp01(self)
    }

    #[inline(always)]
    fn select(self, negative: Self, other: Self) -> Self {
        arithmetic::select(self, negative, other)
    }

    #[inline(always)]
    fn gate(self, live: bool) -> Self {
        if live { self } else { 0.0 }
    }
}

/// A value and its derivatives by `N` variables: the three coordinates, thesis eq. (2.17), or the way along a ray.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Dual<const N: usize = 3> {
    pub(crate) value: f64,
    pub(crate) gradient: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// A function's value, its derivative applied to this gradient.
    #[inline(always)]
    pub(crate) fn chain(self, value: f64, slope: f64) -> Self {
        let mut gradient = self.gradient;
        for part in &mut gradient {
            *part *= slope;
        }
        Self { value, gradient }
    }

    /// A value whose gradient is s·self + t·other.
    #[inline(always)]
    pub(crate) fn chain2(self, other: Self, value: f64, (s, t): (f64, f64)) -> Self {
        let mut gradient = self.gradient;
        for (part, other) in gradient.iter_mut().zip(other.gradient) {
            *part = *part * s + other * t;
        }
        Self { value, gradient }
    }

    #[inline(always)]
    pub(crate) fn binary(self, other: Self, binary: Binary) -> Self {
        let value = binary.value(self.value, other.value);
        self.chain2(other, value, binary.slopes(self.value, other.value, value))
    }

    /// The same with a second number that is constant.
    #[inline(always)]
    pub(crate) fn binary_with(self, constant: f64, binary: Binary) -> Self {
        let value = binary.value(self.value, constant);
        let (slope, _) = binary.slopes(self.value, constant, value);
        self.chain(value, slope)
    }

    /// The same with a first number that is constant.
    #[inline(always)]
    pub(crate) fn binary_after(self, constant: f64, binary: Binary) -> Self {
        let value = binary.value(constant, self.value);
        let (_, slope) = binary.slopes(constant, self.value, value);
        self.chain(value, slope)
    }
}

impl<const N: usize> Number for Dual<N> {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self {
            value,
            gradient: [0.0; N],
        }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let mut gradient = self.gradient;
        for (part, other) in gradient.iter_mut().zip(other.gradient) {
            *part += other;
        }
        Self {
            value: self.value + other.value,
            gradient,
        }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        let mut gradient = self.gradient;
        for (part, other) in gradient.iter_mut().zip(other.gradient) {
            *part -= other;
        }
        Self {
            value: self.value - other.value,
            gradient,
        }
    }

    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        self.chain(self.value * factor, factor)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.chain2(other, self.value * other.value, (other.value, self.value))
    }

    #[inline(always)]
    fn over(self, other: Self) -> Self {
        self.binary(other, Binary::Div)
    }

    #[inline(always)]
    fn unary(self, unary: Unary) -> Self {
        let value = unary.value(self.value);
        self.chain(value, unary.slope(self.value, value))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.binary(other, Binary::Min)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.binary(other, Binary::Max)
    }

    #[inline(always)]
    fn power(self, exponent: f64) -> Self {
        let value = arithmetic::power(exponent, self.value);
        self.chain(value, arithmetic::power_slope(exponent, self.value, value))
    }

    #[inline(always)]
    fn clamp01(self) -> Self {
        let inside = self.value >= 0.0 && self.value <= 1.0;
        self.chain(
            arithmetic::clamp01(self.value),
            if inside { 1.0 } else { 0.0 },
        )
    }

    #[inline(always)]
    fn select(self, negative: Self, other: Self) -> Self {
        if self.value < 0.0 { negative } else { other }
    }

    #[inline(always)]
    fn gate(self, live: bool) -> Self {
        let mut gradient = self.gradient;
        for part in &mut gradient {
            *part = part.gate(live);
        }
        Self {
            value: self.value.gate(live),
            gradient,
        }
    }
}
