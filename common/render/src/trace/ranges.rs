//! The search along single rays by ranges: thesis fig. 5.8 over the points of a ray's grid.
//!
//! A stretch over which the field's range is positive holds no point inside. Any other is cut in two, the nearer half
//! first, down to a few points, which are evaluated. It asks nothing of a field but its ranges: a crease or a steep
//! place, of which a bound knows little, costs a few stretches and no more.

use core::sync::atomic::Ordering;

use field::{Interval, Segment};

use super::batch::{Batch, Lanes, Paths};
use super::bound;
use super::bracket::End;
use super::bundle::Span;
use super::grid::Steps;
use super::means::Arithmetic;
use super::polish::Found;
use super::surface::Surface;
use super::tracer::{Goal, Hit, Ray, Results, Wanted};
use crate::error::Cancelled;

/// Most points of a stretch that is not cut any more: evaluating so many takes about as long as one range.
const POINTS: usize = 8;

/// Room for the rounding of a distance from the eye, relative to the lengths it is made of.
const ROOM: f64 = 1e-7;

/// Memory in which rays are searched.
#[derive(Default)]
pub(crate) struct Ranges {
    /// Stretches between two points that are still to be looked at, the nearest last.
    waiting: Vec<(f64, f64)>,
    paths: Paths,
    batch: Batch,
}

/// How the search along one ray ended.
enum Outcome {
    /// Nothing is inside.
    Clear,
    /// This point is the first inside.
    Inside(End),
    /// The budget was used up here.
    Exhausted(f64),
}

impl Ranges {
    /// Searches along every span, as [`super::search::Search::run`] does.
    pub(crate) fn run(
        &mut self,
        wanted: Wanted<'_>,
        arithmetic: Arithmetic,
        spans: &[Span],
        mut results: Results<'_>,
        mut found: impl FnMut(Found, Results<'_>),
    ) -> Result<(), Cancelled> {
        for span in spans {
            let ray = &wanted.rays[span.ray];
            let outcome = self.follow(wanted, arithmetic, ray, span, &mut results)?;
            let Results {
                scratch,
                counts,
                hits,
            } = &mut results;
            match outcome {
                Outcome::Clear => {}
                Outcome::Exhausted(t) => {
                    counts.exhausted += 1;
                    hits[span.ray] = Hit::Surface(t);
                }
                Outcome::Inside(inside) if wanted.goal == Goal::Occlusion => {
                    hits[span.ray] = Hit::Surface(inside.t);
                }
                Outcome::Inside(inside) => {
                    // The point before it was not evaluated.
                    let one = Found {
                        ray: span.ray,
                        steps: ray.grid.steps(),
                        inside,
                        outside: End::default(),
                    }
                    .without_outside();
                    let results = Results {
                        scratch,
                        counts,
                        hits,
                    };
                    found(one, results);
                }
            }
        }
        Ok(())
    }

    /// The first point of a ray inside.
    fn follow(
        &mut self,
        Wanted {
            surface, cancel, ..
        }: Wanted<'_>,
        arithmetic: Arithmetic,
        ray: &Ray,
        span: &Span,
        results: &mut Results<'_>,
    ) -> Result<Outcome, Cancelled> {
        let steps = ray.grid.steps();
        let (clear, end) = (steps.from(span.clear), steps.from(span.end));
        self.waiting.clear();
        if clear <= end {
            self.waiting.push((clear, end));
        }
        let mut evaluations = 0.0;
        while let Some((from, to)) = self.waiting.pop() {
            if cancel.load(Ordering::Relaxed) {
                return Err(Cancelled);
            }
            if evaluations > surface.steps_max {
                return Ok(Outcome::Exhausted(from));
            }
            let apart = steps.between(from, to);
            if apart < POINTS as u64 {
                let n = usize::try_from(apart).map_or(POINTS, |apart| apart + 1);
                if let Some(inside) = self.points(surface, ray, steps, (from, n), results) {
                    return Ok(Outcome::Inside(inside));
                }
                evaluations += 1.0;
                continue;
            }
            evaluations += 1.0;
            results.counts.evaluations += 1;
            results.counts.steps += 1;
            if arithmetic
                .range(surface, &segment(surface, ray, from, to))
                .low
                > 0.0
            {
                continue;
            }
            results.counts.subdivisions += 1;
            let middle = steps.middle(from, to);
            self.waiting.push((steps.after(middle), to));
            self.waiting.push((from, middle));
        }
        Ok(Outcome::Clear)
    }

    /// The first of `n` points, from a point on, that is inside.
    fn points(
        &mut self,
        surface: &Surface,
        ray: &Ray,
        steps: Steps,
        (from, n): (f64, usize),
        results: &mut Results<'_>,
    ) -> Option<End> {
        let Self { paths, batch, .. } = self;
        let mut at: Lanes = [0.0; field::BATCH];
        let mut t = from;
        for (lane, at) in at[..n].iter_mut().enumerate() {
            paths.set(lane, ray.origin, ray.direction, ray.from_eye, ray.time);
            *at = t;
            t = steps.after(t);
        }
        surface.level.vectorize(
            #[inline(always)]
            || batch.go(surface, n, paths, &at),
        );
        batch.evaluate(surface, n, paths, results.scratch);
        results.counts.evaluations += n as u64;
        let is_cut = bound::cuts(&surface.bound);
        (0..n)
            .find(|&i| {
                let place = [0, 1, 2].map(|axis| batch.place[axis][i]).into();
                batch.value[i] <= 0.0 && (!is_cut || bound::contains(&surface.bound, place))
            })
            .map(|i| End {
                t: at[i],
                value: batch.value[i],
            })
    }
}

/// The stretch of a ray between two points, with every footprint on it.
fn segment(surface: &Surface, ray: &Ray, from: f64, to: f64) -> Segment {
    let eye = ray.from_eye.length();
    let room = ROOM * (eye + to);
    let distance = |t: f64| (ray.from_eye + ray.direction * t).length();
    // A distance from a point is convex along a line, and changes no faster than the way on it.
    let ends = [distance(from), distance(to)];
    let (near, far) = if ends[0] < ends[1] {
        (ends[0], ends[1])
    } else {
        (ends[1], ends[0])
    };
    let nearest = if eye > 0.0 { far - (to - from) } else { near } - room;
    let nearest = if nearest > 0.0 { nearest } else { 0.0 };
    let footprint = surface.footprint;
    Segment {
        origin: ray.origin.into(),
        direction: ray.direction.into(),
        t: Interval::new(from, to),
        footprint: Interval::new(footprint.at(nearest), footprint.at(far + room)),
        time: ray.time,
    }
}
