//! Spot noise, thesis §4.4.2, eq. (4.17), after van Wijk: sparse convolution whose kernels differ from node to node.
//!
//! A spot is an ellipsoid: a radial kernel squeezed across an axis and shrunk. So that a place still needs no more
//! than the 27 cells around it, spots only ever get smaller than the unit ball, never larger (the thesis names the
//! unlimited size as spot noise's drawback).

use super::gradient::Lattice;
use super::jet::Real;
use super::lattice::height;
use super::node::{NEAR, cell_state, draw, fraction, gap, neighbour};
use super::sparse::{HEIGHT, Sparse};

/// Most that a spot is longer than wide.
pub const STRETCH_MAX: f64 = 8.0;

/// Most that sizes vary: the smallest spot has a radius of 1 less this.
pub const VARIETY_MAX: f64 = 0.875;

/// One spot noise.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Spot {
    /// The nodes and their kernel.
    pub(crate) nodes: Sparse,
    /// How many times a spot is longer than wide.
    pub(crate) stretch: f32,
    /// Radii are uniform from 1 less this to 1.
    pub(crate) variety: f32,
    /// The common axis, of length 1; `None`: every spot has a random one.
    pub(crate) axis: Option<[f32; 3]>,
}

impl Spot {
    pub(crate) fn lattice_mut(&mut self) -> &mut Lattice {
        &mut self.nodes.lattice
    }

    /// How many times a kernel can be steeper than the plain one.
    pub(crate) fn squeeze(&self) -> f64 {
        f64::from(self.stretch) / (1.0 - f64::from(self.variety))
    }

    /// No value is farther from zero: a smaller spot is nowhere higher.
    pub(crate) fn range(&self) -> f64 {
        self.nodes.range()
    }

    /// No slope is greater: every node of every cell around may be at its steepest.
    pub(crate) fn slope(&self) -> f64 {
        let steepest = self.nodes.kernel.steepest();
        f64::from(HEIGHT) * 27.0 * f64::from(self.nodes.nodes) * steepest * self.squeeze()
    }

    /// No second derivative along a direction is greater.
    pub(crate) fn bend(&self) -> f64 {
        self.nodes.bend() * self.squeeze() * self.squeeze()
    }

    /// No value is farther from the exact one at its f32 offset.
    pub(crate) fn rounding(&self) -> f64 {
        self.nodes.rounding() * 4.0 * self.squeeze()
    }

    /// The noise at an offset within a cell.
    #[inline(always)]
    pub(crate) fn at<R: Real>(&self, cell: [u32; 3], offset: [f32; 3]) -> R {
        let q = [0, 1, 2].map(
            #[inline(always)]
            |axis| R::variable(offset[axis], axis),
        );
        // 0, unless the place is no number.
        let mut total = R::constant(0.0 * (offset[0] + offset[1] + offset[2]));
        for step in NEAR {
            let [a, b, c] = gap(offset, step);
            if a * a + b * b + c * c >= 1.0 {
                continue;
            }
            let state = cell_state(self.nodes.lattice, neighbour(cell, step));
            for index in 0..self.nodes.nodes {
                let d = [(0, 0), (1, 1), (2, 2)].map(
                    #[inline(always)]
                    |(k, which)| {
                        q[k].raised(-(fraction(draw(state, index, which)) + f32::from(step[k])))
                    },
                );
                let square = self.measure(state, index, d);
                if square.value() < 1.0 {
                    let (h, first, second) = self.nodes.kernel.profile(square.value());
                    let xi = height(draw(state, index, 3)) * HEIGHT;
                    total = total.plus(square.chain(h, first, second).times(xi));
                }
            }
        }
        total
    }

    /// The axis and the radius of a spot.
    pub(crate) fn form(&self, state: u32, index: u32) -> ([f64; 3], f64) {
        let axis = self.axis.unwrap_or_else(|| direction(state, index));
        let radius = 1.0 - self.variety * fraction(draw(state, index, 6));
        (axis.map(f64::from), f64::from(radius))
    }

    /// The squared distance from a spot's node in units of the spot: 1 at its border.
    #[inline(always)]
    fn measure<R: Real>(&self, state: u32, index: u32, d: [R; 3]) -> R {
        let axis = self.axis.unwrap_or_else(|| direction(state, index));
        let radius = 1.0 - self.variety * fraction(draw(state, index, 6));
        let square = d[0].by(d[0]).plus(d[1].by(d[1])).plus(d[2].by(d[2]));
        let along = d[0]
            .times(axis[0])
            .plus(d[1].times(axis[1]))
            .plus(d[2].times(axis[2]));
        let along = along.by(along);
        // Across the axis distances count `stretch` times.
        let across = square.minus(along);
        let wide = self.stretch * self.stretch;
        across
            .times(wide)
            .plus(along)
            .times(1.0 / (radius * radius))
    }
}

/// A unit vector, uniform over the sphere, of a node.
fn direction(state: u32, index: u32) -> [f32; 3] {
    let z = height(draw(state, index, 4));
    let turn = core::f32::consts::TAU * fraction(draw(state, index, 5));
    let (sin, cos) = libm::sincosf(turn);
    let across = (1.0 - z * z).sqrt();
    [across * cos, across * sin, z]
}
