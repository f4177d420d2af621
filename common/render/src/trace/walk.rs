//! Rays of fields that say how far each ray is clear: they are walked to their first roots, many together.
//!
//! That takes the place of bundles and of the steps between: what the search still does is to look at the point of the ray's
//! grid behind. Rays that are clear to their ends are done.

use field::{BATCH, Prospect, Scratch};

use super::batch::{Batch, Lanes, Paths};
use super::bundle::Span;
use super::surface::Surface;
use super::tracer::Ray;
use crate::counts::Counts;

/// Memory in which rays are walked.
#[derive(Default)]
pub(crate) struct Walks {
    paths: Paths,
    batch: Batch,
    rows: Box<Rows>,
}

#[repr(align(64))]
struct Rows {
    offset: Lanes,
    limit: Lanes,
    clear: Lanes,
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            offset: [0.0; BATCH],
            limit: [0.0; BATCH],
            clear: [0.0; BATCH],
        }
    }
}

impl Walks {
    /// Moves the start of every span as far along as its ray is proven to be clear, and leaves out spans that end before.
    pub(crate) fn lead(
        &mut self,
        surface: &Surface,
        rays: &[Ray],
        spans: &mut Vec<Span>,
        scratch: &mut Scratch,
        counts: &mut Counts,
    ) {
        let Self { paths, batch, rows } = self;
        let mut kept = 0;
        for first in (0..spans.len()).step_by(BATCH) {
            let n = BATCH.min(spans.len() - first);
            for (lane, span) in spans[first..first + n].iter().enumerate() {
                let ray = &rays[span.ray];
                let steps = ray.grid.steps();
                paths.set(lane, ray.origin, ray.direction, ray.from_eye, ray.time);
                // No place of the ray is farther from the eye.
                let farthest = paths.eye_square[lane].sqrt() + span.end;
                (rows.offset[lane], _) = surface.clearances.at(farthest).errors;
                rows.clear[lane] = span.clear;
                rows.limit[lane] = steps.after(steps.from(span.end)) - span.clear;
            }
            surface.level.vectorize(
                #[inline(always)]
                || batch.go(surface, n, paths, &rows.clear),
            );
            // They grow with the distance, but nearest to the eye, where those of all distances serve.
            for (offset, distance) in rows.offset[..n].iter_mut().zip(&batch.distance) {
                let (error, _) = surface.clearances.at(*distance).errors;
                *offset = if error > *offset { error } else { *offset };
            }
            let prospect = Prospect {
                offset: &rows.offset[..n],
                limit: &rows.limit[..n],
            };
            batch.walk(surface, n, paths, prospect, &mut rows.clear[..n], scratch);
            counts.evaluations += n as u64;
            counts.steps += n as u64;
            for lane in 0..n {
                let mut span = spans[first + lane];
                if rows.clear[lane] < rows.limit[lane] {
                    span.clear += rows.clear[lane];
                    spans[kept] = span;
                    kept += 1;
                }
            }
        }
        spans.truncate(kept);
    }
}
