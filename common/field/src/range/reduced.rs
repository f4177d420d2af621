//! Reduced affine arithmetic: the symbols that matter, and one for all that is not shared.
//!
//! With one symbol it is the thesis's form along a ray, eqs. (5.19)–(5.22); with three, the form over a cell
//! of directions and distances, eq. (7.11). α − x̂ turns the signs of x̂'s shared terms (eq. (5.22c), mended: ERRATA);
//! the last *coefficient* is never negative (ERRATA row 1853).

use crate::interval::{Interval, larger};
use crate::noise::Lattice;
use crate::noise::cellular::Cellular;
use crate::noise::lattice::Corner;
use crate::range::form::{Form, ROUNDING, TINY};
use crate::range::function::Band;
use crate::range::noise::{self, Near};

/// x₀ + x₁e₁ + … + x_N e_N + error·e: each e in [−1, 1], the last shared with no other number.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Reduced<const N: usize> {
    /// x₀.
    pub centre: f64,
    /// The coefficients of the shared symbols.
    pub along: [f64; N],
    /// The coefficient of its own symbol, ≥ 0; infinite if nothing is known.
    pub error: f64,
}

impl<const N: usize> Reduced<N> {
    /// Nothing is known.
    const UNKNOWN: Self = Self {
        centre: 0.0,
        along: [0.0; N],
        error: f64::INFINITY,
    };

    /// A number without doubt.
    pub const fn point(value: f64) -> Self {
        Self {
            centre: value,
            along: [0.0; N],
            error: 0.0,
        }
    }

    /// `centre` and the given shared symbols.
    pub const fn of_symbols(centre: f64, along: [f64; N]) -> Self {
        Self {
            centre,
            along,
            error: 0.0,
        }
    }

    /// |x₁| + … + error.
    #[inline]
    pub fn radius(&self) -> f64 {
        self.along.iter().fold(self.error, |sum, x| sum + x.abs())
    }

    /// All its values, thesis eq. (5.24), rounded outward.
    #[inline]
    pub fn interval(&self) -> Interval {
        let radius = self.radius();
        if radius.is_finite() {
            // The sum's own rounding is a few units of it, the centre's of both.
            let radius = radius + (radius + self.centre.abs()) * ROUNDING;
            Interval::new(self.centre - radius, self.centre + radius)
        } else {
            Interval::ALL
        }
    }

    #[inline]
    fn magnitude(&self) -> f64 {
        self.centre.abs() + self.radius()
    }

    /// Itself, or nothing known where an overflow left no number.
    #[inline]
    pub(crate) fn checked(self) -> Self {
        let sound = self.centre.is_finite() && self.radius().is_finite();
        if sound { self } else { Self::UNKNOWN }
    }
}

impl<const N: usize> Form for Reduced<N> {
    #[inline]
    fn exact(value: f64) -> Self {
        Self::point(value).checked()
    }

    #[inline]
    fn somewhere(range: Interval) -> Self {
        let centre = 0.5 * (range.low + range.high);
        let error = larger(range.high - centre, centre - range.low);
        Self {
            centre,
            along: [0.0; N],
            error: error + (centre.abs() + error) * ROUNDING,
        }
        .checked()
    }

    #[inline]
    fn span(&self) -> Interval {
        self.interval()
    }

    #[inline]
    fn banded(&self, Band { alpha, beta, delta }: Band) -> Self {
        let size = alpha.abs() * self.magnitude() + beta.abs();
        let mut along = self.along;
        for x in &mut along {
            *x *= alpha;
        }
        Self {
            centre: alpha * self.centre + beta,
            along,
            error: alpha.abs() * self.error + delta + (size * ROUNDING + TINY),
        }
        .checked()
    }

    #[inline]
    fn added(&self, other: &Self, sign: f64) -> Self {
        let mut along = self.along;
        for (x, y) in along.iter_mut().zip(&other.along) {
            *x += sign * y;
        }
        let sum = Self {
            centre: self.centre + sign * other.centre,
            along,
            error: self.error + other.error,
        };
        let room = sum.magnitude() * ROUNDING + TINY;
        Self {
            error: sum.error + room,
            ..sum
        }
        .checked()
    }

    #[inline]
    fn multiplied(&self, other: &Self) -> Self {
        let (x, y) = (self, other);
        let mut along = [0.0; N];
        for (i, z) in along.iter_mut().enumerate() {
            *z = x.centre * y.along[i] + y.centre * x.along[i];
        }
        let (rx, ry) = (x.radius(), y.radius());
        let size = (x.centre.abs() + rx) * (y.centre.abs() + ry);
        Self {
            centre: x.centre * y.centre,
            along,
            error: x.centre.abs() * y.error
                + y.centre.abs() * x.error
                + rx * ry
                + (size * ROUNDING + TINY),
        }
        .checked()
    }

    #[inline]
    fn with_error(self, error: f64) -> Self {
        Self {
            error: (self.error + error) * (1.0 + ROUNDING),
            ..self
        }
        .checked()
    }

    #[inline]
    fn condensed(self, _: &[Self; 3]) -> Self {
        self
    }

    fn kernels(corner: Corner, lattice: Lattice, at: &[Self; 3]) -> Option<Self> {
        noise::reduced::sum(corner, lattice, at)
    }
    fn nearest(cellular: &Cellular, near: &Near<Self>, sorted: &mut [Self]) {
        noise::line::nearest(cellular, near, sorted);
    }
}
