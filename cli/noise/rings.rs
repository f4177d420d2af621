//! Radial power and anisotropy of a plane spectrum, thesis eqs. (4.8a), (4.8b), and what is said of them in a few numbers.

use serde::Serialize;

use super::measure::{Plane, Statistics};
use super::source::whole;

/// One ring of wavenumbers around 0.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub(crate) struct Ring {
    /// Mean wavenumber of its coefficients, cycles per cell.
    pub(crate) wavenumber: f64,
    /// Mean power density.
    pub(crate) power: f64,
    /// The same in decibels relative to a white noise of unit density.
    pub(crate) power_db: f64,
    /// Variance of the power density over the ring, divided by its squared mean.
    pub(crate) anisotropy: f64,
    /// The same in decibels. Of an isotropic field it is −10 log₁₀ of the number of realisations.
    pub(crate) anisotropy_db: f64,
}

/// 10 log₁₀ of a power.
pub(crate) fn decibels(power: f64) -> f64 {
    10.0 * libm::log10(power)
}

/// The rings of a spectrum up to its highest wavenumber along an axis, each one wavenumber step wide; that of 0 is left out.
pub(crate) fn rings(plane: &Plane) -> Vec<Ring> {
    #[derive(Clone, Copy, Default)]
    struct Sums {
        count: f64,
        wavenumber: f64,
        power: f64,
        squares: f64,
    }
    let half = plane.side / 2;
    let mut sums = vec![Sums::default(); half];
    let signed = |k: usize| {
        if k < half {
            whole(k)
        } else {
            whole(k) - whole(plane.side)
        }
    };
    for (i, &power) in plane.density.iter().enumerate() {
        let (x, y) = (signed(i % plane.side), signed(i / plane.side));
        let radius = (x * x + y * y).sqrt();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a radius is not negative, and less than the side"
        )]
        let ring = (radius + 0.5) as usize;
        if let Some(sums) = sums.get_mut(ring) {
            sums.count += 1.0;
            sums.wavenumber += radius * plane.step;
            sums.power += power;
            sums.squares += power * power;
        }
    }
    let ring = |sums: &Sums| {
        let power = sums.power / sums.count;
        let variance = sums.squares / sums.count - power * power;
        let anisotropy = variance / (power * power);
        Ring {
            wavenumber: sums.wavenumber / sums.count,
            power,
            power_db: decibels(power),
            anisotropy,
            anisotropy_db: decibels(anisotropy),
        }
    };
    sums[1..].iter().map(ring).collect()
}

/// What is said of a spectrum in a few numbers. Wavenumbers are cycles per cell.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub(crate) struct Summary {
    /// Where the radial power is greatest.
    pub(crate) peak: f64,
    /// That power in decibels.
    pub(crate) peak_db: f64,
    /// The first wavenumber above the peak with 3 dB less; `null` if there is none.
    pub(crate) down_3_db: Option<f64>,
    /// The first wavenumber above the peak with 20 dB less.
    pub(crate) down_20_db: Option<f64>,
    /// The first minimum of the radial power above the peak, at least 1 dB below what follows.
    pub(crate) first_null: Option<f64>,
    /// Greatest anisotropy in decibels up to the wavenumber with 20 dB less.
    pub(crate) anisotropy_db: f64,
    /// Least and greatest variance along the line, over their mean: 1 and 1 if the field is stationary.
    pub(crate) variance_along_line: [f64; 2],
    /// Exponent of the line's power over one cycle per cell to a quarter of the highest wavenumber.
    pub(crate) line_exponent: Option<f64>,
}

impl Summary {
    /// The summary of what was measured.
    pub(crate) fn new(statistics: &Statistics, rings: &[Ring]) -> Self {
        let top = rings
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.power.total_cmp(&b.1.power))
            .map_or(0, |(index, _)| index);
        let peak = rings[top];
        let above = &rings[top..];
        let down = |by: f64| {
            let pair = above
                .windows(2)
                .find(|pair| pair[1].power_db <= peak.power_db - by)?;
            let part =
                (peak.power_db - by - pair[0].power_db) / (pair[1].power_db - pair[0].power_db);
            Some(pair[0].wavenumber + part * (pair[1].wavenumber - pair[0].wavenumber))
        };
        let down_20_db = down(20.0);
        let relevant = |ring: &&Ring| down_20_db.is_none_or(|k| ring.wavenumber <= k);
        let worst = rings.iter().filter(relevant);
        let diagonal: Vec<f64> = statistics.covariance.diagonal().collect();
        let mean = diagonal.iter().sum::<f64>() / whole(diagonal.len());
        let least = diagonal.iter().copied().fold(f64::INFINITY, f64::min);
        let greatest = diagonal.iter().copied().fold(0.0, f64::max);
        Self {
            peak: peak.wavenumber,
            peak_db: peak.power_db,
            down_3_db: down(3.0),
            down_20_db,
            first_null: first_null(above),
            anisotropy_db: worst
                .map(|ring| ring.anisotropy_db)
                .fold(f64::NEG_INFINITY, f64::max),
            variance_along_line: [least / mean, greatest / mean],
            line_exponent: exponent(&statistics.line, statistics.line_step),
        }
    }
}

/// A minimum that the power rises out of by 1 dB, more than rings scatter, before it falls below it again.
fn first_null(above: &[Ring]) -> Option<f64> {
    const RISE: f64 = 1.0;
    let mut lowest = above.first()?;
    for ring in above {
        if ring.power_db < lowest.power_db {
            lowest = ring;
        } else if ring.power_db > lowest.power_db + RISE {
            return Some(lowest.wavenumber);
        }
    }
    None
}

/// The exponent of a power law fitted to a density by least squares in logarithms, over octaves alike.
fn exponent(density: &[f64], step: f64) -> Option<f64> {
    let highest = whole(density.len() - 1) * step;
    let (from, to) = (1.0, highest / 4.0);
    let [mut n, mut sx, mut sy, mut sxx, mut sxy] = [0.0; 5];
    for (k, &power) in density.iter().enumerate() {
        let wavenumber = whole(k) * step;
        if wavenumber < from || wavenumber > to || power <= 0.0 {
            continue;
        }
        // A bin's share of its octave.
        let weight = 1.0 / wavenumber;
        let (x, y) = (libm::log(wavenumber), libm::log(power));
        n += weight;
        sx += weight * x;
        sy += weight * y;
        sxx += weight * x * x;
        sxy += weight * x * y;
    }
    let spread = n * sxx - sx * sx;
    (to > 2.0 * from && spread > 0.0).then(|| (n * sxy - sx * sy) / spread)
}
