//! How far a ray may go from a place where the field has a known value.

use field::{Interval, Modulus, Program, Region, Surroundings};
use glam::DVec3;
use scene::description::{Bound, Seed};

use super::grid::FAR;
use crate::view::Footprint;

/// Distances are shortened by this share, for the rounding of their own few operations.
const CAUTION: f64 = 1.0 - 1e-9;

/// The least slope that is reckoned with, per metre: roots farther than its inverse are not ruled out.
const FLAT: f64 = 1e-12;

/// Room around a bound for places that rounding puts just outside, relative.
const ROOM: f64 = 1e-8;

/// What changes along a ray in a way that is known without a modulus.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Known {
    /// Nothing.
    Nothing,
    /// The field holds + z.
    Height,
    /// The field holds + ‖x‖, which is convex along every ray.
    Radius,
}

impl Known {
    /// How fast the known part grows along `direction` at `place`; never less further on.
    #[inline]
    pub(crate) fn growth(self, place: DVec3, direction: DVec3) -> f64 {
        match self {
            Self::Nothing => 0.0,
            Self::Height => direction.z,
            Self::Radius => {
                let square = place.dot(place);
                if square > 0.0 {
                    place.dot(direction) / square.sqrt()
                } else {
                    -1.0
                }
            }
        }
    }

    /// The growth along a whole ray between two places; `None` where it changes too much for
    /// one answer to serve.
    pub(crate) fn growth_along(self, from: DVec3, to: DVec3, direction: DVec3) -> Option<Interval> {
        const CHANGE_MAX: f64 = 0.02;
        // Grid points lie up to a gap outside of both places.
        const ROOM: f64 = 1e-6;
        let low = self.growth(from, direction) - ROOM;
        let high = self.growth(to, direction) + ROOM;
        (high - low < CHANGE_MAX).then_some(Interval::new(low, high))
    }

    /// What is known of a field that was split along its seed.
    pub(crate) fn of_seed(seed: &Seed) -> Self {
        match seed {
            Seed::Plane => Self::Height,
            Seed::Sphere { .. } => Self::Radius,
        }
    }
}

/// One bound of a field's change, with the values for which it reaches farthest.
///
/// The values are those for a ray along which the known part does not change; for
/// other rays the choice is good rather than best. Any choice is sound.
#[derive(Clone, Copy, Debug)]
struct Span {
    offset: f64,
    slope: f64,
    from: f64,
    to: f64,
}

/// Bounds of a field's change around places at similar distances from the eye.
#[derive(Clone, Debug)]
pub(crate) struct Clearance {
    /// Offsets rise and slopes fall, in a convex chain.
    levels: Vec<Span>,
    /// The bounds hold no farther than this from the place, metres.
    reach: f64,
}

impl Clearance {
    /// The bounds of `modulus`, each with `rounding` added to its offset.
    fn new(modulus: &Modulus, rounding: f64, reach: f64) -> Self {
        let mut chain: Vec<(f64, f64)> = Vec::new();
        for level in &modulus.levels {
            let (offset, slope) = (level.offset + rounding, level.slope);
            let sound = offset.is_finite() && slope.is_finite() && slope >= 0.0;
            if !sound || chain.last().is_some_and(|last| last.1 <= slope) {
                continue;
            }
            // Of three in a row the middle one is of use only below the line through the others.
            while let [.., a, b] = chain[..] {
                let middle_is_above = (b.1 - a.1) * (offset - a.0) >= (slope - a.1) * (b.0 - a.0);
                if !middle_is_above {
                    break;
                }
                chain.pop();
            }
            chain.push((offset, slope));
        }
        // Two levels reach equally far at the value where their lines meet zero together.
        let meet = |(o0, s0): (f64, f64), (o1, s1): (f64, f64)| (o1 * s0 - o0 * s1) / (s0 - s1);
        let levels = (0..chain.len())
            .map(|at| Span {
                offset: chain[at].0,
                slope: chain[at].1,
                from: match at {
                    0 => f64::NEG_INFINITY,
                    _ => meet(chain[at - 1], chain[at]),
                },
                to: match chain.get(at + 1) {
                    Some(&next) => meet(chain[at], next),
                    None => f64::INFINITY,
                },
            })
            .collect();
        Self { levels, reach }
    }

    /// How far ahead and back of a place no root can be, where the value is `value`.
    ///
    /// `growth` encloses that of the known part from the place on, and up to it.
    /// `hint` is where to look among the levels, and where to look next time.
    #[inline]
    pub(crate) fn spans(&self, value: f64, growth: Interval, hint: &mut usize) -> (f64, f64) {
        let Some(last) = self.levels.len().checked_sub(1) else {
            return (0.0, 0.0);
        };
        let mut at = (*hint).min(last);
        while value > self.levels[at].to {
            at += 1;
        }
        while value < self.levels[at].from {
            at -= 1;
        }
        *hint = at;
        let level = self.levels[at];
        let rest = value - level.offset;
        if rest <= 0.0 {
            return (0.0, 0.0);
        }
        let (fall, rise) = (level.slope - growth.low, level.slope + growth.high);
        let fall = if fall > FLAT { fall } else { FLAT };
        let rise = if rise > FLAT { rise } else { FLAT };
        // rest / fall and rest / rise with one division.
        let share = rest * CAUTION / (fall * rise);
        let cut = |span: f64| if span < self.reach { span } else { self.reach };
        (cut(share * rise), cut(share * fall))
    }
}

/// The bounds at every distance from the eye.
#[derive(Clone, Debug)]
pub(crate) struct Clearances {
    /// The first holds at every distance; the others from a power of two to the next.
    tables: Vec<Clearance>,
    /// The exponent at which the second begins.
    first: i64,
    /// What they leave out.
    pub(crate) known: Known,
}

/// What bounds are asked about.
pub(crate) struct Around<'a> {
    /// The surface's field.
    pub(crate) field: &'a Program,
    /// The field less its known part, if there is one.
    pub(crate) rest: Option<&'a Program>,
    /// Where the surface can be.
    pub(crate) bound: &'a Bound,
    /// What the field is split along.
    pub(crate) seed: &'a Seed,
    /// The law of footprints.
    pub(crate) footprint: Footprint,
    /// Instants of the image.
    pub(crate) time: Interval,
    /// The eye.
    pub(crate) eye: DVec3,
    /// How far the eye moves while the shutter is open.
    pub(crate) travel: f64,
}

impl Clearances {
    /// Tables for distances from about `nearest` metres on; below that the first table serves.
    pub(crate) fn new(around: &Around<'_>, nearest: f64) -> Self {
        let known = match around.rest {
            Some(_) => Known::of_seed(around.seed),
            None => Known::Nothing,
        };
        let mut tables = vec![around.table(0.0, FAR, f64::INFINITY)];
        let first = exponent(nearest);
        if around.footprint.angle > 0.0 {
            for exponent in first..exponent(FAR) {
                let distance = power(exponent);
                tables.push(around.table(distance / 2.0, distance * 4.0, distance / 2.0));
            }
        }
        Self {
            tables,
            first,
            known,
        }
    }

    /// The bounds for places at that distance from the eye.
    #[inline]
    pub(crate) fn at(&self, distance: f64) -> &Clearance {
        let index = exponent(distance) - self.first + 1;
        let last = self.tables.len() - 1;
        &self.tables[usize::try_from(index).unwrap_or(0).min(last)]
    }
}

impl Around<'_> {
    /// Bounds for places between two distances from the eye, to be used up to `reach` from them.
    fn table(&self, near: f64, far: f64, reach: f64) -> Clearance {
        let surroundings = Surroundings {
            region: self.region(far),
            footprint: Interval::new(self.footprint.at(near), self.footprint.at(far)),
            time: self.time,
            footprint_slope: self.footprint.angle,
        };
        let whole = self.field.modulus(&surroundings);
        match (self.rest, whole.levels.first()) {
            (Some(rest), Some(finest)) => {
                Clearance::new(&rest.modulus(&surroundings), finest.offset, reach)
            }
            _ => Clearance::new(&whole, 0.0, reach),
        }
    }

    /// The part of the bound that is no farther from the eye than `far`, or more.
    fn region(&self, far: f64) -> Region {
        match *self.bound {
            Bound::Shell { inner, outer } => Region::Shell {
                inner: inner * (1.0 - ROOM),
                outer: outer * (1.0 + ROOM),
            },
            Bound::Slab { low, high } => {
                let room = ROOM * (low.abs() + high.abs() + self.eye.z.abs());
                let far = (far + self.travel) * (1.0 + ROOM);
                Region::Box {
                    min: [self.eye.x - far, self.eye.y - far, low - room],
                    max: [self.eye.x + far, self.eye.y + far, high + room],
                }
            }
            Bound::Box { min, max } => {
                let room = |axis: usize| ROOM * (min[axis].abs() + max[axis].abs());
                Region::Box {
                    min: [0, 1, 2].map(|axis| min[axis] - room(axis)),
                    max: [0, 1, 2].map(|axis| max[axis] + room(axis)),
                }
            }
        }
    }
}

/// The exponent e of 2ᵉ ≤ `value` < 2ᵉ⁺¹, for positive, normal values.
#[inline]
fn exponent(value: f64) -> i64 {
    (value.to_bits() >> 52).cast_signed() - 1023
}

/// 2ᵉ.
fn power(exponent: i64) -> f64 {
    f64::from_bits((exponent + 1023).cast_unsigned() << 52)
}

#[cfg(test)]
mod tests {
    use super::*;
    use field::Level;

    fn clearance(levels: &[(f64, f64)]) -> Clearance {
        let modulus = Modulus {
            levels: levels
                .iter()
                .map(|&(offset, slope)| Level { offset, slope })
                .collect(),
        };
        Clearance::new(&modulus, 0.0, 1e6)
    }

    #[test]
    fn the_best_level_is_found_from_every_hint() {
        let levels = [
            (0.0, 9.0),
            (0.1, 6.0),
            (0.35, 4.0),
            (0.9, 2.5),
            (2.0, 1.5),
            (5.0, 1.0),
        ];
        let clearance = clearance(&levels);
        for value in [0.01, 0.09, 0.2, 0.5, 1.0, 3.0, 7.0, 100.0] {
            for growth in [-1.0, -0.3, 0.0, 0.3] {
                let best = levels
                    .iter()
                    .map(|(offset, slope)| (value - offset) / (slope - growth))
                    .fold(0.0, f64::max);
                // The level is the best for a growth of 0, and not much worse for others.
                let least = if growth == 0.0 { 0.999_999 } else { 0.6 };
                for hint in 0..levels.len() {
                    let mut found_at = hint;
                    let (ahead, behind) =
                        clearance.spans(value, Interval::point(growth), &mut found_at);
                    assert!(ahead <= best && ahead >= best * least, "{value} {growth}");
                    let (offset, slope) = levels[found_at];
                    let exact = ((value - offset) / (slope + growth)).clamp(0.0, 1e6);
                    assert!(behind <= exact && behind >= exact * 0.999_999);
                }
            }
        }
    }

    #[test]
    fn a_level_that_is_never_best_is_dropped() {
        let count = |levels: &[(f64, f64)]| clearance(levels).levels.len();
        assert_eq!(count(&[(0.0, 4.0), (1.0, 3.9), (2.0, 1.0)]), 2);
        assert_eq!(count(&[(0.0, 4.0), (0.5, 2.0), (2.0, 1.0)]), 3);
        let nothing = clearance(&[]).spans(3.0, Interval::point(0.0), &mut 0);
        assert_eq!(nothing, (0.0, 0.0));
    }

    #[test]
    fn no_span_exceeds_its_reach() {
        let (ahead, behind) = clearance(&[(0.0, 1.0)]).spans(5.0, Interval::point(1.0), &mut 0);
        assert_eq!(ahead, 1e6);
        assert!((behind - 2.5).abs() < 1e-6);
        let level = clearance(&[(0.0, 1.0)]).spans(-5.0, Interval::point(0.0), &mut 0);
        assert_eq!(level, (0.0, 0.0));
    }

    #[test]
    fn growth_of_a_radius_never_falls_along_a_ray() {
        let direction = DVec3::new(0.6, -0.8, 0.0);
        let mut last = -1.0;
        for step in 0..100 {
            let place = DVec3::new(-3.0, 3.0, 1.0) + direction * (f64::from(step) * 0.1);
            let growth = Known::Radius.growth(place, direction);
            assert!(growth >= last);
            last = growth;
        }
        assert!(last > 0.8);
    }
}
