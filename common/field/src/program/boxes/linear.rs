//! A linear function over a box, and how far a number may be from it: reduced affine arithmetic without branches.
//!
//! Every number of the arithmetic is centre + along·e ± error, e in [−1, 1] for each axis of the box. A function φ of one number is
//! φ(centre) + α·(the rest), with α midway between its least and greatest slope and half of what is between them as an
//! error per unit; [`Stretch`] knows values and slopes of every function. Where that says less than its values do, it is
//! those. What is not bounded has an infinite error, or is not a number, and stays so.

use crate::arithmetic::Unary;
use crate::curve::Curve;
use crate::lanes::Lanes;
use crate::number::Number;
use crate::points::BATCH;
use crate::program::ahead::Stretch;
use crate::range::{ROUNDING, TINY};

/// Beyond it nothing is said of a number: far from where products are not finite.
const MOST: f64 = 1e50;

/// centre + along·e ± error.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Linear {
    pub(super) centre: f64,
    pub(super) along: [f64; 3],
    pub(super) error: f64,
}

/// Linear functions, one per lane, as structure of arrays.
#[derive(Debug)]
#[repr(align(64))]
pub(super) struct Linears {
    pub(super) centre: Lanes,
    pub(super) along: [Lanes; 3],
    pub(super) error: Lanes,
}

impl Linears {
    pub(super) fn new() -> Box<Self> {
        Box::new(Self {
            centre: [0.0; BATCH],
            along: [[0.0; BATCH]; 3],
            error: [0.0; BATCH],
        })
    }

    #[inline(always)]
    pub(super) fn at(&self, i: usize) -> Linear {
        let [x, y, z] = &self.along;
        Linear {
            centre: self.centre[i],
            along: [x[i], y[i], z[i]],
            error: self.error[i],
        }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, i: usize, a: Linear) {
        self.centre[i] = a.centre;
        let [x, y, z] = &mut self.along;
        [x[i], y[i], z[i]] = a.along;
        self.error[i] = a.error;
    }

    /// 0 in the first `n` lanes.
    pub(super) fn clear(&mut self, n: usize) {
        self.centre[..n].fill(0.0);
        for along in &mut self.along {
            along[..n].fill(0.0);
        }
        self.error[..n].fill(0.0);
    }

    pub(super) fn fill(&mut self, a: Linear) {
        self.centre.fill(a.centre);
        for (lanes, along) in self.along.iter_mut().zip(a.along) {
            lanes.fill(along);
        }
        self.error.fill(a.error);
    }
}

#[inline(always)]
pub(super) fn choose(condition: bool, a: Linear, b: Linear) -> Linear {
    let pick = |a: f64, b: f64| if condition { a } else { b };
    let ([p, q, r], [s, t, u]) = (a.along, b.along);
    Linear {
        centre: pick(a.centre, b.centre),
        along: [pick(p, s), pick(q, t), pick(r, u)],
        error: pick(a.error, b.error),
    }
}

/// α t + β ± δ around |t| for t between two numbers, one below 0 and one above.
#[inline(always)]
fn magnitude(low: f64, high: f64) -> (f64, f64) {
    let width = high - low;
    ((high + low) / width, -(high * low) / width)
}

impl Linear {
    /// How far it goes from its centre.
    #[inline(always)]
    fn radius(self) -> f64 {
        let [x, y, z] = self.along;
        x.abs() + y.abs() + z.abs() + self.error
    }

    /// No value is farther from 0.
    #[inline(always)]
    pub(super) fn size(self) -> f64 {
        self.centre.abs() + self.radius()
    }

    /// All its values, rounded outward.
    #[inline(always)]
    fn span(self) -> (f64, f64) {
        let radius = self.radius();
        let radius = radius + (radius + self.centre.abs()) * ROUNDING;
        (self.centre - radius, self.centre + radius)
    }

    /// α·self + β ± δ, without room for rounding.
    #[inline(always)]
    fn banded(self, alpha: f64, beta: f64, delta: f64) -> Self {
        Self {
            centre: alpha * self.centre + beta,
            along: self.along.map(
                #[inline(always)]
                |x| alpha * x,
            ),
            error: alpha.abs() * self.error + delta,
        }
    }

    /// With room for the rounding of results of that size.
    #[inline(always)]
    fn rounded(self, size: f64) -> Self {
        Self {
            error: self.error + (size * ROUNDING + TINY),
            ..self
        }
    }

    /// A coordinate, whose centre and edges are rounded.
    pub(super) fn placed(self) -> Self {
        self.rounded(self.size())
    }

    /// Some number between two.
    #[inline(always)]
    pub(super) fn somewhere(low: f64, high: f64) -> Self {
        let whole = Self {
            centre: 0.5 * (low + high),
            along: [0.0; 3],
            error: 0.5 * (high - low),
        };
        whole.rounded(low.abs() + high.abs())
    }

    /// A function of it.
    #[inline(always)]
    fn function(self, f: impl Fn(Stretch) -> Stretch) -> Self {
        let (low, high) = self.span();
        let over = f(Stretch::new((low, high), (1.0, 1.0)));
        let middle = f(Stretch::constant(self.centre));
        let (alpha, spread) = (0.5 * (over.fall + over.rise), 0.5 * (over.rise - over.fall));
        let (value, doubt) = (
            0.5 * (middle.low + middle.high),
            0.5 * (middle.high - middle.low),
        );
        let radius = self.radius();
        let bend = spread * radius;
        let line = Self {
            centre: value,
            ..self.banded(alpha, 0.0, bend + doubt)
        };
        let line = line.rounded(value.abs() + (alpha.abs() + spread) * self.size());
        let whole = Self::somewhere(over.low, over.high);
        // Nothing that is no number is less.
        let is_line = (spread < MOST) & (bend + doubt < whole.error);
        let best = choose(is_line, line, whole);
        let is_known = (self.size() < MOST) & (best.size() < MOST);
        Self {
            error: if is_known { best.error } else { f64::INFINITY },
            ..best
        }
    }

    /// factor/a for a positive number; no bound where it may be less.
    #[inline(always)]
    pub(super) fn inverse(self, factor: f64) -> Self {
        self.function(
            #[inline(always)]
            |a| a.inverse(factor),
        )
    }

    /// 3u² − 2u³ over the way from `low` to `high`.
    #[inline(always)]
    pub(super) fn smoothstep(self, low: f64, high: f64) -> Self {
        self.function(
            #[inline(always)]
            |a| a.smoothstep(low, high),
        )
    }

    /// A curve over it.
    pub(super) fn curve(self, curve: &Curve) -> Self {
        self.function(|a| a.curve(curve))
    }

    /// The smaller number with `sign` −1, the larger with 1, thesis eq. (5.28): half of the sum and half of the difference
    /// share all symbols, and each takes its share of doubt.
    #[inline(always)]
    fn extreme(self, other: Self, sign: f64) -> Self {
        let (low, high) = self.minus(other).span();
        let (alpha, beta) = magnitude(low, high);
        let share = |toward: f64| 0.5 * (1.0 + sign * toward);
        let first = self.banded(share(alpha), sign * 0.5 * beta, 0.5 * beta);
        let second = other.banded(share(-alpha), 0.0, 0.0);
        let size = self.size() + other.size();
        let both = first.plus(second).rounded(size);
        let (above, below) = (low >= 0.0, high <= 0.0);
        let (first, second) = if sign < 0.0 {
            (below, above)
        } else {
            (above, below)
        };
        choose(first, self, choose(second, other, both))
    }

    /// Any number between the two.
    #[inline(always)]
    fn hull(self, other: Self) -> Self {
        let apart = self.minus(other).size();
        let sum = self.plus(other).banded(0.5, 0.0, 0.5 * apart);
        sum.rounded(sum.size())
    }
}

impl Number for Linear {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self {
            centre: value,
            along: [0.0; 3],
            error: 0.0,
        }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let ([p, q, r], [s, t, u]) = (self.along, other.along);
        let sum = Self {
            centre: self.centre + other.centre,
            along: [p + s, q + t, r + u],
            error: self.error + other.error,
        };
        sum.rounded(sum.size())
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.plus(other.banded(-1.0, 0.0, 0.0))
    }

    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        let product = self.banded(factor, 0.0, 0.0);
        product.rounded(product.size())
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let ([p, q, r], [s, t, u]) = (self.along, other.along);
        let (a, b) = (self.centre, other.centre);
        let (ra, rb) = (self.radius(), other.radius());
        let product = Self {
            centre: a * b,
            along: [a * s + b * p, a * t + b * q, a * u + b * r],
            error: a.abs() * other.error + b.abs() * self.error + ra * rb,
        };
        product.rounded((a.abs() + ra) * (b.abs() + rb))
    }

    #[inline(always)]
    fn over(self, other: Self) -> Self {
        let inverse = other.function(
            #[inline(always)]
            |a| Stretch::constant(1.0).over(a),
        );
        self.mul(inverse)
    }

    #[inline(always)]
    fn unary(self, unary: Unary) -> Self {
        match unary {
            Unary::Neg => self.banded(-1.0, 0.0, 0.0),
            Unary::Abs => {
                let (low, high) = self.span();
                let (alpha, beta) = magnitude(low, high);
                let around = self.banded(alpha, beta, beta).rounded(self.size());
                let turned = self.banded(-1.0, 0.0, 0.0);
                choose(low >= 0.0, self, choose(high <= 0.0, turned, around))
            }
            _ => self.function(
                #[inline(always)]
                |a| a.unary(unary),
            ),
        }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.extreme(other, -1.0)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.extreme(other, 1.0)
    }

    #[inline(always)]
    fn power(self, exponent: f64) -> Self {
        self.function(
            #[inline(always)]
            |a| a.power(exponent),
        )
    }

    #[inline(always)]
    fn clamp01(self) -> Self {
        let (low, high) = self.span();
        let clamped = self.function(Stretch::clamp01);
        choose((low >= 0.0) & (high <= 1.0), self, clamped)
    }

    #[inline(always)]
    fn select(self, negative: Self, other: Self) -> Self {
        let (low, high) = self.span();
        let either = negative.hull(other);
        choose(high < 0.0, negative, choose(low >= 0.0, other, either))
    }

    #[inline(always)]
    fn gate(self, live: bool) -> Self {
        choose(live, self, Self::constant(0.0))
    }

    #[inline(always)]
    fn square(self) -> Self {
        let radius = self.radius();
        let half = 0.5 * radius * radius;
        let size = self.size();
        let square = Self {
            centre: self.centre * self.centre + half,
            ..self.banded(2.0 * self.centre, 0.0, half)
        };
        square.rounded(size * size)
    }
}
