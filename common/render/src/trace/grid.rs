//! The fixed dyadic grid of distances on which hits are defined.
//!
//! The grid's points are numbers with a few significant bits, so it grows
//! coarser with distance just as a pixel's footprint does, and depends on
//! nothing but its own three numbers: where a search starts cannot be seen.

use field::BATCH;

/// Bits of an f64's mantissa.
const MANTISSA: u32 = 52;

/// Nearest point of a grid that starts at the eye: a micrometre.
const NEAR: f64 = 1.0 / 1_048_576.0;

/// Farthest distance that is looked at: a million million metres.
pub(crate) const FAR: f64 = 1_099_511_627_776.0;

/// Distances t₀ < t₁ < …; each is an f64 of few significant bits, less an origin.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Grid {
    /// Bits of the first point before `origin` is taken off.
    base: u64,
    /// Mantissa bits that all points lack.
    shift: u32,
    /// A power of two, or 0.
    origin: f64,
}

impl Grid {
    /// Points between `share` and `share`/2 of their distance apart, from a micrometre on.
    ///
    /// This is the grid of camera rays in perspective: `share` is a fraction of the pixel's angle.
    pub(crate) fn from_eye(share: f64) -> Self {
        Self {
            base: NEAR.to_bits(),
            shift: MANTISSA - bits(share),
            origin: 0.0,
        }
    }

    /// Points at most `spacing` apart from 0 on, and coarser only beyond `even`, in proportion to
    /// the distance.
    pub(crate) fn even(spacing: f64, even: f64) -> Self {
        let origin = power_below(even);
        Self {
            base: origin.to_bits(),
            shift: MANTISSA - bits(spacing / origin),
            origin,
        }
    }

    /// The distance of a point; `index` is not negative.
    #[cfg(test)]
    pub(crate) fn place(self, index: i64) -> f64 {
        f64::from_bits(self.base + (index.cast_unsigned() << self.shift)) - self.origin
    }

    /// The first point at `t` or beyond; for some `t` in the last 2⁻¹² of a gap, the point before.
    ///
    /// `t` beyond [`FAR`] is taken as that.
    #[cfg(test)]
    pub(crate) fn first_from(self, t: f64) -> i64 {
        let t = if t < FAR { t } else { FAR };
        let bits = (t + self.origin).to_bits();
        if t <= 0.0 || bits <= self.base {
            return 0;
        }
        let last = (1u64 << self.shift) - 1;
        ((bits - self.base + last) >> self.shift).cast_signed()
    }
}

/// A grid as lanes compute with it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Steps {
    base: u64,
    /// One less than the distance between neighbours, in units of the last place.
    last: u64,
    origin: f64,
}

impl Grid {
    /// The grid for computing with distances instead of indices.
    pub(crate) fn steps(self) -> Steps {
        Steps {
            base: self.base,
            last: (1 << self.shift) - 1,
            origin: self.origin,
        }
    }
}

/// The grids of a batch's lanes: structure of arrays.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(crate) struct StepRows {
    base: [u64; BATCH],
    last: [u64; BATCH],
    origin: [f64; BATCH],
}

impl Default for StepRows {
    fn default() -> Self {
        Self {
            base: [0; BATCH],
            last: [0; BATCH],
            origin: [0.0; BATCH],
        }
    }
}

impl StepRows {
    /// Puts a grid into a lane.
    pub(crate) fn set(&mut self, lane: usize, steps: Steps) {
        self.base[lane] = steps.base;
        self.last[lane] = steps.last;
        self.origin[lane] = steps.origin;
    }

    /// Copies one lane's grid into another.
    pub(crate) fn copy(&mut self, from: usize, to: usize) {
        self.set(to, self.at(from));
    }

    /// A lane's grid.
    #[inline(always)]
    pub(crate) fn at(&self, lane: usize) -> Steps {
        Steps {
            base: self.base[lane],
            last: self.last[lane],
            origin: self.origin[lane],
        }
    }
}

impl Steps {
    /// The first point at `t` or beyond; for some `t` in the last 2⁻¹² of a gap, the point before.
    ///
    /// `t` beyond [`FAR`] is taken as that.
    #[inline(always)]
    pub(crate) fn from(self, t: f64) -> f64 {
        let t = if t < FAR { t } else { FAR };
        let bits = (t + self.origin).to_bits();
        let first = (t <= 0.0) | (bits <= self.base);
        let beyond = if first {
            0
        } else {
            bits.wrapping_sub(self.base)
        };
        let beyond = beyond.wrapping_add(self.last) & !self.last;
        f64::from_bits(self.base.wrapping_add(beyond)) - self.origin
    }

    /// The next point after a point.
    #[inline(always)]
    pub(crate) fn after(self, t: f64) -> f64 {
        let bits = (t + self.origin).to_bits();
        f64::from_bits(bits.wrapping_add(self.last).wrapping_add(1)) - self.origin
    }

    /// The point before a point that is not the first.
    #[inline(always)]
    pub(crate) fn before(self, t: f64) -> f64 {
        let bits = (t + self.origin).to_bits();
        f64::from_bits(bits.wrapping_sub(self.last).wrapping_sub(1)) - self.origin
    }

    /// How many points two points are apart; the second is not before the first.
    pub(crate) fn between(self, from: f64, to: f64) -> u64 {
        let (from, to) = ((from + self.origin).to_bits(), (to + self.origin).to_bits());
        to.wrapping_sub(from) / (self.last + 1)
    }

    /// The point halfway between two by their number, the nearer of two such.
    pub(crate) fn middle(self, from: f64, to: f64) -> f64 {
        let bits = (from + self.origin).to_bits();
        let half = (self.between(from, to) / 2) * (self.last + 1);
        f64::from_bits(bits.wrapping_add(half)) - self.origin
    }

    /// Whether a point is the first.
    #[inline(always)]
    pub(crate) fn is_first(self, t: f64) -> bool {
        (t + self.origin).to_bits() <= self.base
    }
}

/// The number of mantissa bits with which neighbours are at most `share` of their size apart.
fn bits(share: f64) -> u32 {
    let mut bits = 4;
    let mut gap = 1.0 / 16.0;
    while gap > share && bits < 46 {
        bits += 1;
        gap *= 0.5;
    }
    bits
}

/// The largest power of two that is not above `value`; `value` is positive and normal.
pub(crate) fn power_below(value: f64) -> f64 {
    f64::from_bits(value.to_bits() & !((1 << MANTISSA) - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_rise_at_the_promised_spacing() {
        let grid = Grid::from_eye(1e-4);
        for start in [1e-3, 1.0, 77.7, 1e4, 1e9] {
            let first = grid.first_from(start);
            for index in first..first + 5000 {
                let (t, next) = (grid.place(index), grid.place(index + 1));
                assert!(next > t && next - t <= 1e-4 * t && next - t >= 0.25e-4 * t);
            }
        }
        let grid = Grid::even(0.01, 1000.0);
        assert_eq!(grid.place(0), 0.0);
        for index in (0..50_000).step_by(77) {
            let gap = grid.place(index + 1) - grid.place(index);
            assert!((0.0025..=0.01).contains(&gap));
        }
        assert!(grid.place(1_000_000) > 1000.0);
    }

    #[test]
    fn the_first_point_from_a_distance_never_skips_one() {
        for grid in [
            Grid::from_eye(3e-5),
            Grid::even(0.01, 1e5),
            Grid::even(1e-5, 1.0),
        ] {
            let mut t = 1e-7;
            while t < 1e11 {
                let index = grid.first_from(t);
                let gap = grid.place(index + 1) - grid.place(index);
                assert!(grid.place(index) >= t - gap / 4096.0);
                assert!(index == 0 || grid.place(index - 1) < t);
                assert_eq!(grid.first_from(grid.place(index)), index);
                t *= 1.000_37;
            }
        }
    }

    #[test]
    fn steps_go_to_the_points_of_the_grid() {
        for grid in [
            Grid::from_eye(3e-5),
            Grid::even(0.01, 1e5),
            Grid::even(1e-5, 1.0),
        ] {
            let steps = grid.steps();
            let mut t = 1e-8;
            while t < 1e11 {
                let index = grid.first_from(t);
                let place = grid.place(index);
                assert_eq!(steps.from(t), place);
                assert_eq!(steps.after(place), grid.place(index + 1));
                assert_eq!(steps.is_first(place), index == 0);
                if index > 0 {
                    assert_eq!(steps.before(place), grid.place(index - 1));
                }
                for apart in [0, 1, 2, 77, 100_000] {
                    let far = grid.place(index + apart);
                    assert_eq!(steps.between(place, far), apart.unsigned_abs());
                    assert_eq!(steps.middle(place, far), grid.place(index + apart / 2));
                }
                t *= 1.000_37;
            }
            assert_eq!(steps.from(-3.0), grid.place(0));
            assert_eq!(steps.from(f64::INFINITY), grid.place(grid.first_from(FAR)));
        }
    }
}
