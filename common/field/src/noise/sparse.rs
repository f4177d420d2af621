//! Sparse convolution noise, thesis §4.4: random node points, each with a radial kernel of a random height.
//!
//! The heights ξ of (4.13) have mean 0 and variance 1 but are uniform over [−√3, √3), not Gaussian: with
//! unbounded heights the noise would have neither range nor slope bound (ERRATA, note 3 of 1782). The sum is as
//! the thesis writes it, so its variance is the node density times ∫h²: 0.373 per node of a cell for the quintic,
//! and 0.558 in two dimensions.

use super::disc::Tile;
use super::gradient::Lattice;
use super::jet::Real;
use super::node::{NEAR, cell_state, draw, fraction, gap, neighbour};

/// Most node points of a cell.
pub const NODES_MAX: f64 = 8.0;

/// √3: the greatest height, of a uniform distribution of variance 1.
pub(crate) const HEIGHT: f32 = 1.732_050_8;

/// The radial profile of a node.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kernel {
    /// h₁(d) = (1 + cos πd)/2, Lewis's; its second derivative jumps at the border.
    Lewis,
    /// h₂(d) = 1 − 10d³ + 15d⁴ − 6d⁵, twice continuously differentiable.
    Quintic,
    /// 1 − d: creases at the border and cusps at the nodes (thesis fig. 4.13).
    Linear,
}

impl Kernel {
    /// Every kernel, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Lewis, Self::Quintic, Self::Linear];

    /// The number that stands for it among a node's parameters.
    pub const fn number(self) -> f64 {
        match self {
            Self::Lewis => 0.0,
            Self::Quintic => 1.0,
            Self::Linear => 2.0,
        }
    }

    /// The kernel of that number.
    pub fn from_number(number: f64) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|kernel| kernel.number() == number)
    }

    /// h at the distance √q < 1, with its first and second derivative by q.
    ///
    /// At a node itself the derivatives that do not exist count as 0.
    #[inline(always)]
    pub(crate) fn profile(self, q: f32) -> (f32, f32, f32) {
        let d = q.sqrt();
        let inverse = if d > 0.0 { 1.0 / d } else { 0.0 };
        let rest = 1.0 - d;
        match self {
            Self::Quintic => (
                rest * rest * rest * (1.0 + d * (3.0 + 6.0 * d)),
                -15.0 * d * (rest * rest),
                7.5 * rest * (3.0 * d - 1.0) * inverse,
            ),
            Self::Lewis => {
                let (sin, cos) = libm::sincosf(core::f32::consts::PI * d);
                let first = -0.25 * core::f32::consts::PI * sin * inverse;
                let bend = -0.5 * (core::f32::consts::PI * core::f32::consts::PI) * cos;
                // Near a node the difference cancels; its limit, π⁴/48, is close enough below 1/32.
                let second = if d < 0.031_25 {
                    2.029_3
                } else {
                    (bend - 2.0 * first) * (0.25 * inverse * inverse)
                };
                let first = if d > 0.0 { first } else { -2.467_401 };
                (0.5 + 0.5 * cos, first, second)
            }
            Self::Linear => (rest, -0.5 * inverse, 0.25 * inverse * inverse * inverse),
        }
    }

    /// The most that Σ h over the 27 cells can be with one node in each, wherever the nodes are.
    pub(super) fn range(self) -> f64 {
        match self {
            Self::Lewis | Self::Quintic => 8.15,
            Self::Linear => 8.7,
        }
    }

    /// The most that Σ |h′| over the 27 cells can be with one node in each.
    ///
    /// The thesis's 15 is no bound (ERRATA, note 3 of 1782).
    pub(super) fn slope(self) -> f64 {
        match self {
            Self::Lewis => 31.7,
            Self::Quintic => 32.4,
            Self::Linear => 27.0,
        }
    }

    /// The most that |h′| is anywhere.
    pub(crate) fn steepest(self) -> f64 {
        match self {
            Self::Lewis => core::f64::consts::FRAC_PI_2 * (1.0 + 1e-12),
            Self::Quintic => 1.875,
            Self::Linear => 1.0,
        }
    }

    /// The most that a second derivative along a direction can be: of |h″| and |h′|/d.
    fn bend(self) -> f64 {
        match self {
            Self::Lewis => 4.935,
            Self::Quintic => 5.78,
            Self::Linear => f64::INFINITY,
        }
    }
}

/// How node points lie.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scatter {
    /// As many in every cell, uniformly and independently, thesis §4.4.
    Uniform,
    /// One per cell on average, no two nearer than 0.8 cells: a Poisson-disc distribution.
    ///
    /// Few nodes can be near a place, so the range and the slope bound are far smaller.
    Disc,
    /// As `Uniform`, in two dimensions: the nodes lie in a plane, and the third coordinate counts nowhere.
    Plane,
}

impl Scatter {
    /// Every scatter, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Uniform, Self::Disc, Self::Plane];

    /// The number that stands for it among a node's parameters.
    pub const fn number(self) -> f64 {
        match self {
            Self::Uniform => 0.0,
            Self::Disc => 1.0,
            Self::Plane => 2.0,
        }
    }

    /// The scatter of that number.
    pub fn from_number(number: f64) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|scatter| scatter.number() == number)
    }
}

/// One sparse convolution noise.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Sparse {
    pub(crate) lattice: Lattice,
    /// Node points of a cell; 1 for a disc scatter, there on average.
    pub(crate) nodes: u32,
    pub(crate) kernel: Kernel,
    pub(crate) scatter: Scatter,
}

impl Sparse {
    /// No value is farther from zero.
    pub(crate) fn range(&self) -> f64 {
        let sum = match self.scatter {
            Scatter::Uniform => f64::from(self.nodes) * self.kernel.range(),
            Scatter::Disc => self.kernel.disc_range(),
            Scatter::Plane => self.most(),
        };
        f64::from(HEIGHT) * sum
    }

    /// No slope is greater.
    pub(crate) fn slope(&self) -> f64 {
        let sum = match self.scatter {
            Scatter::Uniform => f64::from(self.nodes) * self.kernel.slope(),
            Scatter::Disc => self.kernel.disc_slope(),
            Scatter::Plane => self.most() * self.kernel.steepest(),
        };
        f64::from(HEIGHT) * sum
    }

    /// No second derivative along a direction is greater; infinite where there is none.
    pub(crate) fn bend(&self) -> f64 {
        f64::from(HEIGHT) * self.most() * self.kernel.bend()
    }

    /// No value is farther from the exact one at its f32 offset.
    ///
    /// A distance is good to 2⁻²¹, a profile beyond that to 2⁻²²; a sum of n terms adds n·2⁻²⁴ of their total.
    pub(crate) fn rounding(&self) -> f64 {
        let terms =
            f64::from(HEIGHT) * (self.slope() / f64::from(HEIGHT) * 5e-7 + self.most() * 2.4e-7);
        terms + self.most() * 6e-8 * self.range()
    }

    /// The most nodes that can be within reach of a place.
    fn most(&self) -> f64 {
        match self.scatter {
            Scatter::Uniform => 27.0 * f64::from(self.nodes),
            Scatter::Disc => super::disc::NEAR_MAX,
            Scatter::Plane => 9.0 * f64::from(self.nodes),
        }
    }

    /// The noise at an offset within a cell.
    #[inline(always)]
    pub(crate) fn at<R: Real>(&self, cell: [u32; 3], offset: [f32; 3]) -> R {
        // 0, unless the place is no number.
        let mut total = R::constant(0.0 * (offset[0] + offset[1] + offset[2]));
        let planar = self.scatter == Scatter::Plane;
        let (cell, offset) = if planar {
            ([cell[0], cell[1], 0], [offset[0], offset[1], 0.0])
        } else {
            (cell, offset)
        };
        let q = [0, 1, 2].map(
            #[inline(always)]
            |axis| {
                if planar && axis == 2 {
                    R::constant(0.0)
                } else {
                    R::variable(offset[axis], axis)
                }
            },
        );
        for step in NEAR {
            if planar && step[2] != 0 {
                continue;
            }
            let [a, b, c] = gap(offset, step);
            if a * a + b * b + c * c >= 1.0 {
                continue;
            }
            let cell = neighbour(cell, step);
            let state = cell_state(self.lattice, cell);
            let mut add = |index: u32, node: [f32; 3]| {
                let d = [0, 1, 2].map(
                    #[inline(always)]
                    |k| q[k].raised(-(node[k] + f32::from(step[k]))),
                );
                let square = d[0].by(d[0]).plus(d[1].by(d[1])).plus(d[2].by(d[2]));
                if square.value() < 1.0 {
                    let (h, first, second) = self.kernel.profile(square.value());
                    let xi = super::lattice::height(draw(state, index, 3)) * HEIGHT;
                    total = total.plus(square.chain(h, first, second).times(xi));
                }
            };
            match self.scatter {
                Scatter::Uniform => {
                    for index in 0..self.nodes {
                        add(
                            index,
                            [0, 1, 2].map(|axis| fraction(draw(state, index, axis))),
                        );
                    }
                }
                Scatter::Plane => {
                    for index in 0..self.nodes {
                        let [x, y] = [0, 1].map(|axis| fraction(draw(state, index, axis)));
                        add(index, [x, y, 0.0]);
                    }
                }
                Scatter::Disc => {
                    for (index, node) in (0..).zip(Tile::shared().nodes(self.lattice, cell)) {
                        add(index, *node);
                    }
                }
            }
        }
        total
    }
}
