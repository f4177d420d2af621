//! Functions of one number: images, bands, slopes, derivatives.

use super::*;

fn functions() -> Vec<Function> {
    let mut all: Vec<Function> = UNARY.into_iter().map(Function::Unary).collect();
    all.extend([0.3, 0.5, 1.0, 1.5, 2.0, 2.5, 3.3].map(Function::Power));
    all.extend([
        Function::SmoothStep(-1.0, 2.5),
        Function::Clamp,
        Function::Square,
        Function::Reciprocal,
        Function::OntoSphere(2.0),
        Function::Quintic,
    ]);
    all.extend(profiles().map(Function::Profile));
    all
}

/// Whether no number below 0 is ever asked for.
fn of_squares(function: Function) -> bool {
    matches!(function, Function::Profile(profile) if profile != Profile::Spline)
}

#[test]
fn functions_stay_within_image_band_and_slopes() {
    for (k, function) in (0..).zip(functions()) {
        let mut tight = 0;
        for i in 0..6_000 {
            let centre = 4.0 * number(&[k, i, 0]);
            let half = scale(&[k, i, 1]);
            // Squared distances: half of them beyond the kernel; a range may begin a little below 0, as rounding leaves it.
            let centre = if of_squares(function) {
                0.5 * centre.abs() + 0.99 * half
            } else {
                centre
            };
            let over = Interval::new(centre - half, centre + half);
            let (image, slopes, band) = (
                function.image(over),
                function.slopes(over),
                function.band(over),
            );
            tight += u32::from(band.is_some());
            let mut before: Option<(f64, f64)> = None;
            for j in 0..=8 {
                let a = over.low + f64::from(j) / 8.0 * over.width();
                let a = if a > over.high { over.high } else { a };
                if of_squares(function) && a < 0.0 {
                    continue;
                }
                let value = function.value(a);
                let told = format!("{function:?} at {a} of {over:?}: {value}");
                assert!(image.contains(value), "{told} outside {image:?}");
                if let Some(band) = band {
                    let off = (value - (band.alpha * a + band.beta)).abs();
                    assert!(off <= band.delta, "{told} is {off} off {band:?}");
                }
                if let Some((b, old)) = before
                    && a > b
                {
                    let chord = (value - old) / (a - b);
                    let blur = 1e-14 * (value.abs() + old.abs() + 1.0) / (a - b);
                    assert!(
                        slopes.expand(blur).contains(chord),
                        "{told}: chord {chord} outside {slopes:?}"
                    );
                }
                before = Some((a, value));
            }
        }
        assert!(tight > 2_000, "{function:?}: {tight} bands");
    }
}

#[test]
fn bands_are_no_wider_than_the_function_bends() {
    // Chebyshev: the error over a short interval is h²|φ″|/4.
    for function in functions() {
        for i in 0..200 {
            let a = 0.2 + 0.6 * unit(hash(&[i, 9]));
            let half = 1e-3;
            if function == Function::Profile(Profile::Spline) && (a - 0.5).abs() < 2.0 * half {
                continue;
            }
            let band = function.band(Interval::new(a - half, a + half)).unwrap();
            let bend = function.bend(a).abs();
            let most = 0.26 * half * half * (bend * 1.1 + 0.1) + 3e-14;
            assert!(band.delta <= most, "{function:?} at {a}: {band:?} {bend}");
        }
    }
}

#[test]
fn derivatives_of_functions_are_those_of_differences() {
    for function in functions() {
        for i in 0..500 {
            let a = 3.0 * number(&[i, 5]);
            let a = if of_squares(function) { a.abs() } else { a };
            let near = |x: f64| (a - x).abs() < 0.02;
            if [-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.5]
                .into_iter()
                .any(near)
            {
                continue;
            }
            let h = 1e-5;
            let slope = (function.value(a + h) - function.value(a - h)) / (2.0 * h);
            let bend = (function.slope(a + h) - function.slope(a - h)) / (2.0 * h);
            let close = |x: f64, y: f64| (x - y).abs() < 1e-6 * (1.0 + x.abs() + y.abs());
            assert!(close(slope, function.slope(a)), "{function:?}′ at {a}");
            assert!(close(bend, function.bend(a)), "{function:?}″ at {a}");
        }
    }
}
