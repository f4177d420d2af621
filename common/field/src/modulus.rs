//! How far a field's value can move when its place moves: a modulus of continuity.

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
}
