//! What a noise is good for as a building block: the spectrum of copies of it, each twice as fine as the one before, beside
//! the power law that they are meant to add up to (thesis fig. 4.20). A noise that holds low frequencies talks across.

use super::plot::Curve;
use super::report::Line;
use super::rings::decibels;

/// Copies that are added.
const COPIES: i32 = 5;

/// The Hurst coefficient of the sum: copies are 2^−H as high as the one before.
pub(crate) const HURST: f64 = 0.5;

/// Where noises have most of their power, about, in cycles per cell.
const TYPICAL: f64 = 0.5;

/// The spectra along a line of the copies and of their sum, and the law, (3.41) with r = 2: all in dB.
///
/// The law passes through the sum at the middle copy, whatever the noise.
pub(crate) fn curves(line: &[Line]) -> Vec<Curve> {
    let Some(last) = line.last() else {
        return Vec::new();
    };
    let step = last.wavenumber / line.len() as f64;
    // f(2ⁱx) has the spectrum S(k/2ⁱ)/2ⁱ.
    let copy = |i: i32, k: f64| {
        let scale = libm::exp2(f64::from(i));
        libm::exp2(-2.0 * HURST * f64::from(i)) * between(line, k / scale / step) / scale
    };
    let sum = |k: f64| (0..COPIES).map(|i| copy(i, k)).sum::<f64>();
    let middle = TYPICAL * libm::exp2(f64::from(COPIES / 2));
    let law = |k: f64| sum(middle) * libm::pow(k / middle, -(2.0 * HURST + 1.0));
    let ks = line.iter().map(|one| one.wavenumber);
    let ks: Vec<f64> = ks
        .filter(|k| *k <= libm::exp2(f64::from(COPIES - 1)))
        .collect();
    let curve = |label: String, of: &dyn Fn(f64) -> f64| Curve {
        label,
        points: ks.iter().map(|&k| (k, decibels(of(k)))).collect(),
    };
    let mut curves = vec![
        curve("wanted".to_owned(), &law),
        curve("sum".to_owned(), &sum),
    ];
    curves.extend((0..COPIES).map(|i| curve(format!("copy {}", i + 1), &|k| copy(i, k))));
    curves
}

/// The power at a wavenumber counted in steps from 0, on the straight line between neighbours.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a place in a list, held to it"
)]
fn between(line: &[Line], at: f64) -> f64 {
    // Line 0 is at one step.
    let place = (at - 1.0).max(0.0);
    let before = (place as usize).min(line.len() - 1);
    let after = (before + 1).min(line.len() - 1);
    let part = (place - before as f64).min(1.0);
    line[before].power * (1.0 - part) + line[after].power * part
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(power: impl Fn(f64) -> f64) -> Vec<Line> {
        (1..=16_384)
            .map(|i| f64::from(i) / 256.0)
            .map(|wavenumber| Line {
                wavenumber,
                power: power(wavenumber),
            })
            .collect()
    }

    /// How far the sum is above the law over the middle copies, in dB: most and least.
    fn off(curves: &[Curve]) -> (f64, f64) {
        let pairs = curves[0].points.iter().zip(&curves[1].points);
        let middle = pairs.filter(|(law, _)| (2.0..8.0).contains(&law.0));
        middle.fold(
            (f64::NEG_INFINITY, f64::INFINITY),
            |(most, least), (law, sum)| (most.max(sum.1 - law.1), least.min(sum.1 - law.1)),
        )
    }

    #[test]
    fn bands_keep_to_the_law_and_low_passes_talk_across() {
        // An octave wide and falling as the law does: the copies lie side by side.
        let band = curves(&line(|k| {
            if (0.5..1.0).contains(&k) {
                1.0 / (k * k)
            } else {
                0.0
            }
        }));
        assert_eq!(band.len(), 7);
        let (most, least) = off(&band);
        // At the borders of bands the spectrum's lines are joined: there half a copy may be too much.
        assert!(most < 2.0 && least > -2.0, "{most} {least}");
        let low_pass = curves(&line(|k| if k < 1.0 { 1.0 } else { 0.0 }));
        let (most, least) = off(&low_pass);
        assert!(most - least > 3.0, "{most} {least}");
        assert!(curves(&[]).is_empty());
    }
}
