//! How a rough surface reflects the light that falls on it.

use core::f64::consts::{FRAC_1_PI, PI};

use field::{BATCH, SimdLevel};
use glam::DVec3;

use crate::sky::{Colour, Irradiance, Sky};
use crate::trace::batch::Lanes;

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

/// What of sun and sky falls on surfaces.
struct Sunlit {
    sun: DVec3,
    sunlight: Colour,
    ambient: Irradiance,
}

impl Sunlit {
    fn of(sky: &Sky) -> Self {
        Self {
            sun: sky.sun,
            sunlight: sky.sunlight,
            ambient: sky.ambient.clone(),
        }
    }
}

/// Places of the surface, lane by lane.
#[repr(align(64))]
pub(crate) struct Lits {
    normal: [Lanes; 3],
    direction: [Lanes; 3],
    albedo: [Lanes; 3],
    sun: Lanes,
    radiance: [Lanes; 3],
}

impl Default for Lits {
    fn default() -> Self {
        Self {
            normal: [[0.0; BATCH]; 3],
            direction: [[0.0; BATCH]; 3],
            albedo: [[0.0; BATCH]; 3],
            sun: [0.0; BATCH],
            radiance: [[0.0; BATCH]; 3],
        }
    }
}

impl Lits {
    /// Puts a place into a lane.
    pub(crate) fn set(&mut self, lane: usize, lit: &Lit) {
        for k in 0..3 {
            self.normal[k][lane] = lit.normal[k];
            self.direction[k][lane] = lit.direction[k];
            self.albedo[k][lane] = lit.albedo[k];
        }
        self.sun[lane] = lit.sun;
    }

    /// Computes the radiance of all places.
    pub(crate) fn reflect(&mut self, level: SimdLevel, sky: &Sky) {
        // Copies, for the compiler to see that nothing that is written is read.
        let (normal, direction, albedo) = (&self.normal, &self.direction, &self.albedo);
        let (sun, sky) = (&self.sun, Sunlit::of(sky));
        self.radiance = level.vectorize(
            #[inline(always)]
            move || {
                let mut radiance = [[0.0; BATCH]; 3];
                for i in 0..BATCH {
                    let at = |rows: &[Lanes; 3]| [rows[0][i], rows[1][i], rows[2][i]];
                    let lit = Lit {
                        normal: at(normal).into(),
                        direction: at(direction).into(),
                        albedo: at(albedo),
                        sun: sun[i],
                    };
                    let [red, green, blue] = lit.radiance(&sky);
                    (radiance[0][i], radiance[1][i], radiance[2][i]) = (red, green, blue);
                }
                radiance
            },
        );
    }

    /// The radiance of the place in a lane.
    pub(crate) fn radiance(&self, lane: usize) -> Colour {
        [0, 1, 2].map(|c| self.radiance[c][lane])
    }
}

impl Lit {
    /// Radiance towards the eye: sun, sky and ground, reflected.
    #[inline(always)]
    fn radiance(&self, sky: &Sunlit) -> Colour {
        let facing = self.normal.dot(sky.sun);
        let reflected = oren_nayar(
            facing,
            self.normal.dot(-self.direction),
            sky.sun.dot(-self.direction),
        );
        let is_lit = (facing > 0.0) & (self.sun > 0.0);
        let direct = if is_lit {
            self.sun * facing * reflected
        } else {
            0.0
        };
        let ambient = sky.ambient.at(self.normal);
        [0, 1, 2].map(|c| self.albedo[c] * (sky.sunlight[c] * direct + ambient[c] * FRAC_1_PI))
    }
}

/// Reflection of a rough diffuse surface of albedo 1, per steradian: Oren and Nayar's model as
/// Fujii improved it, which is Lambert's for a roughness of 0.
///
/// The cosines are those between normal and light, normal and view, light and view.
#[inline(always)]
fn oren_nayar(light: f64, view: f64, between: f64) -> f64 {
    let view = if view > 0.0 { view } else { 0.0 };
    let plain = 1.0 / (PI + (PI / 2.0 - 2.0 / 3.0) * ROUGHNESS);
    let s = between - light * view;
    let larger = if light > view { light } else { view };
    let t = if s <= 0.0 { 1.0 } else { larger };
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
