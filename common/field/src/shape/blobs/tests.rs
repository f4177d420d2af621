//! Blobs at many places together against one place at a time, and rays walked to their roots.

use super::{Blobs, Met, Walk};
use crate::hash::{hash, unit};
use crate::number::Dual;
use crate::points::BATCH;
use crate::shape::kernel::Kernel;
use crate::simd::dispatch;
use crate::{Graph, Interval, Op, Points, Program, Scratch, SimdLevel};

fn number(i: u32, k: u32) -> f64 {
    2.0 * unit(hash(&[31, i, k])) - 1.0
}

/// The rules of a kernel and some points, the first at the origin with the radius 1.
fn params(kernel: u32, far: f64, weights: [f64; 2]) -> Vec<f64> {
    let mut params = vec![f64::from(kernel), 0.4, far, 0.0, 0.0, 0.0, 1.0, 1.0];
    for i in 0..39 {
        params.extend([0, 1, 2].map(|k| 2.0 * number(i, k)));
        params.extend([0.6 + 0.4 * number(i, 3), weights[i as usize % 2]]);
    }
    params
}

/// Places among them, where supports end to the last bit, and where there is none.
fn places() -> Vec<[f64; 3]> {
    let mut places: Vec<_> = (100..1_100)
        .map(|i| [0, 1, 2].map(|k| 2.5 * number(i, k)))
        .collect();
    for bits in -3..=3i64 {
        let near = f64::from_bits(1f64.to_bits().wrapping_add_signed(bits));
        places.extend([[near, 0.0, 0.0], [0.0, -near, 0.0], [0.6 * near, 0.0, 0.8]]);
    }
    places.extend([[f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 0.0], [1e200; 3]]);
    places
}

#[test]
fn lanes_give_the_bits_of_one_place() {
    let places = places();
    let axis = |k: usize| places.iter().map(|place| place[k]).collect::<Vec<_>>();
    let (x, y, z, zero) = (axis(0), axis(1), axis(2), vec![0.0; places.len()]);
    let points = Points {
        x: &x,
        y: &y,
        z: &z,
        footprint: &zero,
        time: &zero,
    };
    let known = |value: f64, other: f64| if value.is_nan() { other } else { value };
    for (kernel, far) in (0..6).flat_map(|kernel| [(kernel, 0.0), (kernel, 1.0)]) {
        let params = params(kernel, far, [1.0, -0.3]);
        let Ok(blobs) = Blobs::new(&params) else {
            assert!(far == 1.0 && !Kernel::ALL[kernel as usize].ends());
            continue;
        };
        let mut graph = Graph::new();
        let p = graph.push(Op::Position, &[], &[]).unwrap();
        let root = graph.push(Op::Blobs, &[p], &params).unwrap();
        let program = Program::compile(&graph, &[root], Interval::point(0.0)).unwrap();
        for level in SimdLevel::all_available() {
            let mut value = zero.clone();
            let [mut gx, mut gy, mut gz] = [0, 1, 2].map(|_| zero.clone());
            program.evaluate_gradient(
                level,
                &points,
                &mut Scratch::new(),
                &mut value,
                [&mut gx, &mut gy, &mut gz],
            );
            for (i, place) in places.iter().enumerate() {
                let dual = |k: usize| {
                    let mut gradient = [0.0; 3];
                    gradient[k] = 1.0;
                    Dual {
                        value: place[k],
                        gradient,
                    }
                };
                let alone = blobs.value([dual(0), dual(1), dual(2)]);
                let name = format!("kernel {kernel}, far {far}, {level}, {place:?}");
                assert_eq!(blobs.value(*place).to_bits(), alone.value.to_bits());
                assert_eq!(value[i], known(alone.value, f64::INFINITY), "{name}");
                let gradient = alone.gradient.map(|part| known(part, 0.0));
                assert_eq!([gx[i], gy[i], gz[i]], gradient, "{name}");
            }
        }
    }
}

/// How far rays from z = 4 straight down are clear after one walk, and the values where that ends.
fn walked(kernel: u32, weights: [f64; 2]) -> Vec<(f64, f64)> {
    let blobs = Blobs::new(&params(kernel, 0.0, weights)).unwrap();
    let lanes = |of: &dyn Fn(u32) -> f64| -> [f64; BATCH] {
        std::array::from_fn(|i| of(u32::try_from(i).unwrap()))
    };
    let (x, y) = (
        lanes(&|i| 2.0 * number(i, 20)),
        lanes(&|i| 2.0 * number(i, 21)),
    );
    let (z, zero, down) = ([4.0; BATCH], [0.0; BATCH], [-1.0; BATCH]);
    let walk = Walk {
        place: [&x, &y, &z],
        direction: [&zero, &zero, &down],
        world: [&x, &y, &z],
        offset: &[1e-12; BATCH],
        limit: &[8.0; BATCH],
    };
    let mut ahead = [0.0; BATCH];
    let met = &mut Met::default();
    dispatch!(SimdLevel::best(), simd => blobs.walk(simd, walk, met, &mut ahead));
    let end = |i: usize| (ahead[i], blobs.value([x[i], y[i], 4.0 - ahead[i]]));
    (0..BATCH).map(end).collect()
}

#[test]
fn one_walk_ends_at_the_root_or_at_the_limit() {
    let ends = walked(3, [1.0, 1.0]);
    let is_miss = |(ahead, _): &(f64, f64)| *ahead > 7.999;
    let is_root = |(ahead, f): &(f64, f64)| *ahead < 7.9 && *f < 1e-6;
    let misses = ends.iter().filter(|end| is_miss(end)).count();
    let roots = ends.iter().filter(|end| is_root(end)).count();
    assert!(misses > 10 && roots > 40, "{misses} {roots}");
    let others: Vec<_> = ends
        .iter()
        .filter(|end| !is_miss(end) && !is_root(end))
        .collect();
    assert!(others.is_empty(), "every ray needs one walk: {others:?}");
}

#[test]
fn other_kernels_and_weights_come_close() {
    for kernel in 0..6 {
        for weights in [[1.0, 1.0], [1.0, -0.3]] {
            let ends = walked(kernel, weights);
            let far = ends.iter().filter(|(ahead, f)| *ahead > 7.999 || *f < 0.1);
            let far = far.count();
            assert!(far > BATCH * 2 / 3, "{kernel} {weights:?}: {far}");
            assert!(ends.iter().all(|(ahead, f)| *ahead == 0.0 || *f > 0.0));
        }
    }
}
