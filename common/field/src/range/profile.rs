//! Profiles of noise kernels over ranges: radial ones as functions of the *squared* distance, B-splines of the way along an axis.
//!
//! By the squared distance a profile needs no square root, and along a ray the squared distance is a parabola, whose
//! Chebyshev band three squares give exactly; so a kernel costs one band and loses nothing at its node.
//! The thesis takes the root first, and h of that (§5.4.2).
//!
//! The bands of radial profiles go through the slope in the middle: where a function bends one way they are as
//! narrow as Chebyshev's, and need no root of φ′ = α but the middle itself.

use crate::interval::{Interval, larger, smaller};
use crate::noise::simplex;
use crate::noise::sparse::Kernel;
use crate::range::function::Band;

/// A profile of a noise's kernel.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Profile {
    /// h(√q) of sparse convolution and spot noise, thesis eqs. (4.13), (4.17); q ≥ 0.
    Radial(Kernel),
    /// The weight of a simplex's corner at the squared distance q ≥ 0.
    Simplex,
    /// The quadratic B-spline, thesis §4.6.
    Spline,
}

/// How far a computed value may be from the exact one.
const SLACK: f64 = 4e-15;

/// More than one rounding of a result relative to it, twice over.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// The squared distance where the quintic's slope is steepest: d = ⅓.
const STEEPEST: f64 = 1.0 / 9.0;

impl Profile {
    /// φ(a); below 0, where no squared distance is, that at 0.
    pub(crate) fn value(self, a: f64) -> f64 {
        match self {
            Self::Radial(kernel) => {
                let d = root(a);
                let rest = 1.0 - d;
                if rest <= 0.0 {
                    return 0.0;
                }
                match kernel {
                    Kernel::Lewis => 0.5 + 0.5 * libm::cos(core::f64::consts::PI * d),
                    Kernel::Quintic => rest * rest * rest * (1.0 + d * (3.0 + 6.0 * d)),
                    Kernel::Linear => rest,
                }
            }
            Self::Simplex => {
                let m = 0.5 - larger(a, 0.0);
                if m <= 0.0 {
                    return 0.0;
                }
                f64::from(simplex::SCALE) * ((m * m) * (m * m))
            }
            Self::Spline => {
                let t = a.abs();
                if t < 0.5 {
                    0.75 - t * t
                } else if t < 1.5 {
                    0.5 * (1.5 - t) * (1.5 - t)
                } else {
                    0.0
                }
            }
        }
    }

    /// φ′(a), from the right at a corner.
    pub(crate) fn slope(self, a: f64) -> f64 {
        match self {
            Self::Radial(kernel) => {
                let d = root(a);
                let rest = 1.0 - d;
                if rest <= 0.0 {
                    return 0.0;
                }
                match kernel {
                    Kernel::Lewis if d == 0.0 => {
                        -0.25 * core::f64::consts::PI * core::f64::consts::PI
                    }
                    Kernel::Lewis => {
                        let angle = core::f64::consts::PI * d;
                        -0.25 * core::f64::consts::PI * libm::sin(angle) / d
                    }
                    Kernel::Quintic => -15.0 * d * (rest * rest),
                    Kernel::Linear => -0.5 / d,
                }
            }
            Self::Simplex => {
                let m = larger(0.5 - larger(a, 0.0), 0.0);
                -4.0 * f64::from(simplex::SCALE) * (m * m * m)
            }
            Self::Spline => {
                let t = a.abs();
                let slope = if t < 0.5 {
                    -2.0 * t
                } else if t < 1.5 {
                    t - 1.5
                } else {
                    0.0
                };
                if a < 0.0 { -slope } else { slope }
            }
        }
    }

    /// φ″(a); 0 where there is none.
    pub(crate) fn bend(self, a: f64) -> f64 {
        match self {
            Self::Radial(kernel) => {
                let d = root(a);
                let rest = 1.0 - d;
                if rest <= 0.0 || d <= 0.0 {
                    return 0.0;
                }
                match kernel {
                    Kernel::Lewis => {
                        let angle = core::f64::consts::PI * d;
                        let turned = libm::sin(angle) - angle * libm::cos(angle);
                        0.125 * core::f64::consts::PI * turned / (d * d * d)
                    }
                    Kernel::Quintic => 7.5 * rest * (3.0 * d - 1.0) / d,
                    Kernel::Linear => 0.25 / (d * d * d),
                }
            }
            Self::Simplex => {
                let m = larger(0.5 - larger(a, 0.0), 0.0);
                12.0 * f64::from(simplex::SCALE) * (m * m)
            }
            Self::Spline => match a.abs() {
                t if t < 0.5 => -2.0,
                t if t < 1.5 => 1.0,
                _ => 0.0,
            },
        }
    }

    /// The range without what lies below the profile's domain.
    fn domain(self, a: Interval) -> Interval {
        match self {
            Self::Spline => a,
            _ => {
                let low = larger(0.0, a.low);
                Interval::new(low, larger(low, a.high))
            }
        }
    }

    /// All values over `a`, rounded outward.
    pub(crate) fn image(self, a: Interval) -> Interval {
        let far = match self {
            Self::Spline => a.abs(),
            _ => self.domain(a),
        };
        // Every profile falls from 0 on.
        let image = Interval::new(self.value(far.high), self.value(far.low)).expand(SLACK);
        Interval::new(larger(image.low, 0.0), image.high)
    }

    /// All derivatives over `a`, rounded outward: of both sides where it has a corner.
    pub(crate) fn slopes(self, a: Interval) -> Interval {
        let a = self.domain(a);
        let mut slopes =
            Interval::point(self.slope(a.low)).hull(Interval::point(self.slope(a.high)));
        let turning: &[f64] = match self {
            Self::Radial(Kernel::Quintic) => &[STEEPEST],
            // The slope of the side that the ends do not say.
            Self::Radial(Kernel::Linear) if a.low == 0.0 => {
                slopes.low = f64::NEG_INFINITY;
                &[]
            }
            Self::Radial(Kernel::Linear) if a.low <= 1.0 && a.high >= 1.0 => {
                slopes = slopes.hull(Interval::new(-0.5, 0.0));
                &[]
            }
            Self::Spline => &[-0.5, 0.5],
            _ => &[],
        };
        for &place in turning {
            if a.contains(place) {
                slopes = slopes.hull(Interval::point(self.slope(place)));
            }
        }
        slopes.expand(SLACK * larger(1.0, self.size()))
    }

    /// More than |φ| and |φ′| that are finite, as far as their rounding goes.
    fn size(self) -> f64 {
        match self {
            Self::Simplex => f64::from(simplex::SCALE),
            _ => 4.0,
        }
    }

    /// A line near the profile over `a`, and how near; `None` if the range has no middle.
    pub(crate) fn band(self, a: Interval) -> Option<Band> {
        if !a.low.is_finite() || !a.high.is_finite() {
            return None;
        }
        let over = self.domain(a);
        let (first, last) = (self.value(over.low), self.value(over.high));
        let width = over.width();
        let chord = |(first, last): (f64, f64)| {
            let sound = width > 64.0 * f64::EPSILON * over.magnitude();
            if sound { (last - first) / width } else { 0.0 }
        };
        let mut alpha = match self {
            Self::Spline => chord((first, last)),
            Self::Radial(Kernel::Quintic) if over.high > 1.0 => chord((first, last)),
            _ => self.slope(0.5 * (over.low + over.high)),
        };
        if !alpha.is_finite() {
            alpha = 0.0;
        }
        let rest = |t: f64| self.value(t) - alpha * t;
        let (p, q) = (rest(over.low), rest(over.high));
        let (mut low, mut high) = (smaller(p, q), larger(p, q));
        for place in self.level(alpha, over) {
            if over.contains(place) {
                let here = rest(place);
                low = smaller(low, here);
                high = larger(high, here);
            }
        }
        let size = larger(low.abs(), high.abs()) + 2.0 * alpha.abs() * over.magnitude();
        let delta = 0.5 * (high - low) + ROUNDING * size + SLACK;
        let beta = 0.5 * (low + high);
        (beta.is_finite() && delta.is_finite()).then_some(Band { alpha, beta, delta })
    }

    /// Where φ′ = α over a range, for the α that [`Self::band`] takes. Places outside the range do no harm.
    fn level(self, alpha: f64, over: Interval) -> [f64; 3] {
        let middle = 0.5 * (over.low + over.high);
        match self {
            Self::Radial(Kernel::Quintic) if over.high > 1.0 => {
                // d(1 − d)² = −α/15, by Viète; the third root is beyond 1.
                let c = 13.5 * (alpha / -15.0) - 1.0;
                if !(-1.0..=1.0).contains(&c) {
                    return [middle; 3];
                }
                let turn = libm::acos(c);
                let root = |k: f64| {
                    let angle = (turn + core::f64::consts::TAU * k) / 3.0;
                    let d = (2.0 / 3.0) * (1.0 + libm::cos(angle));
                    d * d
                };
                [root(1.0), root(2.0), middle]
            }
            Self::Radial(Kernel::Quintic) => {
                // One root of the cubic is known, so the others are a quadratic's.
                let d = middle.sqrt();
                let spread = larger(d * (4.0 - 3.0 * d), 0.0).sqrt();
                let near = 0.5 * (2.0 - d - spread);
                let far = 0.5 * (2.0 - d + spread);
                [middle, near * near, far * far]
            }
            Self::Spline => {
                let far = 1.5 - alpha.abs();
                [-0.5 * alpha, if alpha > 0.0 { -far } else { far }, middle]
            }
            // They bend up everywhere: the least is in the middle, the greatest at an end.
            _ => [middle; 3],
        }
    }
}

/// The distance of a squared one.
fn root(a: f64) -> f64 {
    if a > 0.0 { a.sqrt() } else { 0.0 }
}
