//! Every noise under one name: what it is made of, how far and how steeply it can go, its value anywhere.

use super::cellular::{self, Cellular};
use super::gradient::{self, Lattice};
use super::jet::{Jet, Jet2, Real};
use super::lattice::{self, Corner};
use super::simplex;
use super::sparse::{Kernel, Scatter, Sparse};
use super::spot::Spot;
use super::wavelet;
use crate::interval::Interval;
use crate::op::Op;

/// A noise of the unified model, thesis eqs. (4.1)–(4.3), with its constants digested.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Noise {
    Lattice(Corner, Lattice),
    Simplex(Lattice),
    Sparse(Sparse),
    Spot(Spot),
    Wavelet(Lattice),
    Cellular(Box<Cellular>),
}

impl Noise {
    /// The noise of an operation with these constants; `None` if it is none or they do not fit.
    pub(crate) fn new(op: Op, params: &[f64]) -> Option<Self> {
        let (&key, rest) = params.split_first()?;
        let lattice = Lattice::new(whole(key));
        Some(match (op, rest) {
            (Op::Noise, []) => Self::Lattice(Corner::Gradient, lattice),
            (Op::ValueNoise, []) => Self::Lattice(Corner::Value, lattice),
            (Op::ValueGradientNoise, []) => Self::Lattice(Corner::ValueGradient, lattice),
            (Op::SimplexNoise, []) => Self::Simplex(lattice),
            (Op::SparseNoise, &[nodes, kernel, scatter]) => Self::Sparse(Sparse {
                lattice,
                nodes: whole(nodes),
                kernel: Kernel::from_number(kernel)?,
                scatter: Scatter::from_number(scatter)?,
            }),
            (Op::SpotNoise, &[nodes, kernel, stretch, variety, x, y, z]) => Self::Spot(Spot {
                nodes: Sparse {
                    lattice,
                    nodes: whole(nodes),
                    kernel: Kernel::from_number(kernel)?,
                    scatter: Scatter::Uniform,
                },
                stretch: narrow(stretch),
                variety: narrow(variety),
                axis: unit([x, y, z]),
            }),
            (Op::WaveletNoise, []) => Self::Wavelet(lattice),
            (
                Op::CellularNoise | Op::PlaneCellularNoise,
                &[norm, density, a, b, c, d, raised, unbiased],
            ) => {
                let options = cellular::Options {
                    norm,
                    density,
                    weights: [a, b, c, d],
                    exponent: 1.0 + raised,
                    planar: op == Op::PlaneCellularNoise,
                    unbiased: unbiased != 0.0,
                };
                Self::Cellular(Box::new(Cellular::new(lattice, options)))
            }
            _ => return None,
        })
    }

    /// The same noise over the lattice of another key.
    pub(crate) fn keyed(&self, key: u32) -> Self {
        let lattice = Lattice::new(key);
        let mut noise = self.clone();
        match &mut noise {
            Self::Lattice(_, own) | Self::Simplex(own) | Self::Wavelet(own) => *own = lattice,
            Self::Spot(spot) => *spot.lattice_mut() = lattice,
            Self::Sparse(sparse) => sparse.lattice = lattice,
            Self::Cellular(cellular) => cellular.lattice = lattice,
        }
        noise
    }

    /// Whether the noise is a function of skewed coordinates, see [`simplex::skew`].
    pub(crate) fn is_skewed(&self) -> bool {
        matches!(self, Self::Simplex(_))
    }

    /// All values lie within, as they are computed.
    pub(crate) fn range(&self) -> Interval {
        let around = |most: f64| Interval::new(-most, most);
        match self {
            Self::Lattice(Corner::Gradient, _) => around(gradient::RANGE),
            Self::Lattice(Corner::Value, _) => around(lattice::VALUE_RANGE).expand(self.rounding()),
            Self::Lattice(Corner::ValueGradient, _) => around(lattice::VALUE_GRADIENT_RANGE),
            Self::Simplex(_) => around(simplex::RANGE),
            Self::Sparse(sparse) => around(sparse.range()).expand(sparse.rounding()),
            Self::Spot(spot) => around(spot.range()).expand(spot.rounding()),
            Self::Wavelet(_) => around(wavelet::range()).expand(self.rounding()),
            Self::Cellular(cellular) => {
                let (low, high) = cellular.range();
                Interval::new(low, high)
            }
        }
    }

    /// No slope by the place is greater.
    pub(crate) fn slope(&self) -> f64 {
        match self {
            Self::Lattice(Corner::Gradient, _) => gradient::SLOPE,
            Self::Lattice(Corner::Value, _) => lattice::VALUE_SLOPE,
            Self::Lattice(Corner::ValueGradient, _) => lattice::VALUE_GRADIENT_SLOPE,
            Self::Simplex(_) => simplex::SLOPE,
            Self::Sparse(sparse) => sparse.slope(),
            Self::Spot(spot) => spot.slope(),
            Self::Wavelet(_) => wavelet::slope(),
            Self::Cellular(cellular) => cellular.slope(),
        }
    }

    /// No second derivative along a direction is greater; infinite where the gradient jumps.
    pub(crate) fn bend(&self) -> f64 {
        match self {
            Self::Lattice(Corner::Gradient, _) => lattice::GRADIENT_BEND,
            Self::Lattice(Corner::Value, _) => lattice::VALUE_BEND,
            Self::Lattice(Corner::ValueGradient, _) => lattice::GRADIENT_BEND + lattice::VALUE_BEND,
            Self::Simplex(_) => simplex::BEND,
            Self::Sparse(sparse) => sparse.bend(),
            Self::Spot(spot) => spot.bend(),
            Self::Wavelet(_) => wavelet::bend(),
            Self::Cellular(_) => f64::INFINITY,
        }
    }

    /// No value is farther from the exact one at its f32 offset.
    pub(crate) fn rounding(&self) -> f64 {
        match self {
            Self::Lattice(Corner::Gradient, _) => gradient::ROUNDING,
            Self::Lattice(..) => 2.0 * gradient::ROUNDING,
            Self::Simplex(_) => 8e-6,
            Self::Sparse(sparse) => sparse.rounding(),
            Self::Spot(spot) => spot.rounding(),
            Self::Wavelet(_) => 4e-6,
            Self::Cellular(cellular) => cellular.rounding(),
        }
    }

    /// No component of a gradient is farther from the exact one at its f32 offset.
    pub(crate) fn slope_rounding(&self) -> f64 {
        16.0 * self.rounding()
    }

    /// The noise at a place.
    pub(crate) fn value_at(&self, p: [f64; 3]) -> f64 {
        let [(x, u), (y, v), (z, w)] = self.skewed(p).map(gradient::split);
        f64::from(self.value([x, y, z], [u, v, w]))
    }

    /// The noise's gradient at a place, thesis eq. (4.2).
    pub(crate) fn gradient_at(&self, p: [f64; 3]) -> [f64; 3] {
        let [(x, u), (y, v), (z, w)] = self.skewed(p).map(gradient::split);
        let gradient = self.jet([x, y, z], [u, v, w]).gradient.map(f64::from);
        // The skewing is symmetric: it is its own transpose.
        self.skewed(gradient)
    }

    /// The noise's Hessian at a place, thesis eq. (4.3), by rows.
    #[cfg(test)]
    pub(crate) fn hessian_at(&self, p: [f64; 3]) -> [[f64; 3]; 3] {
        let [(x, u), (y, v), (z, w)] = self.skewed(p).map(gradient::split);
        let jet = self.jet2([x, y, z], [u, v, w]);
        let rows = [0, 1, 2].map(|axis| self.skewed(jet.row(axis).map(f64::from)));
        let columns = [0, 1, 2].map(|j| self.skewed(rows.map(|row| row[j])));
        [0, 1, 2].map(|i| columns.map(|column| column[i]))
    }

    fn skewed(&self, p: [f64; 3]) -> [f64; 3] {
        if self.is_skewed() {
            simplex::skew(p)
        } else {
            p
        }
    }

    /// The noise at an offset within a cell.
    #[inline(always)]
    pub(crate) fn value(&self, cell: [u32; 3], offset: [f32; 3]) -> f32 {
        match self {
            Self::Cellular(cellular) => cellular.value_gradient(cell, offset).0,
            _ => self.smooth(cell, offset),
        }
    }

    /// The noise and its gradient, by skewed coordinates if it is skewed.
    #[inline(always)]
    pub(crate) fn jet(&self, cell: [u32; 3], offset: [f32; 3]) -> Jet {
        match self {
            Self::Cellular(cellular) => {
                let (value, gradient) = cellular.value_gradient(cell, offset);
                Jet { value, gradient }
            }
            _ => self.smooth(cell, offset),
        }
    }

    /// The noise, its gradient and its Hessian; a gradient that jumps has a Hessian of 0.
    #[inline(always)]
    pub(crate) fn jet2(&self, cell: [u32; 3], offset: [f32; 3]) -> Jet2 {
        match self {
            Self::Cellular(cellular) => {
                let (value, gradient) = cellular.value_gradient(cell, offset);
                Jet2 {
                    value,
                    gradient,
                    hessian: [0.0; 6],
                }
            }
            _ => self.smooth(cell, offset),
        }
    }

    #[inline(always)]
    fn smooth<R: Real>(&self, cell: [u32; 3], offset: [f32; 3]) -> R {
        match self {
            Self::Lattice(Corner::Gradient, own) => {
                lattice::at(Corner::Gradient, *own, cell, offset)
            }
            Self::Lattice(Corner::Value, own) => lattice::at(Corner::Value, *own, cell, offset),
            Self::Lattice(Corner::ValueGradient, own) => {
                lattice::at(Corner::ValueGradient, *own, cell, offset)
            }
            Self::Simplex(own) => simplex::at(*own, cell, offset),
            Self::Sparse(sparse) => sparse.at(cell, offset),
            Self::Spot(spot) => spot.at(cell, offset),
            Self::Wavelet(own) => wavelet::at(*own, cell, offset),
            Self::Cellular(_) => unreachable!("it is no sum of smooth kernels"),
        }
    }
}

/// What is known of a noise everywhere: for loops that know as much of every noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// All values are within `range` of it.
    pub(crate) middle: f64,
    pub(crate) range: f64,
    /// Of [`Noise::slope`], [`Noise::bend`], [`Noise::rounding`] and [`Noise::slope_rounding`].
    pub(crate) slope: f64,
    pub(crate) bend: f64,
    pub(crate) rounding: f64,
    pub(crate) slope_rounding: f64,
}

impl Limits {
    /// Of gradient noise by its own loops.
    pub(crate) const GRADIENT: Self = Self {
        middle: 0.0,
        range: gradient::RANGE,
        slope: gradient::SLOPE,
        bend: gradient::BEND,
        rounding: gradient::ROUNDING,
        slope_rounding: 16.0 * gradient::ROUNDING,
    };

    /// Of any noise.
    pub(crate) fn of(noise: &Noise) -> Self {
        let Interval { low, high } = noise.range();
        Self {
            middle: 0.5 * (low + high),
            range: 0.5 * (high - low),
            slope: noise.slope(),
            bend: noise.bend(),
            rounding: noise.rounding(),
            slope_rounding: noise.slope_rounding(),
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the noise computes with f32"
)]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// The direction of a vector, `None` if it has none.
fn unit(v: [f64; 3]) -> Option<[f32; 3]> {
    let length = crate::arithmetic::length(v);
    (length > 0.0).then(|| v.map(|part| narrow(part / length)))
}

/// A whole number among an operation's constants; the graph checked its range.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole and in range: the graph checked it"
)]
pub(crate) fn whole(value: f64) -> u32 {
    value as u32
}
