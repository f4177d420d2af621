//! How a rough surface reflects the light that falls on it.

use core::f64::consts::{FRAC_1_PI, PI};

use glam::DVec3;

use crate::sky::{Colour, Sky};

/// How rough the ground is, radians: standard deviation of its slopes below the size of a pixel.
const ROUGHNESS: f64 = 0.35;

/// A place of the surface, as light sees it.
pub(crate) struct Lit {
    /// Unit normal.
    pub(crate) normal: DVec3,
    /// Unit vector along the ray that saw it.
    pub(crate) direction: DVec3,
    /// Diffuse reflectance.
    pub(crate) albedo: Colour,
    /// The share of the sun that it sees.
    pub(crate) sun: f64,
}

impl Lit {
    /// Radiance towards the eye: sun, sky and ground, reflected.
    pub(crate) fn radiance(&self, sky: &Sky) -> Colour {
        let facing = self.normal.dot(sky.sun);
        let direct = if facing > 0.0 && self.sun > 0.0 {
            self.sun
                * facing
                * oren_nayar(
                    facing,
                    self.normal.dot(-self.direction),
                    sky.sun.dot(-self.direction),
                )
        } else {
            0.0
        };
        let ambient = sky.ambient(self.normal);
        [0, 1, 2].map(|c| self.albedo[c] * (sky.sunlight[c] * direct + ambient[c] * FRAC_1_PI))
    }
}

/// Reflection of a rough diffuse surface of albedo 1, per steradian: Oren and Nayar's model as
/// Fujii improved it, which is Lambert's for a roughness of 0.
///
/// The cosines are those between normal and light, normal and view, light and view.
fn oren_nayar(light: f64, view: f64, between: f64) -> f64 {
    let view = if view > 0.0 { view } else { 0.0 };
    let plain = 1.0 / (PI + (PI / 2.0 - 2.0 / 3.0) * ROUGHNESS);
    let s = between - light * view;
    let t = if s <= 0.0 {
        1.0
    } else if light > view {
        light
    } else {
        view
    };
    plain * (1.0 + ROUGHNESS * s / t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_light_leaves_than_falls_on() {
        const STEPS: usize = 200;
        for degrees in [5.0f64, 30.0, 60.0, 85.0] {
            let (sine, cosine) = libm::sincos(degrees.to_radians());
            let light = DVec3::new(sine, 0.0, cosine);
            let mut leaving = 0.0;
            for row in 0..STEPS {
                let z = (row as f64 + 0.5) / STEPS as f64;
                let flat = (1.0 - z * z).sqrt();
                for column in 0..STEPS {
                    let angle = (column as f64 + 0.5) / STEPS as f64 * PI * 2.0;
                    let (s, c) = libm::sincos(angle);
                    let view = DVec3::new(flat * c, flat * s, z);
                    let value = oren_nayar(cosine, z, light.dot(view));
                    assert!(value >= 0.0);
                    leaving += value * z * 2.0 * PI / (STEPS * STEPS) as f64;
                }
            }
            assert!(leaving < 1.0 && leaving > 0.6, "{degrees}: {leaving}");
        }
    }
}
