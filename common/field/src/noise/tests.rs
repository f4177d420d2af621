//! The laws of every noise: derivatives, means, ranges, slopes, wrapping, planets.

use super::Noise;
use crate::hash::{hash, unit};
use crate::op::Op;
use crate::program::tests::noises;

fn all() -> Vec<(String, Noise)> {
    let mut list = noises();
    list.insert(0, ("gradient".to_owned(), Op::Noise, vec![5.0]));
    list.into_iter()
        .map(|(name, op, params)| {
            let noise = Noise::new(op, &params).unwrap();
            (name, noise)
        })
        .collect()
}

fn place(i: u32) -> [f64; 3] {
    [0, 1, 2].map(|k| 4000.0 * unit(hash(&[i, k])) - 2000.0)
}

fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

#[test]
fn gradients_are_derivatives() {
    for (name, noise) in all() {
        // Small where creases are many, not so small that f32 shows.
        let step = if noise.bend().is_finite() {
            1.0 / 512.0
        } else {
            1.0 / 4096.0
        };
        let (mut wrong, mut places) = (0, 0);
        for i in 0..1500 {
            let p = place(i);
            let gradient = noise.gradient_at(p);
            for axis in 0..3 {
                let at = |by: f64| {
                    let mut q = p;
                    q[axis] += by;
                    noise.value_at(q)
                };
                let seen = (at(step) - at(-step)) / (2.0 * step);
                wrong += u32::from((seen - gradient[axis]).abs() > 0.01 + 0.003 * noise.slope());
                places += 1;
            }
        }
        // Creases of distances, borders of linear kernels.
        let allowed = if noise.bend().is_finite() {
            0
        } else {
            places / 40
        };
        assert!(wrong <= allowed, "{name}: {wrong} of {places}");
    }
}

#[test]
fn hessians_are_derivatives_of_gradients() {
    const STEP: f64 = 1.0 / 256.0;
    for (name, noise) in all() {
        if !noise.bend().is_finite() {
            continue;
        }
        let (mut wrong, mut places, mut most) = (0, 0, 0.0f64);
        for i in 0..600 {
            let p = place(i);
            for axis in 0..3 {
                let at = |by: f64| {
                    let mut q = p;
                    q[axis] += by;
                    noise.gradient_at(q)
                };
                let (after, before) = (at(STEP), at(-STEP));
                let hessian = noise.hessian_at(p);
                let seen = [0, 1, 2].map(|k| (after[k] - before[k]) / (2.0 * STEP));
                most = most.max(norm(seen));
                for k in 0..3 {
                    let off = (seen[k] - hessian[axis][k]).abs();
                    wrong += u32::from(off > 0.05 + 0.005 * noise.bend());
                    places += 1;
                }
            }
        }
        // Lewis's second derivative jumps at the borders of its kernels.
        assert!(wrong * 40 <= places, "{name}: {wrong} of {places}");
        assert!(
            most <= noise.bend(),
            "{name}: {most} above {}",
            noise.bend()
        );
        assert!(
            most > noise.bend() * 0.001,
            "{name}: {most} of {}",
            noise.bend()
        );
    }
}

#[test]
fn all_derivatives_come_with_the_same_value() {
    for (name, noise) in all() {
        for i in 0..2000 {
            let cell = [0, 1, 2].map(|k| hash(&[i, k]));
            let offset = [3, 4, 5].map(|k| super::node::fraction(hash(&[i, k])));
            let value = noise.value(cell, offset);
            let (jet, jet2) = (noise.jet(cell, offset), noise.jet2(cell, offset));
            assert_eq!(value.to_bits(), jet.value.to_bits(), "{name}");
            assert_eq!(value.to_bits(), jet2.value.to_bits(), "{name}");
            for k in 0..3 {
                assert_eq!(jet.gradient[k], jet2.gradient[k], "{name}");
            }
        }
    }
}

#[test]
fn gradient_noise_is_its_own_file_to_the_bit() {
    let noise = Noise::new(Op::Noise, &[7.0]).unwrap();
    for i in 0..20_000 {
        assert_eq!(noise.value_at(place(i)), super::noise(7, place(i)));
    }
}

/// What share of its range and of its slope bound a noise is seen to reach in 40,000 places.
fn reached(name: &str) -> (f64, f64) {
    match name {
        "value" => (0.95, 0.7),
        "value-gradient" => (0.6, 0.55),
        "gradient" | "simplex" => (0.85, 0.7),
        "cellular" => (0.3, 0.98),
        "cellular edges" => (0.3, 0.9),
        "cellular maximum" => (0.3, 0.9),
        "cellular 4 squared" => (0.08, 0.1),
        "cellular cubed" | "cellular maximum to 2.5" => (0.05, 0.1),
        "cellular plane" => (0.4, 0.98),
        "cellular plane squared" => (0.1, 0.2),
        "wavelet" => (0.2, 0.08),
        name if name.starts_with("spot") => (0.05, 0.01),
        name if name.starts_with("cellular") => (0.2, 0.5),
        name if name.starts_with("disc") => (0.4, 0.2),
        _ => (0.1, 0.05),
    }
}

#[test]
fn values_and_slopes_stay_below_their_bounds_and_come_near_and_means_are_zero() {
    for (name, noise) in all() {
        const COUNT: u32 = 40_000;
        let range = noise.range();
        let (mut low, mut high, mut steepest, mut sum, mut squares) =
            (0.0f64, 0.0f64, 0.0f64, 0.0, 0.0);
        for i in 0..COUNT {
            let p = place(i);
            let value = noise.value_at(p);
            assert!(range.contains(value), "{name}: {value} outside {range:?}");
            (low, high) = (low.min(value), high.max(value));
            steepest = steepest.max(norm(noise.gradient_at(p)));
            sum += value;
            squares += value * value;
        }
        let mean = sum / f64::from(COUNT);
        let deviation = (squares / f64::from(COUNT)).sqrt();
        println!(
            "{name:20} mean {mean:8.5} deviation {deviation:.4} values {low:.3} to {high:.3} of {:.3} to {:.3}, slope {steepest:.3} of {:.3}",
            range.low,
            range.high,
            noise.slope()
        );
        assert!(
            mean.abs() < 6.0 * deviation / f64::from(COUNT).sqrt(),
            "{name}: mean {mean}"
        );
        let slope = noise.slope() + noise.slope_rounding();
        assert!(steepest <= slope, "{name}: {steepest} above {slope}");
        let (values, slopes) = reached(&name);
        let share = (high - low) / range.width();
        assert!(share > values, "{name}: {share} of the range");
        assert!(steepest > slopes * slope, "{name}: {steepest} of {slope}");
    }
}

#[test]
fn cells_wrap_at_two_to_the_32_and_differ_on_a_planet() {
    for (name, noise) in all() {
        let around = if noise.is_skewed() {
            2_147_483_648.0
        } else {
            4_294_967_296.0
        };
        let p = [0.25, 0.5, 0.75];
        let q = if noise.is_skewed() {
            // Skewed coordinates wrap: their greatest common period runs along the diagonal.
            p.map(|x| x + around)
        } else {
            [p[0] + around, p[1] - around, p[2]]
        };
        assert!(
            (noise.value_at(p) - noise.value_at(q)).abs() < 1e-5,
            "{name}"
        );
        let far = 6_371_000.0 * 8.0;
        let at = |x: f64| noise.value_at([x, 0.2, 0.6]);
        assert_ne!(at(far + 0.3), at(0.3), "{name}");
        let step = at(far + 0.3 + 1e-6) - at(far + 0.3);
        assert!(
            step.abs() <= noise.slope() * 1.1e-6 + 2.0 * noise.rounding(),
            "{name}: {step}"
        );
        let bent = (0..200).map(|i| at(far + f64::from(i) * 1e-3));
        let values: Vec<f64> = bent.collect();
        for pair in values.windows(2) {
            let change = (pair[1] - pair[0]).abs();
            assert!(
                change <= noise.slope() * 1.001e-3 + 2.0 * noise.rounding(),
                "{name}: {change}"
            );
        }
        assert!(noise.value_at([f64::INFINITY, 0.0, 0.0]).is_nan(), "{name}");
    }
}

#[test]
fn noises_of_two_dimensions_do_not_change_along_the_third() {
    let planar = all().into_iter().filter(|(name, _)| name.contains("plane"));
    let mut count = 0;
    for (name, noise) in planar {
        count += 1;
        for i in 0..2000 {
            let [x, y, z] = place(i);
            let (here, there) = ([x, y, z], [x, y, 0.5 * z - 7.25]);
            assert_eq!(noise.value_at(here), noise.value_at(there), "{name}");
            assert_eq!(noise.gradient_at(here)[2], 0.0, "{name}");
        }
    }
    assert_eq!(count, 6);
}

#[test]
fn keys_make_other_noises() {
    for (name, noise) in all() {
        let other = noise.keyed(99);
        assert_eq!(other.keyed(99), other, "{name}");
        let (mut dot, mut square) = (0.0, 0.0);
        for i in 0..4000 {
            let (a, b) = (noise.value_at(place(i)), other.value_at(place(i)));
            dot += a * b;
            square += a * a;
        }
        assert!(dot.abs() < 0.1 * square, "{name}: {}", dot / square);
    }
}
