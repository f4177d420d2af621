//! Unions and intersections without creases: Ricci's, thesis eqs. (2.14), and local ones.

use super::Refusal;
use super::local::Local;
use crate::interval::Interval;
use crate::number::Number;

/// Two functions joined into one; both count as negative inside.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Blend {
    kind: Kind,
    /// Ricci's exponent, or the width of a local blend.
    size: f64,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    RicciUnion,
    RicciIntersection,
    LocalUnion,
    LocalIntersection,
}

/// Least value of F = f + 1 that Ricci's operators see: deeper inside they are flat.
const DEEPEST: f64 = 1.0 / 1024.0;

impl Blend {
    /// From the number of its kind, in the order of [`Kind`], and its size.
    pub(crate) fn new(params: &[f64]) -> Result<Self, Refusal> {
        let kinds = [
            Kind::RicciUnion,
            Kind::RicciIntersection,
            Kind::LocalUnion,
            Kind::LocalIntersection,
        ];
        let kind = (0..4u32)
            .zip(kinds)
            .find(|(number, _)| f64::from(*number) == params[0]);
        let Some((_, kind)) = kind else {
            return Err(("a kind of blend", params[0]));
        };
        let size = params[1];
        match kind {
            Kind::RicciUnion | Kind::RicciIntersection if !(1.0..=64.0).contains(&size) => {
                Err(("a sharpness from 1 (most blending) to 64", size))
            }
            Kind::LocalUnion | Kind::LocalIntersection if size <= 0.0 => {
                Err(("a width above 0", size))
            }
            _ => Ok(Self { kind, size }),
        }
    }

    /// The joined function.
    ///
    /// Ricci's (2.14), mended: ERRATA, are taken of F = f + 1 > 0, whose surface is F = 1, and 1 is taken off after.
    /// As shares of the smaller and the larger F they cannot overflow. A local blend is min − w²/4k with
    /// w = max(0, k − |a − b|): it moves only what lies within k of both.
    #[inline]
    pub(crate) fn value<N: Local>(&self, a: N, b: N) -> N {
        match self.kind {
            Kind::RicciUnion => ricci(a, b, self.size, Number::min, Number::max, true),
            Kind::RicciIntersection => ricci(a, b, self.size, Number::max, Number::min, false),
            Kind::LocalUnion => {
                let fillet = self.fillet(a.clone().minus(b.clone()));
                a.min(b).minus(fillet)
            }
            Kind::LocalIntersection => {
                let fillet = self.fillet(a.clone().minus(b.clone()));
                a.max(b).plus(fillet)
            }
        }
    }

    fn fillet<N: Local>(&self, apart: N) -> N {
        let rest = N::constant(self.size).minus(apart.abs());
        if rest.at() > 0.0 {
            rest.square().times(0.25 / self.size)
        } else {
            N::constant(0.0)
        }
    }

    /// The values over those of `a` and `b`: all blends rise with both.
    pub(crate) fn range(&self, a: Interval, b: Interval) -> Interval {
        let low = self.value(a.low, b.low);
        let high = self.value(a.high, b.high);
        let ends = Interval::new(
            if low.is_nan() { f64::NEG_INFINITY } else { low },
            if high.is_nan() { f64::INFINITY } else { high },
        );
        ends.expand(self.rounding(a, b))
    }

    /// Of a local blend, whether it joins by the smaller number, and how far apart the two must be for it to be just that.
    pub(crate) fn local(&self) -> Option<(bool, f64)> {
        match self.kind {
            Kind::LocalUnion => Some((true, self.size)),
            Kind::LocalIntersection => Some((false, self.size)),
            Kind::RicciUnion | Kind::RicciIntersection => None,
        }
    }

    /// How many times the larger change of the two the result can change.
    ///
    /// A Ricci union's two derivatives are s^{(a+1)/a} of shares s that sum to 1, so they sum to at most 1;
    /// an intersection's are s^{(a−1)/a}, which sum to at most 2^{1/a}. A local blend's sum to 1.
    pub(crate) fn stretch(&self) -> f64 {
        match self.kind {
            Kind::RicciIntersection => libm::exp2(1.0 / self.size) * (1.0 + 1e-12),
            _ => 1.0 + 1e-12,
        }
    }

    /// Twice the rounding of a value.
    pub(crate) fn rounding(&self, a: Interval, b: Interval) -> f64 {
        let most = a.magnitude() + b.magnitude() + self.size + 2.0;
        64.0 * f64::EPSILON * if most.is_finite() { most } else { 0.0 }
    }
}

/// first · (1 + (ratio)^a)^{∓1/a} − 1: of the smaller F for a union, of the larger for an intersection.
#[inline]
fn ricci<N: Local>(
    a: N,
    b: N,
    sharpness: f64,
    first: impl Fn(N, N) -> N,
    second: impl Fn(N, N) -> N,
    union: bool,
) -> N {
    let raise = |f: N| f.plus(N::constant(1.0)).max(N::constant(DEEPEST));
    let (a, b) = (raise(a), raise(b));
    let (main, other) = (first(a.clone(), b.clone()), second(a, b));
    let ratio = if union {
        main.clone().over(other)
    } else {
        other.over(main.clone())
    };
    let exponent = if union {
        -1.0 / sharpness
    } else {
        1.0 / sharpness
    };
    let share = power(ratio, sharpness).plus(N::constant(1.0));
    main.mul(power(share, exponent)).minus(N::constant(1.0))
}

/// a^exponent for a > 0.
#[inline]
fn power<N: Local>(a: N, exponent: f64) -> N {
    let x = a.at();
    let value = libm::pow(x, exponent);
    let slope = if x > 0.0 { exponent * (value / x) } else { 0.0 };
    let bend = if x > 0.0 {
        (exponent - 1.0) * slope / x
    } else {
        0.0
    };
    a.through([value, slope, bend])
}
