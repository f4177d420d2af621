//! Grids by recipe: what a node's constants say of a grid, checked, and made once for all who ask.
//!
//! A synthesised grid travels as its recipe, a handful of numbers, and is computed again wherever the field is
//! compiled: to the same bits, since nothing here depends on a machine ([`crate::fft`], `libm`, [`crate::hash`]).

use std::convert::Infallible;
use std::sync::Arc;

use super::kept::Kept;
use super::midpoint::{self, Displaced, LEVELS_MAX, Mesh};
use super::{Edges, Samples, Surface, sea, spectral, stored};
use crate::graph::Node;
use crate::op::Op;

/// Synthesised surfaces kept for the next image: at most 2049² samples each, 16 MiB and a quarter more for bounds.
static SURFACES: Kept<(Op, Vec<u64>), Surface> = Kept::new(12);

/// Surfaces through files kept for the next image.
static FILES: Kept<OfFile, Surface> = Kept::new(2);

/// A file's samples, one and the same, with what is made of them.
struct OfFile {
    samples: Arc<Samples>,
    constants: Vec<u64>,
}

impl PartialEq for OfFile {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.samples, &other.samples) && self.constants == other.constants
    }
}

/// Largest side of a synthesised square, and of a cube.
const SQUARE_MAX: f64 = 2048.0;
const CUBE_MAX: f64 = 128.0;

/// What a constant must be, if it is not.
pub(crate) fn complaint(op: Op, params: &[f64]) -> Option<(&'static str, f64)> {
    let wrong = |fits: bool, wanted, value| (!fits).then_some((wanted, value));
    let power_of_two = |side: f64, most: f64| {
        (4.0..=most).contains(&side) && side % 1.0 == 0.0 && libm::log2(side) % 1.0 == 0.0
    };
    let degree = |degree: f64| {
        wrong(
            [1.0, 2.0, 3.0].contains(&degree),
            "a degree of 1, 2 or 3",
            degree,
        )
    };
    let hurst = |hurst: f64| {
        wrong(
            hurst > 0.0 && hurst < 1.0,
            "a Hurst coefficient above 0 and below 1",
            hurst,
        )
    };
    match (op, params) {
        (Op::Grid, &[asset, edges, spline]) => {
            let whole = (0.0..65_536.0).contains(&asset) && asset % 1.0 == 0.0;
            wrong(whole, "the number of a file", asset)
                .or_else(|| wrong(Edges::from_number(edges).is_some(), "edges", edges))
                .or_else(|| degree(spline))
        }
        (Op::SpectralTerrain, &[axes, size, h, _, spline]) => {
            let (most, wanted) = if axes == 3.0 {
                (CUBE_MAX, "a size that is a power of two from 4 to 128")
            } else {
                (SQUARE_MAX, "a size that is a power of two from 4 to 2048")
            };
            wrong([2.0, 3.0].contains(&axes), "two or three axes", axes)
                .or_else(|| wrong(power_of_two(size, most), wanted, size))
                .or_else(|| hurst(h))
                .or_else(|| degree(spline))
        }
        (Op::Sea, &[size, cell, wind, direction, _, spline]) => wrong(
            power_of_two(size, SQUARE_MAX),
            "a size that is a power of two from 4 to 2048",
            size,
        )
        .or_else(|| {
            wrong(
                (1e-3..=1e4).contains(&cell),
                "a spacing from 1 mm to 10 km",
                cell,
            )
        })
        .or_else(|| {
            wrong(
                (0.1..=100.0).contains(&wind),
                "a wind from 0.1 to 100 m/s",
                wind,
            )
        })
        .or_else(|| {
            wrong(
                direction.abs() <= 1e3,
                "a direction within a few turns",
                direction,
            )
        })
        .or_else(|| degree(spline)),
        (Op::MidpointTerrain, &[levels, mesh, displaced, h, _, spline]) => {
            let most = f64::from(LEVELS_MAX);
            let whole = (2.0..=most).contains(&levels) && levels % 1.0 == 0.0;
            wrong(whole, "2 to 11 whole levels", levels)
                .or_else(|| wrong([0.0, 1.0].contains(&mesh), "a mesh", mesh))
                .or_else(|| wrong([0.0, 1.0].contains(&displaced), "0 or 1", displaced))
                .or_else(|| hurst(h))
                .or_else(|| degree(spline))
        }
        _ => None,
    }
}

/// The number of the file that a grid's node names.
pub(crate) fn file(node: &Node) -> u32 {
    number(node.params[0])
}

/// How many samples a node's grid has: of a file's, `file` knows.
pub(crate) fn count(node: &Node, file: impl Fn(u32) -> Option<usize>) -> usize {
    match (node.op, node.params.as_slice()) {
        (Op::Grid, &[asset, ..]) => file(number(asset)).unwrap_or(0),
        (Op::SpectralTerrain, &[axes, size, ..]) => side(size).pow(number(axes)),
        (Op::Sea, &[size, ..]) => side(size).pow(2),
        (Op::MidpointTerrain, &[levels, ..]) => ((1 << number(levels)) + 1usize).pow(2),
        _ => 0,
    }
}

/// The surface of a node that synthesises one; `None` of any other node.
pub(crate) fn synthesised(node: &Node) -> Option<Arc<Surface>> {
    let make = || -> Option<Surface> {
        let (sides, values, edges, degree) = match (node.op, node.params.as_slice()) {
            (Op::SpectralTerrain, &[axes, size, hurst, key, degree]) => {
                let (side, axes) = (side(size), number(axes));
                let values = spectral::fractal(side, axes, hurst, number(key));
                let depth = if axes == 3 { side } else { 1 };
                ([side, side, depth], values, Edges::Repeat, degree)
            }
            (Op::Sea, &[size, cell, wind, direction, key, degree]) => {
                let side = side(size);
                let values = sea::heights(side, cell, wind, direction, number(key));
                ([side, side, 1], values, Edges::Repeat, degree)
            }
            (Op::MidpointTerrain, &[levels, mesh, displaced, hurst, key, degree]) => {
                let levels = number(levels);
                let mesh = if mesh == 0.0 {
                    Mesh::Squares
                } else {
                    Mesh::Triangles
                };
                let displaced = if displaced == 0.0 {
                    Displaced::Midpoints
                } else {
                    Displaced::All
                };
                let values = midpoint::heights(levels, mesh, displaced, hurst, number(key));
                let side = (1 << levels) + 1;
                ([side, side, 1], values, Edges::Hold, degree)
            }
            _ => return None,
        };
        let values = values.into_iter().map(stored).collect();
        let samples = Samples::new(sides, values).expect("a recipe makes finite samples");
        Some(Surface::new(&samples, number(degree), edges))
    };
    SURFACES
        .get((node.op, bits(node)), || make().ok_or(()))
        .ok()
}

/// The surface through a file's samples.
pub(crate) fn of_file(node: &Node, samples: &Arc<Samples>) -> Arc<Surface> {
    let [_, edges, degree] = node.params[..] else {
        unreachable!("the graph counted the constants")
    };
    let edges = Edges::from_number(edges).expect("the graph checked the edges");
    let name = OfFile {
        samples: samples.clone(),
        constants: bits(node),
    };
    let make = || Ok::<_, Infallible>(Surface::new(samples, number(degree), edges));
    let Ok(surface) = FILES.get(name, make);
    surface
}

fn bits(node: &Node) -> Vec<u64> {
    node.params.iter().map(|value| value.to_bits()).collect()
}

/// A whole constant that the graph has checked.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole and in range: the graph checked it"
)]
fn number(value: f64) -> u32 {
    value as u32
}

fn side(size: f64) -> usize {
    number(size) as usize
}
