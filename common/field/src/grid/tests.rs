//! Grids: splines go through their samples, edges are what they say, recipes have the statistics they promise.

use std::sync::Arc;

use super::basis::{Order, taps};
use super::midpoint::{self, Displaced, Mesh};
use super::{Edges, GridError, Samples, Surface, gaussian, sea, spectral, stored, whole};
use crate::hash::{hash, unit};
use crate::program::tests::values;
use crate::{CompileError, Graph, Interval, NodeId, Op, Points, Program, SimdLevel};

fn number(words: &[u32]) -> f64 {
    2.0 * unit(hash(words)) - 1.0
}

fn samples(sides: [usize; 3], key: u32) -> Samples {
    let count = u32::try_from(sides.iter().product::<usize>()).unwrap();
    let values = (0..count).map(|i| stored(number(&[key, i]))).collect();
    Samples::new(sides, values).unwrap()
}

/// Every degree, kind of edge and number of axes.
fn all() -> Vec<(Samples, Surface, Edges, u32)> {
    let mut all = Vec::new();
    for sides in [[9, 6, 1], [5, 4, 7], [4, 4, 1], [33, 17, 1]] {
        for edges in [Edges::Repeat, Edges::Hold] {
            for degree in 1..=3 {
                let samples = samples(sides, degree);
                let surface = Surface::new(&samples, degree, edges);
                all.push((samples, surface, edges, degree));
            }
        }
    }
    all
}

#[test]
fn a_surface_goes_through_its_samples() {
    for (samples, surface, edges, degree) in all() {
        let [nx, ny, nz] = samples.sides();
        for (i, &value) in samples.values().iter().enumerate() {
            let at = [i % nx, i / nx % ny, i / (nx * ny)].map(whole);
            let found = surface.value(at);
            assert!(
                (found - f64::from(value)).abs() < 2e-6,
                "{edges:?} degree {degree} at {at:?}: {found}, not {value}"
            );
            if edges == Edges::Repeat {
                let turn = if nz == 1 { 0.0 } else { whole(nz) };
                let far = [at[0] - 3.0 * whole(nx), at[1] + whole(ny), at[2] - turn];
                assert_eq!(found.to_bits(), surface.value(far).to_bits(), "{at:?}");
            }
        }
    }
}

#[test]
fn a_held_edge_is_level_outside() {
    for (_, surface, edges, _) in all() {
        if edges == Edges::Repeat {
            continue;
        }
        let (value, gradient) = surface.value_gradient([-40.0, 2.3, 1.1]);
        assert_eq!(gradient[0], 0.0);
        assert_eq!(value, surface.value([-1e9, 2.3, 1.1]));
    }
}

#[test]
fn weights_are_a_partition_of_one_and_derivatives_of_each_other() {
    for degree in 1..=3 {
        for i in 0..200 {
            let at = 3.0 * number(&[degree, i]);
            let sum = |order, at| -> f64 {
                let taps = taps(degree, order, at);
                // Against a quadratic, so that derivatives are seen.
                (0i32..)
                    .zip(taps.weights)
                    .map(|(k, weight)| {
                        let place = taps.first as f64 + f64::from(k);
                        weight * (1.0 + place + 0.5 * place * place)
                    })
                    .sum()
            };
            let total: f64 = taps(degree, Order::Value, at).weights.iter().sum();
            assert!((total - 1.0).abs() < 1e-15, "{total}");
            let h = 1e-5;
            let smooth = taps(degree, Order::Value, at - h).first
                == taps(degree, Order::Value, at + h).first;
            if !smooth {
                continue;
            }
            let slope = (sum(Order::Value, at + h) - sum(Order::Value, at - h)) / (2.0 * h);
            assert!(
                (slope - sum(Order::Slope, at)).abs() < 1e-8,
                "{degree} {at}"
            );
            let bend = (sum(Order::Slope, at + h) - sum(Order::Slope, at - h)) / (2.0 * h);
            assert!((bend - sum(Order::Bend, at)).abs() < 1e-8, "{degree} {at}");
        }
    }
}

#[test]
fn boxes_hold_values_and_slopes() {
    for (key, (samples, surface, edges, degree)) in (0..).zip(all()) {
        let sides = samples.sides().map(whole);
        for i in 0..300 {
            let size = libm::exp2(6.0 * number(&[key, i, 0]));
            let low = [0, 1, 2].map(|k| (0.5 + number(&[key, i, 1, k])) * sides[k as usize]);
            let over = low.map(|low| Interval::new(low, low + size));
            let (range, slopes) = surface.over(over);
            for j in 0..20 {
                let at = [0u32, 1, 2].map(|k| low[k as usize] + size * unit(hash(&[key, i, j, k])));
                let (value, gradient) = surface.value_gradient(at);
                assert!(
                    range.contains(value),
                    "{edges:?} degree {degree}: {value} at {at:?} outside {range:?}"
                );
                for (slope, slopes) in gradient.iter().zip(slopes) {
                    assert!(
                        slopes.contains(*slope),
                        "{edges:?} degree {degree}: {slope} at {at:?} outside {slopes:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn small_boxes_say_more_than_large_ones() {
    let samples = samples([256, 256, 1], 9);
    let surface = Surface::new(&samples, 3, Edges::Repeat);
    let width = |size: f64| {
        let over = [0.0; 3].map(|low| Interval::new(low + 100.2, low + 100.2 + size));
        surface.over(over).0.width()
    };
    assert!(width(1.0) < width(30.0) && width(30.0) <= width(1e6));
}

#[test]
fn what_is_no_grid_is_refused() {
    assert_eq!(
        Samples::new([3, 8, 1], vec![0.0; 24]),
        Err(GridError::TooSmall)
    );
    assert_eq!(
        Samples::new([4, 4, 2], vec![0.0; 32]),
        Err(GridError::TooSmall)
    );
    let huge = [usize::MAX, 4, 4];
    assert_eq!(Samples::new(huge, Vec::new()), Err(GridError::TooLarge));
    assert_eq!(
        Samples::new([4, 4, 1], vec![0.0; 15]),
        Err(GridError::Count(16, 15))
    );
    let mut values = vec![0.0; 16];
    values[5] = f32::NAN;
    assert_eq!(
        Samples::new([4, 4, 1], values),
        Err(GridError::NotFinite(5))
    );
}

fn mean_square(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>() / whole(values.len())
}

#[test]
fn synthesised_terrain_has_unit_variance_and_falls_off_as_its_hurst_coefficient_says() {
    let (mut variance, mut counted) = (0.0, 0.0);
    for hurst in [0.3, 0.5, 0.8] {
        // Power in two bands an octave apart: a ratio of 2^(n − β) = 2^(−2H).
        let side = 64;
        let mut bands = [0.0; 2];
        for key in 0..24 {
            let terrain = spectral::fractal(side, 2, hurst, key);
            let mean = terrain.iter().sum::<f64>() / whole(terrain.len());
            assert!(mean.abs() < 1e-12, "{mean}");
            variance += mean_square(&terrain);
            counted += 1.0;
            let mut spectrum: Vec<_> = terrain
                .iter()
                .map(|&value| crate::fft::Complex::new(value, 0.0))
                .collect();
            let fft = crate::fft::Fft::new(side).unwrap();
            fft.run_axes(crate::fft::Direction::Forward, 2, &mut spectrum);
            for (i, z) in spectrum.iter().enumerate() {
                let part = |k: usize| {
                    if 2 * k <= side {
                        whole(k)
                    } else {
                        whole(k) - whole(side)
                    }
                };
                let k = (part(i % side) * part(i % side) + part(i / side) * part(i / side)).sqrt();
                if (6.0..12.0).contains(&k) {
                    bands[0] += z.power();
                } else if (12.0..24.0).contains(&k) {
                    bands[1] += z.power();
                }
            }
        }
        let octave = libm::log2(bands[1] / bands[0]);
        assert!((octave + 2.0 * hurst).abs() < 0.12, "{hurst}: {octave}");
    }
    let variance = variance / counted;
    assert!((variance - 1.0).abs() < 0.15, "{variance}");
}

#[test]
fn a_sea_is_as_high_as_its_wind_says() {
    for wind in [6.0, 12.0] {
        // ∫ S dω in closed form; a grid of 256 × 3 m holds nearly all of it.
        let expected = 0.0081 / (4.0 * 0.74) * wind * wind * wind * wind / (9.81 * 9.81);
        let mut seen = 0.0;
        for key in 0..6 {
            seen += mean_square(&sea::heights(256, wind / 5.0, wind, 0.3, key)) / 6.0;
        }
        assert!(
            (0.85..1.1).contains(&(seen / expected)),
            "{wind} m/s: {seen}, not {expected}"
        );
    }
    // By the trapezium rule, the closed form is the integral of the spectrum.
    let step = 1e-3;
    let sum: f64 = (1..20_000u32)
        .map(|i| sea::frequency_spectrum(10.0, f64::from(i) * step) * step)
        .sum();
    let expected = 0.0081 / (4.0 * 0.74) * 1e4 / (9.81 * 9.81);
    assert!((sum / expected - 1.0).abs() < 1e-3, "{sum} {expected}");
}

#[test]
fn midpoints_keep_what_is_there_and_additions_do_not() {
    let levels = |levels, displaced| midpoint::heights(levels, Mesh::Triangles, displaced, 0.8, 3);
    let (coarse, fine) = (
        levels(3, Displaced::Midpoints),
        levels(5, Displaced::Midpoints),
    );
    for y in 0..9 {
        for x in 0..9 {
            assert_eq!(coarse[y * 9 + x], fine[4 * y * 33 + 4 * x], "{x} {y}");
        }
    }
    let all = levels(5, Displaced::All);
    assert!((0..9).any(|i| all[4 * i] != levels(3, Displaced::All)[i]));
}

#[test]
fn increments_of_subdivision_grow_with_distance_to_the_hurst_coefficient() {
    for mesh in [Mesh::Squares, Mesh::Triangles] {
        for displaced in [Displaced::Midpoints, Displaced::All] {
            let hurst = 0.5;
            let side = 257;
            let [mut near, mut far] = [0.0; 2];
            for key in 0..8 {
                let heights = midpoint::heights(8, mesh, displaced, hurst, key);
                for y in 0..side {
                    for x in 0..side - 16 {
                        let square = |apart: usize| {
                            let d = heights[y * side + x + apart] - heights[y * side + x];
                            d * d
                        };
                        near += square(4);
                        far += square(16);
                    }
                }
            }
            // E{Δ²} goes as distance^2H.
            let found = 0.25 * libm::log2(far / near);
            assert!(
                (found - hurst).abs() < 0.12,
                "{mesh:?} {displaced:?}: {found}"
            );
        }
    }
}

#[test]
fn gaussian_numbers_have_unit_variance() {
    let numbers: Vec<f64> = (0..20_000).map(|i| gaussian(1, 2, [i, 0, 0])).collect();
    assert!((mean_square(&numbers) - 1.0).abs() < 0.03);
    let mean = numbers.iter().sum::<f64>() / 20_000.0;
    assert!(mean.abs() < 0.03, "{mean}");
}

/// The first bits of every recipe: they may never change, on no machine.
#[test]
fn recipes_never_move() {
    let digest = |values: Vec<f64>| {
        let words: Vec<u32> = values
            .iter()
            .map(|value| stored(*value).to_bits())
            .collect();
        hash(&words)
    };
    let seen = [
        digest(spectral::fractal(32, 2, 0.8, 1)),
        digest(spectral::fractal(8, 3, 0.5, 2)),
        digest(sea::heights(32, 2.0, 10.0, 0.7, 3)),
        digest(midpoint::heights(4, Mesh::Squares, Displaced::All, 0.8, 4)),
        digest(midpoint::heights(
            4,
            Mesh::Triangles,
            Displaced::Midpoints,
            0.8,
            5,
        )),
    ];
    let known = [
        0xc747_c76e,
        0xfa28_f06e,
        0x3f84_590e,
        0x5aa9_1952,
        0x5455_6d65,
    ];
    assert_eq!(seen, known, "{seen:#010x?}");
}

fn grid(graph: &mut Graph) -> NodeId {
    let p = graph.push(Op::Position, &[], &[]).unwrap();
    graph.push(Op::Grid, &[p], &[0.0, 1.0, 3.0]).unwrap()
}

#[test]
fn a_file_s_grid_is_evaluated_where_the_file_is() {
    let mut graph = Graph::new();
    let root = grid(&mut graph);
    let time = Interval::point(0.0);
    assert_eq!(
        Program::compile(&graph, &[root], time).unwrap_err(),
        CompileError::NoFile(0)
    );
    assert_eq!(graph.files_needed(), [0]);
    let samples = Arc::new(samples([6, 5, 4], 1));
    graph.attach(0, samples.clone());
    let program = Program::compile(&graph, &[root], time).unwrap();
    let surface = Surface::new(&samples, 3, Edges::Hold);
    let places: Vec<[f64; 3]> = (0..200)
        .map(|i| [0, 1, 2].map(|k| 4.0 * number(&[i, k]) + 2.0))
        .collect();
    let axis = |k: usize| places.iter().map(|place| place[k]).collect::<Vec<_>>();
    let (x, y, z, still) = (axis(0), axis(1), axis(2), vec![0.0; places.len()]);
    let points = Points {
        x: &x,
        y: &y,
        z: &z,
        footprint: &still,
        time: &still,
    };
    for level in SimdLevel::all_available() {
        for (value, place) in values(&program, level, &points).iter().zip(&places) {
            assert_eq!(value.to_bits(), surface.value(*place).to_bits());
        }
    }
}

#[test]
fn too_many_samples_are_refused_before_any_is_made() {
    let mut graph = Graph::new();
    let p = graph.push(Op::Position, &[], &[]).unwrap();
    let mut sum = graph.constant(0.0).unwrap();
    for key in 0..5 {
        let params = [2.0, 2048.0, 0.8, f64::from(key), 1.0];
        let terrain = graph.push(Op::SpectralTerrain, &[p], &params).unwrap();
        sum = graph.push(Op::Add, &[sum, terrain], &[]).unwrap();
    }
    let refused = Program::compile(&graph, &[sum], Interval::point(0.0)).unwrap_err();
    assert_eq!(refused, CompileError::TooManySamples);
    for (op, params) in [
        (Op::SpectralTerrain, &[2.0, 100.0, 0.8, 1.0, 3.0][..]),
        (Op::SpectralTerrain, &[3.0, 256.0, 0.8, 1.0, 3.0]),
        (Op::SpectralTerrain, &[2.0, 64.0, 1.0, 1.0, 3.0]),
        (Op::Sea, &[64.0, 1.0, 0.0, 0.0, 1.0, 3.0]),
        (Op::MidpointTerrain, &[12.0, 0.0, 0.0, 0.5, 1.0, 1.0]),
        (Op::Grid, &[0.0, 2.0, 1.0]),
        (Op::Grid, &[0.0, 0.0, 4.0]),
    ] {
        assert!(graph.push(op, &[p], params).is_err(), "{op:?} {params:?}");
    }
}
