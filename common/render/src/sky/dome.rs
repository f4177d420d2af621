//! The sky's light from every direction above the horizon, tabulated for one stand of the sun.

use glam::DVec3;

use super::air::{Air, Colour, Depth, haze_phase, rayleigh_phase};
use super::depth::{Depths, height_along, place, to_space};
use crate::crew::{Crew, in_order};

/// Entries from the horizon to the zenith, densest at the horizon.
const ROWS: usize = 64;

/// Entries from the sun's side to the other.
const COLUMNS: usize = 24;

/// Steps along each path of sight.
const STEPS: usize = 40;

/// Height of the place from which the sky is seen, metres.
const EYE: f64 = 30.0;

/// Share of the light falling on the ground that it sends back into the air.
const GROUND_ALBEDO: f64 = 0.2;

/// Light that is scattered a second time is scattered on: a geometric series of this ratio.
const AGAIN: f64 = 0.45;

/// Light arriving from one direction, split by what scattered it.
#[derive(Clone, Copy, Default)]
struct Entry {
    /// By gases, without the phase function.
    rayleigh: Colour,
    /// By haze, without the phase function.
    haze: Colour,
    /// Twice and more, the same from everywhere.
    again: Colour,
}

/// The sky for sunlight of irradiance 1.
pub(crate) struct Dome {
    up: DVec3,
    sun: DVec3,
    /// Horizontal and unit, on the sun's side.
    sunwards: DVec3,
    entries: Vec<Entry>,
    /// What is left of sunlight at the ground.
    pub(crate) sunlight: Colour,
}

impl Dome {
    /// The sky over a place whose vertical is `up`, with the sun in direction `sun`.
    pub(crate) fn new(air: &Air, up: DVec3, sun: DVec3, crew: &dyn Crew) -> Self {
        let depths = Depths::known();
        let sine = sun.dot(up);
        let level = sun - up * sine;
        let length = level.dot(level).sqrt();
        let sunwards = if length > 1e-9 {
            level * (1.0 / length)
        } else {
            up.any_orthonormal_vector()
        };
        let sunlight = depths
            .at(EYE, sine)
            .map_or([0.0; 3], |depth| air.transmitted(depth));
        let rows: [usize; ROWS] = core::array::from_fn(|row| row);
        let entries = in_order(crew, &rows, |&row| {
            let share = row as f64 / (ROWS - 1) as f64;
            let rise = share * share;
            let flat = (1.0 - rise * rise).sqrt();
            let mut columns = [Entry::default(); COLUMNS];
            for (column, entry) in columns.iter_mut().enumerate() {
                let side = 1.0 - 2.0 * column as f64 / (COLUMNS - 1) as f64;
                // The cosine of the angle to the sun decides about the Earth's shadow alone.
                let towards = flat * side * length + rise * sine;
                *entry = gather(air, depths, rise, sine, towards);
            }
            columns
        });
        let mut dome = Self {
            up,
            sun,
            sunwards,
            entries: entries.into_iter().flatten().collect(),
            sunlight,
        };
        let mean = dome.mean();
        for entry in &mut dome.entries {
            for (again, mean) in entry.again.iter_mut().zip(mean) {
                *again *= mean / (1.0 - AGAIN);
            }
        }
        dome
    }

    /// Radiance from a direction; below the horizon, that of the horizon.
    pub(crate) fn radiance(&self, direction: DVec3) -> Colour {
        let rise = direction.dot(self.up);
        self.toward(direction, if rise > 0.0 { rise } else { 0.0 })
    }

    /// Radiance of the horizon below or above a direction.
    pub(crate) fn horizon(&self, direction: DVec3) -> Colour {
        self.toward(direction, 0.0)
    }

    /// Radiance at a height above the horizon, on the side of `direction`.
    fn toward(&self, direction: DVec3, rise: f64) -> Colour {
        let level = direction - self.up * direction.dot(self.up);
        let length = level.dot(level).sqrt();
        let side = if length > 1e-12 {
            level.dot(self.sunwards) / length
        } else {
            0.0
        };
        let (row, v) = place(rise.sqrt(), ROWS);
        let (column, u) = place((1.0 - side) / 2.0, COLUMNS);
        let flat = if rise < 1.0 {
            (1.0 - rise * rise).sqrt()
        } else {
            0.0
        };
        let cosine = flat * side * self.sun.dot(self.sunwards) + rise * self.sun.dot(self.up);
        let (rayleigh, haze) = (rayleigh_phase(cosine), haze_phase(cosine));
        let mut light = [0.0; 3];
        for (row, v) in [(row, 1.0 - v), (row + 1, v)] {
            // On the horizon, which all surfaces ask for, the first row is all.
            if v == 0.0 {
                continue;
            }
            for (column, u) in [(column, 1.0 - u), (column + 1, u)] {
                let entry = &self.entries[row * COLUMNS + column];
                for (c, light) in light.iter_mut().enumerate() {
                    *light += u
                        * v
                        * (entry.rayleigh[c] * rayleigh + entry.haze[c] * haze + entry.again[c]);
                }
            }
        }
        light
    }

    /// Mean radiance over all directions, the lit ground below included.
    fn mean(&self) -> Colour {
        let mut sky = [0.0; 3];
        let mut down = self
            .sunlight
            .map(|light| light * self.sun.dot(self.up).max(0.0));
        let rows: usize = 16;
        let columns: usize = 32;
        for row in 0..rows {
            let rise = (row as f64 + 0.5) / rows as f64;
            let flat = (1.0 - rise * rise).sqrt();
            for column in 0..columns {
                let angle = (column as f64 + 0.5) / columns as f64 * core::f64::consts::PI;
                let (sine, cosine) = libm::sincos(angle);
                let across = self.up.cross(self.sunwards);
                let direction = self.up * rise + (self.sunwards * cosine + across * sine) * flat;
                let light = self.radiance_once(direction, rise);
                for c in 0..3 {
                    sky[c] += light[c] / (rows * columns) as f64;
                    down[c] += light[c] * rise * core::f64::consts::TAU / (rows * columns) as f64;
                }
            }
        }
        [0, 1, 2].map(|c| 0.5 * (sky[c] + down[c] * GROUND_ALBEDO * core::f64::consts::FRAC_1_PI))
    }

    /// Radiance of light scattered once; what is scattered again is not yet scaled.
    fn radiance_once(&self, direction: DVec3, rise: f64) -> Colour {
        let cosine = direction.dot(self.sun);
        let (rayleigh, haze) = (rayleigh_phase(cosine), haze_phase(cosine));
        let side = direction - self.up * rise;
        let length = side.dot(side).sqrt();
        let side = if length > 1e-12 {
            side.dot(self.sunwards) / length
        } else {
            0.0
        };
        let (row, _) = place(rise.sqrt(), ROWS);
        let (column, _) = place((1.0 - side) / 2.0, COLUMNS);
        let entry = &self.entries[row * COLUMNS + column];
        [0, 1, 2].map(|c| entry.rayleigh[c] * rayleigh + entry.haze[c] * haze)
    }
}

/// Follows a path of sight through the air and adds up what is scattered into it.
///
/// `rise` and `sun` are the sines of elevation of path and sun, `towards` the
/// cosine of the angle between them.
fn gather(air: &Air, depths: &Depths, rise: f64, sun: f64, towards: f64) -> Entry {
    let whole = to_space(EYE, rise);
    let mut entry = Entry::default();
    let mut passed = Depth::default();
    let mut last = 0.0;
    for step in 1..=STEPS {
        let share = step as f64 / STEPS as f64;
        let length = whole * share * share;
        let (middle, span) = ((last + length) / 2.0, length - last);
        last = length;
        let height = height_along(EYE, rise, middle);
        let density = Depth::density(height);
        let seen = air.transmitted(passed.and(density, span / 2.0));
        passed = passed.and(density, span);
        // The vertical turns along the path: the sun's elevation there.
        let radius = super::air::GROUND + height;
        let sun_there = (sun * (super::air::GROUND + EYE) + towards * middle) / radius;
        let lit = depths
            .at(height, sun_there)
            .map_or([0.0; 3], |depth| air.transmitted(depth));
        let rayleigh = air.rayleigh_scattering(density);
        let haze = air.haze_scattering(density);
        for c in 0..3 {
            entry.rayleigh[c] += seen[c] * lit[c] * rayleigh[c] * span;
            entry.haze[c] += seen[c] * lit[c] * haze * span;
            entry.again[c] += seen[c] * (rayleigh[c] + haze) * span;
        }
    }
    entry
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crew::Alone;

    fn dome(elevation: f64) -> Dome {
        let (sine, cosine) = libm::sincos(elevation.to_radians());
        Dome::new(
            &Air {
                rayleigh: 1.0,
                haze: 1.0,
            },
            DVec3::Z,
            DVec3::new(0.0, cosine, sine),
            &Alone,
        )
    }

    #[test]
    fn the_zenith_is_blue_and_the_horizon_pale_and_brighter() {
        let dome = dome(35.0);
        let zenith = dome.radiance(DVec3::Z);
        let horizon = dome.radiance(DVec3::X);
        assert!(zenith[2] > 2.0 * zenith[0]);
        assert!(horizon[2] < 1.8 * horizon[0]);
        assert!(horizon[1] > 2.0 * zenith[1]);
    }

    #[test]
    fn a_low_sun_is_red_and_below_the_horizon_there_is_none() {
        let low = dome(3.0).sunlight;
        assert!(low[0] > 2.0 * low[2] && low[0] < 1.0);
        assert!(dome(60.0).sunlight[2] > 0.5);
        assert_eq!(dome(-10.0).sunlight, [0.0; 3]);
    }

    #[test]
    fn the_sky_has_no_seam_at_the_horizon_and_is_finite_everywhere() {
        let dome = dome(12.0);
        for step in 0..64 {
            let (sine, cosine) = libm::sincos(f64::from(step) * 0.1);
            let side = DVec3::new(cosine, sine, 0.0);
            let above = dome.radiance((side + DVec3::Z * 1e-7).normalize());
            let below = dome.radiance((side - DVec3::Z * 1e-3).normalize());
            for c in 0..3 {
                assert!((above[c] / below[c] - 1.0).abs() < 1e-2);
                assert!(above[c].is_finite() && above[c] > 0.0);
            }
        }
        assert!(dome.radiance(DVec3::Z).iter().all(|c| c.is_finite()));
    }
}
