//! Superquadrics, thesis eq. (2.6): spheres whose roundness changes (Barr 1981).

use super::Refusal;
use super::local::Local;
use super::within::{Known, Within};
use crate::interval::{Interval, larger};

/// (|x|^{2/ε₂} + |y|^{2/ε₂})^{ε₂/ε₁} + |z|^{2/ε₁} − 1.
///
/// ε₁ and ε₂ are at most 2: beyond, the surface has spikes at which it has no bounded slope.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Superquadric {
    /// 2/ε₂: the exponent around z.
    around: f64,
    /// 2/ε₁: the exponent along z.
    up: f64,
}

impl Superquadric {
    pub(crate) fn new(params: &[f64]) -> Result<Self, Refusal> {
        for &value in params {
            if !(0.0625..=2.0).contains(&value) {
                return Err(("exponents from 1/16 to 2", value));
            }
        }
        Ok(Self {
            up: 2.0 / params[0],
            around: 2.0 / params[1],
        })
    }

    /// Its value.
    ///
    /// The first two terms are ‖(x, y)‖_a^b, and a norm has a bounded gradient where powers of its
    /// own terms have none: that is how the derivative is formed, from shares below 1.
    #[inline]
    pub(crate) fn value<N: Local>(&self, [x, y, z]: [N; 3]) -> N {
        let (a, b) = (self.around, self.up);
        let (x, y, z) = (x.abs(), y.abs(), z.abs());
        let swap = x.at() < y.at();
        let (large, small) = if swap { (y, x) } else { (x, y) };
        let flat = if large.at() > 0.0 {
            // large · (1 + (small/large)^a)^{1/a}
            let share = raised(small.over(large.clone()), a);
            let stretch = raised(share.plus(N::constant(1.0)), 1.0 / a);
            raised(large.mul(stretch), b)
        } else {
            N::constant(0.0)
        };
        flat.plus(raised(z, b)).minus(N::constant(1.0))
    }

    /// It rises with |x|, |y| and |z|; the gradient of an a-norm is at most 1 long for a ≥ 2, 2^{1/a − 1/2} below.
    pub(crate) fn bound(&self, within: &Within) -> Known {
        let (a, b) = (self.around, self.up);
        let ends = within.parts.map(Interval::abs);
        let least = self.value(ends.map(|part| part.low));
        let most = self.value(ends.map(|part| part.high));
        let steps = 8.0 + 4.0 * b;
        let rounding = 2.0 * (most.abs() + 2.0) * steps * f64::EPSILON;
        let [x, y, z] = ends.map(|part| part.high);
        let flat = libm::pow(libm::pow(x, a) + libm::pow(y, a), 1.0 / a);
        let stretch = if a < 2.0 {
            libm::exp2(1.0 / a - 0.5)
        } else {
            1.0
        };
        let across = b * libm::pow(larger(flat, 1e-300), b - 1.0) * stretch;
        let along = b * libm::pow(larger(z, 1e-300), b - 1.0);
        Known {
            range: Interval::new(least, most).expand(rounding),
            slope: (across * across + along * along).sqrt() * (1.0 + 1e-9),
            rounding,
        }
    }
}

/// a^exponent for a ≥ 0; flat at 0 unless the exponent is 1.
#[inline]
fn raised<N: Local>(a: N, exponent: f64) -> N {
    let x = a.at();
    let value = libm::pow(x, exponent);
    if x > 0.0 {
        let slope = exponent * (value / x);
        a.through([value, slope, (exponent - 1.0) * slope / x])
    } else {
        let slope = if exponent == 1.0 { 1.0 } else { 0.0 };
        a.through([value, slope, 0.0])
    }
}
