//! The Weierstrass–Mandelbrot function of thesis eq. (3.38), put together from sines.

use field::hash::{hash, unit};
use field::{NodeId, Op};
use rhai::{Dynamic, Map};

use super::Shared;
use super::noises::known_options;
use super::values::{Made, Operand, refuse};

const NAME: &str = "weierstrass";

impl Shared {
    /// Σᵢ Σⱼ aᵢⱼ r^{−iH} cos(2π rⁱ dⱼ·x + φᵢⱼ)/√J: i runs over the octaves, j over J random directions.
    ///
    /// The heights a are Gaussian with variance 1, the phases φ uniform; √J keeps the variance from growing
    /// with the number of directions. There is no level of detail: every sine is there everywhere.
    pub(super) fn weierstrass(&self, at: &Dynamic, options: &Map) -> Made<Dynamic> {
        let at = Self::vector(NAME, at)?;
        known_options(
            NAME,
            options,
            &["octaves", "directions", "lacunarity", "hurst", "key"],
        )?;
        let number = |option: &str, default: f64, low: f64, high: f64, wanted: &str| {
            let value = match options.get(option) {
                Some(value) => Self::constant(&format!("{NAME}: {option}"), value)?,
                None => default,
            };
            if (low..=high).contains(&value) {
                return Ok(value);
            }
            refuse(
                format!("`{NAME}` wants {wanted}, not {value}"),
                "see the options of the call",
            )
        };
        let octaves = number("octaves", 8.0, 1.0, 24.0, "1 to 24 whole octaves")?;
        let directions = number("directions", 8.0, 1.0, 64.0, "1 to 64 whole directions")?;
        let lacunarity = number("lacunarity", 2.0, 1.1, 16.0, "a lacunarity from 1.1 to 16")?;
        let hurst = number("hurst", 0.8, -4.0, 4.0, "a Hurst coefficient from -4 to 4")?;
        let key = number(
            "key",
            0.0,
            0.0,
            f64::from(u32::MAX),
            "a key from 0 to 4294967295",
        )?;
        for value in [octaves, directions, key] {
            if value % 1.0 != 0.0 {
                return refuse(
                    format!("`{NAME}` wants a whole number here, not {value}"),
                    "octaves, directions and key are whole",
                );
            }
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "whole and in range: checked above"
        )]
        let (octaves, directions, key) = (octaves as u32, directions as u32, key as u32);
        let mut total: Option<NodeId> = None;
        for j in 0..directions {
            let along = direction(key, j).map(|part| self.push(Op::Constant, &[], &[part]));
            let [x, y, z] = along;
            let along = self.push(Op::Vector, &[x?, y?, z?], &[])?;
            let way = self.push(Op::Dot, &[at, along], &[])?;
            let (mut frequency, mut i) = (2.0 * core::f64::consts::PI, 0);
            while i < octaves {
                let amplitude = gaussian(key, i, j) * libm::pow(lacunarity, -hurst * f64::from(i))
                    / libm::sqrt(f64::from(directions));
                let phase = 2.0 * core::f64::consts::PI * unit(hash(&[key, 3, i, j]));
                let term = self.wave(way, frequency, phase, amplitude)?;
                total = Some(match total {
                    Some(total) => self.push(Op::Add, &[total, term], &[])?,
                    None => term,
                });
                frequency *= lacunarity;
                i += 1;
            }
        }
        let total = total.expect("there is a direction and an octave");
        Ok(Operand::Scalar(total).into_dynamic())
    }

    /// amplitude · cos(frequency · way + phase).
    fn wave(&self, way: NodeId, frequency: f64, phase: f64, amplitude: f64) -> Made<NodeId> {
        let constant = |value: f64| self.push(Op::Constant, &[], &[value]);
        let turned = self.push(Op::Mul, &[way, constant(frequency)?], &[])?;
        let turned = self.push(Op::Add, &[turned, constant(phase)?], &[])?;
        let wave = self.push(Op::Cos, &[turned], &[])?;
        self.push(Op::Mul, &[wave, constant(amplitude)?], &[])
    }
}

/// A unit vector, uniform over the sphere.
fn direction(key: u32, j: u32) -> [f64; 3] {
    let z = 2.0 * unit(hash(&[key, 0, j])) - 1.0;
    let (sin, cos) = libm::sincos(2.0 * core::f64::consts::PI * unit(hash(&[key, 1, j])));
    let across = libm::sqrt(1.0 - z * z);
    [across * cos, across * sin, z]
}

/// A normally distributed number, by Box and Muller.
fn gaussian(key: u32, i: u32, j: u32) -> f64 {
    let radius = libm::sqrt(-2.0 * libm::log(1.0 - unit(hash(&[key, 4, i, j]))));
    radius * libm::cos(2.0 * core::f64::consts::PI * unit(hash(&[key, 5, i, j])))
}
