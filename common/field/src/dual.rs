//! Numbers, and numbers with their gradients, under one set of operations: what is written once for both.

use crate::arithmetic;

/// A value with its gradient by three coordinates, or the bare value.
///
/// The value of a [`Dual`] takes the same operations as the bare one, so both agree to the bit.
pub(crate) trait Number: Copy {
    /// The same everywhere.
    fn constant(value: f64) -> Self;
    fn plus(self, other: Self) -> Self;
    fn times(self, factor: f64) -> Self;
    fn mul(self, other: Self) -> Self;
    fn abs(self) -> Self;
    fn clamp01(self) -> Self;
    /// Itself where `live`, else 0.
    fn gate(self, live: bool) -> Self;
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
    fn times(self, factor: f64) -> Self {
        self * factor
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self::abs(self)
    }

    #[inline(always)]
    fn clamp01(self) -> Self {
        arithmetic::clamp01(self)
    }

    #[inline(always)]
    fn gate(self, live: bool) -> Self {
        if live { self } else { 0.0 }
    }
}

/// A value and its gradient.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Dual {
    pub(crate) value: f64,
    pub(crate) gradient: [f64; 3],
}

impl Dual {
    /// A function's value, its derivative applied to this gradient.
    #[inline(always)]
    pub(crate) fn chain(self, value: f64, slope: f64) -> Self {
        let [x, y, z] = self.gradient;
        Self {
            value,
            gradient: [x * slope, y * slope, z * slope],
        }
    }

    /// A value whose gradient is s·self + t·other.
    #[inline(always)]
    pub(crate) fn chain2(self, other: Self, value: f64, (s, t): (f64, f64)) -> Self {
        let ([a, b, c], [x, y, z]) = (self.gradient, other.gradient);
        Self {
            value,
            gradient: [a * s + x * t, b * s + y * t, c * s + z * t],
        }
    }
}

impl Number for Dual {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self {
            value,
            gradient: [0.0; 3],
        }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.gradient, other.gradient);
        Self {
            value: self.value + other.value,
            gradient: [a + x, b + y, c + z],
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
    fn abs(self) -> Self {
        self.chain(self.value.abs(), if self.value < 0.0 { -1.0 } else { 1.0 })
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
    fn gate(self, live: bool) -> Self {
        let [x, y, z] = self.gradient;
        Self {
            value: self.value.gate(live),
            gradient: [x.gate(live), y.gate(live), z.gate(live)],
        }
    }
}
