//! Functions of space: noises, field graphs, and their evaluation over batches of points.
//!
//! A [`Graph`] says what a field is; everything that computes with it stands
//! behind the graph: points, gradients, ranges, moduli of continuity.
//! This crate knows no scene, ray, image or file.

mod arithmetic;
mod cascade;
pub mod curve;
pub mod fft;
pub mod graph;
pub mod grid;
pub mod hash;
pub mod interval;
mod lanes;
pub mod modulus;
pub mod noise;
mod number;
pub mod op;
pub mod points;
pub mod program;
pub mod range;
mod shape;
pub mod simd;
pub mod surroundings;

pub use graph::{Graph, GraphError, NodeId};
pub use interval::Interval;
pub use modulus::{Level, Modulus};
pub use op::{Basis, Kind, Op};
pub use points::{BATCH, Points, Scratch};
pub use program::{Boxes, CompileError, Cut, Outlook, Program, Prospect, Sides, Taylor};
pub use range::{Affine, Cell, Jet, Place, Reduced, Segment, Slope};
pub use simd::SimdLevel;
pub use surroundings::{Region, Surroundings};
