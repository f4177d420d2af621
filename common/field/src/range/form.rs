//! What every affine form has in common: a line of symbols, and functions as Chebyshev bands.

use crate::arithmetic::Unary;
use crate::curve::Curve;
use crate::interval::{Interval, larger, smaller};
use crate::noise::Lattice;
use crate::noise::cellular::Cellular;
use crate::noise::lattice::Corner;
use crate::number::Number;
use crate::range::Arithmetic;
use crate::range::function::{Band, Function};
use crate::range::interval::curve_over;
use crate::range::noise::{self, Near};

/// Room for the rounding of one operation on forms, of the magnitudes that go into it.
pub(crate) const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Room for results too small for relative rounding.
pub(crate) const TINY: f64 = 1e-300;

/// An affine form: a centre, shared symbols, and an error of its own.
pub(crate) trait Form: Clone {
    /// A number without doubt.
    fn exact(value: f64) -> Self;
    /// Some number of a finite or infinite range.
    fn somewhere(range: Interval) -> Self;
    /// All its values.
    fn span(&self) -> Interval;
    /// α·self + β ± δ; a δ that comes of a function may be a new symbol.
    fn banded(&self, band: Band) -> Self;
    /// self + sign·other, sign ±1.
    fn added(&self, other: &Self, sign: f64) -> Self;
    /// The product, thesis eqs. (5.17), (5.21).
    fn multiplied(&self, other: &Self) -> Self;
    /// With room for an error that nothing else shares.
    fn with_error(self, error: f64) -> Self;
    /// Condensed to the symbols of the inputs, thesis eq. (5.18).
    fn condensed(self, inputs: &[Self; 3]) -> Self;

    /// The exact sum of a lattice noise's kernels; `None` where a place is too far or too wide.
    fn kernels(corner: Corner, lattice: Lattice, at: &[Self; 3]) -> Option<Self> {
        noise::lattice::sum(corner, lattice, at)
    }

    /// A cellular noise's distances, or their squares, sorted into `sorted`, which begins with the greatest there can be.
    fn nearest(cellular: &Cellular, near: &Near<Self>, sorted: &mut [Self]) {
        noise::cellular::nearest(cellular, near, sorted);
    }
}

/// Any number between two forms: their mean, give or take half of their difference.
fn between<F: Form>(a: &F, b: &F) -> F {
    let apart = a.added(b, -1.0).span().magnitude();
    let half = Band {
        alpha: 0.5,
        beta: 0.0,
        delta: 0.0,
    };
    a.added(b, 1.0).banded(half).with_error(0.5 * apart)
}

/// Thesis eq. (5.28), with `sign` −1 for the smaller and 1 for the larger.
///
/// Half of the sum and half of the difference share all symbols. Joined here in one step they keep them, so that reduced
/// forms lose nothing against standard ones inside a minimum, as they do in thesis §5.4.2.
fn extreme<F: Form>(a: &F, b: &F, sign: f64) -> F {
    let difference = a.added(b, -1.0);
    let apart = difference.span();
    if apart.low >= 0.0 {
        return if sign < 0.0 { b.clone() } else { a.clone() };
    }
    if apart.high <= 0.0 {
        return if sign < 0.0 { a.clone() } else { b.clone() };
    }
    let Some(Band { alpha, beta, delta }) = Function::Unary(Unary::Abs).band(apart) else {
        let (p, q) = (a.span(), b.span());
        return F::somewhere(if sign < 0.0 { p.min(q) } else { p.max(q) });
    };
    // |a − b| ∈ α(a − b) + β ± δ: the result is a mean of the two, and takes from each no more doubt than its share.
    let share = |toward: f64| 0.5 * (1.0 + sign * toward);
    let first = a.banded(Band {
        alpha: share(alpha),
        beta: sign * 0.5 * beta,
        delta: 0.5 * delta,
    });
    let second = b.banded(Band {
        alpha: share(-alpha),
        beta: 0.0,
        delta: 0.0,
    });
    let result = first.added(&second, 1.0);
    let (p, q) = (a.span(), b.span());
    held(result, if sign < 0.0 { p.min(q) } else { p.max(q) })
}

/// ‖v‖ as the line n·v, n the direction midway, and what v has across it: ‖v‖ − n·v lies between 0 and ‖v across n‖²/(2 n·v).
///
/// Along a ray that is half as wide as the root of a sum of squares, and a point towards the node. `None` where v may be 0 or turn far.
fn length<F: Form>(v: &[F; 3]) -> Option<F> {
    let middle = v.each_ref().map(|part| {
        let span = part.span();
        0.5 * (span.low + span.high)
    });
    let size = crate::arithmetic::length(middle);
    let n = middle.map(|part| part / size);
    let other = if n[0].abs() < 0.6 { 0 } else { 1 };
    // Across n and the axis that it is farthest from.
    let [x, y, z] = n;
    let b = if other == 0 {
        [0.0, z, -y]
    } else {
        [-z, 0.0, x]
    };
    let b_size = crate::arithmetic::length(b);
    let b = b.map(|part| part / b_size);
    let c = [
        y * b[2] - z * b[1],
        z * b[0] - x * b[2],
        x * b[1] - y * b[0],
    ];
    let dot = |e: [f64; 3]| {
        let scaled = |k: usize| {
            v[k].banded(Band {
                alpha: e[k],
                beta: 0.0,
                delta: 0.0,
            })
        };
        scaled(0).added(&scaled(1), 1.0).added(&scaled(2), 1.0)
    };
    let line = dot(n);
    let (p, q) = (dot(b).span().magnitude(), dot(c).span().magnitude());
    let span = line.span();
    let bulge = (p * p + q * q) / (2.0 * span.low);
    let near = span.low > 0.0 && bulge < 0.25 * span.low;
    near.then(|| {
        // n, b and c are orthonormal to a few units in the last place.
        let room = 32.0 * f64::EPSILON * (span.high + p + q);
        line.banded(Band {
            alpha: 1.0,
            beta: 0.5 * bulge,
            delta: 0.5 * bulge * (1.0 + ROUNDING) + room,
        })
    })
}

fn of<F: Form>(form: &F, function: Function) -> F {
    let span = form.span();
    match function.band(span) {
        Some(band) => form.banded(band),
        None => F::somewhere(function.image(span)),
    }
}

/// The form, or where it says less than `range` does, some number of that.
fn held<F: Form>(form: F, range: Interval) -> F {
    let span = form.span();
    if span.low < range.low && span.high > range.high {
        return F::somewhere(range);
    }
    let most = smaller(span.high, range.high) - larger(span.low, range.low);
    // What is cut off on one side is worth more than the correlation only where it is most of the form.
    if most >= 0.0 && most < 0.5 * span.width() {
        return F::somewhere(span.meet(range));
    }
    form
}

impl<F: Form> Number for F {
    fn constant(value: f64) -> Self {
        F::exact(value)
    }

    fn plus(self, other: Self) -> Self {
        self.added(&other, 1.0)
    }

    fn minus(self, other: Self) -> Self {
        self.added(&other, -1.0)
    }

    fn times(self, factor: f64) -> Self {
        self.banded(Band {
            alpha: factor,
            beta: 0.0,
            delta: 0.0,
        })
    }

    fn mul(self, other: Self) -> Self {
        self.multiplied(&other)
    }

    fn over(self, other: Self) -> Self {
        self.multiplied(&of(&other, Function::Reciprocal))
    }

    fn unary(self, unary: Unary) -> Self {
        self.apply(Function::Unary(unary))
    }

    fn min(self, other: Self) -> Self {
        extreme(&self, &other, -1.0)
    }

    fn max(self, other: Self) -> Self {
        extreme(&self, &other, 1.0)
    }

    fn power(self, exponent: f64) -> Self {
        of(&self, Function::Power(exponent))
    }

    fn clamp01(self) -> Self {
        self.apply(Function::Clamp)
    }

    fn select(self, negative: Self, other: Self) -> Self {
        let span = self.span();
        if span.high < 0.0 {
            negative
        } else if span.low >= 0.0 {
            other
        } else {
            between(&negative, &other)
        }
    }

    fn gate(self, live: bool) -> Self {
        if live { self } else { F::exact(0.0) }
    }

    fn square(self) -> Self {
        of(&self, Function::Square)
    }
}

impl<F: Form> Arithmetic for F {
    fn any(range: Interval) -> Self {
        F::somewhere(range)
    }

    fn range(&self) -> Interval {
        self.span()
    }

    fn within(self, range: Interval) -> Self {
        held(self, range)
    }

    fn blurred(self, error: f64) -> Self {
        self.with_error(error)
    }

    fn hull(self, other: Self) -> Self {
        between(&self, &other)
    }

    fn apply(self, function: Function) -> Self {
        let span = self.span();
        match function {
            Function::Unary(Unary::Neg) => self.times(-1.0),
            Function::Unary(Unary::Abs) if span.low >= 0.0 => self,
            Function::Unary(Unary::Abs) if span.high <= 0.0 => self.times(-1.0),
            Function::Clamp if span.low >= 0.0 && span.high <= 1.0 => self,
            Function::Power(1.0) => self,
            _ => of(&self, function),
        }
    }

    fn distance(v: [Self; 3]) -> Self {
        length(&v).unwrap_or_else(|| {
            let [x, y, z] = v;
            x.square().plus(y.square()).plus(z.square()).sqrt()
        })
    }

    fn curve(self, curve: &Curve) -> Self {
        F::somewhere(curve_over(curve, self.span()))
    }

    fn settled(self, inputs: &[Self; 3]) -> Self {
        self.condensed(inputs)
    }

    fn kernels(corner: Corner, lattice: Lattice, at: &[Self; 3]) -> Option<Self> {
        F::kernels(corner, lattice, at)
    }
    fn nearest(cellular: &Cellular, near: &Near<Self>, sorted: &mut [Self]) {
        F::nearest(cellular, near, sorted);
    }
}
