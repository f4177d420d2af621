//! Spectral synthesis: Gaussian coefficients of a given power, transformed to samples (thesis §3.2.2).

use crate::fft::{Complex, Direction, Fft};
use crate::grid::{gaussian, whole};

/// The stream of random numbers that coefficients come from.
const STREAM: u32 = 0x5bec_7a11;

/// Samples on a grid of `side` along each of `axes` axes: the real sum of thesis eq. (3.27), mended (ERRATA row 1029).
///
/// `power` is the mean square of a coefficient at a wave vector in cycles per grid, each part from −N/2 to N/2:
/// wavenumbers are min(k, N − k), there is none at 0, and g(−k) is the conjugate of g(k), so that a coefficient
/// that is its own opposite is real. The grid is periodic.
pub(super) fn synthesise(
    side: usize,
    axes: u32,
    key: u32,
    power: impl Fn([f64; 3]) -> f64,
) -> Vec<f64> {
    let fft = Fft::new(side).expect("a recipe's side is a power of two");
    let count = side.pow(axes);
    let mut spectrum = vec![Complex::default(); count];
    let parts = |i: usize| [i % side, i / side % side, i / (side * side)];
    let opposite = |i: usize| {
        let [x, y, z] = parts(i).map(|k| (side - k) % side);
        (z * side + y) * side + x
    };
    let signed = |k: usize| {
        if 2 * k <= side {
            whole(k)
        } else {
            whole(k) - whole(side)
        }
    };
    // The zero vector stays without power: the mean is 0.
    for i in 1..count {
        let other = opposite(i);
        if i > other {
            continue;
        }
        let words = parts(i).map(|k| u32::try_from(k).unwrap_or(u32::MAX));
        let square = power(parts(i).map(signed));
        if i == other {
            spectrum[i] = Complex::new(libm::sqrt(square) * gaussian(key, STREAM, words), 0.0);
        } else {
            let deviation = libm::sqrt(0.5 * square);
            let re = deviation * gaussian(key, STREAM, words);
            let im = deviation * gaussian(key, STREAM + 1, words);
            spectrum[i] = Complex::new(re, im);
            spectrum[other] = Complex::new(re, -im);
        }
    }
    fft.run_axes(Direction::Inverse, axes, &mut spectrum);
    spectrum.into_iter().map(|sample| sample.re).collect()
}

/// Fractional Brownian motion: power falls as k^{−β}, β = 2H + n (thesis eq. (3.26)), scaled to unit variance.
pub(super) fn fractal(side: usize, axes: u32, hurst: f64, key: u32) -> Vec<f64> {
    let beta = 2.0 * hurst + f64::from(axes);
    let power = |[x, y, z]: [f64; 3]| {
        let square = x * x + y * y + z * z;
        libm::pow(square, -0.5 * beta)
    };
    let half = side / 2;
    let mut total = 0.0;
    // Every wave vector once: the expected variance of a sample.
    for i in 1..side.pow(axes) {
        let part = |k: usize| {
            if k <= half {
                whole(k)
            } else {
                whole(k) - whole(side)
            }
        };
        total += power([
            part(i % side),
            part(i / side % side),
            part(i / (side * side)),
        ]);
    }
    synthesise(side, axes, key, |k| power(k) / total)
}
