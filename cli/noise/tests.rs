//! Known facts about noises, which a measurement must find.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use super::measure::{Settings, Statistics, Window, measure};
use super::rings::{Ring, Summary, rings};
use super::source::{Source, Varied, whole};

const SETTINGS: Settings = Settings {
    realisations: 40,
    cells: 32,
    samples: 8,
    line_samples: 16,
    z: 0.0,
    key: 1,
    window: Window::Hann,
};

fn measured(source: &Source, settings: Settings) -> (Statistics, Vec<Ring>, Summary) {
    let statistics = measure(source, &settings, |_| Ok(())).unwrap();
    let rings = rings(&statistics.plane);
    let summary = Summary::new(&statistics, &rings);
    (statistics, rings, summary)
}

fn field(text: &str) -> Source {
    Source::Field(text.to_owned())
}

#[test]
fn white_noise_is_flat_and_isotropic_at_0_db() {
    // Many cells, so that every ring has some hundred independent coefficients.
    let settings = Settings {
        cells: 256,
        samples: 4,
        ..SETTINGS
    };
    for window in [Window::Hann, Window::None] {
        let (statistics, rings, _) = measured(&Source::White, Settings { window, ..settings });
        for ring in rings.iter().filter(|ring| ring.wavenumber > 0.5) {
            assert!(ring.power_db.abs() < 0.3, "{ring:?}");
            // Forty realisations scatter by a fortieth of the squared mean, −16 dB; small rings have few coefficients.
            let room = if ring.wavenumber < 1.5 { 3.0 } else { 1.5 };
            assert!((ring.anisotropy_db + 16.0).abs() < room, "{ring:?}");
        }
        let mean = statistics.line[8..].iter().sum::<f64>() / whole(statistics.line.len() - 8);
        assert!((mean - 1.0).abs() < 0.05, "{mean}");
    }
}

/// h of thesis fig. 4.4.
fn quintic(t: f64) -> f64 {
    let t = t.abs();
    1.0 - t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// The power of the transforms of h(t) and t h(t) at a wavenumber, by the midpoint rule.
fn kernel_powers(k: f64) -> [f64; 2] {
    const PARTS: u32 = 4_000;
    let (mut even, mut odd) = (0.0, 0.0);
    for i in 0..PARTS {
        let t = (f64::from(i) + 0.5) / f64::from(PARTS);
        let (sine, cosine) = libm::sincos(TAU * k * t);
        even += 2.0 * quintic(t) * cosine / f64::from(PARTS);
        odd += 2.0 * t * quintic(t) * sine / f64::from(PARTS);
    }
    [even * even, odd * odd]
}

/// What radial power gradient noise must have in a lattice plane: nodes are independent, so powers of
/// their kernels add up, and each component of the twelve gradients has the mean square 2/3.
fn expected(k: f64) -> f64 {
    const ANGLES: u32 = 64;
    let mut sum = 0.0;
    for i in 0..ANGLES {
        let (sine, cosine) = libm::sincos(TAU * (f64::from(i) + 0.5) / f64::from(ANGLES));
        let ([h_x, g_x], [h_y, g_y]) = (kernel_powers(k * cosine), kernel_powers(k * sine));
        sum += 2.0 / 3.0 * (g_x * h_y + h_x * g_y) / f64::from(ANGLES);
    }
    sum
}

#[test]
fn gradient_noise_has_the_spectrum_of_its_kernels() {
    let gradient = Source::named("gradient").unwrap();
    let (statistics, rings, summary) = measured(&gradient, SETTINGS);
    assert_eq!(statistics.varied, Varied::ByKey);
    for ring in rings.iter().step_by(4) {
        if !(0.2..1.2).contains(&ring.wavenumber) {
            continue;
        }
        let expected = 10.0 * libm::log10(expected(ring.wavenumber));
        assert!(
            (ring.power_db - expected).abs() < 0.5,
            "{ring:?}: {expected}"
        );
    }
    // ERRATA row 1442: not at 1, as the thesis's axes have it.
    assert!((0.42..0.54).contains(&summary.peak), "{summary:?}");
    let at_one = rings.iter().find(|ring| ring.wavenumber >= 1.0).unwrap();
    let below = at_one.power_db - summary.peak_db;
    assert!((-11.0..-7.0).contains(&below), "{below}");
    let null = summary.first_null.unwrap();
    assert!((1.2..1.36).contains(&null), "{null}");
    // It is 0 at every node: not stationary (thesis fig. 4.6).
    assert!(summary.variance_along_line[0] < 1e-9, "{summary:?}");
    assert!(summary.variance_along_line[1] > 1.3, "{summary:?}");
}

#[test]
fn a_field_without_key_is_looked_at_elsewhere() {
    let (by_place, there, _) = measured(&field("noise(p)"), SETTINGS);
    assert_eq!(by_place.varied, Varied::ByPlace);
    let (_, by_key, _) = measured(&field("noise(p, key)"), SETTINGS);
    for (a, b) in there.iter().zip(&by_key).take(32).skip(4) {
        assert!((a.power_db - b.power_db).abs() < 1.0, "{a:?} {b:?}");
    }
}

#[test]
fn a_wave_is_found_where_it_is() {
    // 2 cycles per cell along the diagonal.
    let k = TAU * 2.0 * FRAC_1_SQRT_2;
    let wave = format!("sin({k} * (p.x + p.y))");
    let (statistics, rings, summary) = measured(&field(&wave), SETTINGS);
    assert!((summary.peak - 2.0).abs() < 0.05, "{summary:?}");
    // All power of a field that has one direction is in two bins of a ring.
    let ring = rings
        .iter()
        .max_by(|a, b| a.power.total_cmp(&b.power))
        .unwrap();
    assert!(ring.anisotropy_db > 10.0, "{ring:?}");
    // The whole spectrum holds the mean square (Parseval).
    let step = statistics.plane.step;
    let total = statistics.plane.density.iter().sum::<f64>() * step * step;
    assert!((total - 0.5).abs() < 0.02, "{total}");
    assert!((statistics.values.variance - 0.5).abs() < 0.02);
}

#[test]
fn fractal_sums_fall_off_as_their_hurst_coefficient_says() {
    for (name, hurst) in [("fbm0.2", 0.2), ("fbm0.5", 0.5), ("fbm0.8", 0.8)] {
        let settings = Settings {
            line_samples: 64,
            samples: 2,
            realisations: 60,
            ..SETTINGS
        };
        let (_, _, summary) = measured(&Source::named(name).unwrap(), settings);
        // Thesis eq. (3.26), mended (ERRATA row 1155): β = 2H + 1.
        let exponent = summary.line_exponent.unwrap();
        assert!(
            (exponent + 2.0 * hurst + 1.0).abs() < 0.25,
            "{name}: {exponent}"
        );
    }
}

#[test]
fn mistakes_in_expressions_are_sentences() {
    let error = field("nois(p)").varied().unwrap_err().to_string();
    assert!(error.contains("nois") && error.contains("noise"), "{error}");
}
