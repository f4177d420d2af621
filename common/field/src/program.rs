//! Compiled fields: a graph flattened for evaluation over batches of points.

mod ahead;
mod bends;
mod bounds;
mod boxes;
mod coarse;
mod code;
mod fold;
mod machine;
pub(crate) mod plan;
mod simplify;
mod slopes;
mod walk;

#[cfg(test)]
mod bound_tests;
#[cfg(test)]
pub(crate) mod tests;

use crate::interval::Interval;
use crate::lanes::Lanes;
use crate::modulus::Modulus;
use crate::points::{BATCH, Points, Scratch};
use crate::range::Reduced;
use crate::simd::{SimdLevel, dispatch};
use crate::surroundings::Surroundings;
use crate::{Graph, NodeId};
pub(crate) use ahead::Ahead;
pub use ahead::{Outlook, Sides};
pub use bends::Taylor;
pub(crate) use bounds::Change;
use bounds::Pass;
pub use boxes::Boxes;
pub(crate) use boxes::OverBoxes;
pub use coarse::Cut;
use code::{Code, Instruction, Operation};
use machine::Count;
pub(crate) use machine::Machine;
use plan::Plan;
pub(crate) use slopes::Slopes;
pub use walk::Prospect;

/// A field ready for evaluation; shared by threads.
#[derive(Clone, Debug)]
pub struct Program {
    pub(crate) plan: Plan,
    code: Code,
    walks: bool,
}

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
    /// Its grids are too large.
    #[error("the grids of the fields have more than {max} samples together", max = crate::grid::SAMPLES_MAX)]
    TooManySamples,
    /// A grid's file was not attached.
    #[error("the samples of file number {0} are not here")]
    NoFile(u32),
}

impl Program {
    /// Compiles the fields `roots` of `graph` for instants in `time`: what is constant over them is computed once, here.
    pub fn compile(graph: &Graph, roots: &[NodeId], time: Interval) -> Result<Self, CompileError> {
        let plan = Plan::new(graph, roots, time)?;
        let code = Code::new(&plan)?;
        Ok(Self::of_code(plan, code))
    }

    fn of_code(plan: Plan, code: Code) -> Self {
        let walks = walk::is_walked(&code);
        Self { plan, code, walks }
    }

    /// Whether its values change over the time that it was compiled for.
    pub fn moves(&self) -> bool {
        self.plan
            .steps
            .iter()
            .any(|step| matches!(step.act, plan::Act::Time))
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
        let n = points.len();
        assert!(
            out.len() == self.code.roots.len() && out.iter().all(|out| out.len() == n),
            "there is a result slice per root, as long as the batch"
        );
        let Scratch {
            noise_evaluations,
            machine,
            ..
        } = scratch;
        machine.prepare(&self.code);
        let mut start = 0;
        while start < n {
            let count = dispatch!(level, simd => machine.run(simd, &self.code, points, start, noise_evaluations));
            let end = start + count.points;
            for (out, root) in out.iter_mut().zip(&self.code.roots) {
                numbers(&mut out[start..end], machine.register(*root), f64::INFINITY);
            }
            start = end;
        }
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
        let n = points.len();
        assert!(
            value.len() == n && gradient.iter().all(|part| part.len() == n),
            "the result slices are as long as the batch"
        );
        let root = *self.code.roots.first().expect("there is a root");
        let Scratch {
            noise_evaluations,
            slopes,
            ..
        } = scratch;
        slopes.prepare(&self.code);
        let [gx, gy, gz] = gradient;
        let mut start = 0;
        while start < n {
            let count = dispatch!(level, simd => slopes.run(simd, &self.code.instructions, points, start, noise_evaluations));
            let duals = slopes.register(root);
            let end = start + count.points;
            let [x, y, z] = &duals.gradient;
            numbers(&mut value[start..end], &duals.value, f64::INFINITY);
            numbers(&mut gx[start..end], x, 0.0);
            numbers(&mut gy[start..end], y, 0.0);
            numbers(&mut gz[start..end], z, 0.0);
            start = end;
        }
    }

    /// Evaluates the first root and its derivative along a direction at each point.
    ///
    /// The value is that of [`Program::evaluate`] to the bit; the derivative is the gradient's product with
    /// the direction but for rounding, at two thirds of the gradient's cost. One that is not a number becomes 0.
    ///
    /// # Panics
    /// If the slices differ in length, or the program has no root.
    pub fn evaluate_along(
        &self,
        level: SimdLevel,
        points: &Points<'_>,
        direction: [&[f64]; 3],
        scratch: &mut Scratch,
        [value, slope]: [&mut [f64]; 2],
    ) {
        let n = points.len();
        assert!(
            value.len() == n && slope.len() == n && direction.iter().all(|part| part.len() == n),
            "the slices are as long as the batch"
        );
        let root = *self.code.roots.first().expect("there is a root");
        let Scratch {
            noise_evaluations,
            along,
            ..
        } = scratch;
        along.prepare(&self.code);
        along.keep_noises(false);
        let mut start = 0;
        while start < n {
            let code = &self.code.instructions;
            let count = Self::run_along(
                level,
                code,
                points,
                direction,
                start,
                along,
                noise_evaluations,
            );
            let duals = along.register(root);
            let end = start + count.points;
            numbers(&mut value[start..end], &duals.value, f64::INFINITY);
            numbers(&mut slope[start..end], &duals.gradient[0], 0.0);
            start = end;
        }
    }

    /// Values and derivatives along directions of the points from `start` on. Both evaluations with such derivatives
    /// call it, so that its loops are compiled once per SIMD level.
    #[inline(never)]
    fn run_along(
        level: SimdLevel,
        instructions: &[Instruction],
        points: &Points<'_>,
        direction: [&[f64]; 3],
        start: usize,
        along: &mut Slopes<1>,
        noises: &mut u64,
    ) -> Count {
        along.aim(direction, start);
        dispatch!(level, simd => along.run(simd, instructions, points, start, noises))
    }

    /// Whether [`Program::evaluate_ahead`] can bound the first root.
    pub fn looks_ahead(&self) -> bool {
        ahead::bounds(&self.code)
    }

    /// Whether [`Program::walk`] serves the first root: so it is where that is blobs alone, of a place that moves evenly along
    /// straight rays.
    pub fn walks(&self) -> bool {
        self.walks
    }

    /// How far ahead of each place along its direction the first root is positive: walked to where it is not, with luck.
    ///
    /// `clear` gets distances that are proven for values as they are computed, up to the limit. Nothing is evaluated.
    ///
    /// # Panics
    /// If the slices differ in length or are longer than a batch, or if the program does not [walk](Self::walks).
    pub fn walk(
        &self,
        level: SimdLevel,
        points: &Points<'_>,
        direction: [&[f64]; 3],
        prospect: Prospect<'_>,
        scratch: &mut Scratch,
        clear: &mut [f64],
    ) {
        let n = points.len();
        assert!(
            n <= BATCH
                && [prospect.offset, prospect.limit, &*clear]
                    .iter()
                    .chain(&direction)
                    .all(|slice| slice.len() == n),
            "the slices are as long as the batch, and that is one"
        );
        if n == 0 {
            return;
        }
        let (blobs, args) = walk::blobs(&self.code)
            .filter(|_| self.walks)
            .expect("the program walks");
        let Scratch {
            noise_evaluations,
            along,
            met,
            ..
        } = scratch;
        along.prepare(&self.code);
        along.keep_noises(false);
        // What the blobs' place is made by alone.
        let code = &self.code.instructions;
        let code = &code[..code.len() - 1];
        Self::run_along(level, code, points, direction, 0, along, noise_evaluations);
        dispatch!(level, simd => walk::run(simd, (blobs, args), along, prospect, met, clear));
    }

    /// [`Program::evaluate_along`], and how far ahead of each place along its direction the first root is positive, and
    /// how far behind it.
    ///
    /// `ahead` and `behind` get distances that are proven for values as they are computed, 0 if nothing is; no farther than
    /// outlooks say, and behind only if they look there.
    /// `bend` holds how fast the range of the derivative is thought to spread with the distance from the place, in the
    /// field's unit per square metre, 0 if nothing is known of it, and gets how fast it was seen to.
    ///
    /// # Panics
    /// If the slices differ in length or are longer than a batch, or if the program does not look ahead.
    pub fn evaluate_ahead(
        &self,
        level: SimdLevel,
        points: &Points<'_>,
        direction: [&[f64]; 3],
        outlook: Outlook<'_>,
        scratch: &mut Scratch,
        [value, slope, ahead, behind, bend]: [&mut [f64]; 5],
    ) {
        let n = points.len();
        assert!(
            n <= BATCH
                && [&*value, &*slope, &*ahead, &*behind, &*bend]
                    .iter()
                    .chain(&[outlook.offset, outlook.slope, outlook.limit])
                    .chain(&[outlook.least, outlook.most])
                    .chain(&direction)
                    .all(|slice| slice.len() == n),
            "the slices are as long as the batch, and that is one"
        );
        if n == 0 {
            return;
        }
        let root = *self.code.roots.first().expect("there is a root");
        let Scratch {
            noise_evaluations,
            along,
            stretches,
            ..
        } = scratch;
        along.prepare(&self.code);
        along.keep_noises(true);
        stretches.prepare(&self.code);
        let code = &self.code.instructions;
        Self::run_along(level, code, points, direction, 0, along, noise_evaluations);
        let seen = [ahead, behind, bend];
        dispatch!(level, simd => stretches.run(simd, &self.code, along, outlook, root, seen));
        let duals = along.register(root);
        numbers(value, &duals.value, f64::INFINITY);
        numbers(slope, &duals.gradient[0], 0.0);
    }

    /// The first root over boxes, as [`Program::over_cell`] gives it over one: many at a time and not quite as narrow.
    ///
    /// Fields with shapes, grids or gradients of noises are asked cell by cell.
    ///
    /// # Panics
    /// If the slices differ in length, or the program has no root.
    pub fn over_boxes(
        &self,
        level: SimdLevel,
        boxes: &Boxes<'_>,
        scratch: &mut Scratch,
        out: &mut [Reduced<3>],
    ) {
        assert!(boxes.len() == out.len(), "there is a result for every box");
        if !boxes::bounds(&self.code) {
            for (i, out) in out.iter_mut().enumerate() {
                *out = self.over_cell(&boxes.cell(i));
            }
            return;
        }
        let root = *self.code.roots.first().expect("there is a root");
        let machine = &mut scratch.boxes;
        machine.prepare(&self.code);
        let mut start = 0;
        while start < out.len() {
            start +=
                dispatch!(level, simd => machine.run(simd, &self.code, boxes, start, root, out));
        }
    }

    /// The values that each root can take, rounding included; may be infinite.
    pub fn range(&self, around: &Surroundings) -> Vec<Interval> {
        let bounds = Pass::new(around, 0.0).run(&self.plan);
        self.plan
            .roots
            .iter()
            .map(|&root| bounds[root].range())
            .collect()
    }

    /// How far the first root's value can move with the place.
    pub fn modulus(&self, around: &Surroundings) -> Modulus {
        let Some(&root) = self.plan.roots.first() else {
            return Modulus::default();
        };
        Modulus::of_levels(|radius| {
            let mut pass = Pass::new(around, radius);
            let bounds = pass.run(&self.plan);
            (bounds[root].change(), pass.crossings)
        })
    }

    /// How far the first root can fall below its tangent along a line; `None` if nothing bounds that.
    pub fn taylor(&self, around: &Surroundings) -> Option<Taylor> {
        bends::taylor(&self.plan, around)
    }

    /// How many noises one evaluation of all roots needs at a place of that footprint.
    ///
    /// [`Scratch::noise_evaluations`] counts them as they are evaluated; both depend on
    /// the places alone, not on batches or levels.
    pub fn noise_evaluations(&self, footprint: f64) -> u64 {
        self.code
            .instructions
            .iter()
            .map(|instruction| match &instruction.act {
                Operation::Noise(_) | Operation::AnyNoise(_) | Operation::Slope(..) => 1,
                Operation::Cascade(cascade) => cascade.count(footprint),
                _ => 0,
            })
            .sum()
    }
}

/// Copies lanes; `other` stands for what is not a number.
fn numbers(out: &mut [f64], lanes: &Lanes, other: f64) {
    for (out, value) in out.iter_mut().zip(lanes) {
        *out = if value.is_nan() { other } else { *value };
    }
}
