//! How far a ray may go from a place where the field has a known value.

use field::{Interval, Modulus, Program, Region, Surroundings};
use glam::DVec3;
use scene::description::{Bound, Seed};

use super::grid::FAR;
use crate::view::Footprint;

/// Distances are shortened by this share, for the rounding of their own few operations.
const CAUTION: f64 = 1.0 - 1e-9;

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

    /// What is known of a field that was split along its seed.
    pub(crate) fn of_seed(seed: &Seed) -> Self {
        match seed {
            Seed::Plane => Self::Height,
            Seed::Sphere { .. } => Self::Radius,
        }
    }
}

/// Bounds of a field's change around places at similar distances from the eye.
#[derive(Clone, Debug)]
pub(crate) struct Clearance {
    /// Offsets rise and slopes fall; none is below the line through its neighbours.
    levels: Vec<(f64, f64)>,
    /// The bounds hold no farther than this from the place, metres.
    reach: f64,
}

impl Clearance {
    /// The bounds of `modulus`, each with `rounding` added to its offset.
    fn new(modulus: &Modulus, rounding: f64, reach: f64) -> Self {
        let mut levels: Vec<(f64, f64)> = Vec::new();
        for level in &modulus.levels {
            let (offset, slope) = (level.offset + rounding, level.slope);
            let sound = offset.is_finite() && slope.is_finite() && slope >= 0.0;
            if !sound || levels.last().is_some_and(|last| last.1 <= slope) {
                continue;
            }
            // Of three in a row the middle one is of use only below the line through the others.
            while let [.., a, b] = levels[..] {
                let middle_is_above = (b.1 - a.1) * (offset - a.0) >= (slope - a.1) * (b.0 - a.0);
                if !middle_is_above {
                    break;
                }
                levels.pop();
            }
            levels.push((offset, slope));
        }
        Self { levels, reach }
    }

    /// How far ahead no root can be, from a place of value `value` > 0.
    ///
    /// `growth` is that of the known part, at the place or less. `hint` is where
    /// to look among the levels, and where to look next time.
    #[inline]
    pub(crate) fn ahead(&self, value: f64, growth: f64, hint: &mut usize) -> f64 {
        if self.levels.is_empty() {
            return 0.0;
        }
        let mut at = (*hint).min(self.levels.len() - 1);
        let mut best = self.at_level(at, value, growth);
        while at + 1 < self.levels.len() {
            let next = self.at_level(at + 1, value, growth);
            if next <= best {
                break;
            }
            (at, best) = (at + 1, next);
        }
        while at > 0 {
            let next = self.at_level(at - 1, value, growth);
            if next < best {
                break;
            }
            (at, best) = (at - 1, next);
        }
        *hint = at;
        if best > 0.0 { best } else { 0.0 }
    }

    /// How far back no root can be, by the level that `hint` names.
    #[inline]
    pub(crate) fn behind(&self, value: f64, growth: f64, hint: usize) -> f64 {
        if hint < self.levels.len() {
            let behind = self.at_level(hint, value, -growth);
            if behind > 0.0 { behind } else { 0.0 }
        } else {
            0.0
        }
    }

    #[inline]
    fn at_level(&self, level: usize, value: f64, growth: f64) -> f64 {
        let (offset, slope) = self.levels[level];
        let (rest, fall) = (value - offset, slope - growth);
        if rest <= 0.0 {
            // Levels beyond have larger offsets still: fall back towards the first.
            return rest;
        }
        if fall * self.reach <= rest {
            return self.reach;
        }
        rest / fall * CAUTION
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
            for growth in [-1.0, -0.3, 0.0, 0.3, 0.99] {
                let best = levels
                    .iter()
                    .map(|(offset, slope)| (value - offset) / (slope - growth))
                    .fold(0.0, f64::max);
                let best = if best < 1e6 { best } else { 1e6 };
                for hint in 0..levels.len() {
                    let found = clearance.ahead(value, growth, &mut { hint });
                    assert!(
                        found <= best && found >= best * 0.999_999,
                        "{value} {growth}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_level_that_is_never_best_is_dropped() {
        assert_eq!(
            clearance(&[(0.0, 4.0), (1.0, 3.9), (2.0, 1.0)])
                .levels
                .len(),
            2
        );
        assert_eq!(
            clearance(&[(0.0, 4.0), (0.5, 2.0), (2.0, 1.0)])
                .levels
                .len(),
            3
        );
        assert_eq!(clearance(&[]).ahead(3.0, 0.0, &mut 0), 0.0);
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
