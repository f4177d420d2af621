//! Discrete surfaces: fields interpolated between samples on a regular grid (thesis §2.2, §3.2.2, §3.2.3).
//!
//! A grid's coordinates count samples: sample (i, j, k) stands at the place (i, j, k). A field puts it where
//! it belongs in the world by scaling and moving its argument. Grids of one layer are functions of x and y alone.
//!
//! [`Samples`] are what a file holds or a recipe synthesises; a [`Surface`] interpolates them by
//! tensor-product B-splines of degree 1 to 3 *through* the samples, with gradient, Hessian, and bounds of both over
//! boxes. Samples are f32, everything computed from them is f64, at every SIMD level by the same code.

mod basis;
mod filter;
pub mod kept;
mod midpoint;
mod pyramid;
pub(crate) mod recipe;
mod sea;
mod spectral;
mod surface;

#[cfg(test)]
mod tests;

pub use surface::{Edges, Surface};

use crate::hash::{hash, unit};

/// Most samples of a grid, and of all grids of a field together: 64 MiB of them.
pub const SAMPLES_MAX: usize = 1 << 24;

/// Fewest samples along an axis of a grid.
pub const SIDE_MIN: usize = 4;

/// Why numbers are no grid.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum GridError {
    /// Too few samples along an axis.
    #[error("a grid has at least {SIDE_MIN} samples along each axis")]
    TooSmall,
    /// Too many samples.
    #[error("a grid has at most {SAMPLES_MAX} samples")]
    TooLarge,
    /// Not as many numbers as the sides say.
    #[error("a grid of {0} samples has {1} numbers")]
    Count(usize, usize),
    /// A sample is NaN or infinite.
    #[error("sample {0} of the grid is not a finite number")]
    NotFinite(usize),
}

/// Numbers on a regular grid of two or three dimensions.
#[derive(Clone, PartialEq, Debug)]
pub struct Samples {
    sides: [usize; 3],
    values: Vec<f32>,
}

impl Samples {
    /// A grid of `sides` samples, x running fastest; a third side of 1 makes it a function of x and y.
    pub fn new(sides: [usize; 3], values: Vec<f32>) -> Result<Self, GridError> {
        let count = Self::count(sides)?;
        if count != values.len() {
            return Err(GridError::Count(count, values.len()));
        }
        match values.iter().position(|value| !value.is_finite()) {
            Some(place) => Err(GridError::NotFinite(place)),
            None => Ok(Self { sides, values }),
        }
    }

    /// How many samples such sides make, if they are a grid's.
    pub fn count(sides: [usize; 3]) -> Result<usize, GridError> {
        let [x, y, z] = sides;
        if x < SIDE_MIN || y < SIDE_MIN || (z < SIDE_MIN && z != 1) {
            return Err(GridError::TooSmall);
        }
        match x.checked_mul(y).and_then(|xy| xy.checked_mul(z)) {
            Some(count) if count <= SAMPLES_MAX => Ok(count),
            _ => Err(GridError::TooLarge),
        }
    }

    /// How many samples there are along x, y and z.
    pub fn sides(&self) -> [usize; 3] {
        self.sides
    }

    /// The samples, x running fastest.
    pub fn values(&self) -> &[f32] {
        &self.values
    }
}

/// A Gaussian number of zero mean and unit variance, keyed by words: Box and Muller's method.
fn gaussian(key: u32, stream: u32, words: [u32; 3]) -> f64 {
    let [a, b, c] = words;
    let number = |part: u32| unit(hash(&[key, stream, a, b, c, part]));
    let radius = libm::sqrt(-2.0 * libm::log(1.0 - number(0)));
    radius * libm::cos(std::f64::consts::TAU * number(1))
}

/// A count of samples as a number; a double holds it.
#[expect(clippy::cast_precision_loss, reason = "at most SAMPLES_MAX")]
pub(crate) fn whole(count: usize) -> f64 {
    count as f64
}

/// A sample, as grids store it.
#[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
fn stored(value: f64) -> f32 {
    value as f32
}
