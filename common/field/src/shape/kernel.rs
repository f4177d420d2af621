//! The blending functions h of thesis eqs. (2.9)–(2.11): how a primitive's influence falls with distance.

mod bends;

use super::local::Local;
use crate::interval::Interval;

/// A blending function of ρ = d/r, written over u = ρ²: h(0) = 1, falling, never negative.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Kernel {
    /// e^{−u}, without an end (Blinn 1982).
    Blinn,
    /// 1 − 3ρ² to ρ = 1/3, then 3/2 (1 − ρ)² (Nishimura et al. 1985).
    Metaballs,
    /// 1 − 22/9 u + 17/9 u² − 4/9 u³ (Wyvill et al. 1986): 1/2 at ρ = 1/2.
    Wyvill,
    /// (1 − u)² (Murakami and Ichihara 1987).
    Murakami,
    /// 1 − 10ρ³ + 15ρ⁴ − 6ρ⁵: C² at its end, so that shading has no bands (Hart et al. 1998).
    Hart,
    /// 1/(1 + u)², without an end (Sherstyuk 1999).
    Cauchy,
}

/// Room for the rounding of a bound of a slope.
const ROOM: f64 = 1.0 + 1e-9;

impl Kernel {
    pub(crate) const ALL: [Self; 6] = [
        Self::Blinn,
        Self::Metaballs,
        Self::Wyvill,
        Self::Murakami,
        Self::Hart,
        Self::Cauchy,
    ];

    /// The kernel of that number; numbers are never given another meaning.
    pub(crate) fn from_number(number: f64) -> Option<Self> {
        (0..6u32)
            .zip(Self::ALL)
            .find(|(known, _)| f64::from(*known) == number)
            .map(|(_, kernel)| kernel)
    }

    /// Whether it is 0 from ρ = 1 on.
    #[inline(always)]
    pub(crate) fn ends(self) -> bool {
        !matches!(self, Self::Blinn | Self::Cauchy)
    }

    /// Whether a term counts at u: where it does not, or u is not a number, it is 0.
    #[inline(always)]
    pub(crate) fn reaches(self, u: f64) -> bool {
        if self.ends() { u < 1.0 } else { !u.is_nan() }
    }

    /// Its value and its first two derivatives by u.
    #[inline(always)]
    pub(crate) fn jet(self, u: f64) -> [f64; 3] {
        if u >= 1.0 && self.ends() {
            return [0.0; 3];
        }
        match self {
            Self::Blinn => {
                let e = libm::exp(-u);
                [e, -e, e]
            }
            Self::Metaballs => {
                if u <= 1.0 / 9.0 {
                    [1.0 - 3.0 * u, -3.0, 0.0]
                } else {
                    let rho = u.sqrt();
                    let rest = 1.0 - rho;
                    [1.5 * rest * rest, -1.5 * rest / rho, 0.75 / (rho * u)]
                }
            }
            Self::Wyvill => {
                const A: f64 = 4.0 / 9.0;
                const B: f64 = 17.0 / 9.0;
                const C: f64 = 22.0 / 9.0;
                [
                    1.0 + u * (u * (B - A * u) - C),
                    u * (2.0 * B - 3.0 * A * u) - C,
                    2.0 * B - 6.0 * A * u,
                ]
            }
            Self::Murakami => {
                let rest = 1.0 - u;
                [rest * rest, -2.0 * rest, 2.0]
            }
            Self::Hart => {
                let rho = u.sqrt();
                let rest = 1.0 - rho;
                let bend = if rho > 0.0 {
                    -7.5 * rest * (1.0 - 3.0 * rho) / rho
                } else {
                    0.0
                };
                [
                    1.0 + u * rho * (rho * (15.0 - 6.0 * rho) - 10.0),
                    -15.0 * rho * rest * rest,
                    bend,
                ]
            }
            Self::Cauchy => {
                let inverse = 1.0 / (1.0 + u);
                let square = inverse * inverse;
                [square, -2.0 * square * inverse, 6.0 * square * square]
            }
        }
    }

    /// h at a number u.
    #[inline(always)]
    pub(crate) fn of<N: Local>(self, u: N) -> N {
        let jet = self.jet(u.at());
        u.through(jet)
    }

    /// All values over distances ρ ≥ 0; it falls, so they lie between those of the ends.
    pub(crate) fn range(self, rho: Interval) -> Interval {
        let Interval { low, high } = rho;
        let least = if high.is_finite() {
            self.jet(high * high)[0]
        } else {
            0.0
        };
        // Values that should be 0 may be computed as a few units of rounding on either side.
        Interval::new(least, self.jet(low * low)[0]).expand(8.0 * f64::EPSILON)
    }

    /// The most of |dh/dρ| over distances ρ ≥ 0; it rises to one peak and falls after.
    pub(crate) fn slope(self, rho: Interval) -> f64 {
        let peak = match self {
            Self::Blinn => core::f64::consts::FRAC_1_SQRT_2,
            Self::Metaballs => 1.0 / 3.0,
            Self::Wyvill => 0.503_467_9,
            Self::Murakami => 0.577_350_3,
            Self::Hart => 0.5,
            Self::Cauchy => 0.447_213_6,
        };
        let at = |rho: f64| {
            let slope = (2.0 * rho * self.jet(rho * rho)[1]).abs();
            if slope.is_nan() { 0.0 } else { slope }
        };
        let steepest = if rho.high < peak - 1e-6 {
            at(rho.high)
        } else if rho.low > peak + 1e-6 {
            at(rho.low)
        } else {
            at(peak)
        };
        steepest * ROOM + 1e-15
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(kernel: Kernel, rho: f64) -> f64 {
        kernel.jet(rho * rho)[0]
    }

    #[test]
    fn kernels_fall_from_one_and_end_smoothly() {
        for kernel in Kernel::ALL {
            assert!((at(kernel, 0.0) - 1.0).abs() < 1e-15, "{kernel:?}");
            let mut steepest = 0.0f64;
            for i in 0..3000 {
                let rho = f64::from(i) * 5e-4;
                let (before, after) = (at(kernel, rho), at(kernel, rho + 5e-4));
                assert!(
                    after <= before + 1e-16 && after >= -1e-15,
                    "{kernel:?} {rho}"
                );
                steepest = steepest.max((before - after) / 5e-4);
                let here = kernel.slope(Interval::new(rho, rho + 5e-4));
                assert!((before - after) / 5e-4 <= here + 1e-12, "{kernel:?} {rho}");
            }
            let all = kernel.slope(Interval::new(0.0, f64::INFINITY));
            assert!(
                (0.999..=1.0).contains(&(steepest / all)),
                "{kernel:?}: {steepest} {all}"
            );
            if kernel.ends() {
                // C¹ at the end of its support, and 0 from there on.
                assert!(at(kernel, 0.9999).abs() < 1e-6 && at(kernel, 1.0) == 0.0);
                assert!(kernel.jet(0.999_999)[1].abs() < 1e-4, "{kernel:?}");
            }
        }
        assert!((at(Kernel::Wyvill, 0.5) - 0.5).abs() < 1e-15);
        let join = at(Kernel::Metaballs, 1.0 / 3.0 + 1e-12);
        assert!((join - 2.0 / 3.0).abs() < 1e-10);
        // Only Hart's has no jump in its second derivative at the end of its support: d²h/dρ² = 4u h'' + 2h'.
        let bend = |kernel: Kernel, u: f64| {
            let [_, slope, bend] = kernel.jet(u);
            (4.0 * u * bend + 2.0 * slope).abs()
        };
        assert!(bend(Kernel::Hart, 1.0 - 1e-9) < 1e-6);
        for kernel in [Kernel::Metaballs, Kernel::Wyvill, Kernel::Murakami] {
            assert!(bend(kernel, 1.0 - 1e-9) > 1.0, "{kernel:?}");
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        for kernel in Kernel::ALL {
            for i in 1..140 {
                let u = f64::from(i) * 0.01 + 0.003;
                let step = 1e-5;
                let (before, here, after) =
                    (kernel.jet(u - step), kernel.jet(u), kernel.jet(u + step));
                let slope = (after[0] - before[0]) / (2.0 * step);
                let bend = (after[1] - before[1]) / (2.0 * step);
                assert!((slope - here[1]).abs() < 1e-6, "{kernel:?} {u}");
                assert!(
                    (bend - here[2]).abs() < 1e-4,
                    "{kernel:?} {u}: {bend} {here:?}"
                );
            }
        }
    }
}
