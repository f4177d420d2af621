//! What each operation on numbers computes, and its derivative: the one definition that scalar and batch code share.
//!
//! Minimum, maximum and selection are comparisons: equal to the bit everywhere,
//! signed zeros and NaN included. Transcendentals are `libm`'s.

use crate::number::Number;
use crate::op::Op;

/// A function of one number.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Unary {
    Neg,
    Abs,
    Sqrt,
    Sin,
    Cos,
    Exp,
}

/// A function of two numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    Min,
    Max,
}

impl Unary {
    pub(crate) fn of(op: Op) -> Option<Self> {
        Some(match op {
            Op::Neg => Self::Neg,
            Op::Abs => Self::Abs,
            Op::Sqrt => Self::Sqrt,
            Op::Sin => Self::Sin,
            Op::Cos => Self::Cos,
            Op::Exp => Self::Exp,
            _ => return None,
        })
    }

    #[inline(always)]
    pub(crate) fn value(self, a: f64) -> f64 {
        match self {
            Self::Neg => -a,
            Self::Abs => a.abs(),
            Self::Sqrt => (if a < 0.0 { 0.0 } else { a }).sqrt(),
            Self::Sin => libm::sin(a),
            Self::Cos => libm::cos(a),
            Self::Exp => libm::exp(a),
        }
    }

    /// The derivative at `a`, where the value is `f`; 0 where there is none.
    #[inline(always)]
    pub(crate) fn slope(self, a: f64, f: f64) -> f64 {
        match self {
            Self::Neg => -1.0,
            Self::Abs => {
                if a < 0.0 {
                    -1.0
                } else {
                    1.0
                }
            }
            Self::Sqrt => {
                if f > 0.0 {
                    0.5 / f
                } else {
                    0.0
                }
            }
            Self::Sin => libm::cos(a),
            Self::Cos => -libm::sin(a),
            Self::Exp => f,
        }
    }
}

impl Binary {
    pub(crate) fn of(op: Op) -> Option<Self> {
        Some(match op {
            Op::Add => Self::Add,
            Op::Sub => Self::Sub,
            Op::Mul => Self::Mul,
            Op::Div => Self::Div,
            Op::Min => Self::Min,
            Op::Max => Self::Max,
            _ => return None,
        })
    }

    #[inline(always)]
    pub(crate) fn value(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Sub => a - b,
            Self::Mul => a * b,
            Self::Div => a / b,
            Self::Min => {
                if a < b {
                    a
                } else {
                    b
                }
            }
            Self::Max => {
                if a > b {
                    a
                } else {
                    b
                }
            }
        }
    }

    /// The operation on numbers of any arithmetic.
    #[inline(always)]
    pub(crate) fn of_numbers<T: Number>(self, a: T, b: T) -> T {
        match self {
            Self::Add => a.plus(b),
            Self::Sub => a.minus(b),
            Self::Mul => a.mul(b),
            Self::Div => a.over(b),
            Self::Min => a.min(b),
            Self::Max => a.max(b),
        }
    }

    /// The derivatives by `a` and by `b`, where the value is `f`.
    #[inline(always)]
    pub(crate) fn slopes(self, a: f64, b: f64, f: f64) -> (f64, f64) {
        match self {
            Self::Add => (1.0, 1.0),
            Self::Sub => (1.0, -1.0),
            Self::Mul => (b, a),
            Self::Div => (1.0 / b, -f / b),
            Self::Min => {
                if a < b {
                    (1.0, 0.0)
                } else {
                    (0.0, 1.0)
                }
            }
            Self::Max => {
                if a > b {
                    (1.0, 0.0)
                } else {
                    (0.0, 1.0)
                }
            }
        }
    }
}

/// b where a < 0, else c.
#[inline(always)]
pub(crate) fn select(a: f64, b: f64, c: f64) -> f64 {
    if a < 0.0 { b } else { c }
}

/// sign(a) · |a|^exponent (ERRATA row 1232).
#[inline(always)]
pub(crate) fn power(exponent: f64, a: f64) -> f64 {
    let size = a.abs();
    // Roots and products are one instruction each and the same on every machine; a power in general takes fifty.
    let magnitude = if exponent == 0.5 {
        size.sqrt()
    } else if exponent == 1.5 {
        size * size.sqrt()
    } else if exponent == 2.5 {
        size * size * size.sqrt()
    } else {
        libm::pow(size, exponent)
    };
    if a < 0.0 { -magnitude } else { magnitude }
}

/// The derivative of [`power`], whose value is `f`; 0 at 0 unless the exponent is 1.
#[inline(always)]
pub(crate) fn power_slope(exponent: f64, a: f64, f: f64) -> f64 {
    if exponent == 1.0 {
        1.0
    } else if a == 0.0 {
        0.0
    } else {
        exponent * (f / a)
    }
}

/// 0 below 0, 1 above 1.
#[inline(always)]
#[expect(
    clippy::manual_clamp,
    reason = "comparisons are the definition, NaN and −0 included"
)]
pub(crate) fn clamp01(a: f64) -> f64 {
    if a < 0.0 {
        0.0
    } else if a > 1.0 {
        1.0
    } else {
        a
    }
}

/// 3u² − 2u³ over the way from `low` to `high`.
#[inline(always)]
pub(crate) fn smoothstep(low: f64, high: f64, a: f64) -> f64 {
    let u = clamp01((a - low) / (high - low));
    u * u * (3.0 - 2.0 * u)
}

/// The derivative of [`smoothstep`].
#[inline(always)]
pub(crate) fn smoothstep_slope(low: f64, high: f64, a: f64) -> f64 {
    let u = clamp01((a - low) / (high - low));
    6.0 * u * (1.0 - u) / (high - low)
}

/// ‖v‖.
#[inline(always)]
pub(crate) fn length(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

/// What the vector is multiplied with to lie on the sphere of that radius; 0 at the origin.
#[inline(always)]
pub(crate) fn onto_sphere(radius: f64, length: f64) -> f64 {
    if length > 0.0 { radius / length } else { 0.0 }
}

/// A divisor's inverse, 0 for 0.
#[inline(always)]
pub(crate) fn inverse(a: f64) -> f64 {
    if a > 0.0 { 1.0 / a } else { 0.0 }
}
