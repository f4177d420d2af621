//! The search along single rays: speculative sphere tracing, thesis fig. 5.5, with tangents.
//!
//! Every ray is a lane; lanes advance together, so that the field is evaluated on dense batches,
//! and a lane that is done makes room for the next ray. What a lane does depends on its own ray alone.
//!
//! A value and its derivative along the ray prove a stretch free of roots on either side: by the
//! bound of the field's change, which is the better far from the surface, or by that of its fall below
//! the tangent ([`field::Taylor`]), which is the better close to it.

mod rows;

use core::sync::atomic::Ordering;

use field::{BATCH, Scratch, Sides};
use rows::Rows;

use super::batch::{Batch, Paths};
use super::bound;
use super::bracket::End;
use super::bundle::Span;
use super::coarse;
use super::grid::Steps;
use super::means::Means;
use super::polish::Found;
use super::surface::{Looks, Surface};
use super::techniques::Technique;
use super::tracer::{Goal, Hit, Ray, Results, Wanted};
use crate::error::Cancelled;

/// Most evaluations along one ray: more than a ray's grid has points within any scene that can be rendered in
/// a day, so that no answer depends on where a search began. A ray that still is not done counts as a hit where it stands.
pub(crate) const STEPS_MAX: f64 = 4_194_304.0;

/// Memory in which rays are searched.
#[derive(Default)]
pub(crate) struct Search {
    rays: Vec<Lane>,
    paths: Paths,
    pub(crate) batch: Batch,
    rows: Box<Rows>,
}

/// What a lane keeps that its steps do not change.
#[derive(Clone, Copy)]
struct Lane {
    ray: usize,
    steps: Steps,
    /// After so many evaluations it pauses.
    pause: f64,
}

/// When rays pause in their search, to be led on by what costs less, and those that did. They also do where they come
/// far from a surface that has a coarse one, and near on that.
pub(crate) struct Pause<'a> {
    /// After so many evaluations of a round.
    pub(crate) after: f64,
    pub(crate) spans: &'a mut Vec<Span>,
}

impl Search {
    /// Searches along every span until the ray is done or pauses. Rays that find a point inside go to `found`, which gets the memory
    /// of evaluations and the counts with them; for those that need no more, `hits` has the answer. On a coarse surface nothing is
    /// found. With `TURNS`, rays pause where another surface serves them better: one that has or is a coarse one must be followed so.
    pub(crate) fn run<const TURNS: bool>(
        &mut self,
        Wanted {
            surface,
            goal,
            rays,
            cancel,
        }: Wanted<'_>,
        spans: &[Span],
        pause: Pause<'_>,
        Results {
            scratch,
            counts,
            hits,
        }: Results<'_>,
        mut found: impl FnMut(Found, Results<'_>),
    ) -> Result<(), Cancelled> {
        // Rays towards the sun begin at the surface and leave it: they gain nothing by looking back.
        let looks = match goal {
            Goal::Distance => surface.looks,
            Goal::Occlusion => Looks::default(),
        };
        let is_coarse = TURNS && surface.is_coarse();
        let mut waiting = spans.iter();
        loop {
            while self.rays.len() < BATCH {
                let Some(span) = waiting.next() else {
                    break;
                };
                self.start(self.rays.len(), rays, span, pause.after);
            }
            let n = self.rays.len();
            if n == 0 {
                return Ok(());
            }
            if cancel.load(Ordering::Relaxed) || surface.spend(n as u64).is_err() {
                self.rays.clear();
                return Err(Cancelled);
            }
            self.step(surface, looks, n, scratch);
            counts.evaluations += n as u64;
            for i in (0..n).rev() {
                let rows = &self.rows;
                counts.backtracks += u64::from(rows.back[i] > 0.0);
                let is_found = !is_coarse && rows.clear[i] >= rows.inside[i];
                let is_exhausted = !is_coarse && rows.count[i] > surface.steps_max;
                if !is_found && !is_exhausted && rows.clear[i] <= rows.end[i] {
                    let lane = &self.rays[i];
                    let is_due = rows.count[i] >= lane.pause;
                    // Whoever knows a point inside is about to find the first, but not on a surface that is below.
                    let knows_inside = rows.inside[i] < f64::INFINITY;
                    let is_far = || coarse::is_far(surface, &self.batch, i);
                    let pauses = if is_coarse {
                        is_due || knows_inside || !is_far()
                    } else {
                        !knows_inside && (is_due || TURNS && is_far())
                    };
                    if pauses {
                        pause.spans.push(Span {
                            ray: lane.ray,
                            clear: rows.clear[i],
                            end: rows.end[i],
                            steps: rows.count[i],
                        });
                        self.replace(i, rays, &mut waiting, pause.after);
                    }
                    continue;
                }
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a small whole number"
                )]
                let steps = rows.count[i] as u64;
                counts.steps += steps;
                let lane = self.rays[i];
                if is_found && goal == Goal::Occlusion {
                    hits[lane.ray] = Hit::Surface(rows.inside[i]);
                } else if is_found {
                    let end = |t: f64, value: f64| End { t, value };
                    let one = Found {
                        ray: lane.ray,
                        steps: lane.steps,
                        inside: end(rows.inside[i], rows.inside_value[i]),
                        outside: end(rows.outside[i], rows.outside_value[i]),
                    };
                    let results = Results {
                        scratch,
                        counts,
                        hits,
                    };
                    found(one, results);
                } else if is_exhausted {
                    counts.exhausted += 1;
                    hits[lane.ray] = Hit::Surface(rows.clear[i]);
                }
                self.replace(i, rays, &mut waiting, pause.after);
            }
        }
    }

    /// Puts a ray into a lane, the next one or another's; whether it has any point to look at.
    fn start(&mut self, lane: usize, rays: &[Ray], span: &Span, pause: f64) -> bool {
        let ray = &rays[span.ray];
        let steps = ray.grid.steps();
        let (clear, end) = (steps.from(span.clear), steps.from(span.end));
        if clear > end {
            return false;
        }
        self.paths
            .set(lane, ray.origin, ray.direction, ray.from_eye, ray.time);
        let rows = &mut self.rows;
        rows.end[lane] = end;
        rows.clear[lane] = clear;
        rows.at[lane] = clear;
        rows.inside[lane] = f64::INFINITY;
        rows.inside_value[lane] = 0.0;
        rows.outside[lane] = f64::NEG_INFINITY;
        rows.outside_value[lane] = 0.0;
        rows.count[lane] = span.steps;
        rows.seen[lane] = 0.0;
        rows.bend[lane] = 0.0;
        rows.steps.set(lane, steps);
        let begun = Lane {
            ray: span.ray,
            steps,
            pause: span.steps + pause,
        };
        match self.rays.get_mut(lane) {
            Some(other) => *other = begun,
            None => self.rays.push(begun),
        }
        true
    }

    /// Puts the next ray into the lane of one that is done, or the last lane's where there is none.
    fn replace(
        &mut self,
        i: usize,
        rays: &[Ray],
        waiting: &mut core::slice::Iter<'_, Span>,
        pause: f64,
    ) {
        if !waiting.any(|span| self.start(i, rays, span, pause)) {
            self.remove(i);
        }
    }

    fn remove(&mut self, i: usize) {
        self.rays.swap_remove(i);
        let last = self.rays.len();
        if i == last {
            return;
        }
        self.paths.copy(last, i);
        let rows = &mut *self.rows;
        for row in [
            &mut rows.end,
            &mut rows.clear,
            &mut rows.at,
            &mut rows.inside,
            &mut rows.inside_value,
            &mut rows.outside,
            &mut rows.outside_value,
            &mut rows.count,
            &mut rows.seen,
            &mut rows.bend,
        ] {
            row[i] = row[last];
        }
        rows.steps.copy(last, i);
    }

    /// One evaluation of every lane, and what follows from it.
    fn step(&mut self, surface: &Surface, looks: Looks, n: usize, scratch: &mut Scratch) {
        let Self {
            paths, batch, rows, ..
        } = self;
        surface.level.vectorize(
            #[inline(always)]
            || batch.go(surface, n, paths, &rows.at),
        );
        for i in 0..n {
            let clearance = surface.clearances.at(batch.distance[i]);
            (rows.error[i], rows.slope_error[i]) = clearance.errors;
            rows.reach[i] = clearance.reach;
        }
        let means = surface.steps_by();
        if means == Means::Stretches {
            rows.look(n, looks.bends);
            let outlook = [
                &rows.error,
                &rows.slope_error,
                &rows.limit,
                &rows.least,
                &rows.most,
            ];
            let sides = if looks.back {
                Sides::Both
            } else {
                Sides::Ahead
            };
            let seen = [&mut rows.seen, &mut rows.looked_back, &mut rows.bend];
            batch.evaluate_ahead(surface, n, paths, (sides, outlook), seen, scratch);
        } else if means == Means::Tangents {
            batch.evaluate_along(surface, n, paths, scratch);
        } else {
            batch.evaluate(surface, n, paths, scratch);
            rows.chords(n, batch);
        }
        for i in 0..n {
            let clearance = surface.clearances.at(batch.distance[i]);
            let pick = clearance.pick(batch.value[i]);
            (rows.offset[i], rows.slope[i]) = (pick.offset, pick.slope);
            let tangent = &clearance.tangent;
            rows.tangent_offset[i] = if means != Means::Values {
                tangent.offset
            } else {
                f64::INFINITY
            };
            rows.tangent_slope[i] = tangent.slope;
            rows.curvature[i] = tangent.curvature;
        }
        if bound::cuts(&surface.bound) {
            for i in 0..n {
                let place = [0, 1, 2].map(|axis| batch.place[axis][i]).into();
                let within = bound::contains(&surface.bound, place);
                rows.cut[i] = if within { 0.0 } else { 1.0 };
            }
        }
        let known = surface.clearances.known;
        // Walks need no foresight: they reach the root itself.
        let is_foreseen = Technique::Foresight.is_used(surface.without) && !surface.walks();
        surface.level.vectorize(
            #[inline(always)]
            || rows.advance(n, known, paths, batch, is_foreseen),
        );
    }
}
