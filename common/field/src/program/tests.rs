//! Evaluation: every operation, every level, the same bits; gradients against differences; batches and places.

use crate::hash::{hash, unit};
use crate::{Graph, Interval, NodeId, Op, Points, Program, Scratch, SimdLevel};

/// Named fields that together use every operation.
pub(crate) fn zoo() -> Vec<(String, Program)> {
    let mut zoo = Vec::new();
    let mut add = |name: &str, build: &dyn Fn(&mut Graph) -> NodeId| {
        let mut graph = Graph::new();
        let root = build(&mut graph);
        let program = Program::compile(&graph, &[root], Interval::new(0.0, 1.0)).unwrap();
        zoo.push((name.to_owned(), program));
    };
    for op in [Op::Neg, Op::Abs, Op::Sqrt, Op::Sin, Op::Cos, Op::Exp] {
        add(op.signature().name, &|g| {
            let [x, ..] = position(g);
            g.push(op, &[x], &[]).unwrap()
        });
    }
    for op in [Op::Add, Op::Sub, Op::Mul, Op::Div, Op::Min, Op::Max] {
        add(op.signature().name, &|g| {
            let [x, y, _] = position(g);
            g.push(op, &[x, y], &[]).unwrap()
        });
    }
    for exponent in [0.5, 1.0, 1.5, 2.0, 2.5, 3.3] {
        add(&format!("pow {exponent}"), &|g| {
            let [x, ..] = position(g);
            g.push(Op::Power, &[x], &[exponent]).unwrap()
        });
    }
    add("smoothstep", &|g| {
        let [x, ..] = position(g);
        g.push(Op::SmoothStep, &[x], &[-1.0, 2.5]).unwrap()
    });
    add("select", &|g| {
        let [x, y, z] = position(g);
        g.push(Op::Select, &[x, y, z], &[]).unwrap()
    });
    for op in [Op::Linear, Op::Smooth] {
        add(op.signature().name, &|g| {
            let [x, _, _] = position(g);
            let t = g.push(Op::Time, &[], &[]).unwrap();
            let t = g.push(Op::Add, &[x, t], &[]).unwrap();
            g.push(op, &[t], &[-3.0, 1.0, -1.0, 2.0, 0.5, -4.0, 2.0, -5.0])
                .unwrap()
        });
    }
    add("vectors", &|g| {
        let [x, y, z] = position(g);
        let p = g.push(Op::Position, &[], &[]).unwrap();
        let q = g.push(Op::Vector, &[z, x, y], &[]).unwrap();
        let sum = g.push(Op::VectorAdd, &[p, q], &[]).unwrap();
        let difference = g.push(Op::VectorSub, &[sum, q], &[]).unwrap();
        let scaled = g.push(Op::Scale, &[difference, x], &[]).unwrap();
        let plane = g.push(Op::OntoPlane, &[q], &[]).unwrap();
        let dot = g.push(Op::Dot, &[scaled, plane], &[]).unwrap();
        let length = g.push(Op::Length, &[plane], &[]).unwrap();
        g.push(Op::Add, &[dot, length], &[]).unwrap()
    });
    add("onto_sphere", &|g| {
        let p = g.push(Op::Position, &[], &[]).unwrap();
        let q = g.push(Op::OntoSphere, &[p], &[2.0]).unwrap();
        let c = [0.3, -0.7, 1.1].map(|c| g.constant(c).unwrap());
        let c = g.push(Op::Vector, &c, &[]).unwrap();
        g.push(Op::Dot, &[q, c], &[]).unwrap()
    });
    add("noise", &|g| {
        let p = scaled(g, 1.7);
        g.push(Op::Noise, &[p], &[5.0]).unwrap()
    });
    add("spheres of fig. 5.6", &fig_5_6);
    for op in [Op::Sum, Op::AltitudeOne, Op::AltitudeTwo] {
        for basis in [0.0, 1.0, 2.0] {
            for detail in [0.0, 1.0] {
                add(
                    &format!("{} basis {basis} detail {detail}", op.signature().name),
                    &|g| {
                        let p = scaled(g, 0.9);
                        let xi = if op == Op::Sum { 0.0 } else { 0.8 };
                        g.push(op, &[p], &[basis, 3.0, 2.0, 0.9, 6.0, xi, detail])
                            .unwrap()
                    },
                );
            }
        }
    }
    for detail in [0.0, 1.5] {
        add(&format!("ridged multifractal detail {detail}"), &|g| {
            let p = scaled(g, 0.9);
            g.push(
                Op::RidgedMultifractal,
                &[p],
                &[3.0, 2.1, 0.8, 7.0, 1.0, 2.0, detail],
            )
            .unwrap()
        });
    }
    for (name, op, params) in grids() {
        add(name, &|g| {
            let p = scaled(g, 2.3);
            g.push(op, &[p], params).unwrap()
        });
    }
    add("planet", &|g| planet(g, 3.0));
    add("warp", &|g| {
        let p = scaled(g, 1.0);
        let [a, b, c] = [1.0, 2.0, 3.0].map(|key| g.push(Op::Noise, &[p], &[key]).unwrap());
        let warp = g.push(Op::Vector, &[a, b, c], &[]).unwrap();
        let q = g.push(Op::VectorAdd, &[p, warp], &[]).unwrap();
        let n = g.push(Op::Noise, &[q], &[4.0]).unwrap();
        let product = g.push(Op::Mul, &[n, a], &[]).unwrap();
        g.push(Op::Min, &[product, b], &[]).unwrap()
    });
    for (name, graph, root) in crate::shape::tests::zoo() {
        let program = Program::compile(&graph, &[root], Interval::new(0.0, 1.0)).unwrap();
        zoo.push((name, program));
    }
    zoo
}

/// Small grids of every recipe, degree and kind of edge.
fn grids() -> [(&'static str, Op, &'static [f64]); 6] {
    [
        (
            "spectral cubic",
            Op::SpectralTerrain,
            &[2.0, 16.0, 0.8, 1.0, 3.0],
        ),
        (
            "spectral quadratic",
            Op::SpectralTerrain,
            &[2.0, 8.0, 0.4, 2.0, 2.0],
        ),
        ("flakes", Op::SpectralTerrain, &[3.0, 8.0, 0.7, 3.0, 3.0]),
        ("sea", Op::Sea, &[32.0, 2.0, 9.0, 0.5, 4.0, 2.0]),
        (
            "midpoints",
            Op::MidpointTerrain,
            &[3.0, 0.0, 0.0, 0.8, 5.0, 3.0],
        ),
        (
            "additions",
            Op::MidpointTerrain,
            &[2.0, 1.0, 1.0, 0.5, 6.0, 2.0],
        ),
    ]
}

/// Fields of every noise but gradient noise.
///
/// Their derivatives are computed in f32, so they are compared with differences less closely than the rest: see `noise::tests`.
pub(crate) fn noise_zoo() -> Vec<(String, Program)> {
    let mut zoo = Vec::new();
    let mut add = |name: String, op: Op, cells: f64, params: &[f64]| {
        let mut g = Graph::new();
        let p = scaled(&mut g, cells);
        let mut root = g.push(op, &[p], params).unwrap();
        if g.kind(root) == crate::Kind::Vector {
            root = g.push(Op::Z, &[root], &[]).unwrap();
        }
        let program = Program::compile(&g, &[root], Interval::new(0.0, 1.0)).unwrap();
        zoo.push((name, program));
    };
    for (name, op, params) in noises() {
        add(name.clone(), op, 0.7, &params);
        let over: Vec<f64> = [f64::from(op.code())].into_iter().chain(params).collect();
        if ["value", "simplex", "sparse quintic", "cellular edges"].contains(&name.as_str()) {
            let cascade = [0.0, 0.0, 3.0, 2.0, 0.9, 3.0, 0.0, 1.0, 1.0, 2.0, 1.0];
            let params: Vec<f64> = cascade.into_iter().chain(over.iter().copied()).collect();
            add(format!("cascade of {name}"), Op::Cascade, 0.5, &params);
        }
        if ["value-gradient", "simplex", "disc quintic", "wavelet"].contains(&name.as_str()) {
            add(format!("gradient of {name}"), Op::NoiseGradient, 0.8, &over);
        }
    }
    zoo
}

/// A noise of every kind with its constants.
pub(crate) fn noises() -> Vec<(String, Op, Vec<f64>)> {
    let mut list = Vec::new();
    let mut add = |name: &str, op: Op, params: &[f64]| {
        list.push((name.to_owned(), op, params.to_vec()));
    };
    add("value", Op::ValueNoise, &[5.0]);
    add("value-gradient", Op::ValueGradientNoise, &[5.0]);
    add("simplex", Op::SimplexNoise, &[5.0]);
    for (kernel, name) in ["Lewis", "quintic", "linear"].into_iter().enumerate() {
        let kernel = [0.0, 1.0, 2.0][kernel];
        add(
            &format!("sparse {name}"),
            Op::SparseNoise,
            &[5.0, 2.0, kernel, 0.0],
        );
        add(
            &format!("disc {name}"),
            Op::SparseNoise,
            &[5.0, 1.0, kernel, 1.0],
        );
        add(
            &format!("plane {name}"),
            Op::SparseNoise,
            &[5.0, 2.0, kernel, 2.0],
        );
    }
    add(
        "spot",
        Op::SpotNoise,
        &[5.0, 1.0, 1.0, 3.0, 0.5, 0.0, 0.0, 0.0],
    );
    add(
        "spot along",
        Op::SpotNoise,
        &[5.0, 2.0, 0.0, 2.0, 0.0, 1.0, 2.0, 0.0],
    );
    add("wavelet", Op::WaveletNoise, &[5.0]);
    let one = [1.0, 0.0, 0.0, 0.0];
    let edges = [-1.0, 1.0, 0.0, 0.0];
    let all = [0.5, -0.25, 0.125, 1.0];
    for (name, norm, density, a, raised) in [
        ("cellular", 2.0, 2.0, one, 0.0),
        ("cellular edges", 2.0, 1.0, edges, 0.0),
        ("cellular Manhattan", 1.0, 2.0, all, 0.0),
        ("cellular maximum", 0.0, 0.5, edges, 0.0),
        ("cellular 1.5", 1.5, 2.0, one, 0.0),
        ("cellular 4 squared", 4.0, 4.0, all, 1.0),
        ("cellular cubed", 2.0, 2.0, one, 2.0),
        ("cellular maximum to 2.5", 0.0, 2.0, edges, 1.5),
        ("cellular plane", 2.0, 2.0, one, 0.0),
        ("cellular plane Manhattan", 1.0, 4.0, edges, 0.0),
        ("cellular plane squared", 2.0, 2.0, all, 1.0),
    ] {
        let params = [5.0, norm, density, a[0], a[1], a[2], a[3], raised, 1.0];
        let op = if name.contains("plane") {
            Op::PlaneCellularNoise
        } else {
            Op::CellularNoise
        };
        add(name, op, &params);
    }
    list
}

pub(crate) fn position(g: &mut Graph) -> [NodeId; 3] {
    let p = g.push(Op::Position, &[], &[]).unwrap();
    [Op::X, Op::Y, Op::Z].map(|op| g.push(op, &[p], &[]).unwrap())
}

pub(crate) fn scaled(g: &mut Graph, factor: f64) -> NodeId {
    let p = g.push(Op::Position, &[], &[]).unwrap();
    let factor = g.constant(factor).unwrap();
    g.push(Op::Scale, &[p, factor], &[]).unwrap()
}

/// Thesis eq. (5.11).
pub(crate) fn fig_5_6(g: &mut Graph) -> NodeId {
    let p = g.push(Op::Position, &[], &[]).unwrap();
    let length = g.push(Op::Length, &[p], &[]).unwrap();
    let one = g.constant(1.0).unwrap();
    let mut f = g.push(Op::Sub, &[length, one], &[]).unwrap();
    for (amplitude, frequency) in [(0.3, 4.0), (0.15, 8.0), (0.05, 16.0)] {
        let p = scaled(g, frequency);
        let n = g.push(Op::Noise, &[p], &[0.0]).unwrap();
        let amplitude = g.constant(amplitude).unwrap();
        let n = g.push(Op::Mul, &[amplitude, n], &[]).unwrap();
        f = g.push(Op::Add, &[f, n], &[]).unwrap();
    }
    f
}

/// ‖p‖ − R − 5 · fbm(onto_sphere(p)/`cell`).
pub(crate) fn planet(g: &mut Graph, cell: f64) -> NodeId {
    let p = g.push(Op::Position, &[], &[]).unwrap();
    let length = g.push(Op::Length, &[p], &[]).unwrap();
    let radius = g.constant(6_371_000.0).unwrap();
    let height = g.push(Op::Sub, &[length, radius], &[]).unwrap();
    let q = g.push(Op::OntoSphere, &[p], &[6_371_000.0]).unwrap();
    let factor = g.constant(1.0 / cell).unwrap();
    let q = g.push(Op::Scale, &[q, factor], &[]).unwrap();
    let fbm = g
        .push(Op::Sum, &[q], &[0.0, 1.0, 2.0, 1.0, 4.0, 0.0, 1.0])
        .unwrap();
    let five = g.constant(5.0).unwrap();
    let fbm = g.push(Op::Mul, &[five, fbm], &[]).unwrap();
    g.push(Op::Sub, &[height, fbm], &[]).unwrap()
}

/// Places of all sizes: small, planetary, on lattice points, on axes, negative, −0.
pub(crate) struct Places {
    pub(crate) columns: [Vec<f64>; 5],
}

impl Places {
    pub(crate) fn new(n: u32, key: u32) -> Self {
        let mut columns: [Vec<f64>; 5] = Default::default();
        for i in 0..n {
            let number = |k: u32| 2.0 * unit(hash(&[key, i, k])) - 1.0;
            let coordinate = |k: u32| match hash(&[key, i, 7]) % 8 {
                0 => (number(k) * 6.0).round(),
                1 => 6_371_000.0 * number(k),
                2 if k == 1 => -0.0,
                3 => number(k) * 1e-12,
                4 => number(k) * 1e5,
                _ => 3.0 * number(k),
            };
            for k in 0..3 {
                columns[k as usize].push(coordinate(k));
            }
            columns[3].push(match i % 5 {
                0 => 0.0,
                1 => 1e9,
                _ => libm::exp2(12.0 * number(3) - 6.0),
            });
            columns[4].push(number(4).abs());
        }
        Self { columns }
    }

    pub(crate) fn points(&self) -> Points<'_> {
        self.part(0, self.columns[0].len())
    }

    pub(crate) fn part(&self, from: usize, to: usize) -> Points<'_> {
        let [x, y, z, footprint, time] = self.columns.each_ref().map(|column| &column[from..to]);
        Points {
            x,
            y,
            z,
            footprint,
            time,
        }
    }
}

pub(crate) fn values(program: &Program, level: SimdLevel, points: &Points<'_>) -> Vec<f64> {
    let mut out = vec![0.0; points.len()];
    program.evaluate(level, points, &mut Scratch::new(), &mut [&mut out]);
    out
}

pub(crate) fn gradients(
    program: &Program,
    level: SimdLevel,
    points: &Points<'_>,
) -> (Vec<f64>, [Vec<f64>; 3]) {
    let mut value = vec![0.0; points.len()];
    let mut gradient = [(); 3].map(|()| vec![0.0; points.len()]);
    let [x, y, z] = &mut gradient;
    program.evaluate_gradient(level, points, &mut Scratch::new(), &mut value, [x, y, z]);
    (value, gradient)
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn every_level_gives_the_same_bits() {
    let places = Places::new(2000, 1);
    let points = places.points();
    for (name, program) in zoo().into_iter().chain(noise_zoo()) {
        let reference = values(&program, SimdLevel::scalar(), &points);
        let (value, gradient) = gradients(&program, SimdLevel::scalar(), &points);
        assert_eq!(
            bits(&reference),
            bits(&value),
            "{name}: value with and without gradient"
        );
        assert!(reference.iter().all(|value| !value.is_nan()), "{name}");
        for level in SimdLevel::all_available() {
            assert_eq!(
                bits(&values(&program, level, &points)),
                bits(&reference),
                "{name} at {level}"
            );
            let (v, g) = gradients(&program, level, &points);
            assert_eq!(bits(&v), bits(&value), "{name} at {level}: value");
            for axis in 0..3 {
                assert_eq!(
                    bits(&g[axis]),
                    bits(&gradient[axis]),
                    "{name} at {level}: gradient"
                );
            }
        }
    }
}

#[test]
fn neighbours_do_not_matter() {
    let places = Places::new(300, 2);
    for (name, program) in zoo().into_iter().chain(noise_zoo()) {
        let whole = values(&program, SimdLevel::best(), &places.points());
        let mut scratch = Scratch::new();
        let mut pieces = vec![0.0; 300];
        let mut noises = 0;
        for (from, to) in [(0, 1), (1, 18), (18, 150), (150, 299), (299, 300)] {
            program.evaluate(
                SimdLevel::best(),
                &places.part(from, to),
                &mut scratch,
                &mut [&mut pieces[from..to]],
            );
        }
        assert_eq!(bits(&whole), bits(&pieces), "{name}");
        for footprint in &places.columns[3] {
            noises += program.noise_evaluations(*footprint);
        }
        assert_eq!(scratch.noise_evaluations, noises, "{name}");
    }
}

#[test]
fn gradients_agree_with_differences() {
    const STEP: f64 = 1e-4;
    let mut compared = 0;
    for (name, program) in zoo().into_iter().chain(noise_zoo()) {
        if name == "planet" || name.starts_with("spot") {
            // Squeezed spots show the steps of f32 over so short a way; `noise::tests` takes longer ones.
            // At 6 371 km a difference over this step is rounding; planets have their own test.
            continue;
        }
        let mut places = Places {
            columns: Default::default(),
        };
        for i in 0..1000 {
            let number = |k: u32| unit(hash(&[3, i, k]));
            for (axis, sign) in [
                (0, 0.0),
                (0, 1.0),
                (0, -1.0),
                (1, 1.0),
                (1, -1.0),
                (2, 1.0),
                (2, -1.0),
            ] {
                for k in 0..3 {
                    let step = if k == axis { sign * STEP } else { 0.0 };
                    places.columns[k as usize].push(6.0 * number(k) - 3.0 + step);
                }
                places.columns[3].push(0.1 * number(3));
                places.columns[4].push(number(4));
            }
        }
        let (value, gradient) = gradients(&program, SimdLevel::best(), &places.points());
        let mut wrong = 0;
        let count = value.len() / 7;
        for i in 0..count {
            for (axis, gradient) in gradient.iter().enumerate() {
                let (after, before) = (7 * i + 2 * axis + 1, 7 * i + 2 * axis + 2);
                let seen = (value[after] - value[before]) / (2.0 * STEP);
                // f32 noise is rough at 1e-6, so differences are good to about 1e-2 in steep places.
                let exact = gradient[7 * i];
                let curved = (gradient[after] - gradient[before]).abs();
                let tolerance = 0.02 + 1e-3 * exact.abs() + curved;
                wrong += usize::from((seen - exact).abs() > tolerance || !seen.is_finite());
                compared += 1;
            }
        }
        // Creases, poles and jumps within a step of a place.
        assert!(wrong * 100 < count, "{name}: {wrong} of {}", 3 * count);
    }
    assert!(compared > 100_000);
}

#[test]
fn planets_are_as_smooth_as_plains() {
    // 25 m above the ground of an Earth, a step of a millimetre moves the field as the gradient says.
    let mut graph = Graph::new();
    let root = planet(&mut graph, 3.0);
    let program = Program::compile(&graph, &[root], Interval::point(0.0)).unwrap();
    let mut places = Places {
        columns: Default::default(),
    };
    let direction = [0.36, 0.48, 0.8];
    for i in 0..2000 {
        let along = f64::from(i) * 1e-3;
        let p = [0, 1, 2].map(|k| direction[k] * 6_371_025.0 + [0.8, -0.6, 0.0][k] * along);
        for (column, value) in places.columns.iter_mut().zip([p[0], p[1], p[2], 0.01, 0.0]) {
            column.push(value);
        }
    }
    let (value, gradient) = gradients(&program, SimdLevel::best(), &places.points());
    for i in 1..value.len() {
        let slope = 0.8 * gradient[0][i] - 0.6 * gradient[1][i];
        let step = value[i] - value[i - 1];
        assert!(
            (step - slope * 1e-3).abs() < 2e-4,
            "{i}: {step} against {}",
            slope * 1e-3
        );
    }
}

#[test]
fn what_is_constant_over_the_shutter_is_folded() {
    let mut graph = Graph::new();
    let time = graph.push(Op::Time, &[], &[]).unwrap();
    let curve = graph
        .push(Op::Linear, &[time], &[0.0, 2.0, 1.0, 2.0, 2.0, 5.0])
        .unwrap();
    let twice = graph.push(Op::Mul, &[curve, curve], &[]).unwrap();
    let p = graph.push(Op::Position, &[], &[]).unwrap();
    let q = graph.push(Op::Scale, &[p, twice], &[]).unwrap();
    let unused = graph.push(Op::Noise, &[p], &[9.0]).unwrap();
    let root = graph.push(Op::Length, &[q], &[]).unwrap();
    let still = Program::compile(&graph, &[root], Interval::new(0.25, 0.75)).unwrap();
    assert_eq!(still.code.constants, [4.0]);
    assert_eq!(
        still.code.instructions.len(),
        4,
        "three products and a length"
    );
    let moving = Program::compile(&graph, &[root], Interval::new(0.25, 1.5)).unwrap();
    assert_eq!(moving.code.instructions.len(), 6);
    let both = Program::compile(&graph, &[root, unused, root], Interval::new(0.25, 0.75)).unwrap();
    let places = Places::new(40, 5);
    let mut out = [vec![0.0; 40], vec![0.0; 40], vec![0.0; 40]];
    let [a, b, c] = &mut out;
    both.evaluate(
        SimdLevel::best(),
        &places.points(),
        &mut Scratch::new(),
        &mut [a, b, c],
    );
    assert_eq!(bits(a), bits(c));
    assert_eq!(
        bits(a),
        bits(&values(&still, SimdLevel::scalar(), &places.points()))
    );
    for (i, b) in b.iter().enumerate() {
        let p = [0, 1, 2].map(|k| places.columns[k][i]);
        assert_eq!(*b, crate::noise::noise(9, p));
    }
}

#[test]
fn time_moves_what_depends_on_it() {
    let mut graph = Graph::new();
    let time = graph.push(Op::Time, &[], &[]).unwrap();
    let root = graph
        .push(Op::Linear, &[time], &[0.0, 0.0, 1.0, 10.0])
        .unwrap();
    let program = Program::compile(&graph, &[root], Interval::new(0.0, 1.0)).unwrap();
    let zero = [0.0; 3];
    let points = Points {
        x: &zero,
        y: &zero,
        z: &zero,
        footprint: &zero,
        time: &[0.0, 0.25, 1.0],
    };
    assert_eq!(
        values(&program, SimdLevel::best(), &points),
        [0.0, 2.5, 10.0]
    );
}

#[test]
fn programs_share_scratch_memory() {
    let places = Places::new(200, 6);
    let mut scratch = Scratch::new();
    let mut out = vec![0.0; 200];
    let zoo = zoo();
    for (name, program) in zoo.iter().chain(zoo.iter().rev()) {
        program.evaluate(
            SimdLevel::best(),
            &places.points(),
            &mut scratch,
            &mut [&mut out],
        );
        assert_eq!(
            bits(&out),
            bits(&values(program, SimdLevel::best(), &places.points())),
            "{name}"
        );
    }
}

#[test]
fn long_chains_need_few_registers() {
    let mut graph = Graph::new();
    let [x, y, _] = position(&mut graph);
    let mut root = x;
    for _ in 0..2000 {
        root = graph.push(Op::Add, &[root, y], &[]).unwrap();
    }
    let program = Program::compile(&graph, &[root], Interval::point(0.0)).unwrap();
    assert!(program.code.registers <= 7, "{}", program.code.registers);
}

#[test]
fn graphs_that_cannot_be_compiled_are_refused() {
    let mut graph = Graph::new();
    let p = graph.push(Op::Position, &[], &[]).unwrap();
    let time = Interval::point(0.0);
    let refused = |roots: &[NodeId]| {
        Program::compile(&graph, roots, time)
            .unwrap_err()
            .to_string()
    };
    assert!(refused(&[p]).contains("three"));
    assert!(refused(&[NodeId(7)]).contains('7'));
    let mut wide = Graph::new();
    let [x, ..] = position(&mut wide);
    let mut level: Vec<NodeId> = Vec::new();
    for i in 0..5000 {
        let c = wide.constant(f64::from(i)).unwrap();
        let sum = wide.push(Op::Add, &[x, c], &[]).unwrap();
        level.push(wide.push(Op::Sin, &[sum], &[]).unwrap());
    }
    assert!(matches!(
        Program::compile(&wide, &level, time),
        Err(crate::CompileError::TooWide(_))
    ));
}

#[test]
fn what_is_not_a_number_lies_outside() {
    let mut graph = Graph::new();
    let [x, ..] = position(&mut graph);
    let root = graph.push(Op::Div, &[x, x], &[]).unwrap();
    let program = Program::compile(&graph, &[root], Interval::point(0.0)).unwrap();
    let (x, zero) = ([0.0, 2.0], [0.0; 2]);
    let points = Points {
        x: &x,
        y: &zero,
        z: &zero,
        footprint: &zero,
        time: &zero,
    };
    let (value, gradient) = gradients(&program, SimdLevel::best(), &points);
    assert_eq!(value, [f64::INFINITY, 1.0]);
    assert_eq!(gradient[0], [0.0, 0.0]);
}
