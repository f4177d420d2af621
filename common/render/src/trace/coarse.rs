//! The surface without half of its noises: Worley and Hart's early exit, as a surface of its own.
//!
//! A field is nowhere farther from itself without some of its noises than a bound says ([`field::Program::moved_by`]). What
//! is left, less that bound, is below the field: where it is positive there is no root, and its own change says how
//! far that goes. Bundles and rays follow it far from the surface, for less an evaluation and with the slope of large
//! features alone. It finds no root: rays that come near go on by the whole field, and come back when they are far again.

use std::sync::Arc;

use field::Program;

use super::batch::Batch;
use super::clearance::{Around, Clearances};
use super::means::Means;
use super::surface::Surface;
use crate::crew::Crew;

/// The share of the octaves that is left. A third and two thirds spare less.
const SHARE: f64 = 0.5;

/// What an evaluation costs beside its noises, in noises, with what a step is besides.
const BESIDES: f64 = 6.0;

/// An evaluation that costs more than this share of a whole one is not worth trying: so it is of fields of four noises or fewer.
const COST_MAX: f64 = 0.75;

/// A ray goes over where a step of the coarse surface reaches so many times as far as one of the whole for what both cost, and
/// comes back where it reaches no farther.
const THERE: f64 = 1.3;

/// It is used where rays that are tried then cost at most this share: going there and back is not counted in that.
pub(crate) const WORTH: f64 = 0.85;

/// The surface with its coarse one; `None` if nothing bounds what that leaves out, or it costs nearly as much.
pub(crate) fn with(
    surface: &Surface,
    around: &Around<'_>,
    nearest: f64,
    crew: &dyn Crew,
) -> Option<Surface> {
    let whole = around.field;
    let cut = whole.cut(SHARE, &around.everywhere())?;
    let program = whole.coarse(&cut)?;
    let rest = match around.rest {
        Some(rest) => Some(rest.coarse(&cut)?),
        None => None,
    };
    let cost = |program: &Program| BESIDES + program.noise_evaluations(0.0) as f64;
    let cost = cost(&program) / cost(whole);
    if cost > COST_MAX {
        return None;
    }
    let around = Around {
        field: &program,
        rest: rest.as_ref(),
        cut: Some((whole, &cut)),
        ..*around
    };
    let clearances = Clearances::new(&around, nearest, crew);
    let both = Clearances::clone(&surface.clearances).turning(clearances, THERE * cost, cost);
    let [clearances, below] = both.map(Arc::new);
    let coarse = Surface {
        program,
        clearances: below,
        cost,
        means: Means::Values,
        gradients: false,
        ..surface.clone()
    };
    Some(Surface {
        clearances,
        coarse: Some(Arc::new(coarse)),
        ..surface.clone()
    })
}

/// Whether a lane's ray is so far from the surface that it should go over to the coarse one, or stay there if it is that.
#[inline]
pub(crate) fn is_far(surface: &Surface, batch: &Batch, i: usize) -> bool {
    batch.value[i] > surface.clearances.at(batch.distance[i]).turn
}
