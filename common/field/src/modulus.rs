//! How far a field's value can move when its place moves: a modulus of continuity.

use crate::program::Change;

/// Most levels that are kept.
pub const LEVELS_MAX: usize = 16;

/// Most radii that are tried.
const RADII_MAX: usize = 48;

/// |f(y) − f(x)| ≤ offset + slope · ‖y − x‖.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Level {
    /// In the field's unit.
    pub offset: f64,
    /// In the field's unit per metre.
    pub slope: f64,
}

/// Affine bounds of a field's change; all hold for any two places of the region, at one instant.
///
/// They hold for the values that evaluation computes: its rounding is in the offsets.
/// Offsets rise and slopes fall along `levels`. Without levels nothing is known.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Modulus {
    /// By rising offset and falling slope.
    pub levels: Vec<Level>,
}

impl Modulus {
    /// The radius about a place of value `distance` ≠ 0 within which the field keeps its sign.
    ///
    /// 0 if nothing is known, infinite if it is so everywhere in the region.
    pub fn clear_radius(&self, distance: f64) -> f64 {
        let distance = distance.abs();
        let mut radius = 0.0;
        for level in &self.levels {
            let clear = (distance - level.offset) / level.slope;
            if distance > level.offset && clear > radius {
                radius = clear;
            }
        }
        radius
    }

    /// The slope of the level whose offset is rounding alone: a Lipschitz bound. Infinite if there is none.
    pub fn lipschitz(&self) -> f64 {
        self.levels
            .first()
            .map_or(f64::INFINITY, |level| level.slope)
    }

    /// The levels of a bound that can be asked for at a radius; it also names the radii at which it changes its kind.
    pub(crate) fn of_levels(mut bound: impl FnMut(f64) -> (Change, Vec<f64>)) -> Self {
        let (steepest, crossings) = bound(0.0);
        let mut levels = vec![steepest];
        for radius in radii(crossings) {
            levels.push(bound(radius).0);
        }
        let levels: Vec<Level> = levels
            .into_iter()
            .filter(|level| level.offset.is_finite() && level.slope.is_finite())
            .map(|Change { offset, slope }| Level { offset, slope })
            .collect();
        Self {
            levels: thinned(envelope(levels)),
        }
    }
}

/// A radius between each two neighbouring crossings, and one above them all.
fn radii(mut crossings: Vec<f64>) -> Vec<f64> {
    crossings.sort_by(f64::total_cmp);
    let mut ratio = 1.05;
    loop {
        let mut kept: Vec<f64> = Vec::new();
        for &crossing in &crossings {
            if kept.last().is_none_or(|last| crossing > last * ratio) {
                kept.push(crossing);
            }
        }
        if kept.len() > RADII_MAX {
            ratio *= ratio;
            continue;
        }
        let above = kept.last().map(|last| last * 4.0);
        let between = kept.windows(2).map(|pair| (pair[0] * pair[1]).sqrt());
        return between.chain(above).collect();
    }
}

/// The levels that are the least at some distance, by rising offset.
fn envelope(mut levels: Vec<Level>) -> Vec<Level> {
    levels.sort_by(|a, b| {
        a.offset
            .total_cmp(&b.offset)
            .then(a.slope.total_cmp(&b.slope))
    });
    let mut kept: Vec<Level> = Vec::new();
    for level in levels {
        if kept.last().is_some_and(|last| level.slope >= last.slope) {
            continue;
        }
        while let [.., before, last] = kept[..]
            && meeting(before, level) <= meeting(before, last)
        {
            kept.pop();
        }
        kept.push(level);
    }
    kept
}

/// The distance from which on the flatter level is the lesser.
fn meeting(steep: Level, flat: Level) -> f64 {
    (flat.offset - steep.offset) / (steep.slope - flat.slope)
}

/// At most [`LEVELS_MAX`] of them: without those that are missed least where they are the best.
fn thinned(mut levels: Vec<Level>) -> Vec<Level> {
    while levels.len() > LEVELS_MAX {
        let loss = |i: usize| {
            let (before, level, after) = (levels[i - 1], levels[i], levels[i + 1]);
            let radius = meeting(before, after);
            (before.offset + before.slope * radius) / (level.offset + level.slope * radius)
        };
        let least = (1..levels.len() - 1).min_by(|&a, &b| loss(a).total_cmp(&loss(b)));
        levels.remove(least.expect("there are more than two"));
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(offset: f64, slope: f64) -> Level {
        Level { offset, slope }
    }

    #[test]
    fn the_envelope_keeps_what_is_least_somewhere() {
        let levels = [
            (0.0, 10.0),
            (1.0, 9.9),
            (2.0, 2.0),
            (3.0, 2.0),
            (2.5, 1.0),
            (9.0, 0.0),
        ];
        let kept = envelope(levels.map(|(offset, slope)| level(offset, slope)).to_vec());
        assert_eq!(
            kept,
            [
                level(0.0, 10.0),
                level(2.0, 2.0),
                level(2.5, 1.0),
                level(9.0, 0.0)
            ]
        );
    }

    #[test]
    fn thinning_keeps_the_ends() {
        let many: Vec<Level> = (0..40)
            .map(|i| level(f64::from(i * i), f64::from(1600 - 40 * i)))
            .collect();
        let many = envelope(many);
        assert!(many.len() > LEVELS_MAX);
        let few = thinned(many.clone());
        assert_eq!(
            (few.len(), few[0], few[LEVELS_MAX - 1]),
            (LEVELS_MAX, many[0], many[many.len() - 1])
        );
    }

    #[test]
    fn clear_radius_takes_the_best_level() {
        let modulus = Modulus {
            levels: vec![level(0.0, 10.0), level(2.0, 1.0)],
        };
        assert_eq!(modulus.clear_radius(1.0), 0.1);
        assert_eq!(modulus.clear_radius(-12.0), 10.0);
        assert_eq!(modulus.clear_radius(0.0), 0.0);
        assert_eq!(modulus.lipschitz(), 10.0);
        assert_eq!(Modulus::default().clear_radius(5.0), 0.0);
        let flat = Modulus {
            levels: vec![level(3.0, 0.0)],
        };
        assert_eq!(
            (flat.clear_radius(2.0), flat.clear_radius(4.0)),
            (0.0, f64::INFINITY)
        );
    }
}
