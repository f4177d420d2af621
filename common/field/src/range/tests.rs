//! The conformance suite of all arithmetics: what a range says holds at every point of it; derivatives are those of differences.

mod cells;
mod chains;
mod functions;
mod lattices;
mod lines;

use super::function::Function;
use super::profile::Profile;
use super::{Affine, Arithmetic, Jet, Place, Reduced, Segment, Slope};
use crate::arithmetic::{Binary, Unary};
use crate::curve::{Curve, Join};
use crate::hash::{hash, unit};
use crate::interval::Interval;
use crate::noise::sparse::Kernel;
use crate::number::Number;
use crate::program::tests::{noise_zoo, zoo};
use crate::{Points, Program, Scratch, SimdLevel};
use cells::over_cells;

/// Random numbers in [−1, 1], by name.
fn number(words: &[u32]) -> f64 {
    2.0 * unit(hash(words)) - 1.0
}

/// A scale between 2⁻³⁰ and 8, evenly in the exponent.
fn scale(words: &[u32]) -> f64 {
    libm::exp2(-13.5 + 16.5 * number(words))
}

const UNARY: [Unary; 6] = [
    Unary::Neg,
    Unary::Abs,
    Unary::Sqrt,
    Unary::Sin,
    Unary::Cos,
    Unary::Exp,
];

const BINARY: [Binary; 6] = [
    Binary::Add,
    Binary::Sub,
    Binary::Mul,
    Binary::Div,
    Binary::Min,
    Binary::Max,
];

fn profiles() -> [Profile; 5] {
    let [a, b, c] = Kernel::ALL.map(Profile::Radial);
    [a, b, c, Profile::Simplex, Profile::Spline]
}

/// Whether a form holds `value` where its shared symbols are `e`.
fn holds<const N: usize>(form: &Reduced<N>, e: [f64; N], value: f64) -> bool {
    if value.is_nan() || form.error.is_infinite() {
        return form.error.is_infinite() || value.is_nan();
    }
    let shared: f64 = form.along.iter().zip(e).map(|(x, e)| x * e).sum();
    (value - (form.centre + shared)).abs() <= form.error * (1.0 + 1e-12) + 1e-15 * form.centre.abs()
}

/// Calls with random segments, long and short, and some of their places with t in [−1, 1] of the segment.
fn over_segments(count: u32, mut check: impl FnMut(&Segment, &[(f64, Place)])) {
    for i in 0..count {
        let part = |k: u32| number(&[i, k, 31]);
        let direction = [part(3), part(4), part(5)];
        let length = crate::arithmetic::length(direction) + 1e-9;
        let direction = direction.map(|x| x / length);
        let half = 0.5 * scale(&[i, 6, 31]);
        let middle = 2.0 + part(7);
        let origin = [part(0), part(1), part(2)].map(|x| 1.7 * x);
        let origin = [0, 1, 2].map(|k| origin[k] - middle * direction[k]);
        let t = Interval::new(middle - half, middle + half);
        let least = if i % 3 == 0 {
            0.0
        } else {
            0.01 * (1.0 + part(8))
        };
        let footprint = Interval::new(least, least * (1.0 + f64::from(i % 2)));
        let segment = Segment {
            origin,
            direction,
            t,
            footprint,
            time: unit(hash(&[i, 9, 31])),
        };
        let places = [0u32, 1, 2, 3, 4].map(|j| {
            let e = if j < 2 {
                2.0 * f64::from(j) - 1.0
            } else {
                number(&[i, j, 32])
            };
            let at = middle + e * half;
            let at = if at > t.high {
                t.high
            } else if at < t.low {
                t.low
            } else {
                at
            };
            let share = unit(hash(&[i, j, 33]));
            let place = Place {
                at: [0, 1, 2].map(|k| origin[k] + at * direction[k]),
                footprint: footprint.low + share * footprint.width(),
                time: segment.time,
            };
            ((at - middle) / half, place)
        });
        check(&segment, &places);
    }
}

/// How wide ranges are along short segments, by intervals and by affine forms; adds nothing where they say nothing.
#[derive(Default)]
struct Widths {
    intervals: f64,
    forms: f64,
}

/// Every arithmetic against points along `count` segments of a field.
fn along(name: &str, program: &Program, count: u32) -> Widths {
    let mut widths = Widths::default();
    over_segments(count, |segment, places| {
        let interval = program.along_interval(segment);
        let reduced = program.along_reduced(segment);
        let affine = program.along_affine(segment);
        let slope = program.along_slope(segment);
        for (e, place) in places {
            let value = program.at(place);
            let told = || format!("{name} at {place:?} of {segment:?}: {value}");
            assert!(interval.contains(value), "{}: {interval:?}", told());
            assert!(slope.value.contains(value), "{}: {slope:?}", told());
            // e is good to the rounding of the segment's middle.
            let blur = 1e-14 / segment.t.width() * reduced.along[0].abs();
            assert!(
                holds(&reduced.blurred(blur), [*e], value),
                "{}: {reduced:?}",
                told()
            );
            let blur = 1e-14 / segment.t.width() * affine.along[0].abs();
            assert!(
                holds(&affine.blurred(blur), [*e], value),
                "{}: {affine:?}",
                told()
            );
        }
        let short = segment.t.width() < 0.02 && segment.t.width() > 1e-3;
        if short && interval.magnitude() < 100.0 && reduced.error < 100.0 {
            widths.intervals += interval.width();
            widths.forms += reduced.interval().width();
        }
    });
    widths
}

#[test]
fn every_field_stays_within_its_ranges_along_segments() {
    // Most shapes are known by their bounds alone, and those are intervals.
    let shapes: Vec<String> = crate::shape::tests::zoo()
        .into_iter()
        .map(|(name, ..)| name)
        .collect();
    let mut sum = Widths::default();
    for (name, program) in zoo() {
        let widths = along(&name, &program, 500);
        if !shapes.contains(&name) {
            sum.intervals += widths.intervals;
            sum.forms += widths.forms;
        }
    }
    // Along short segments correlation is worth more than half of the width.
    let Widths { intervals, forms } = sum;
    assert!(
        forms < 0.5 * intervals,
        "affine {forms}, intervals {intervals}"
    );
}

#[test]
fn every_noise_stays_within_its_ranges_along_segments() {
    for (name, program) in noise_zoo() {
        let Widths { intervals, forms } = along(&name, &program, 1_000);
        // A gradient's components are known as intervals.
        let correlated = !name.starts_with("gradient of");
        // Two ways to a node have less to correlate than three.
        let share = if name.starts_with("cellular plane") {
            0.85
        } else {
            0.7
        };
        assert!(
            !correlated || forms < share * intervals,
            "{name}: affine {forms}, intervals {intervals}"
        );
    }
}

/// Three million places of noises, by every arithmetic; half of one of everything else.
#[test]
#[ignore = "long: tests/run --all"]
fn millions_of_places_stay_within_their_ranges() {
    let long = |(name, program): &(String, Program), count| {
        along(name, program, count);
        over_cells(name, program, count / 8);
    };
    let (fields, noises) = (zoo(), noise_zoo());
    std::thread::scope(|scope| {
        for thread in 0..2 {
            let (fields, noises) = (&fields, &noises);
            scope.spawn(move || {
                for field in noises.iter().skip(thread).step_by(2) {
                    long(field, 20_000);
                }
                for field in fields.iter().skip(thread).step_by(2) {
                    long(field, 1_500);
                }
            });
        }
    });
}

#[test]
fn slopes_along_segments_hold_every_chord() {
    for (name, program) in zoo().into_iter().chain(noise_zoo()) {
        if name == "select" {
            continue;
        }
        over_segments(300, |segment, places| {
            let footprint = Interval::point(segment.footprint.low);
            let segment = Segment {
                footprint,
                ..*segment
            };
            let slope = program.along_slope(&segment);
            for pair in places.windows(2) {
                let apart = (pair[1].0 - pair[0].0) * 0.5 * segment.t.width();
                let value = |place: &Place| {
                    program.at(&Place {
                        footprint: footprint.low,
                        ..*place
                    })
                };
                let (a, b) = (value(&pair[0].1), value(&pair[1].1));
                let chord = (b - a) / apart;
                // Noises are in f32.
                let blur = 1e-4 * (1.0 + a.abs() + b.abs()) / apart.abs();
                assert!(
                    !chord.is_finite() || slope.slopes[0].expand(blur).contains(chord),
                    "{name}: {chord} over {segment:?}, {slope:?}"
                );
            }
        });
    }
}

/// The program's own value and gradient at one place.
fn evaluated(program: &Program, place: &Place) -> (f64, [f64; 3]) {
    let [x, y, z] = place.at;
    let points = Points {
        x: &[x],
        y: &[y],
        z: &[z],
        footprint: &[place.footprint],
        time: &[place.time],
    };
    let (mut value, mut gradient) = ([0.0], [[0.0]; 3]);
    let [gx, gy, gz] = &mut gradient;
    program.evaluate_gradient(
        SimdLevel::best(),
        &points,
        &mut Scratch::new(),
        &mut value,
        [gx, gy, gz],
    );
    (value[0], gradient.map(|part| part[0]))
}

#[test]
fn points_and_jets_are_what_evaluation_gives() {
    for (name, program) in zoo().into_iter().chain(noise_zoo()) {
        over_segments(150, |_, places| {
            for (_, place) in places {
                let (value, gradient) = evaluated(&program, place);
                let jet = program.jet(place);
                assert_eq!(program.at(place).to_bits(), value.to_bits(), "{name}");
                assert!(
                    jet.value.to_bits() == value.to_bits() || jet.value.is_nan(),
                    "{name}"
                );
                for (mine, exact) in jet.gradient.into_iter().zip(gradient) {
                    let room = 1e-4 * (1.0 + mine.abs() + jet.value.abs());
                    assert!(
                        !mine.is_finite() || (mine - exact).abs() < room,
                        "{name} at {place:?}: {mine} {exact}"
                    );
                }
            }
        });
    }
}

#[test]
fn hessians_are_the_differences_of_gradients() {
    for (name, program) in zoo() {
        // So near its centre a planet's ground changes within nanometres.
        if name == "planet" {
            continue;
        }
        let (mut seen, mut off) = (0, 0);
        // A noise's value is in f32: where it multiplies a slope, differences over short ways see its steps.
        let smooth = !["basis", "ridged", "warp"]
            .iter()
            .any(|word| name.contains(word))
            || name.contains("fbm basis 0");
        let (h, room, share) = if smooth {
            (1e-5, 1e-4, 40)
        } else {
            (1e-4, 1e-2, 10)
        };
        over_segments(120, |_, places| {
            let place = places[2].1;
            let here = program.jet(&place);
            for k in 0..3 {
                let beside = |by: f64| {
                    let mut at = place.at;
                    at[k] += by;
                    program.jet(&Place { at, ..place }).gradient
                };
                let (a, b) = (beside(h), beside(-h));
                for j in 0..3 {
                    let exact = (a[j] - b[j]) / (2.0 * h);
                    let mine = here.hessian[j][k];
                    assert!(
                        mine == here.hessian[k][j]
                            || (mine - here.hessian[k][j]).abs() < 1e-9 * mine.abs(),
                        "{name}: the Hessian is symmetric"
                    );
                    if !exact.is_finite() || !mine.is_finite() {
                        continue;
                    }
                    seen += 1;
                    // A corner between the two places leaves a difference that is no derivative.
                    off += u32::from((mine - exact).abs() > room * (10.0 + mine.abs()));
                }
            }
        });
        assert!(seen > 500 && off * share < seen, "{name}: {off} of {seen}");
    }
}

#[test]
fn what_is_unknown_stays_unknown_and_nothing_panics() {
    let wild = [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e300, -0.0];
    for (name, program) in zoo().into_iter().chain(noise_zoo()) {
        for a in wild {
            for b in wild {
                let place = Place {
                    at: [a, b, 0.5],
                    footprint: 0.0,
                    time: 0.0,
                };
                let value = program.at(&place);
                let all = [
                    Interval::ALL,
                    Interval::new(-1e300, 1e300),
                    Interval::point(0.5),
                ];
                let zero = Interval::point(0.0);
                let over = program.over_box(all, zero, zero);
                assert!(over.low <= over.high, "{name}: {over:?}");
                let _ = (
                    value,
                    program.jet(&place),
                    program.slopes_over_box(all, zero, 0.0),
                );
                let segment = Segment {
                    origin: [a, b, 0.0],
                    direction: [1.0, b, 0.0],
                    t: Interval::new(0.0, 1e300),
                    footprint: zero,
                    time: 0.0,
                };
                let form = program.along_reduced(&segment);
                assert!(form.error >= 0.0, "{name}: {form:?}");
                assert!(program.along_affine(&segment).error >= 0.0, "{name}");
            }
        }
    }
    let lost = Slope::<1>::any(Interval::ALL).mul(Slope::constant(0.0));
    assert!(lost.value.contains(0.0));
    assert_eq!(Jet::constant(2.0).over(Jet::constant(4.0)).value, 0.5);
}
