//! Noises over an unbounded lattice, thesis ch. 4: one file each, all in the unified model (4.1)–(4.3).
//!
//! A coordinate is split into a cell, counted in f64, and an offset within it in f32, so that a planet has its
//! millimetres; all that follows is 32-bit arithmetic, except for cellular noise's distances. Cells are numbered
//! modulo 2³² and every random number is a hash of key and cell: a noise repeats every 4,294,967,296 cells.
//! What each noise can reach, and how steeply, stands in its file as constants that its tests prove or search.
//!
//! [`gradient`] noise is the default and has loops of its own; the others share `batch`.

pub(crate) mod batch;
pub mod cellular;
pub(crate) mod disc;
pub mod gradient;
pub(crate) mod jet;
pub(crate) mod kind;
pub mod lattice;
pub(crate) mod limits;
pub(crate) mod node;
#[cfg(test)]
mod proofs;
pub(crate) mod ranges;
pub mod simplex;
pub mod sparse;
pub mod spot;
#[cfg(test)]
mod tests;
pub mod wavelet;

pub use gradient::{BEND, RANGE, ROUNDING, SLOPE, noise, noise_gradient};
pub(crate) use gradient::{
    Lattice, corners, gradient_of, mean_gradient, node_hash, split, value, value_along, value_bend,
};
pub(crate) use kind::{Limits, Noise};
