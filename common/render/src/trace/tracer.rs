//! Speculative sphere tracing over batches of rays, thesis fig. 5.5.
//!
//! Every ray is a lane; lanes advance together, so that the field is evaluated
//! on dense batches, and a lane that is done makes room for the next ray. What a lane does depends on
//! its own ray alone.

use core::sync::atomic::{AtomicBool, Ordering};

use field::{Interval, Points, Scratch};
use glam::DVec3;

use super::bound;
use super::bracket::{Bracket, End};
use super::grid::Grid;
use super::surface::Surface;
use crate::counts::Counts;
use crate::error::Cancelled;

/// How much farther than proven a first step reaches, thesis §5.2.2.
const OVERSHOOT: f64 = 1.46;

/// The share of the way to where both ends of a step would just meet, if the field went on as it
/// did from the last point to this one. Later steps reach there: up to twice as far as proven.
const FORESIGHT: f64 = 0.9;

/// Most evaluations along one ray. A ray that is still not done then runs along the
/// surface within a step of it, and counts as meeting it where it stands.
const STEPS_MAX: u32 = 16_384;

/// Rays that advance together: enough for dense batches, few enough for the nearest cache.
const LANES: usize = 64;

/// A ray to be traced.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Ray {
    /// Where it begins, world metres.
    pub(crate) origin: DVec3,
    /// Unit vector.
    pub(crate) direction: DVec3,
    /// From the eye to its origin: what footprints are measured by.
    pub(crate) from_eye: DVec3,
    /// Seconds from image 0.
    pub(crate) time: f64,
    /// The distances at which it may meet the surface.
    pub(crate) grid: Grid,
    /// No grid point nearer than this has f ≤ 0.
    pub(crate) clear: f64,
}

/// What is wanted of a ray.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Goal {
    /// The distance at which it meets the surface, polished.
    Distance,
    /// Whether it does.
    Occlusion,
}

/// Where a ray meets the surface.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Hit {
    /// Nowhere.
    None,
    /// At that distance.
    Surface(f64),
    /// At that distance on a face of the box that cuts the surface off.
    Face(f64),
}

impl Hit {
    /// The distance, if there is one.
    pub(crate) fn distance(self) -> Option<f64> {
        match self {
            Self::None => None,
            Self::Surface(distance) | Self::Face(distance) => Some(distance),
        }
    }
}

/// Memory in which rays are traced; one per thread.
#[derive(Default)]
pub(crate) struct Tracer {
    lanes: Vec<Lane>,
    batch: Batch,
    /// Memory of evaluations; also counts noises.
    pub(crate) scratch: Scratch,
}

/// The places at which lanes want values, lane by lane.
struct Batch {
    x: [f64; LANES],
    y: [f64; LANES],
    z: [f64; LANES],
    footprint: [f64; LANES],
    time: [f64; LANES],
    distance: [f64; LANES],
    value: [f64; LANES],
}

impl Default for Batch {
    fn default() -> Self {
        Self {
            x: [0.0; LANES],
            y: [0.0; LANES],
            z: [0.0; LANES],
            footprint: [0.0; LANES],
            time: [0.0; LANES],
            distance: [0.0; LANES],
            value: [0.0; LANES],
        }
    }
}

/// No point of a grid.
const NOWHERE: i64 = i64::MAX;

/// A ray on its way.
struct Lane {
    ray: usize,
    origin: DVec3,
    direction: DVec3,
    /// ‖from eye‖² and 2 · from eye · direction.
    eye_square: f64,
    eye_along: f64,
    time: f64,
    grid: Grid,
    /// The last point worth looking at.
    end: i64,
    /// All points before this one are known to be outside.
    clear: i64,
    /// The point whose value is wanted, while searching.
    at: i64,
    /// The distance at which a value is wanted.
    t: f64,
    /// A point known to be inside, or `NOWHERE`.
    inside: i64,
    inside_value: f64,
    /// The last point evaluated and found outside, with all before it.
    outside: i64,
    outside_t: f64,
    outside_value: f64,
    steps: u32,
    hint: usize,
    /// Of the known part over the whole ray, where it hardly changes.
    growth: Option<Interval>,
    stage: Stage,
    bracket: Bracket,
}

/// What a lane wants a value for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// To find the first point inside.
    Search,
    /// That point is known: to know the value at the one before it.
    Before,
    /// The root lies between the two: to close in on it.
    Polish,
}

impl Tracer {
    /// Traces `rays` and appends what they meet to `hits`, in their order.
    pub(crate) fn trace(
        &mut self,
        surface: &Surface,
        goal: Goal,
        rays: &[Ray],
        cancel: &AtomicBool,
        counts: &mut Counts,
        hits: &mut Vec<Hit>,
    ) -> Result<(), Cancelled> {
        let first = hits.len();
        hits.resize(first + rays.len(), Hit::None);
        let hits = &mut hits[first..];
        let mut waiting = rays.iter().enumerate();
        let Self {
            lanes,
            batch,
            scratch,
        } = self;
        lanes.clear();
        loop {
            while lanes.len() < LANES {
                let Some((index, ray)) = waiting.next() else {
                    break;
                };
                if let Some(lane) = Lane::new(surface, index, ray) {
                    batch.put(surface, lanes.len(), &lane);
                    lanes.push(lane);
                }
            }
            if lanes.is_empty() {
                return Ok(());
            }
            if cancel.load(Ordering::Relaxed) {
                return Err(Cancelled);
            }
            batch.evaluate(surface, lanes.len(), scratch);
            counts.evaluations += lanes.len() as u64;
            // Backwards, so that the lane which fills a gap has had its turn.
            for index in (0..lanes.len()).rev() {
                let lane = &mut lanes[index];
                let (value, distance) = (batch.value[index], batch.distance[index]);
                match lane.step(surface, goal, value, distance, counts) {
                    None => batch.put(surface, index, lane),
                    Some(hit) => {
                        hits[lane.ray] = hit;
                        counts.steps += u64::from(lane.steps);
                        lanes.swap_remove(index);
                        if let Some(lane) = lanes.get(index) {
                            batch.put(surface, index, lane);
                        }
                    }
                }
            }
        }
    }
}

impl Batch {
    /// Puts down the place at which a lane wants its next value.
    #[inline]
    fn put(&mut self, surface: &Surface, index: usize, lane: &Lane) {
        let t = lane.t;
        let place = lane.origin + lane.direction * t;
        // From the eye itself the root is that of t², which is t.
        let distance = if lane.eye_square > 0.0 {
            (lane.eye_square + t * (lane.eye_along + t)).sqrt()
        } else {
            t
        };
        self.x[index] = place.x;
        self.y[index] = place.y;
        self.z[index] = place.z;
        self.distance[index] = distance;
        self.footprint[index] = surface.footprint.at(distance);
        self.time[index] = lane.time;
    }

    /// Evaluates the field where the lanes want it.
    fn evaluate(&mut self, surface: &Surface, lanes: usize, scratch: &mut Scratch) {
        surface.program.evaluate(
            surface.level,
            &Points {
                x: &self.x[..lanes],
                y: &self.y[..lanes],
                z: &self.z[..lanes],
                footprint: &self.footprint[..lanes],
                time: &self.time[..lanes],
            },
            scratch,
            &mut [&mut self.value[..lanes]],
        );
    }
}

impl Lane {
    /// The lane of a ray; `None` for one that cannot meet the surface.
    fn new(surface: &Surface, index: usize, ray: &Ray) -> Option<Self> {
        let (start, end) = bound::clip(&surface.bound, ray.origin, ray.direction)?;
        let start = if ray.clear > start { ray.clear } else { start };
        let last = end;
        let (clear, end) = (ray.grid.first_from(start), ray.grid.first_from(end));
        (clear <= end).then(|| Self {
            ray: index,
            origin: ray.origin,
            direction: ray.direction,
            eye_square: ray.from_eye.dot(ray.from_eye),
            eye_along: 2.0 * ray.from_eye.dot(ray.direction),
            time: ray.time,
            grid: ray.grid,
            end,
            clear,
            at: clear,
            t: ray.grid.place(clear),
            inside: NOWHERE,
            inside_value: 0.0,
            outside: NOWHERE,
            outside_t: 0.0,
            outside_value: 0.0,
            steps: 0,
            hint: 0,
            growth: surface.clearances.known.growth_along(
                ray.origin + ray.direction * start,
                ray.origin + ray.direction * last,
                ray.direction,
            ),
            stage: Stage::Search,
            bracket: Bracket::default(),
        })
    }

    /// Takes the value that was wanted; returns the result, or wants another.
    #[inline]
    fn step(
        &mut self,
        surface: &Surface,
        goal: Goal,
        value: f64,
        distance: f64,
        counts: &mut Counts,
    ) -> Option<Hit> {
        match self.stage {
            Stage::Search => self.search(surface, goal, value, distance, counts),
            Stage::Before => self.enclose(value),
            Stage::Polish => {
                let root = self.bracket.narrow(value, surface.footprint.at(distance));
                self.t = self.bracket.middle;
                root.map(Hit::Surface)
            }
        }
    }

    /// One step of the search.
    #[inline]
    fn search(
        &mut self,
        surface: &Surface,
        goal: Goal,
        value: f64,
        distance: f64,
        counts: &mut Counts,
    ) -> Option<Hit> {
        self.steps += 1;
        if self.steps > STEPS_MAX {
            counts.exhausted += 1;
            return Some(Hit::Surface(self.grid.place(self.clear)));
        }
        let place = self.origin + self.direction * self.t;
        // A value that is not finite proves nothing about its surroundings.
        let proof = if bound::contains(&surface.bound, place) && value.is_finite() {
            value
        } else {
            0.0
        };
        if value > 0.0 || proof == 0.0 {
            self.pass(surface, place, proof, distance, counts);
        } else {
            self.inside = self.at;
            self.inside_value = value;
            if self.at > self.clear {
                counts.backtracks += 1;
                self.at = self.clear;
            }
        }
        if self.clear >= self.inside {
            return self.found(surface, goal);
        }
        if self.clear > self.end {
            return Some(Hit::None);
        }
        self.t = self.grid.place(self.at);
        None
    }

    /// The point is outside, with that value: what does it prove, and where to look next?
    #[inline]
    fn pass(
        &mut self,
        surface: &Surface,
        place: DVec3,
        value: f64,
        distance: f64,
        counts: &mut Counts,
    ) {
        let clearances = &surface.clearances;
        let clearance = clearances.at(distance);
        let growth = self
            .growth
            .unwrap_or_else(|| Interval::point(clearances.known.growth(place, self.direction)));
        let (ahead, behind) = clearance.spans(value, growth, &mut self.hint);
        // Lanes are at different points of their search, so that branches on how far each one is
        // would be mispredicted: all of this is computed for every lane.
        let uncovered = self.grid.place(self.clear) <= self.t - behind;
        if (self.at > self.clear) & uncovered {
            counts.backtracks += 1;
            self.at = self.clear;
            return;
        }
        // With x the way to go and c the rate of fall, the spheres at both ends meet where
        // x = ahead + behind · (value − c x) / value.
        let (drop, way) = (self.outside_value - value, self.t - self.outside_t);
        let meet = (ahead + behind) * value * way / (value * way + behind * drop);
        let reach = if self.outside == NOWHERE {
            OVERSHOOT * ahead
        } else {
            FORESIGHT * meet
        };
        let reach = if reach > ahead { reach } else { ahead };
        self.outside = self.at;
        self.outside_t = self.t;
        self.outside_value = value;
        self.clear = self.grid.first_from(self.t + ahead).max(self.at + 1);
        // The last point within reach: one beyond would not be covered.
        let next = self.grid.first_from(self.t + reach) - 1;
        self.at = next.min(self.inside - 1).min(self.end).max(self.clear);
    }

    /// The first point inside is known: ask for the value before it, or begin to polish.
    fn found(&mut self, surface: &Surface, goal: Goal) -> Option<Hit> {
        let far = self.grid.place(self.inside);
        if goal == Goal::Occlusion || self.inside == 0 {
            return Some(Hit::Surface(far));
        }
        let before = self.inside - 1;
        let near = self.grid.place(before);
        if !bound::contains(&surface.bound, self.origin + self.direction * near) {
            return Some(Hit::Face(far));
        }
        if self.outside == before {
            return self.enclose(self.outside_value);
        }
        self.stage = Stage::Before;
        self.t = near;
        None
    }

    /// The value at the point before the hit is known: the root is enclosed.
    fn enclose(&mut self, outside: f64) -> Option<Hit> {
        let end = |index: i64, value: f64| End {
            t: self.grid.place(index),
            value,
        };
        let far = end(self.inside, self.inside_value);
        if !(outside > 0.0 && outside.is_finite()) {
            return Some(Hit::Surface(far.t));
        }
        self.bracket = Bracket::new(end(self.inside - 1, outside), far);
        self.stage = Stage::Polish;
        self.t = self.bracket.middle;
        None
    }
}
