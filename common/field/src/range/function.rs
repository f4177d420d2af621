//! Functions of one number, as every arithmetic needs them: value, derivatives, and where they bend away from a line.
//!
//! A range arithmetic needs of φ over an interval only the extremes of φ(t) − αt: with α = 0 they are the
//! image, with α the slope of the chord they are the Chebyshev approximation of thesis §5.4.2. They stand at
//! the ends or where φ′ = α, and for each function here that has a closed form.

use crate::arithmetic::{self, Unary};
use crate::interval::{Interval, larger, smaller};
use crate::range::profile::Profile;

/// A function of one number.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Function {
    /// One of the operations of a graph.
    Unary(Unary),
    /// sign(a)·|a|^exponent.
    Power(f64),
    /// 3u² − 2u³ from the first number to the second.
    SmoothStep(f64, f64),
    /// 0 below 0, 1 above 1.
    Clamp,
    /// a².
    Square,
    /// 1/a.
    Reciprocal,
    /// radius/a, 0 at 0: what a vector of length a is multiplied with to lie on the sphere.
    OntoSphere(f64),
    /// 1 − 6|t|⁵ + 15t⁴ − 10|t|³ for |t| < 1, else 0: the profile of lattice noises, thesis fig. 4.4
    /// (row 1973 of ERRATA: the quintic, not the cubic).
    Quintic,
    /// A profile of another noise's kernel.
    Profile(Profile),
}

/// Places where a function's derivative is a given number: at most this many within one turn of a circle.
const PLACES: usize = 6;

/// A few numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Places {
    at: [f64; PLACES],
    count: usize,
}

impl Places {
    fn none() -> Self {
        Self {
            at: [0.0; PLACES],
            count: 0,
        }
    }

    /// With one more; beyond the room there is, it is left out.
    fn and(mut self, place: f64) -> Self {
        if let Some(free) = self.at.get_mut(self.count) {
            *free = place;
            self.count += 1;
        }
        self
    }

    fn slice(&self) -> &[f64] {
        &self.at[..self.count]
    }
}

/// A line with room on both sides: α t + β ± δ.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Band {
    pub(crate) alpha: f64,
    pub(crate) beta: f64,
    pub(crate) delta: f64,
}

/// More than one rounding of a result relative to it, twice over: for the values and for the line.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Room for the rounding of the quintic: sums of terms up to 15 that end near 0.
const QUINTIC_SLACK: f64 = 2e-14;

/// A whole turn, a little less, so that no interval longer than it is called shorter.
const TURN: f64 = std::f64::consts::TAU * (1.0 - 1e-9);

impl Function {
    /// φ(a), the same bits as evaluation gives.
    #[inline]
    pub(crate) fn value(self, a: f64) -> f64 {
        match self {
            Self::Unary(unary) => unary.value(a),
            Self::Power(exponent) => arithmetic::power(exponent, a),
            Self::SmoothStep(low, high) => arithmetic::smoothstep(low, high, a),
            Self::Clamp => arithmetic::clamp01(a),
            Self::Square => a * a,
            Self::Reciprocal => 1.0 / a,
            Self::OntoSphere(radius) => arithmetic::onto_sphere(radius, a),
            Self::Profile(profile) => profile.value(a),
            Self::Quintic => {
                let t = a.abs();
                if t < 1.0 {
                    1.0 - t * t * t * (t * (6.0 * t - 15.0) + 10.0)
                } else {
                    0.0
                }
            }
        }
    }

    /// φ′(a); 0 or that of one side where there is none.
    #[inline]
    pub(crate) fn slope(self, a: f64) -> f64 {
        match self {
            Self::Unary(unary) => unary.slope(a, unary.value(a)),
            Self::Power(exponent) => {
                arithmetic::power_slope(exponent, a, arithmetic::power(exponent, a))
            }
            Self::SmoothStep(low, high) => arithmetic::smoothstep_slope(low, high, a),
            Self::Clamp => f64::from(u8::from((0.0..=1.0).contains(&a))),
            Self::Square => 2.0 * a,
            Self::Reciprocal => -1.0 / (a * a),
            Self::Profile(profile) => profile.slope(a),
            Self::OntoSphere(radius) => {
                let inverse = arithmetic::inverse(a);
                -radius * inverse * inverse
            }
            Self::Quintic => {
                let t = a.abs();
                let p = t * (1.0 - t);
                let slope = if t < 1.0 { 30.0 * p * p } else { 0.0 };
                if a < 0.0 { slope } else { -slope }
            }
        }
    }

    /// φ″(a); 0 where there is none.
    pub(crate) fn bend(self, a: f64) -> f64 {
        match self {
            Self::Unary(Unary::Neg | Unary::Abs) | Self::Clamp => 0.0,
            Self::Unary(Unary::Sqrt) => {
                let root = Unary::Sqrt.value(a);
                if root > 0.0 { -0.25 / (root * a) } else { 0.0 }
            }
            Self::Unary(unary @ (Unary::Sin | Unary::Cos)) => -unary.value(a),
            Self::Unary(Unary::Exp) => libm::exp(a),
            Self::Power(exponent) => {
                if exponent == 1.0 || a == 0.0 {
                    0.0
                } else {
                    exponent * (exponent - 1.0) * (arithmetic::power(exponent, a) / (a * a))
                }
            }
            Self::SmoothStep(low, high) => {
                let width = high - low;
                let u = (a - low) / width;
                if (0.0..=1.0).contains(&u) {
                    (6.0 - 12.0 * u) / (width * width)
                } else {
                    0.0
                }
            }
            Self::Square => 2.0,
            Self::Reciprocal => 2.0 / (a * a * a),
            Self::Profile(profile) => profile.bend(a),
            Self::OntoSphere(radius) => {
                let inverse = arithmetic::inverse(a);
                2.0 * radius * inverse * inverse * inverse
            }
            Self::Quintic => {
                let t = a.abs();
                if t < 1.0 {
                    -60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)
                } else {
                    0.0
                }
            }
        }
    }

    /// All values over `a`, rounded outward.
    pub(crate) fn image(self, a: Interval) -> Interval {
        match self {
            Self::Reciprocal if a.low <= 0.0 && a.high >= 0.0 => return Interval::ALL,
            Self::OntoSphere(radius) if a.low <= 0.0 => {
                // On the sphere's axis the factor is 0; just beside it there is no limit.
                return if radius == 0.0 {
                    Interval::point(0.0)
                } else {
                    Interval::new(smaller(0.0, radius * f64::INFINITY), f64::INFINITY)
                };
            }
            Self::Unary(Unary::Sin | Unary::Cos) if turns(a) => return Interval::new(-1.0, 1.0),
            _ => {}
        }
        if a.low.is_nan() || a.high.is_nan() {
            return Interval::ALL;
        }
        if let Self::Profile(profile) = self {
            return profile.image(a);
        }
        if self == Self::Quintic {
            // It falls from 0 on, on both sides.
            let far = a.abs();
            let image = Interval::new(self.value(far.high), self.value(far.low));
            return image.expand(self.slack());
        }
        let (low, high) = self.extremes(0.0, a);
        let image = Interval::new(low, high).expand(self.slack());
        match self {
            Self::Unary(Unary::Sin | Unary::Cos) => image.clamp(-1.0, 1.0),
            Self::Unary(Unary::Sqrt | Unary::Abs | Unary::Exp) | Self::Square => {
                Interval::new(larger(image.low, 0.0), image.high)
            }
            Self::Clamp => image.clamp(0.0, 1.0),
            _ => image,
        }
    }

    /// All derivatives over `a`, rounded outward: of both sides where it has a corner.
    pub(crate) fn slopes(self, a: Interval) -> Interval {
        let Interval { low, high } = a;
        if let Self::Profile(profile) = self {
            let known = !low.is_nan() && !high.is_nan();
            return if known {
                profile.slopes(a)
            } else {
                Interval::ALL
            };
        }
        // The derivatives at the ends, at the turning points of φ′ within, and on both sides of its corners.
        let turning: &[f64] = match self {
            Self::Unary(Unary::Neg) => return Interval::point(-1.0),
            Self::Unary(Unary::Sin) => return Function::Unary(Unary::Cos).image(a),
            Self::Unary(Unary::Cos) => return Function::Unary(Unary::Sin).image(a).neg(),
            Self::Unary(Unary::Exp) => return self.image(a),
            Self::Square => return a.mul(Interval::point(2.0)),
            Self::Unary(Unary::Abs) => {
                let least = if low < 0.0 { -1.0 } else { 1.0 };
                let most = if high < 0.0 { -1.0 } else { 1.0 };
                return Interval::new(least, most);
            }
            Self::Clamp => {
                let outside = low < 0.0 || high > 1.0;
                let inside = high >= 0.0 && low <= 1.0;
                return Interval::new(f64::from(u8::from(!outside)), f64::from(u8::from(inside)));
            }
            Self::Unary(Unary::Sqrt) => {
                let roots = self.image(a);
                if low <= 0.0 {
                    return Interval::new(0.0, if high < 0.0 { 0.0 } else { f64::INFINITY });
                }
                return Interval::point(0.5).div(roots);
            }
            // Across its pole it does not change by any slope.
            Self::Reciprocal if low <= 0.0 && high >= 0.0 => return Interval::ALL,
            Self::Reciprocal => return self.image(a).square().neg(),
            Self::OntoSphere(radius) => {
                if low <= 0.0 {
                    return Interval::ALL;
                }
                return Function::Reciprocal
                    .image(a)
                    .square()
                    .mul(Interval::point(-radius));
            }
            Self::Power(exponent) => {
                let magnitude = a.abs();
                let rest = if exponent == 1.0 {
                    Interval::point(1.0)
                } else if exponent < 1.0 && magnitude.low <= 0.0 {
                    Interval::new(0.0, f64::INFINITY)
                } else {
                    let end = |x: f64| libm::pow(x, exponent - 1.0);
                    Interval::point(end(magnitude.low))
                        .hull(Interval::point(end(magnitude.high)))
                        .widen()
                };
                return rest.mul(Interval::point(exponent));
            }
            Self::Profile(_) => &[],
            Self::SmoothStep(from, to) => &[0.5 * (from + to)],
            Self::Quintic => &[-1.0, -0.5, 0.0, 0.5, 1.0],
        };
        if low.is_nan() || high.is_nan() {
            return Interval::ALL;
        }
        let mut slopes = Interval::point(self.slope(low)).hull(Interval::point(self.slope(high)));
        for &place in turning {
            if a.contains(place) {
                slopes = slopes.hull(Interval::point(self.slope(place)));
            }
        }
        if let Self::SmoothStep(from, to) = self {
            let at_rest = low < from || high > to;
            if at_rest {
                slopes = slopes.hull(Interval::point(0.0));
            }
        }
        slopes.expand(self.slack() * larger(1.0, slopes.magnitude()))
    }

    /// The line that the function stays closest to over `a`, through the slope of its chord, and how close; `None` if there is none.
    #[inline]
    pub(crate) fn band(self, a: Interval) -> Option<Band> {
        let finite = a.low.is_finite() && a.high.is_finite();
        match self {
            Self::Profile(profile) => profile.band(a),
            Self::Quintic => finite.then(|| quintic_band(a)),
            Self::Square => square_band(a),
            Self::Unary(Unary::Sqrt) if a.low > 0.0 => sqrt_band(a),
            _ => self.chord_band(a),
        }
    }

    /// The same for any function whose extremes beside a line are known.
    fn chord_band(self, a: Interval) -> Option<Band> {
        let broken = match self {
            Self::Reciprocal => a.low <= 0.0 && a.high >= 0.0,
            Self::OntoSphere(_) => a.low <= 0.0,
            Self::Unary(Unary::Sin | Unary::Cos) => turns(a),
            _ => false,
        };
        if broken || !a.low.is_finite() || !a.high.is_finite() {
            return None;
        }
        let width = a.width();
        let reach = a.magnitude();
        let (first, last) = (self.value(a.low), self.value(a.high));
        let alpha = if width > 64.0 * f64::EPSILON * reach {
            (last - first) / width
        } else {
            0.0
        };
        let (low, high) = self.extremes(alpha, a);
        Band::around(alpha, low, high, reach, self.slack())
    }

    /// The least and the greatest of φ(t) − αt over `a`.
    fn extremes(self, alpha: f64, a: Interval) -> (f64, f64) {
        let rest = |t: f64| {
            if alpha == 0.0 {
                self.value(t)
            } else {
                self.value(t) - alpha * t
            }
        };
        let (first, last) = (rest(a.low), rest(a.high));
        let (mut low, mut high) = (smaller(first, last), larger(first, last));
        for &place in self.level(alpha, a).slice() {
            if a.contains(place) {
                let here = rest(place);
                low = smaller(low, here);
                high = larger(high, here);
            }
        }
        (low, high)
    }

    /// Where φ′ = α, and the function's corners. Places outside `a` do no harm.
    fn level(self, alpha: f64, a: Interval) -> Places {
        let none = Places::none();
        match self {
            Self::Unary(Unary::Neg) | Self::Profile(_) | Self::Quintic => none,
            Self::Unary(Unary::Abs) => none.and(0.0),
            Self::Unary(Unary::Sqrt) => none.and(0.0).and(0.25 / (alpha * alpha)),
            Self::Unary(Unary::Exp) => none.and(libm::log(alpha)),
            Self::Unary(unary @ (Unary::Sin | Unary::Cos)) => circle(unary, alpha, a),
            Self::Power(exponent) => {
                let there = libm::pow(alpha / exponent, 1.0 / (exponent - 1.0));
                none.and(0.0).and(there).and(-there)
            }
            Self::SmoothStep(low, high) => {
                let width = high - low;
                // 6u(1 − u) = α width.
                let root = (larger(1.0 - alpha * width * (2.0 / 3.0), 0.0)).sqrt();
                let at = |u: f64| low + u * width;
                none.and(low)
                    .and(high)
                    .and(at(0.5 * (1.0 - root)))
                    .and(at(0.5 * (1.0 + root)))
            }
            Self::Clamp => none.and(0.0).and(1.0),
            Self::Square => none.and(0.5 * alpha),
            Self::Reciprocal => {
                let there = 1.0 / (-alpha).sqrt();
                none.and(there).and(-there)
            }
            Self::OntoSphere(radius) => none.and((radius / -alpha).sqrt()),
        }
    }

    /// How far a computed value may be from the exact one beyond eight units in its last place.
    fn slack(self) -> f64 {
        match self {
            Self::Quintic => QUINTIC_SLACK,
            Self::SmoothStep(..) => 4e-15,
            Self::Unary(Unary::Sin | Unary::Cos) => 1e-15,
            _ => 0.0,
        }
    }
}

impl Band {
    /// The line of slope `alpha` midway between the extremes of φ(t) − αt over numbers up to `reach`; `None` beyond all numbers.
    #[inline(always)]
    fn around(alpha: f64, low: f64, high: f64, reach: f64, slack: f64) -> Option<Self> {
        let size = larger(low.abs(), high.abs()) + 2.0 * alpha.abs() * reach;
        let beta = 0.5 * (low + high);
        let delta = 0.5 * (high - low) + ROUNDING * size + slack;
        let finite = alpha.is_finite() && beta.is_finite() && delta.is_finite();
        finite.then_some(Self { alpha, beta, delta })
    }
}

/// The band of a²: its chord's slope is the sum of the ends, and it is farthest from the chord midway.
#[inline]
fn square_band(a: Interval) -> Option<Band> {
    let alpha = a.low + a.high;
    let (least, most) = (-0.25 * alpha * alpha, -a.low * a.high);
    Band::around(alpha, least, most, a.magnitude(), 0.0)
}

/// The band of √a over positive numbers, whose slope is the chord's at a quarter of the inverse slope.
#[inline]
fn sqrt_band(a: Interval) -> Option<Band> {
    let (p, q) = (a.low.sqrt(), a.high.sqrt());
    let alpha = 1.0 / (p + q);
    Band::around(alpha, p * q * alpha, 0.25 * (p + q), a.high, 0.0)
}

/// The band of [`Function::Quintic`] over any finite numbers.
#[inline(always)]
pub(crate) fn quintic_band(a: Interval) -> Band {
    let Interval { low, high } = a;
    let value = |t: f64| {
        let t = t.abs();
        let u = if t < 1.0 { t } else { 1.0 } - 0.5;
        let u2 = u * u;
        0.5 - u * (1.875 + u2 * (6.0 * u2 - 5.0))
    };
    let width = high - low;
    let reach = a.magnitude();
    let alpha = if width > 64.0 * f64::EPSILON * reach {
        (value(high) - value(low)) / width
    } else {
        0.0
    };
    // 30(t(1 − t))² = |α|, on the side where the sign is α's.
    let s = (alpha.abs() * (1.0 / 30.0)).sqrt();
    let root = larger(1.0 - 4.0 * s, 0.0).sqrt();
    let side = if alpha > 0.0 { -0.5 } else { 0.5 };
    // Places beyond an end say what the end does.
    let places = [
        low,
        high,
        0.0,
        1.0,
        -1.0,
        side * (1.0 - root),
        side * (1.0 + root),
    ];
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for t in places {
        let t = larger(low, smaller(high, t));
        let rest = value(t) - alpha * t;
        least = smaller(rest, least);
        most = larger(rest, most);
    }
    let size = larger(least.abs(), most.abs()) + 2.0 * alpha.abs() * reach;
    Band {
        alpha,
        beta: 0.5 * (least + most),
        delta: 0.5 * (most - least) + ROUNDING * size + QUINTIC_SLACK,
    }
}

/// Whether an angle goes round, or is so large that its place on the circle means nothing.
fn turns(a: Interval) -> bool {
    !(a.width() < TURN && a.magnitude() < 1e6)
}

/// Where the derivative of a sine or a cosine is `alpha`, over less than a turn.
fn circle(unary: Unary, alpha: f64, a: Interval) -> Places {
    use std::f64::consts::{FRAC_PI_2, PI};
    let held = smaller(larger(alpha, -1.0), 1.0);
    // cos t = α at ±arccos α; −sin t = α where the cosine of t + π/2 is α.
    let (angle, shift) = (
        libm::acos(held),
        if unary == Unary::Sin { 0.0 } else { -FRAC_PI_2 },
    );
    let mut places = Places::none();
    for angle in [angle, -angle] {
        let base = angle + shift;
        let first = ((a.low - base) / (2.0 * PI)).floor();
        for turn in [0.0, 1.0, 2.0] {
            places = places.and(base + 2.0 * PI * (first + turn));
        }
    }
    places
}
