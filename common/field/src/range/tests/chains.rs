//! Operations on numbers, one after the other, in all arithmetics at once.

use super::*;

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
