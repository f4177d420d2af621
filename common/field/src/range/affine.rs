//! Standard affine arithmetic, thesis §5.3.2: a new symbol for every operation that is not affine.
//!
//! Symbols are told apart by numbers that are drawn once and never again; no result depends on which.
//! A form keeps at most 64 of them: beyond that its smallest terms are condensed into one of its own.

use std::cell::Cell;

use crate::interval::{Interval, larger};
use crate::range::form::{Form, ROUNDING, TINY};
use crate::range::function::Band;
use crate::range::reduced::Reduced;

/// Most symbols of a form. A noise's kernel makes six of its own, a field of ten noises some thirty.
pub(crate) const TERMS_MAX: usize = 64;

/// The symbols that stand for the ray, or for a cell's three directions.
const SHARED: u64 = 3;

thread_local! {
    static NEXT: Cell<u64> = const { Cell::new(SHARED) };
}

/// A symbol that no form has yet.
fn fresh() -> u64 {
    NEXT.with(|next| {
        let symbol = next.get();
        next.set(symbol + 1);
        symbol
    })
}

/// x₀ + Σ xᵢeᵢ ± error, thesis eq. (5.15): symbols shared among numbers, and an error that is not.
#[derive(Clone, PartialEq, Debug)]
pub struct Affine {
    centre: f64,
    /// Symbol and coefficient, by rising symbol.
    terms: Vec<(u64, f64)>,
    error: f64,
}

impl Affine {
    fn unknown() -> Self {
        Self {
            centre: 0.0,
            terms: Vec::new(),
            error: f64::INFINITY,
        }
    }

    fn radius(&self) -> f64 {
        self.terms
            .iter()
            .fold(self.error, |sum, (_, x)| sum + x.abs())
    }

    fn magnitude(&self) -> f64 {
        self.centre.abs() + self.radius()
    }

    fn checked(self) -> Self {
        if self.centre.is_finite() && self.radius().is_finite() {
            self
        } else {
            Self::unknown()
        }
    }

    /// x·self + y·other, without what is not linear in them.
    fn combined(&self, x: f64, other: &Self, y: f64) -> Vec<(u64, f64)> {
        let mut terms = Vec::with_capacity(self.terms.len() + other.terms.len() + 1);
        let (mut i, mut j) = (0, 0);
        loop {
            let next = match (self.terms.get(i), other.terms.get(j)) {
                (Some(&(s, p)), Some(&(t, q))) if s == t => {
                    (i, j) = (i + 1, j + 1);
                    (s, x * p + y * q)
                }
                (Some(&(s, p)), rest) if rest.is_none_or(|&(t, _)| s < t) => {
                    i += 1;
                    (s, x * p)
                }
                (_, Some(&(t, q))) => {
                    j += 1;
                    (t, y * q)
                }
                (_, None) => return terms,
            };
            terms.push(next);
        }
    }

    /// With a new symbol of that coefficient, and condensed if that makes too many.
    fn with_symbol(mut self, coefficient: f64) -> Self {
        if coefficient > 0.0 {
            if self.terms.len() >= TERMS_MAX {
                self = self.shortened();
            }
            self.terms.push((fresh(), coefficient));
        }
        self
    }

    /// Its smaller half condensed into one symbol; those of the inputs stay.
    fn shortened(mut self) -> Self {
        let mut sizes: Vec<f64> = self.terms.iter().map(|(_, x)| x.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let middle = sizes[sizes.len() / 2];
        let mut gathered = 0.0;
        self.terms.retain(|(symbol, x)| {
            let kept = *symbol < SHARED || x.abs() > middle;
            if !kept {
                gathered += x.abs();
            }
            kept
        });
        self.terms.push((fresh(), gathered * (1.0 + ROUNDING)));
        self
    }

    /// The same number as a standard form: its own symbol gets a new number (thesis §5.5).
    pub fn from_reduced<const N: usize>(form: &Reduced<N>) -> Self {
        let terms = (0..).zip(form.along).take(3).collect();
        Self {
            centre: form.centre,
            terms,
            error: 0.0,
        }
        .with_symbol(form.error)
        .checked()
    }

    /// Condensed to the shared symbols, thesis eq. (5.18) (n ≤ i, mended: ERRATA).
    pub fn to_reduced<const N: usize>(&self) -> Reduced<N> {
        let mut reduced = Reduced {
            centre: self.centre,
            along: [0.0; N],
            error: self.error,
        };
        for &(symbol, x) in &self.terms {
            match usize::try_from(symbol)
                .ok()
                .and_then(|symbol| reduced.along.get_mut(symbol))
            {
                Some(along) => *along = x,
                None => reduced.error += x.abs(),
            }
        }
        reduced.error *= 1.0 + TERMS_MAX as f64 * f64::EPSILON;
        reduced
    }
}

impl Form for Affine {
    fn exact(value: f64) -> Self {
        Self {
            centre: value,
            terms: Vec::new(),
            error: 0.0,
        }
        .checked()
    }

    fn somewhere(range: Interval) -> Self {
        let centre = 0.5 * (range.low + range.high);
        let error = larger(range.high - centre, centre - range.low);
        Self {
            centre,
            terms: Vec::new(),
            error: (centre.abs() + error) * ROUNDING,
        }
        .with_symbol(error)
        .checked()
    }

    fn span(&self) -> Interval {
        self.to_reduced::<1>().interval()
    }

    fn banded(&self, Band { alpha, beta, delta }: Band) -> Self {
        let size = alpha.abs() * self.magnitude() + beta.abs();
        Self {
            centre: alpha * self.centre + beta,
            terms: self.terms.iter().map(|(i, x)| (*i, alpha * x)).collect(),
            error: alpha.abs() * self.error + (size * ROUNDING + TINY),
        }
        .with_symbol(delta)
        .checked()
    }

    fn added(&self, other: &Self, sign: f64) -> Self {
        let sum = Self {
            centre: self.centre + sign * other.centre,
            terms: self.combined(1.0, other, sign),
            error: self.error + other.error,
        };
        let room = sum.magnitude() * ROUNDING + TINY;
        let mut sum = Self {
            error: sum.error + room,
            ..sum
        };
        while sum.terms.len() > TERMS_MAX {
            sum = sum.shortened();
        }
        sum.checked()
    }

    fn multiplied(&self, other: &Self) -> Self {
        let (x, y) = (self, other);
        let (rx, ry) = (x.radius(), y.radius());
        let size = (x.centre.abs() + rx) * (y.centre.abs() + ry);
        let mut product = Self {
            centre: x.centre * y.centre,
            terms: x.combined(y.centre, y, x.centre),
            error: x.centre.abs() * y.error + y.centre.abs() * x.error + (size * ROUNDING + TINY),
        };
        while product.terms.len() >= TERMS_MAX {
            product = product.shortened();
        }
        product.with_symbol(rx * ry).checked()
    }

    fn with_error(self, error: f64) -> Self {
        Self {
            error: (self.error + error) * (1.0 + ROUNDING),
            ..self
        }
        .checked()
    }

    fn condensed(mut self, inputs: &[Self; 3]) -> Self {
        let known = |symbol: u64| {
            inputs.iter().any(|input| {
                input
                    .terms
                    .binary_search_by_key(&symbol, |term| term.0)
                    .is_ok()
            })
        };
        let mut gathered = 0.0;
        self.terms.retain(|(symbol, x)| {
            let kept = known(*symbol);
            if !kept {
                gathered += x.abs();
            }
            kept
        });
        self.with_symbol(gathered * (1.0 + TERMS_MAX as f64 * f64::EPSILON))
            .checked()
    }
}
