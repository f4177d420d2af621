//! The search along single rays: speculative sphere tracing, thesis fig. 5.5, with tangents.
//!
//! Every ray is a lane; lanes advance together, so that the field is evaluated on dense batches,
//! and a lane that is done makes room for the next ray. What a lane does depends on its own ray alone.
//!
//! A value and its derivative along the ray prove a stretch free of roots on either side: by the
//! bound of the field's change, which is the better far from the surface, or by that of its fall below
//! the tangent ([`field::Taylor`]), which is the better close to it.

use core::sync::atomic::Ordering;

use field::{BATCH, Scratch};

use super::batch::{Batch, Lanes, Paths};
use super::bound;
use super::bracket::End;
use super::bundle::Span;
use super::clearance::{CAUTION, FLAT, Known};
use super::grid::Steps;
use super::polish::Found;
use super::surface::Surface;
use super::techniques::Technique;
use super::tracer::{Goal, Hit, Ray, Results, Wanted};
use crate::error::Cancelled;

/// The share of the way to where both ends of a step would just meet, if the field went on as its
/// tangent does. Steps reach there: up to about twice as far as proven.
const FORESIGHT: f64 = 0.9;

/// From where on the way to the tangent's root counts as nearly proven: steps then go to the root itself.
const NEARLY: f64 = 0.6;

/// Most evaluations along one ray: more than a ray's grid has points within any scene that can be rendered in
/// a day, so that no answer depends on where a search began. A ray that still is not done counts as a hit where it stands.
const STEPS_MAX: f64 = 4_194_304.0;

/// Memory in which rays are searched.
#[derive(Default)]
pub(crate) struct Search {
    rays: Vec<Lane>,
    paths: Paths,
    batch: Batch,
    rows: Box<Rows>,
}

/// What a lane keeps that its steps do not change.
#[derive(Clone, Copy)]
struct Lane {
    ray: usize,
    steps: Steps,
}

/// The state of the lanes: distances along the rays, all of them points of the rays' grids.
struct Rows {
    /// The last point worth looking at.
    end: Lanes,
    /// All points before this one are known to be outside.
    clear: Lanes,
    /// The point whose value is wanted.
    at: Lanes,
    /// A point known to be inside, or infinity.
    inside: Lanes,
    inside_value: Lanes,
    /// The last point evaluated and found outside, with all before it.
    outside: Lanes,
    outside_value: Lanes,
    /// Evaluations so far.
    count: Lanes,
    /// 1 where a step was taken back.
    back: Lanes,
    /// 1 where the surface cannot be, 0 elsewhere.
    cut: Lanes,
    offset: Lanes,
    slope: Lanes,
    tangent_offset: Lanes,
    tangent_slope: Lanes,
    curvature: Lanes,
    reach: Lanes,
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            end: [0.0; BATCH],
            clear: [0.0; BATCH],
            at: [0.0; BATCH],
            inside: [0.0; BATCH],
            inside_value: [0.0; BATCH],
            outside: [0.0; BATCH],
            outside_value: [0.0; BATCH],
            count: [0.0; BATCH],
            back: [0.0; BATCH],
            cut: [0.0; BATCH],
            offset: [0.0; BATCH],
            slope: [0.0; BATCH],
            tangent_offset: [0.0; BATCH],
            tangent_slope: [0.0; BATCH],
            curvature: [0.0; BATCH],
            reach: [0.0; BATCH],
        }
    }
}

impl Search {
    /// Searches along every span. Rays that find a point inside go to `found`, which gets the memory
    /// of evaluations and the counts with them; for those that need no more, `hits` has the answer.
    pub(crate) fn run(
        &mut self,
        Wanted {
            surface,
            goal,
            rays,
            cancel,
        }: Wanted<'_>,
        spans: &[Span],
        Results {
            scratch,
            counts,
            hits,
        }: Results<'_>,
        mut found: impl FnMut(Found, Results<'_>),
    ) -> Result<(), Cancelled> {
        let mut waiting = spans.iter();
        loop {
            while self.rays.len() < BATCH {
                let Some(span) = waiting.next() else {
                    break;
                };
                self.start(rays, span);
            }
            let n = self.rays.len();
            if n == 0 {
                return Ok(());
            }
            if cancel.load(Ordering::Relaxed) {
                self.rays.clear();
                return Err(Cancelled);
            }
            self.step(surface, n, scratch);
            counts.evaluations += n as u64;
            for i in (0..n).rev() {
                let rows = &self.rows;
                counts.backtracks += u64::from(rows.back[i] > 0.0);
                let is_found = rows.clear[i] >= rows.inside[i];
                let is_exhausted = rows.count[i] > STEPS_MAX;
                if !is_found && !is_exhausted && rows.clear[i] <= rows.end[i] {
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
                self.remove(i);
            }
        }
    }

    fn start(&mut self, rays: &[Ray], span: &Span) {
        let ray = &rays[span.ray];
        let steps = ray.grid.steps();
        let (clear, end) = (steps.from(span.clear), steps.from(span.end));
        if clear > end {
            return;
        }
        let lane = self.rays.len();
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
        rows.count[lane] = 0.0;
        self.rays.push(Lane {
            ray: span.ray,
            steps,
        });
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
        ] {
            row[i] = row[last];
        }
    }

    /// One evaluation of every lane, and what follows from it.
    fn step(&mut self, surface: &Surface, n: usize, scratch: &mut Scratch) {
        let Self {
            rays,
            paths,
            batch,
            rows,
        } = self;
        surface.level.vectorize(
            #[inline(always)]
            || batch.go(surface, n, paths, &rows.at),
        );
        if surface.tangents {
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
            rows.tangent_offset[i] = if surface.tangents {
                tangent.offset
            } else {
                f64::INFINITY
            };
            rows.tangent_slope[i] = tangent.slope;
            rows.curvature[i] = tangent.curvature;
            rows.reach[i] = clearance.reach;
        }
        if bound::cuts(&surface.bound) {
            for i in 0..n {
                let place = [0, 1, 2].map(|axis| batch.place[axis][i]).into();
                let within = bound::contains(&surface.bound, place);
                rows.cut[i] = if within { 0.0 } else { 1.0 };
            }
        }
        let known = surface.clearances.known;
        let is_foreseen = Technique::Foresight.is_used(surface.without);
        surface.level.vectorize(
            #[inline(always)]
            || rows.advance(rays, known, paths, batch, is_foreseen),
        );
    }
}

impl Rows {
    /// Takes the way from the last point outside for the derivative: it proves nothing, and foresees well enough.
    fn chords(&self, n: usize, batch: &mut Batch) {
        for i in 0..n {
            let way = self.at[i] - self.outside[i];
            let slope = (batch.value[i] - self.outside_value[i]) / way;
            batch.slope[i] = if slope.is_finite() { slope } else { 0.0 };
        }
    }

    #[inline(always)]
    fn advance(
        &mut self,
        rays: &[Lane],
        known: Known,
        paths: &Paths,
        batch: &Batch,
        is_foreseen: bool,
    ) {
        assert!(rays.len() <= BATCH);
        for (i, lane) in rays.iter().enumerate() {
            let part = |axis: usize| (batch.place[axis][i], paths.direction[axis][i]);
            let growth = known.growth_at([part(0), part(1), part(2)]);
            let (value, slope) = (batch.value[i], batch.slope[i]);
            self.advance_one(i, lane.steps, growth, value, slope, is_foreseen);
        }
    }

    /// What the value at a lane's point proves, and where to look next. Lanes are at different
    /// points of their searches, so that branches would be mispredicted: all of it is computed for each.
    #[inline(always)]
    fn advance_one(
        &mut self,
        i: usize,
        steps: Steps,
        growth: f64,
        value: f64,
        slope: f64,
        is_foreseen: bool,
    ) {
        let (at, clear) = (self.at[i], self.clear[i]);
        let is_outside = (value > 0.0) | (self.cut[i] > 0.0);
        // A value that is not finite proves nothing about its surroundings.
        let proof = if (value > 0.0) & value.is_finite() {
            value
        } else {
            0.0
        };
        let (ahead, behind) = self.spans(i, proof, growth, slope);

        let uncovered = clear <= at - behind;
        let gap = (at > clear) & uncovered;
        // Inside, or outside with a gap before it: back to the first point that is not proven.
        let passes = is_outside & !gap;
        let (inside, inside_value) = if is_outside {
            (self.inside[i], self.inside_value[i])
        } else {
            (at, value)
        };
        let next = steps.after(at);
        let proven = steps.from(at + ahead);
        let proven = if proven > next { proven } else { next };
        let new_clear = if passes { proven } else { clear };

        // Where this step and the next would just meet, with the value falling as the tangent does:
        // x = ahead + behind · (value + slope x)/value.
        let fall = -slope * behind / proof;
        let rate = 1.0 + if fall > -0.5 { fall } else { -0.5 };
        let meet = FORESIGHT * (ahead + behind) / rate;
        let root = proof / -slope;
        // Nothing proven, nothing foreseen: then it may not be a number.
        let meet = if is_foreseen & (meet > ahead) {
            meet
        } else {
            ahead
        };
        // The last point within reach: one beyond would not be covered. Past the root it need not be.
        let target = if is_foreseen & (slope < 0.0) & (ahead > NEARLY * root) {
            steps.from(at + root)
        } else {
            steps.before(steps.from(at + meet))
        };
        let most = if inside < f64::INFINITY {
            steps.before(inside)
        } else {
            self.end[i]
        };
        let target = if target < most { target } else { most };
        let target = if target > new_clear {
            target
        } else {
            new_clear
        };

        self.back[i] = if !passes & (at > clear) { 1.0 } else { 0.0 };
        self.at[i] = if passes { target } else { clear };
        self.outside[i] = if passes { at } else { self.outside[i] };
        self.outside_value[i] = if passes { value } else { self.outside_value[i] };
        self.inside[i] = inside;
        self.inside_value[i] = inside_value;
        self.clear[i] = new_clear;
        self.count[i] += 1.0;
    }

    /// How far ahead and back of a lane's point no root can be, where the field has that value and that derivative.
    #[inline(always)]
    fn spans(&self, i: usize, value: f64, growth: f64, slope: f64) -> (f64, f64) {
        let most = |a: f64, b: f64| if a > b { a } else { b };
        // By the change: it falls by no more than slope − growth per metre ahead, slope + growth back.
        let rest = (value - self.offset[i]) * CAUTION;
        let (fall, rise) = (self.slope[i] - growth, self.slope[i] + growth);
        let (fall, rise) = (most(fall, FLAT), most(rise, FLAT));
        // With one division.
        let share = rest / (fall * rise);
        let (ahead, behind) = (share * rise, share * fall);
        // By the tangent: where value + h s − ½ c s² meets zero, from the root of the larger size.
        let rest = most(value - self.tangent_offset[i], 0.0) * CAUTION;
        let c = self.curvature[i];
        let solve = |h: f64| {
            let size = (h * h + 2.0 * c * rest).sqrt();
            let near = 2.0 * rest / (size - h);
            let far = (size + h) * CAUTION / most(c, FLAT);
            if h > 0.0 { far } else { near }
        };
        let limit = self.tangent_slope[i];
        let (tangent_ahead, tangent_behind) = (solve(slope - limit), solve(-slope - limit));
        let proves = rest > 0.0;
        let cut = |a: f64, b: f64| {
            let b = if proves { b } else { 0.0 };
            let span = most(most(a, b), 0.0);
            if span < self.reach[i] {
                span
            } else {
                self.reach[i]
            }
        };
        (cut(ahead, tangent_ahead), cut(behind, tangent_behind))
    }
}
