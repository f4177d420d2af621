//! How much air lies between a height and space, tabulated.

use std::sync::OnceLock;

use super::air::{Depth, GROUND, TOP};

/// Entries over heights and over directions.
const HEIGHTS: usize = 32;
const DIRECTIONS: usize = 64;

/// Steps along each path.
const STEPS: usize = 40;

/// Air between a height and space, along straight paths; `None` where the ground is in the way.
pub(crate) struct Depths {
    /// Row by row of rising height; along a row from just below the horizon to straight up.
    table: Vec<Depth>,
}

/// Distance from a place to where a path leaves the air; `up` is the sine of its elevation.
pub(crate) fn to_space(height: f64, up: f64) -> f64 {
    let radius = GROUND + height;
    let along = radius * up;
    (along * along + (TOP - height) * (2.0 * GROUND + TOP + height)).sqrt() - along
}

/// The height of the place `length` along a path.
pub(crate) fn height_along(height: f64, up: f64, length: f64) -> f64 {
    let radius = GROUND + height;
    // √(r² + 2 r l u + l²) − GROUND without losing the difference.
    let excess = length * (2.0 * radius * up + length);
    height + excess / ((radius * radius + excess).sqrt() + radius)
}

/// The sine of the elevation of the horizon seen from a height; not positive.
pub(crate) fn horizon(height: f64) -> f64 {
    let radius = GROUND + height;
    -(height * (2.0 * GROUND + height)).sqrt() / radius
}

impl Depths {
    /// Those of the Earth's air: the same for every sky, and computed once.
    pub(crate) fn known() -> &'static Self {
        static KNOWN: OnceLock<Depths> = OnceLock::new();
        KNOWN.get_or_init(Self::new)
    }

    fn new() -> Self {
        let mut table = Vec::with_capacity(HEIGHTS * DIRECTIONS);
        for row in 0..HEIGHTS {
            let share = row as f64 / (HEIGHTS - 1) as f64;
            let height = share * share * TOP;
            let lowest = horizon(height);
            for column in 0..DIRECTIONS {
                let share = column as f64 / (DIRECTIONS - 1) as f64;
                let up = lowest + (1.0 - lowest) * share * share;
                table.push(integrate(height, up));
            }
        }
        Self { table }
    }

    /// The air from `height` up to space along a path of sine of elevation `up`.
    pub(crate) fn at(&self, height: f64, up: f64) -> Option<Depth> {
        let height = if height > 0.0 { height } else { 0.0 };
        let lowest = horizon(height);
        if up < lowest {
            return None;
        }
        let (row, v) = place((height / TOP).sqrt(), HEIGHTS);
        let (column, u) = place(((up - lowest) / (1.0 - lowest)).sqrt(), DIRECTIONS);
        let entry = |row: usize, column: usize| self.table[row * DIRECTIONS + column];
        let low = entry(row, column).mixed(entry(row, column + 1), u);
        let high = entry(row + 1, column).mixed(entry(row + 1, column + 1), u);
        Some(low.mixed(high, v))
    }
}

/// The entry before a share of a table of `size` entries, and how far it is to the next.
pub(crate) fn place(share: f64, size: usize) -> (usize, f64) {
    let along = if share > 0.0 { share } else { 0.0 } * (size - 1) as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "not negative, and cut to the table"
    )]
    let entry = (along as usize).min(size - 2);
    let rest = along - entry as f64;
    (entry, if rest < 1.0 { rest } else { 1.0 })
}

fn integrate(height: f64, up: f64) -> Depth {
    let whole = to_space(height, up);
    let mut depth = Depth::default();
    let mut last = 0.0;
    for step in 1..=STEPS {
        let share = step as f64 / STEPS as f64;
        let length = whole * share * share;
        let middle = (last + length) / 2.0;
        let density = Depth::density(height_along(height, up, middle));
        depth = depth.and(density, length - last);
        last = length;
    }
    depth
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_up_there_is_one_scale_height_of_air() {
        let depth = Depths::new().at(0.0, 1.0).unwrap();
        assert!((depth.rayleigh / 8_000.0 - 1.0).abs() < 0.01);
        assert!((depth.haze / 1_200.0 - 1.0).abs() < 0.02);
        assert!((depth.ozone / 15_000.0 - 1.0).abs() < 0.02);
    }

    #[test]
    fn the_horizon_has_some_thirty_eight_times_as_much_and_below_it_is_ground() {
        let depths = Depths::new();
        let level = depths.at(0.0, 0.0).unwrap().rayleigh / 8_000.0;
        assert!((34.0..40.0).contains(&level), "{level}");
        assert!(depths.at(0.0, -1e-3).is_none());
        assert!(depths.at(5_000.0, -0.03).is_some());
    }

    #[test]
    fn heights_along_a_path_are_those_of_a_sphere() {
        assert!((height_along(100.0, 1.0, 50.0) - 150.0).abs() < 1e-6);
        let far = height_along(0.0, 0.0, 100_000.0);
        assert!((far - 786.0).abs() < 1.0, "{far}");
        assert!((height_along(10.0, 0.3, to_space(10.0, 0.3)) - TOP).abs() < 1e-3);
    }
}
