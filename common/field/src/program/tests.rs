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
    for exponent in [0.5, 1.0, 2.0, 3.3] {
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
    zoo
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
    for (name, program) in zoo() {
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
    for (name, program) in zoo() {
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
fn speed() {
    let mut g = Graph::new();
    let p = scaled(&mut g, 0.9);
    let root = g
        .push(Op::Sum, &[p], &[0.0, 3.0, 2.0, 0.9, 8.0, 0.0, 0.0])
        .unwrap();
    let program = Program::compile(&g, &[root], Interval::point(0.0)).unwrap();
    let places = Places::new(1280, 4);
    let mut out = vec![0.0; 1280];
    let mut gr = [(); 3].map(|()| vec![0.0; 1280]);
    let mut scratch = Scratch::new();
    for level in SimdLevel::all_available() {
        let mut best = [f64::INFINITY; 2];
        for _ in 0..100 {
            let t = std::time::Instant::now();
            program.evaluate(level, &places.points(), &mut scratch, &mut [&mut out]);
            let a = t.elapsed().as_secs_f64();
            let t = std::time::Instant::now();
            let [x, y, z] = &mut gr;
            program.evaluate_gradient(level, &places.points(), &mut scratch, &mut out, [x, y, z]);
            let b = t.elapsed().as_secs_f64();
            best = [best[0].min(a), best[1].min(b)];
        }
        println!(
            "{level}: fbm8 {:.1} M points/s, gradient {:.1}",
            1280e-6 / best[0],
            1280e-6 / best[1]
        );
    }
}
