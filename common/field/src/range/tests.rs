//! The conformance suite of all arithmetics: what a range says holds at every point of it; derivatives are those of differences.

use super::function::Function;
use super::profile::Profile;
use super::{Affine, Arithmetic, Cell, Jet, Place, Reduced, Segment, Slope};
use crate::arithmetic::{Binary, Unary};
use crate::curve::{Curve, Join};
use crate::hash::{hash, unit};
use crate::interval::Interval;
use crate::noise::sparse::Kernel;
use crate::number::Number;
use crate::program::tests::{noise_zoo, zoo};
use crate::{Points, Program, Scratch, SimdLevel};

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

fn functions() -> Vec<Function> {
    let mut all: Vec<Function> = UNARY.into_iter().map(Function::Unary).collect();
    all.extend([0.3, 0.5, 1.0, 2.0, 3.3].map(Function::Power));
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

fn profiles() -> [Profile; 5] {
    let [a, b, c] = Kernel::ALL.map(Profile::Radial);
    [a, b, c, Profile::Simplex, Profile::Spline]
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

/// Whether a form holds `value` where its shared symbols are `e`.
fn holds<const N: usize>(form: &Reduced<N>, e: [f64; N], value: f64) -> bool {
    if value.is_nan() || form.error.is_infinite() {
        return form.error.is_infinite() || value.is_nan();
    }
    let shared: f64 = form.along.iter().zip(e).map(|(x, e)| x * e).sum();
    (value - (form.centre + shared)).abs() <= form.error * (1.0 + 1e-12) + 1e-15 * form.centre.abs()
}

/// Chains of random operations on a few numbers of two shared symbols; at each, all arithmetics against points.
fn chains(count: u32) {
    const E: usize = 3;
    let curve = Curve::new(Join::Smooth, &[-2.0, 1.0, 0.0, 3.0, 1.0, 2.5, 4.0, -2.0]);
    for i in 0..count {
        let e: [f64; E] = [0, 1, 2].map(|k| number(&[i, k, 77]));
        let size = scale(&[i, 78]);
        let start = |k: u32| {
            let along = [0, 1, 2].map(|axis| size * number(&[i, k, axis, 79]));
            Reduced::<E>::of_symbols(3.0 * number(&[i, k, 80]), along)
        };
        let value = |form: &Reduced<E>| {
            form.centre + form.along.iter().zip(e).map(|(x, e)| x * e).sum::<f64>()
        };
        let mut forms: Vec<Reduced<E>> = (0..3).map(start).collect();
        let mut points: Vec<f64> = forms.iter().map(value).collect();
        // A point computed otherwise than the form may round otherwise.
        for form in &mut forms {
            *form = form.blurred(1e-14);
        }
        let mut full: Vec<Affine> = forms.iter().map(Affine::from_reduced).collect();
        let mut spans: Vec<Interval> = forms.iter().map(Reduced::interval).collect();
        for step in 0..12u32 {
            let pick = |k: u32| hash(&[i, step, k]) as usize % 3;
            let (a, b, c, to) = (pick(0), pick(1), pick(2), pick(3));
            let kind = hash(&[i, step, 4]) % 24;
            let profile = Function::Profile(profiles()[pick(5) + usize::from(pick(6) == 0)]);
            macro_rules! act {
                ($list:ident) => {{
                    let [x, y, z] = [a, b, c].map(|k| $list[k].clone());
                    let result = match kind {
                        0..6 => BINARY[kind as usize].of_numbers(x, y),
                        6..12 => x.unary(UNARY[kind as usize - 6]),
                        12 => x.select(y, z),
                        13 => x.clamp01(),
                        14 => x.square(),
                        15 => x.power(0.7),
                        16 => x.apply(Function::Quintic),
                        17 => Arithmetic::distance([x, y, z]),
                        18 => x.apply(Function::SmoothStep(-1.0, 2.5)),
                        19 => x.curve(&curve),
                        20 => x.square().apply(profile),
                        21 => x.apply(Function::Profile(Profile::Spline)),
                        22 => x.square().sqrt().apply(Function::OntoSphere(2.0)).mul(y),
                        _ => x.times(-0.37).plus(y),
                    };
                    $list[to] = result;
                }};
            }
            act!(points);
            act!(forms);
            act!(full);
            act!(spans);
            let point = points[to];
            let told = || format!("chain {i}, step {step}, operation {kind}: {point}");
            assert!(holds(&forms[to], e, point), "{}: {:?}", told(), forms[to]);
            let condensed = full[to].to_reduced::<E>();
            assert!(holds(&condensed, e, point), "{}: {condensed:?}", told());
            assert!(
                point.is_nan() || spans[to].contains(point),
                "{}: {:?}",
                told(),
                spans[to]
            );
            if point.is_nan() || point.abs() > 1e6 {
                break;
            }
        }
    }
}

#[test]
fn chains_of_operations_hold_their_points() {
    chains(12_000);
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_million_operations_hold_their_points() {
    chains(300_000);
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
        assert!(
            !correlated || forms < 0.7 * intervals,
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

#[test]
fn every_field_stays_within_its_ranges_over_boxes_and_cells() {
    for (name, program) in zoo().into_iter().chain(noise_zoo()) {
        over_cells(&name, &program, 250);
    }
}

/// Boxes, their slopes and cells of three symbols against points, `count` times.
fn over_cells(name: &str, program: &Program, count: u32) {
    for i in 0..count {
        let part = |k: u32| number(&[i, k, 41]);
        let size = scale(&[i, 9, 41]);
        let centre = [0, 1, 2].map(|k| 2.0 * part(k));
        let edges = [0, 1, 2].map(|a| [0, 1, 2].map(|k| size * part(10 + 3 * a + k)));
        let cell = Cell::of_edges(centre, edges);
        let form = program.over_cell(&cell);
        let reach = [0, 1, 2].map(|k| {
            let half: f64 = edges.iter().map(|edge| edge[k].abs()).sum();
            Interval::point(centre[k]).expand(half)
        });
        let zero = Interval::point(0.0);
        let over = program.over_box(reach, zero, zero);
        let slopes = program.slopes_over_box(reach, zero, 0.0);
        for j in 0..8u32 {
            let e = [0, 1, 2].map(|k| number(&[i, j, k, 42]));
            let at = [0, 1, 2]
                .map(|k| centre[k] + e[0] * edges[0][k] + e[1] * edges[1][k] + e[2] * edges[2][k]);
            let place = Place {
                at,
                footprint: 0.0,
                time: 0.0,
            };
            let value = program.at(&place);
            let told = || format!("{name} at {place:?} of {centre:?} {edges:?}: {value}");
            assert!(over.contains(value), "{}: {over:?}", told());
            assert!(slopes.value.contains(value), "{}: {slopes:?}", told());
            let blur = 1e-14 / size * form.along.iter().map(|x| x.abs()).sum::<f64>();
            assert!(holds(&form.blurred(blur), e, value), "{}: {form:?}", told());
            let jet = program.jet(&place);
            for (slope, exact) in slopes.slopes.iter().zip(jet.gradient) {
                let room = slope.expand(1e-9 * (1.0 + exact.abs()));
                assert!(
                    !exact.is_finite() || room.contains(exact),
                    "{}: {exact} outside {slope:?}",
                    told()
                );
            }
        }
    }
}

#[test]
fn cells_of_rays_hold_their_rays() {
    let (_, program) = zoo()
        .into_iter()
        .find(|(name, _)| name.starts_with("spheres"))
        .unwrap();
    for i in 0..400u32 {
        let part = |k: u32| number(&[i, k, 51]);
        let origin = [0, 1, 2].map(|k| 3.0 * part(k));
        let direction = [0, 1, 2].map(|k| part(3 + k));
        let [across, up] = [6, 9].map(|from| [0, 1, 2].map(|k| 0.01 * part(from + k)));
        let t = Interval::new(1.0 + part(20), 1.0 + part(20) + 0.3 * (1.0 + part(21)));
        let form = program.over_cell(&Cell::of_rays(origin, [direction, across, up], t));
        for j in 0..10u32 {
            let e = [0, 1, 2].map(|k| number(&[i, j, k, 52]));
            let along = 0.5 * (t.low + t.high) + e[0] * 0.5 * t.width();
            let at = [0, 1, 2]
                .map(|k| origin[k] + along * (direction[k] + e[1] * across[k] + e[2] * up[k]));
            let value = program.at(&Place {
                at,
                footprint: 0.0,
                time: 0.0,
            });
            assert!(holds(&form.blurred(1e-13), e, value), "{value}: {form:?}");
        }
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
fn standard_and_reduced_forms_convert_without_loss() {
    let form = Reduced {
        centre: 2.0,
        along: [0.5, -0.25, 0.125],
        error: 0.0625,
    };
    let back: Reduced<3> = Affine::from_reduced(&form).to_reduced();
    assert_eq!((back.centre, back.along), (form.centre, form.along));
    assert!(back.error >= form.error && back.error < form.error * (1.0 + 1e-12));
    // x − x is 0 where the symbols are known, and 2 errors wide where they are not.
    let full = Affine::from_reduced(&form);
    let nothing = full.clone().minus(full).to_reduced::<3>();
    assert!(nothing.radius() < 1e-13);
    let apart = form.minus(form);
    assert!((apart.radius() - 0.125).abs() < 1e-12);
}

#[test]
fn long_chains_keep_their_symbols_bounded_and_their_points() {
    let t = Reduced::of_symbols(0.3, [0.05]);
    let mut form = Affine::from_reduced(&t);
    let mut point = 0.3 + 0.05 * 0.7;
    let (first, start) = (form.clone(), point);
    for _ in 0..400 {
        form = form
            .clone()
            .mul(first.clone())
            .plus(form.unary(Unary::Sin).times(0.5));
        point = point * start + point.value_of_sine() * 0.5;
        let reduced = form.to_reduced::<1>();
        assert!(
            holds(&reduced.blurred(1e-15), [0.7], point),
            "{point}: {reduced:?}"
        );
    }
}

trait Sine {
    fn value_of_sine(self) -> f64;
}

impl Sine for f64 {
    fn value_of_sine(self) -> f64 {
        Unary::Sin.value(self)
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
