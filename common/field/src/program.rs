//! Compiled fields: a graph flattened for evaluation over batches of points.

use crate::interval::Interval;
use crate::modulus::Modulus;
use crate::points::{Points, Scratch};
use crate::simd::SimdLevel;
use crate::surroundings::Surroundings;
use crate::{Graph, NodeId};

/// A field ready for evaluation; shared by threads.
#[derive(Clone, Debug)]
pub struct Program {}

/// Why a graph could not be compiled.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CompileError {
    /// A root is no node of the graph.
    #[error("node {0} is not in the graph")]
    Missing(u32),
    /// A root yields a vector.
    #[error("a field yields one number, but `{0}` yields three; take its length or a component")]
    Vector(&'static str),
    /// Too many intermediate results are alive at once.
    #[error("the field keeps {0} intermediate results at once; the most is 4096")]
    TooWide(usize),
}

impl Program {
    /// Compiles the fields `roots` of `graph` for instants in `time`: what is constant over them is computed once, here.
    pub fn compile(graph: &Graph, roots: &[NodeId], time: Interval) -> Result<Self, CompileError> {
        let _ = (graph, roots, time);
        Ok(Self {})
    }

    /// Evaluates every root at every point: `out` has one slice per root, each as long as the batch.
    ///
    /// The values are the same to the bit at every level, and a point's values do not depend on
    /// its neighbours or its place in the batch. A value that is not a number counts as outside: +∞.
    ///
    /// # Panics
    /// If the slices differ in length or number.
    pub fn evaluate(
        &self,
        level: SimdLevel,
        points: &Points<'_>,
        scratch: &mut Scratch,
        out: &mut [&mut [f64]],
    ) {
        let _ = (level, points, scratch, out);
    }

    /// Evaluates the first root and its gradient with respect to the place, thesis eq. (2.17).
    ///
    /// The value is that of [`Program::evaluate`] to the bit. A level-of-detail weight counts as constant:
    /// the gradient is that of the surface as it is seen. A component that is not a number becomes 0.
    ///
    /// # Panics
    /// If the slices differ in length, or the program has no root.
    pub fn evaluate_gradient(
        &self,
        level: SimdLevel,
        points: &Points<'_>,
        scratch: &mut Scratch,
        value: &mut [f64],
        gradient: [&mut [f64]; 3],
    ) {
        let _ = (level, points, scratch, value, gradient);
    }

    /// The values that each root can take, rounding included; may be infinite.
    pub fn range(&self, around: &Surroundings) -> Vec<Interval> {
        let _ = around;
        Vec::new()
    }

    /// How far the first root's value can move with the place.
    pub fn modulus(&self, around: &Surroundings) -> Modulus {
        let _ = around;
        Modulus::default()
    }

    /// How many noises one evaluation of all roots needs at a place of that footprint.
    ///
    /// [`Scratch::noise_evaluations`] counts them as they are evaluated; both depend on
    /// the places alone, not on batches or levels.
    pub fn noise_evaluations(&self, footprint: f64) -> u64 {
        let _ = footprint;
        0
    }
}
