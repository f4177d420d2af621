//! The experiment is the thesis's.

use field::hash::{hash, unit};
use field::{Interval, Place};

use super::cells::{Cells, Known};
use super::thesis::{Experiment, NAMES, lipschitz};

#[test]
fn fields_are_eq_5_11_with_the_bound_of_eq_5_12() {
    let experiment = Experiment::embedded().unwrap();
    let names: Vec<&str> = experiment.noises.iter().map(|n| n.name.as_str()).collect();
    assert_eq!(names, NAMES);
    let setting = experiment.noises[0].setting().unwrap();
    assert_eq!(
        setting.field,
        "length(p) - 1 + 0.3*noise(4*p) + 0.15*noise(8*p) + 0.05*noise(16*p)"
    );
    assert!((lipschitz(3.75) - 13.0).abs() < 1e-12);
    assert!((lipschitz(2.75) - 9.8).abs() < 1e-12);
    assert!((setting.radius - 1.5185).abs() < 1e-12);
    let (origin, direction) = setting.ray([0.5, -0.5]);
    assert_eq!(direction, [0.0, 1.0, 0.0]);
    assert!((origin[0] - 1.6).abs() < 1e-12 && (origin[2] + 1.6).abs() < 1e-12);
    assert!(
        experiment
            .noises
            .iter()
            .all(|noise| noise.found().is_some())
    );
}

#[test]
fn the_last_slope_of_each_noise_is_a_bound() {
    let experiment = Experiment::embedded().unwrap();
    for noise in &experiment.noises {
        let setting = noise.setting().unwrap();
        let most = lipschitz(*noise.lambda.last().unwrap());
        let mut steepest = 0.0f64;
        for i in 0..20_000u32 {
            let at = [0, 1, 2].map(|k| 3.0 * unit(hash(&[i, k])) - 1.5);
            let place = Place {
                at,
                footprint: 0.0,
                time: 0.0,
            };
            let [x, y, z] = setting.program.jet(&place).gradient;
            steepest = steepest.max((x * x + y * y + z * z).sqrt());
        }
        assert!(steepest < most, "{}: {steepest}", noise.name);
        // Outside of the bound nothing is inside: no root is looked for there.
        let far = Interval::new(setting.radius, 2.0 * setting.radius);
        let zero = Interval::point(0.0);
        let beyond = setting.program.over_box([far, zero, zero], zero, zero);
        assert!(noise.name == "sparse" || beyond.high > 0.0, "{beyond:?}");
    }
}

#[test]
fn cells_bound_the_noise_within_them() {
    let along = [0.0, 0.6, 0.8];
    let alone = scene::expression("noise(p)", &[]).unwrap();
    let noise = field::Program::compile(&alone.graph, &[alone.root], Interval::point(0.0)).unwrap();
    let [length, fall] =
        [Known::Length, Known::Fall].map(|known| Cells::new(along, known).unwrap());
    let (mut sums, mut falls) = (0.0, 0.0);
    for cell in 0..40i64 {
        let cell = [cell, -cell, 3];
        let (mut steepest, mut steepest_fall) = (0.0f64, 0.0f64);
        for i in 0..400u32 {
            let at =
                [(0, 0), (1, 1), (2, 2)].map(|(k, word)| cell[k] as f64 + unit(hash(&[i, word])));
            let place = Place {
                at,
                footprint: 0.0,
                time: 0.0,
            };
            let [x, y, z] = noise.jet(&place).gradient;
            steepest = steepest.max((x * x + y * y + z * z).sqrt());
            steepest_fall = steepest_fall.max(-(0.6 * y + 0.8 * z));
        }
        assert!(steepest <= length.bound(cell), "{cell:?}: {steepest}");
        assert!(
            steepest_fall <= fall.bound(cell),
            "{cell:?}: {steepest_fall}"
        );
        sums += length.bound(cell) / 40.0;
        falls += fall.bound(cell) / 40.0;
    }
    // What a cell proves of its gradient's length in so few boxes is hardly less than the bound of all cells; of its fall it is.
    assert!(falls < 0.95 * sums && sums <= 3.75, "{falls} {sums}");
}
