//! The shapes of thesis chapter 2: implicit functions with parameters of their own.
//!
//! A shape is one operation of a graph: a function of a place (or of two numbers, where it joins
//! surfaces) with its list of constants. Each is written once, over [`Local`] numbers, and states
//! its range and its slope over a region. What the constants mean is said where the shape is made.

mod bend;
mod bernstein;
mod blend;
mod blobs;
mod convolution;
mod distance;
mod kernel;
mod lanes;
mod local;
mod polynomial;
mod roots;
mod skeleton;
mod sum;
mod superquadric;
mod supports;
mod within;

#[cfg(test)]
pub(crate) mod tests;

use fearless_simd::Simd;

use crate::interval::{Interval, larger};
use crate::op::Op;
use crate::range::Arithmetic;
use bend::Bend;
use bernstein::Bernstein;
use blend::Blend;
pub(crate) use blobs::{Blobs, Met, Walk};
use convolution::Convolution;
use distance::Distances;
pub(crate) use lanes::Rows;
pub(crate) use local::Local;
use polynomial::Polynomial;
use superquadric::Superquadric;
pub(crate) use within::{Known, Within};

/// Why parameters are refused: what is wanted, and what was given.
pub(crate) type Refusal = (&'static str, f64);

/// A shape, its constants digested.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Shape {
    Polynomial(Polynomial),
    Superquadric(Superquadric),
    Blobs(Blobs),
    Distances(Distances),
    Convolution(Convolution),
    Bernstein(Bernstein),
    Bend(Bend),
    Blend(Blend),
}

impl Shape {
    /// The shape of an operation; `None` if the operation is none.
    pub(crate) fn new(op: Op, params: &[f64]) -> Option<Result<Self, Refusal>> {
        Some(match op {
            Op::Polynomial => Polynomial::new(params).map(Self::Polynomial),
            Op::Superquadric => Superquadric::new(params).map(Self::Superquadric),
            Op::Blobs => Blobs::new(params).map(Self::Blobs),
            Op::Distances => Distances::new(params).map(Self::Distances),
            Op::Convolution => Convolution::new(params).map(Self::Convolution),
            Op::Bernstein => Bernstein::new(params).map(Self::Bernstein),
            Op::Bend => Bend::new(params).map(Self::Bend),
            Op::Blend => Blend::new(params).map(Self::Blend),
            _ => return None,
        })
    }

    /// Its value at a place; a blend takes the first two numbers.
    #[inline]
    pub(crate) fn value<N: Local>(&self, at: [N; 3]) -> N {
        match self {
            Self::Polynomial(shape) => shape.value(at),
            Self::Superquadric(shape) => shape.value(at),
            Self::Blobs(shape) => shape.value(at),
            Self::Distances(shape) => shape.value(at),
            Self::Convolution(shape) => shape.value(at),
            Self::Bernstein(shape) => shape.value(at),
            Self::Bend(shape) => shape.value(at),
            Self::Blend(shape) => {
                let [a, b, _] = at;
                shape.value(a, b)
            }
        }
    }

    /// Its values at the first `n` lanes' places, those of [`Self::value`] to the bit; `n` is a multiple of [`lanes::WIDTH`].
    #[inline(always)]
    pub(crate) fn values<S: Simd, R: Rows>(&self, simd: S, n: usize, at: [&R; 3], out: &mut R) {
        match self {
            Self::Blobs(shape) => shape.values(simd, n, at, out),
            _ => lanes::each(n, at, out, |at| self.value(at)),
        }
    }

    /// What is known over a region. The slope is per unit of the place, of a blend per unit of the larger change.
    pub(crate) fn bound(&self, within: &Within) -> Known {
        match self {
            Self::Polynomial(shape) => shape.bound(within),
            Self::Superquadric(shape) => shape.bound(within),
            Self::Blobs(shape) => shape.bound(within),
            Self::Distances(shape) => shape.bound(within),
            Self::Convolution(shape) => shape.bound(within),
            Self::Bernstein(shape) => shape.bound(within),
            Self::Bend(shape) => shape.bound(within),
            Self::Blend(shape) => {
                let [a, b, _] = within.parts;
                Known {
                    range: shape.range(a, b),
                    slope: shape.stretch(),
                    rounding: shape.rounding(a, b),
                }
            }
        }
    }
}

impl Shape {
    /// All second derivatives along unit directions over a region; infinite where they have no bound.
    pub(crate) fn bend(&self, within: &Within) -> Interval {
        match self {
            Self::Polynomial(shape) => shape.bend(within),
            Self::Blobs(shape) => shape.bend(within),
            Self::Distances(shape) => shape.bend(within),
            Self::Convolution(shape) => shape.bend(within),
            // Powers from 1 on of norms are convex.
            Self::Superquadric(_) => Interval::new(0.0, f64::INFINITY),
            Self::Bernstein(_) | Self::Bend(_) | Self::Blend(_) => Interval::ALL,
        }
    }

    /// What is known over a box of places, or over the values of two numbers.
    pub(crate) fn known(&self, parts: [Interval; 3]) -> Known {
        let norm = Interval::new(0.0, f64::INFINITY);
        self.bound(&Within { parts, norm })
    }

    /// Its value in an arithmetic of ranges: a polynomial keeps what its parts know of each other.
    pub(crate) fn enclosed<T: Arithmetic>(&self, at: [T; 3]) -> T {
        let known = self.known(at.each_ref().map(T::range));
        match self {
            Self::Polynomial(shape) => shape.value(at).within(known.range),
            _ => T::any(known.range),
        }
    }

    /// How fast the value can change where its arguments change that fast.
    pub(crate) fn carried(&self, slope: f64, [x, y, z]: [f64; 3]) -> f64 {
        let rate = match self {
            Self::Blend(_) => larger(x, y),
            _ => (x * x + y * y + z * z).sqrt(),
        };
        if rate == 0.0 {
            0.0
        } else {
            slope * rate * (1.0 + 1e-12)
        }
    }
}

impl Within {
    /// The values of two numbers.
    pub(crate) fn of_numbers(a: Interval, b: Interval) -> Self {
        Self {
            parts: [a, b, Interval::point(0.0)],
            norm: Interval::new(0.0, f64::INFINITY),
        }
    }
}
