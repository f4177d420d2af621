//! Functions of space: noises, field graphs, and their evaluation over batches of points.
//!
//! A [`Graph`] says what a field is; everything that computes with it stands
//! behind the graph: points, gradients, ranges, moduli of continuity.
//! This crate knows no scene, ray, image or file.

pub mod graph;
pub mod op;

pub use graph::{Graph, GraphError, NodeId};
pub use op::{Basis, Kind, Op};
