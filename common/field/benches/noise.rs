//! Points per second of the noise and its cascades, at every SIMD level of the machine.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use field::hash::{hash, unit};
use field::{Graph, Interval, Op, Points, Program, Scratch, SimdLevel};

const POINTS: usize = 1024;

/// A field of one operation on 4·p.
fn program(op: Op, params: &[f64]) -> Program {
    let mut graph = Graph::new();
    let mut push =
        |op, args: &[_], params: &[f64]| graph.push(op, args, params).expect("a valid graph");
    let p = push(Op::Position, &[], &[]);
    let four = push(Op::Constant, &[], &[4.0]);
    let q = push(Op::Scale, &[p, four], &[]);
    let root = push(op, &[q], params);
    Program::compile(&graph, &[root], Interval::point(0.0)).expect("a valid program")
}

fn noise(criterion: &mut Criterion) {
    let column = |k: u32| {
        (0..1024)
            .map(|i| 100.0 * unit(hash(&[i, k])))
            .collect::<Vec<f64>>()
    };
    let (x, y, z) = (column(0), column(1), column(2));
    let (footprint, time) = (vec![1e-3; POINTS], vec![0.0; POINTS]);
    let points = Points {
        x: &x,
        y: &y,
        z: &z,
        footprint: &footprint,
        time: &time,
    };
    let mut scratch = Scratch::new();
    let mut out = vec![0.0; POINTS];
    let direction = [0.6, 0.8, 0.0].map(|part| vec![part; POINTS]);
    let mut slope = vec![0.0; POINTS];
    let mut gradient = [(); 3].map(|()| vec![0.0; POINTS]);
    let programs = [
        ("noise", program(Op::Noise, &[1.0])),
        (
            "fbm8",
            program(Op::Sum, &[0.0, 1.0, 2.0, 1.0, 8.0, 0.0, 0.0]),
        ),
        (
            "fbm8-detail",
            program(Op::Sum, &[0.0, 1.0, 2.0, 1.0, 8.0, 0.0, 1.0]),
        ),
        (
            "ridged8",
            program(Op::RidgedMultifractal, &[1.0, 2.0, 1.0, 8.0, 1.0, 2.0, 0.0]),
        ),
    ];
    for (name, program) in &programs {
        let mut group = criterion.benchmark_group(*name);
        group.throughput(Throughput::Elements(POINTS as u64));
        for level in SimdLevel::all_available() {
            group.bench_function(BenchmarkId::new("value", level), |bencher| {
                bencher.iter(|| program.evaluate(level, &points, &mut scratch, &mut [&mut out]));
            });
            group.bench_function(BenchmarkId::new("gradient", level), |bencher| {
                let [gx, gy, gz] = &mut gradient;
                bencher.iter(|| {
                    program.evaluate_gradient(level, &points, &mut scratch, &mut out, [gx, gy, gz])
                });
            });
            let [gx, gy, gz] = &direction;
            group.bench_function(BenchmarkId::new("along", level), |bencher| {
                bencher.iter(|| {
                    let out = [&mut out[..], &mut slope];
                    program.evaluate_along(level, &points, [gx, gy, gz], &mut scratch, out)
                });
            });
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(30).measurement_time(std::time::Duration::from_secs(1)).warm_up_time(std::time::Duration::from_millis(200));
    targets = noise
}
criterion_main!(benches);
