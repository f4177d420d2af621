//! What every affine form has in common: a line of symbols, and functions as Chebyshev bands.

use crate::arithmetic::Unary;
use crate::curve::Curve;
use crate::interval::{Interval, larger, smaller};
use crate::number::Number;
use crate::range::Arithmetic;
use crate::range::function::{Band, Function};
use crate::range::interval::curve_over;

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
fn extreme<F: Form>(a: &F, b: &F, sign: f64) -> F {
    let difference = a.added(b, -1.0);
    let apart = difference.span();
    if apart.low >= 0.0 {
        return if sign < 0.0 { b.clone() } else { a.clone() };
    }
    if apart.high <= 0.0 {
        return if sign < 0.0 { a.clone() } else { b.clone() };
    }
    let half = Band {
        alpha: 0.5,
        beta: 0.0,
        delta: 0.0,
    };
    let sum = a.added(b, 1.0);
    let result = sum
        .added(&of(&difference, Function::Unary(Unary::Abs)), sign)
        .banded(half);
    let (p, q) = (a.span(), b.span());
    held(result, if sign < 0.0 { p.min(q) } else { p.max(q) })
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

    fn curve(self, curve: &Curve) -> Self {
        F::somewhere(curve_over(curve, self.span()))
    }

    fn settled(self, inputs: &[Self; 3]) -> Self {
        self.condensed(inputs)
    }
}
