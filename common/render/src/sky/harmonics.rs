//! Light from all around as nine numbers per colour: irradiance for any normal.
//!
//! Ramamoorthi and Hanrahan (2001): irradiance keeps only the first nine
//! spherical harmonics of the light around.

use core::f64::consts::{PI, TAU};
use glam::DVec3;

use super::air::Colour;

/// Directions that light is sampled from: rows of equal solid angle.
const ROWS: usize = 48;
const COLUMNS: usize = 96;

/// Irradiance as a function of the normal.
#[derive(Clone, Debug)]
pub(crate) struct Irradiance([Colour; 9]);

impl Irradiance {
    /// The same from all around, for every normal.
    pub(crate) fn uniform(irradiance: Colour) -> Self {
        let mut terms = [[0.0; 3]; 9];
        terms[0] = irradiance.map(|irradiance| irradiance / basis(DVec3::Z)[0]);
        Self(terms)
    }

    /// That of a radiance given by direction.
    pub(crate) fn of(radiance: impl Fn(DVec3) -> Colour) -> Self {
        /// How much of each band a cosine lobe keeps: π, 2π/3, π/4.
        const KEPT: [f64; 3] = [PI, TAU / 3.0, PI / 4.0];
        let mut terms = [[0.0; 3]; 9];
        let share = 4.0 * PI / (ROWS * COLUMNS) as f64;
        for row in 0..ROWS {
            let z = 1.0 - 2.0 * (row as f64 + 0.5) / ROWS as f64;
            let flat = (1.0 - z * z).sqrt();
            for column in 0..COLUMNS {
                let (sine, cosine) = libm::sincos(TAU * (column as f64 + 0.5) / COLUMNS as f64);
                let direction = DVec3::new(flat * cosine, flat * sine, z);
                let light = radiance(direction);
                for (i, value) in basis(direction).into_iter().enumerate() {
                    let band = [0, 1, 1, 1, 2, 2, 2, 2, 2][i];
                    for c in 0..3 {
                        terms[i][c] += light[c] * value * KEPT[band] * share;
                    }
                }
            }
        }
        Self(terms)
    }

    /// Irradiance of a surface of that unit normal; never negative.
    #[inline(always)]
    pub(crate) fn at(&self, normal: DVec3) -> Colour {
        let basis = basis(normal);
        [0, 1, 2].map(|c| {
            let sum: f64 = (0..9).map(|i| self.0[i][c] * basis[i]).sum();
            if sum > 0.0 { sum } else { 0.0 }
        })
    }
}

/// The first nine real spherical harmonics.
#[inline(always)]
fn basis(d: DVec3) -> [f64; 9] {
    [
        0.282_094_791_773_878_14,
        0.488_602_511_902_919_9 * d.y,
        0.488_602_511_902_919_9 * d.z,
        0.488_602_511_902_919_9 * d.x,
        1.092_548_430_592_079_2 * d.x * d.y,
        1.092_548_430_592_079_2 * d.y * d.z,
        0.315_391_565_252_520_05 * (3.0 * d.z * d.z - 1.0),
        1.092_548_430_592_079_2 * d.x * d.z,
        0.546_274_215_296_039_6 * (d.x * d.x - d.y * d.y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_sky_gives_pi_times_its_radiance() {
        let even = Irradiance::of(|_| [1.0, 2.0, 0.5]);
        let uniform = Irradiance::uniform([PI, TAU, PI / 2.0]);
        for normal in [DVec3::Z, DVec3::X, DVec3::new(0.6, 0.0, -0.8)] {
            for c in 0..3 {
                let want = [PI, TAU, PI / 2.0][c];
                assert!((even.at(normal)[c] - want).abs() < 1e-2);
                assert!((uniform.at(normal)[c] - want).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn half_a_sky_lights_the_ground_fully_and_a_wall_by_half() {
        let half = Irradiance::of(|d| if d.z > 0.0 { [1.0; 3] } else { [0.0; 3] });
        assert!((half.at(DVec3::Z)[0] / PI - 1.0).abs() < 0.03);
        assert!((half.at(DVec3::X)[0] / PI - 0.5).abs() < 0.03);
        assert!(half.at(-DVec3::Z)[0] < 0.1);
    }
}
