//! The patch of surface that one pixel covers: how high and steep it is, and how much that varies.
//!
//! A pixel that looks along the ground covers a long strip of it. What a
//! material decides by height and slope it decides for the whole strip;
//! otherwise far crests would flicker between snow and grass from ray to ray.

use glam::DVec3;

/// Rays flatter to the surface than this count as this flat: cosine to the normal.
const FLATTEST: f64 = 1.0 / 16.0;

/// How much slopes vary, radians, for each doubling of a patch's length over its width.
///
/// Every octave of a terrain's cascade has about the same slope (thesis §3.2.4, H near 1), and a
/// patch twice as long hides one octave more.
const SLOPE_PER_DOUBLING: f64 = 0.07;

/// What one ray stands for on the surface. What takes roots and logarithms is computed where a material has layers, which
/// ask for it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Patch {
    /// Mean height over the seed, metres.
    pub(crate) height: f64,
    /// Width of the pixel, metres.
    footprint: f64,
    /// Cosine between normal and vertical.
    upright: f64,
    /// Cosine between normal and ray, never less than [`FLATTEST`].
    facing: f64,
    /// How fast the height rises across the ray.
    gradient: DVec3,
}

impl Patch {
    /// The patch around a place of that height, seen along `direction` by a pixel `footprint` wide.
    pub(crate) fn new(
        normal: DVec3,
        direction: DVec3,
        vertical: DVec3,
        height: f64,
        footprint: f64,
    ) -> Self {
        let facing = facing(normal.dot(direction));
        // A step q across the ray moves the place by q − d(n·q)/(n·d) in the surface's plane, and
        // its height by q·g.
        Self {
            height,
            footprint,
            upright: normal.dot(vertical),
            facing,
            gradient: vertical + normal * (vertical.dot(direction) / facing),
        }
    }

    /// From its lowest to its highest place, metres.
    pub(crate) fn height_spread(&self) -> f64 {
        self.footprint * self.gradient.dot(self.gradient).sqrt()
    }

    /// Mean angle to the horizontal, radians.
    pub(crate) fn slope(&self) -> f64 {
        libm::acos(self.upright.clamp(-1.0, 1.0))
    }

    /// Between the gentlest and the steepest place, radians.
    pub(crate) fn slope_spread(&self) -> f64 {
        SLOPE_PER_DOUBLING * libm::log2(1.0 / self.facing)
    }

    /// How many times wider than the pixel a round patch of the same area is.
    pub(crate) fn longer(facing_ray: f64) -> f64 {
        1.0 / facing(facing_ray).sqrt()
    }
}

/// The cosine between normal and the way back along the ray; never flatter than [`FLATTEST`].
fn facing(along: f64) -> f64 {
    let facing = along.abs();
    if facing > FLATTEST { facing } else { FLATTEST }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_of_heights_is_that_of_the_plane_under_the_pixel() {
        let normal = DVec3::new(0.3, -0.4, 1.2).normalize();
        let direction = DVec3::new(0.2, 0.9, -0.5).normalize();
        let patch = Patch::new(normal, direction, DVec3::Z, 7.0, 0.5);
        // The highest place of the plane over the disc of the pixel's diameter, by going around it.
        let right = direction.cross(DVec3::Z).normalize();
        let up = right.cross(direction);
        let highest = (0..10_000)
            .map(|i| {
                let (sine, cosine) = libm::sincos(f64::from(i) * core::f64::consts::TAU / 1e4);
                let across = (right * cosine + up * sine) * 0.25;
                let way = -normal.dot(across) / normal.dot(direction);
                (across + direction * way).z
            })
            .fold(0.0, f64::max);
        assert!((patch.height_spread() - 2.0 * highest).abs() < 1e-6);
        assert_eq!(patch.height, 7.0);
    }

    #[test]
    fn a_surface_seen_straight_on_has_the_pixels_size() {
        let level = Patch::new(DVec3::Z, -DVec3::Z, DVec3::Z, 0.0, 0.5);
        assert_eq!(
            (level.height_spread(), level.slope(), level.slope_spread()),
            (0.0, 0.0, 0.0)
        );
        assert_eq!(Patch::longer(-1.0), 1.0);
        assert_eq!(Patch::longer(0.0), 4.0);
        let wall = Patch::new(-DVec3::Y, DVec3::Y, DVec3::Z, 0.0, 0.5);
        assert_eq!(wall.height_spread(), 0.5);
    }
}
