//! A fully developed sea by the spectrum of Pierson and Moskowitz (thesis fig. 3.6).

use super::spectral::synthesise;
use super::whole;

/// Phillips's constant.
const ALPHA: f64 = 0.0081;

/// Where the spectrum ends towards slow waves.
const BETA: f64 = 0.74;

/// Metres per second squared.
const GRAVITY: f64 = 9.81;

/// S(ω) = α g²/ω⁵ · exp(−β (g/(U ω))⁴), square metres per radian per second; U is the wind 19.5 m above the sea.
pub(super) fn frequency_spectrum(wind: f64, omega: f64) -> f64 {
    let square = omega * omega;
    let slow = GRAVITY / (wind * omega);
    let slow = slow * slow;
    ALPHA * GRAVITY * GRAVITY / (square * square * omega) * libm::exp(-BETA * slow * slow)
}

/// Heights in metres on a periodic grid of `side`² samples, `cell` metres apart.
///
/// Waves in deep water: ω² = g k. Their power spreads about the wind's direction as 2/π cos²θ, none against
/// it; a surface at one instant does not tell the two ways of a wave apart, so each has half.
pub(super) fn heights(side: usize, cell: f64, wind: f64, direction: f64, key: u32) -> Vec<f64> {
    let step = std::f64::consts::TAU / (whole(side) * cell);
    let (sine, cosine) = libm::sincos(direction);
    synthesise(side, 2, key, |[x, y, _]| {
        let (x, y) = (x * step, y * step);
        let square = x * x + y * y;
        let k = libm::sqrt(square);
        let omega = libm::sqrt(GRAVITY * k);
        // dω/dk = ½ √(g/k), and the plane's area element is k dk dθ.
        let radial = frequency_spectrum(wind, omega) * 0.5 * libm::sqrt(GRAVITY / k) / k;
        let along = (x * cosine + y * sine) / k;
        // Half of 2/π cos²θ, in both directions.
        let spread = std::f64::consts::FRAC_1_PI * along * along;
        radial * spread * step * step
    })
}
