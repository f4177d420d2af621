//! The region over which a shape's bounds are wanted, and what a shape answers.

use crate::arithmetic::length;
use crate::interval::{Interval, larger, smaller};
use crate::surroundings::WORLD;

/// Where a shape's argument lies: a box, and how far from the origin.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Within {
    pub(crate) parts: [Interval; 3],
    pub(crate) norm: Interval,
}

/// What is known of a shape over a region.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Known {
    /// Its values, those that are computed with their rounding included.
    pub(crate) range: Interval,
    /// |f(q) − f(p)| ≤ slope · ‖q − p‖; infinite if there is no bound.
    pub(crate) slope: f64,
    /// Twice the most by which a computed value may be off.
    pub(crate) rounding: f64,
}

/// A box by its least and its greatest corner.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Extent {
    pub(crate) min: [f64; 3],
    pub(crate) max: [f64; 3],
}

impl Extent {
    /// All of space.
    pub(crate) const ALL: Self = Self {
        min: [f64::NEG_INFINITY; 3],
        max: [f64::INFINITY; 3],
    };

    /// The least box around places, with `margin` on every side.
    pub(crate) fn around(places: &[[f64; 3]], margin: f64) -> Self {
        let mut extent = Self {
            min: [f64::INFINITY; 3],
            max: [f64::NEG_INFINITY; 3],
        };
        for place in places {
            extent.min = [0, 1, 2].map(|k| smaller(place[k], extent.min[k]));
            extent.max = [0, 1, 2].map(|k| larger(place[k], extent.max[k]));
        }
        for k in 0..3 {
            extent.min[k] -= margin;
            extent.max[k] += margin;
        }
        extent
    }

    /// A box that holds every place whose computed distance from the centre is below the radius.
    pub(crate) fn of_ball(centre: [f64; 3], radius: f64) -> Self {
        let size = centre
            .iter()
            .fold(radius, |most, part| larger(most, part.abs()));
        Self::around(&[centre], radius + 16.0 * f64::EPSILON * size)
    }

    pub(crate) fn hull(self, other: Self) -> Self {
        Self {
            min: [0, 1, 2].map(|k| smaller(self.min[k], other.min[k])),
            max: [0, 1, 2].map(|k| larger(self.max[k], other.max[k])),
        }
    }

    /// Whether it and the region have places in common.
    pub(crate) fn meets(&self, parts: &[Interval; 3]) -> bool {
        (0..3).all(|k| parts[k].low <= self.max[k] && parts[k].high >= self.min[k])
    }

    /// Whether it holds the whole region.
    pub(crate) fn covers(&self, parts: &[Interval; 3]) -> bool {
        (0..3).all(|k| self.min[k] <= parts[k].low && self.max[k] >= parts[k].high)
    }
}

impl Within {
    /// The distances of the region's places from a place, outward rounded.
    pub(crate) fn distance(&self, place: [f64; 3]) -> Interval {
        let [x, y, z] =
            [0, 1, 2].map(|k| self.parts[k].sub(Interval::point(place[k])).abs().square());
        let boxed = x.add(y).add(z).sqrt();
        let away = length(place);
        let least = larger(self.norm.low - away, away - self.norm.high);
        let (low, high) = (
            larger(boxed.low, least),
            smaller(boxed.high, self.norm.high + away),
        );
        let widened = Interval::new(smaller(low, high), high).widen();
        Interval::new(larger(widened.low, 0.0), widened.high)
    }

    /// The box's part within an extent; `None` if they have nothing in common.
    pub(crate) fn clipped(&self, extent: &Extent) -> Option<Self> {
        if !extent.meets(&self.parts) {
            return None;
        }
        let parts = [0, 1, 2].map(|k| {
            Interval::new(
                larger(self.parts[k].low, extent.min[k]),
                smaller(self.parts[k].high, extent.max[k]),
            )
        });
        Some(Self {
            parts,
            norm: self.norm,
        })
    }

    /// The box cut into at most `most` pieces along each axis, none much shorter than `length`.
    pub(crate) fn pieces(&self, length: f64, most: u32) -> Vec<Self> {
        let cuts = self.parts.map(|part| {
            let wanted = libm::ceil(part.width() / length);
            if wanted >= f64::from(most) {
                most
            } else {
                (1..most).find(|n| f64::from(*n) >= wanted).unwrap_or(most)
            }
        });
        let cut = |k: usize, i: u32| {
            let Interval { low, high } = self.parts[k];
            let at = |i: u32| {
                if i == 0 {
                    low
                } else if i == cuts[k] {
                    high
                } else {
                    low + (high - low) * (f64::from(i) / f64::from(cuts[k]))
                }
            };
            Interval::new(at(i), at(i + 1))
        };
        let mut pieces = Vec::new();
        for i in 0..cuts[0] {
            for j in 0..cuts[1] {
                for k in 0..cuts[2] {
                    pieces.push(Self {
                        parts: [cut(0, i), cut(1, j), cut(2, k)],
                        norm: self.norm,
                    });
                }
            }
        }
        pieces
    }

    /// Whether no coordinate goes to the end of the world.
    pub(crate) fn is_bounded(&self) -> bool {
        self.parts.iter().all(|part| part.magnitude() < 0.5 * WORLD)
    }
}

impl Known {
    /// What is known over two regions that make up one convex region.
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            range: self.range.hull(other.range),
            slope: larger(self.slope, other.slope),
            rounding: larger(self.rounding, other.rounding),
        }
    }

    /// Over all pieces of a region, of which there is at least one.
    pub(crate) fn over(pieces: &[Within], of: impl Fn(&Within) -> Self) -> Self {
        let mut known = of(&pieces[0]);
        for piece in &pieces[1..] {
            known = known.and(of(piece));
        }
        known
    }
}
