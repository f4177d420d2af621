//! Light and air of one image: sun, sky, what falls on surfaces, and what distance does to colours.

mod air;
mod clouds;
mod depth;
mod disc;
mod dome;
mod harmonics;

use glam::DVec3;
use scene::Description;
use scene::description::Sky as Kind;

use air::Air;
pub(crate) use air::Colour;
use clouds::Light;
pub(crate) use clouds::{Clouds, Crossing, Scanned};
use dome::Dome;
pub(crate) use harmonics::Irradiance;

use crate::crew::Crew;

/// Contrast that is left at the distance called visibility: 2 %, Koschmieder.
const CONTRAST: f64 = 0.02;

/// How extinction by haze near the ground depends on wavelength: Ångström's exponent.
const ANGSTROM: f64 = 1.1;

/// Wavelengths of red, green and blue over that of green.
const WAVELENGTHS: Colour = [680.0 / 550.0, 1.0, 440.0 / 550.0];

/// Sun, sky and air.
pub(crate) struct Sky {
    /// Unit vector towards the sun.
    pub(crate) sun: DVec3,
    /// Irradiance of a surface facing the sun, at the ground.
    pub(crate) sunlight: Colour,
    /// Irradiance from everywhere else.
    pub(crate) ambient: Irradiance,
    /// The same for clouds: the mean of what comes from above and below.
    on_clouds: Colour,
    air: Option<Layer>,
    /// Radiance of the background without air.
    plain: Colour,
}

/// The air between eye and surface, and the sky behind.
struct Layer {
    dome: Dome,
    /// Irradiance of the sun above the air.
    strength: Colour,
    /// Per metre.
    extinction: Colour,
    /// Haze, 1 for a clear day.
    haze: f64,
}

impl Sky {
    /// The sky at an instant over a place whose vertical is `up`; `ground` is the mean
    /// reflectance of the surface, which lights what faces it.
    pub(crate) fn new(
        description: &Description,
        time: f64,
        up: DVec3,
        ground: Colour,
        crew: &dyn Crew,
    ) -> Self {
        let sun = DVec3::from(description.sun.direction(time));
        let strength = description.sun.irradiance;
        match &description.sky {
            Kind::Plain { radiance, ambient } => Self {
                sun,
                sunlight: strength,
                ambient: Irradiance::uniform(*ambient),
                on_clouds: *ambient,
                air: None,
                plain: *radiance,
            },
            Kind::Air {
                rayleigh,
                haze,
                visibility,
                clouds: _,
            } => {
                let air = Air {
                    rayleigh: *rayleigh,
                    haze: *haze,
                };
                let dome = Dome::new(&air, up, sun, crew);
                let sunlight = [0, 1, 2].map(|c| strength[c] * dome.sunlight[c]);
                let layer = Layer {
                    dome,
                    strength,
                    extinction: extinction(visibility.at(time)),
                    haze: *haze,
                };
                let height = sun.dot(up);
                let direct = sunlight.map(|light| light * if height > 0.0 { height } else { 0.0 });
                let above = Irradiance::of(|direction| {
                    if direction.dot(up) > 0.0 {
                        layer.radiance(direction)
                    } else {
                        [0.0; 3]
                    }
                });
                let from_sky = above.at(up);
                let below = [0, 1, 2]
                    .map(|c| ground[c] * (direct[c] + from_sky[c]) * core::f64::consts::FRAC_1_PI);
                let ambient = Irradiance::of(|direction| {
                    if direction.dot(up) > 0.0 {
                        layer.radiance(direction)
                    } else {
                        below
                    }
                });
                let (over, under) = (ambient.at(up), ambient.at(-up));
                Self {
                    sun,
                    sunlight,
                    ambient,
                    on_clouds: [0, 1, 2].map(|c| (over[c] + under[c]) / 2.0),
                    air: Some(layer),
                    plain: [0.0; 3],
                }
            }
        }
    }

    /// Radiance seen along a ray that meets no surface.
    pub(crate) fn background(&self, direction: DVec3) -> Colour {
        let Some(layer) = &self.air else {
            return self.plain;
        };
        let sky = layer.radiance(direction);
        let sun = disc::radiance(direction.dot(self.sun), layer.haze);
        [0, 1, 2].map(|c| sky[c] + self.sunlight[c] * sun[c])
    }

    /// What falls on clouds above.
    pub(crate) fn on_clouds(&self) -> Light {
        Light {
            sun: self.sun,
            sunlight: self.sunlight,
            ambient: self.on_clouds,
        }
    }

    /// What is seen of `radiance` at that distance in a direction: part of it is lost, and the
    /// horizon's light on that side comes in its place.
    pub(crate) fn through_air(&self, radiance: Colour, direction: DVec3, distance: f64) -> Colour {
        let Some(layer) = &self.air else {
            return radiance;
        };
        let horizon = layer.dome.horizon(direction);
        [0, 1, 2].map(|c| {
            let left = libm::exp(-layer.extinction[c] * distance);
            radiance[c] * left + layer.strength[c] * horizon[c] * (1.0 - left)
        })
    }
}

impl Layer {
    fn radiance(&self, direction: DVec3) -> Colour {
        let light = self.dome.radiance(direction);
        [0, 1, 2].map(|c| light[c] * self.strength[c])
    }
}

/// Extinction per metre for a visibility in metres.
fn extinction(visibility: f64) -> Colour {
    let green = -libm::log(CONTRAST) / visibility;
    WAVELENGTHS.map(|wavelength| green * libm::pow(wavelength, -ANGSTROM))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_the_visibility_two_percent_are_left_of_green_and_less_of_blue() {
        let extinction = extinction(10_000.0);
        let left = extinction.map(|c| libm::exp(-c * 10_000.0));
        assert!((left[1] - CONTRAST).abs() < 1e-12);
        assert!(left[0] > left[1] && left[1] > left[2]);
    }
}
