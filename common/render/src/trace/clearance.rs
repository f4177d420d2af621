//! How far a ray may go from a place where the field has a known value.

use field::{BATCH, Cut, Interval, Modulus, Program, Region, Surroundings, Taylor};
use glam::DVec3;
use scene::description::{Bound, Seed};

use super::batch::Lanes;
use super::grid::FAR;
use super::techniques::Technique;
use crate::crew::{Crew, in_order};
use crate::view::Footprint;

/// Distances are shortened by this share, for the rounding of their own few operations.
pub(crate) const CAUTION: f64 = 1.0 - 1e-9;

/// The least slope that is reckoned with, per metre: roots farther than its inverse are not ruled out.
pub(crate) const FLAT: f64 = 1e-12;

/// By this share of its extent a bound is widened before the field is bounded over it, so that
/// places just outside serve too.
pub(crate) const MARGIN: f64 = 1.0 / 16.0;

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
    /// How fast the known part grows at a place along a direction, both given axis by axis; never less further on.
    #[inline(always)]
    pub(crate) fn growth_at(self, [(x, dx), (y, dy), (z, dz)]: [(f64, f64); 3]) -> f64 {
        match self {
            Self::Nothing => 0.0,
            Self::Height => dz,
            Self::Radius => {
                let along = x * dx + y * dy + z * dz;
                let size = (x * x + y * y + z * z).sqrt();
                if size > 0.0 { along / size } else { -1.0 }
            }
        }
    }

    /// [`Self::growth_at`] for the first `n` lanes.
    #[inline(always)]
    pub(crate) fn growths(
        self,
        n: usize,
        [x, y, z]: &[Lanes; 3],
        [dx, dy, dz]: &[Lanes; 3],
        growth: &mut Lanes,
    ) {
        assert!(n <= BATCH);
        // One loop per case, so that none of them decides anything.
        match self {
            Self::Nothing => growth[..n].fill(0.0),
            Self::Height => growth[..n].copy_from_slice(&dz[..n]),
            Self::Radius => {
                for i in 0..n {
                    let parts = [(x[i], dx[i]), (y[i], dy[i]), (z[i], dz[i])];
                    growth[i] = Self::Radius.growth_at(parts);
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

/// One bound of a field's change: f moves by no more than offset + slope · distance.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Pick {
    pub(crate) offset: f64,
    pub(crate) slope: f64,
}

impl Pick {
    /// How far the field is positive from a place where it has a value.
    fn reach(&self, value: f64) -> f64 {
        let slope = if self.slope > FLAT { self.slope } else { FLAT };
        (value - self.offset) / slope
    }
}

/// Bins of values, two to a factor of two: from 2⁻⁴⁸ to 2³².
const BINS: usize = 160;

/// The value at which the second bin begins, as the upper bits of an f64.
const FIRST_BIN: u64 = (1023 - 48) << 1;

/// A value a quarter into a bin.
fn within(bin: usize) -> f64 {
    f64::from_bits(((FIRST_BIN + bin as u64) << 51) | (1 << 49))
}

/// Bounds of a field's change around places at similar distances from the eye.
#[derive(Clone, Debug)]
pub(crate) struct Clearance {
    /// By the field's value, the bound that reaches farthest. Any choice would be sound.
    picks: Vec<Pick>,
    /// How far the field may fall below its tangent.
    pub(crate) tangent: Taylor,
    /// The errors of values and of derivatives along rays.
    pub(crate) errors: (f64, f64),
    /// The bounds hold no farther than this from the place, metres.
    pub(crate) reach: f64,
    /// How far the surface's field may be below this one, of which noises were left out.
    pub(crate) moved: f64,
    /// Above this value it pays to go on by a coarse field, or by this one if it is that.
    pub(crate) turn: f64,
}

/// A tangent that bounds nothing.
const NO_TANGENT: Taylor = Taylor {
    offset: f64::INFINITY,
    slope: 0.0,
    curvature: 1.0,
};

impl Clearance {
    /// The bounds of `modulus`, each with `rounding` added to its offset.
    fn new(modulus: &Modulus, rounding: f64, tangent: Option<Taylor>, reach: f64) -> Self {
        let levels: Vec<Pick> = modulus
            .levels
            .iter()
            .map(|level| Pick {
                offset: level.offset + rounding,
                slope: level.slope,
            })
            .filter(|level| level.offset.is_finite() && level.slope.is_finite())
            .collect();
        let nothing = Pick {
            offset: f64::INFINITY,
            slope: 1.0,
        };
        let picks = (0..BINS)
            .map(|bin| {
                let value = within(bin);
                let reach = |pick: &Pick| pick.reach(value);
                levels
                    .iter()
                    .copied()
                    .max_by(|a, b| reach(a).total_cmp(&reach(b)))
                    .unwrap_or(nothing)
            })
            .collect();
        let errors = tangent.map_or((f64::INFINITY, 0.0), |tangent| {
            (tangent.offset, tangent.slope)
        });
        Self {
            picks,
            tangent: tangent
                .filter(|tangent| tangent.curvature.is_finite())
                .unwrap_or(NO_TANGENT),
            errors,
            reach,
            moved: 0.0,
            turn: f64::INFINITY,
        }
    }

    /// The least of the tabled values from which on a field of fewer noises reaches `gain` times as far; infinite if none does.
    fn gains(&self, coarse: &Self, gain: f64) -> f64 {
        let reaches = |value: &f64| {
            let below = value - coarse.moved;
            coarse.pick(below).reach(below) > gain * self.pick(*value).reach(*value)
        };
        (0..BINS)
            .map(within)
            .find(|value| *value > coarse.moved && reaches(value))
            .unwrap_or(f64::INFINITY)
    }

    /// The bound that reaches farthest from a place where the field has that value.
    #[inline]
    pub(crate) fn pick(&self, value: f64) -> Pick {
        let bin = (value.to_bits() >> 51).saturating_sub(FIRST_BIN);
        self.picks[usize::try_from(bin).unwrap_or(0).min(BINS - 1)]
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
    /// The program that this is without what is left out, and what that is.
    pub(crate) cut: Option<(&'a Program, &'a Cut)>,
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
    /// A technique that is left out.
    pub(crate) without: Option<Technique>,
}

impl Clearances {
    /// Tables for distances from about `nearest` metres to the farthest place of the bound; nearer and beyond the
    /// first table serves.
    pub(crate) fn new(around: &Around<'_>, nearest: f64, crew: &dyn Crew) -> Self {
        let known = match around.rest {
            Some(_) => Known::of_seed(around.seed),
            None => Known::Nothing,
        };
        let mut wanted = vec![(0.0, FAR, f64::INFINITY)];
        let first = exponent(nearest);
        if around.footprint.angle > 0.0 && Technique::Distances.is_used(around.without) {
            let last = exponent(around.farthest());
            for exponent in first..=last {
                let distance = power(exponent);
                wanted.push((distance / 2.0, distance * 4.0, distance / 2.0));
            }
        }
        Self {
            tables: in_order(crew, &wanted, |&(near, far, reach)| {
                around.table(near, far, reach)
            }),
            first,
            known,
        }
    }

    /// Bounds that say where to go over to `coarse` ones, where these reach `there` times as far, and these where to come `back`.
    pub(crate) fn turning(mut self, mut coarse: Self, there: f64, back: f64) -> [Self; 2] {
        for (whole, coarse) in self.tables.iter_mut().zip(&mut coarse.tables) {
            whole.turn = whole.gains(coarse, there);
            coarse.turn = whole.gains(coarse, back) - coarse.moved;
        }
        [self, coarse]
    }

    /// The bounds for places at that distance from the eye.
    #[inline]
    pub(crate) fn at(&self, distance: f64) -> &Clearance {
        let index = exponent(distance) - self.first + 1;
        let index = usize::try_from(index).unwrap_or(0);
        let index = if index < self.tables.len() { index } else { 0 };
        &self.tables[index]
    }
}

impl Around<'_> {
    /// Bounds for places between two distances from the eye, to be used up to `reach` from them.
    fn table(&self, near: f64, far: f64, reach: f64) -> Clearance {
        let surroundings = self.between(near, far);
        let bounds = |program: &Program| {
            let mut modulus = program.modulus(&surroundings);
            if !Technique::Levels.is_used(self.without) {
                modulus.levels.truncate(1);
            }
            modulus
        };
        let whole = bounds(self.field);
        let (tangent, moved) = match self.cut {
            Some((uncut, cut)) => (None, uncut.moved_by(cut, &surroundings)),
            None => (self.field.taylor(&surroundings), 0.0),
        };
        let clearance = match (self.rest, whole.levels.first()) {
            (Some(rest), Some(finest)) => {
                let rest = bounds(rest);
                Clearance::new(&rest, finest.offset, tangent, reach)
            }
            _ => Clearance::new(&whole, 0.0, tangent, reach),
        };
        Clearance { moved, ..clearance }
    }

    /// All that a field is asked about.
    pub(crate) fn everywhere(&self) -> Surroundings {
        self.between(0.0, FAR)
    }

    fn between(&self, near: f64, far: f64) -> Surroundings {
        Surroundings {
            region: self.region(far),
            footprint: Interval::new(self.footprint.at(near), self.footprint.at(far)),
            time: self.time,
            footprint_slope: self.footprint.angle,
        }
    }

    /// No place of the widened bound is farther from the eye at any instant, nor are more than [`FAR`] worth tables.
    fn farthest(&self) -> f64 {
        let farthest = match widened(self.bound) {
            Bound::Slab { .. } => FAR,
            Bound::Shell { outer, .. } => outer + self.eye.length(),
            Bound::Box { min, max } => {
                let corner = [0, 1, 2].map(|axis| {
                    let eye = self.eye[axis];
                    let (low, high) = ((min[axis] - eye).abs(), (max[axis] - eye).abs());
                    if low > high { low } else { high }
                });
                DVec3::from(corner).length()
            }
        };
        let farthest = (farthest + self.travel) * (1.0 + ROOM);
        if farthest < FAR { farthest } else { FAR }
    }

    /// The part of the widened bound that is no farther from the eye than `far`, or more.
    fn region(&self, far: f64) -> Region {
        match widened(self.bound) {
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

/// The bound with its margin.
pub(crate) fn widened(bound: &Bound) -> Bound {
    match *bound {
        Bound::Shell { inner, outer } => {
            let margin = (outer - inner) * MARGIN;
            // Not to the centre, where directions are lost.
            let least = inner * 0.75;
            let low = inner - margin;
            Bound::Shell {
                inner: if low > least { low } else { least },
                outer: outer + margin,
            }
        }
        Bound::Slab { low, high } => {
            let margin = (high - low) * MARGIN;
            Bound::Slab {
                low: low - margin,
                high: high + margin,
            }
        }
        Bound::Box { min, max } => {
            let margin = |axis: usize| (max[axis] - min[axis]) * MARGIN;
            Bound::Box {
                min: [0, 1, 2].map(|axis| min[axis] - margin(axis)),
                max: [0, 1, 2].map(|axis| max[axis] + margin(axis)),
            }
        }
    }
}

impl Clearances {
    /// Whether a tangent bounds the field anywhere.
    pub(crate) fn have_tangents(&self) -> bool {
        self.tables
            .iter()
            .any(|table| table.tangent.offset.is_finite())
    }

    /// Whether the errors of values and derivatives are known anywhere.
    pub(crate) fn have_errors(&self) -> bool {
        self.tables.iter().any(|table| table.errors.0.is_finite())
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

    #[test]
    fn the_pick_is_the_level_that_reaches_farthest() {
        let levels = [
            (0.0, 9.0),
            (0.1, 6.0),
            (0.35, 4.0),
            (0.9, 2.5),
            (2.0, 1.5),
            (5.0, 1.0),
        ];
        let modulus = Modulus {
            levels: levels
                .iter()
                .map(|&(offset, slope)| Level { offset, slope })
                .collect(),
        };
        let clearance = Clearance::new(&modulus, 0.0, None, 1e6);
        let mut value = 1e-3;
        while value < 1e3 {
            let reach = |(offset, slope): (f64, f64)| ((value - offset) / slope).max(0.0);
            let pick = clearance.pick(value);
            let best = levels.iter().copied().map(reach).fold(0.0, f64::max);
            assert!(reach((pick.offset, pick.slope)) > 0.8 * best, "{value}");
            value *= 1.1;
        }
        for odd in [0.0, 1e-300, 1e300, f64::INFINITY] {
            assert!(clearance.pick(odd).slope > 0.0);
        }
        let nothing = Clearance::new(&Modulus::default(), 0.0, None, 1e6).pick(3.0);
        assert_eq!(nothing.offset, f64::INFINITY);
    }

    #[test]
    fn growth_of_a_radius_never_falls_along_a_ray() {
        let direction = DVec3::new(0.6, -0.8, 0.0);
        let mut last = -1.0;
        for step in 0..100 {
            let place = DVec3::new(-3.0, 3.0, 1.0) + direction * (f64::from(step) * 0.1);
            let growth =
                Known::Radius.growth_at([0, 1, 2].map(|axis| (place[axis], direction[axis])));
            assert!(growth >= last);
            last = growth;
        }
        assert!(last > 0.8);
    }
}
