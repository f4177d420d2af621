//! Speculative sphere tracing over batches of rays, thesis fig. 5.5.
//!
//! Every ray is a lane; lanes advance together, so that the field is evaluated
//! on dense batches, and a lane that is done makes room for the next ray. What a lane does depends on
//! its own ray alone.

use core::sync::atomic::{AtomicBool, Ordering};

use field::{BATCH, Points, Scratch};
use glam::DVec3;

use super::bound;
use super::grid::Grid;
use super::surface::Surface;
use crate::counts::Counts;
use crate::error::Cancelled;

/// How much farther than proven a step reaches, thesis §5.2.2.
const OVERSHOOT: f64 = 1.46;

/// Most evaluations along one ray. A ray that is still not done then runs along the
/// surface within a step of it, and counts as meeting it where it stands.
const STEPS_MAX: u32 = 16_384;

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
}

/// The places at which lanes want values.
#[derive(Default)]
struct Batch {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    footprint: Vec<f64>,
    time: Vec<f64>,
    distance: Vec<f64>,
    value: Vec<f64>,
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
    /// The point whose value is wanted.
    at: i64,
    /// A point known to be inside, or `NOWHERE`.
    inside: i64,
    inside_value: f64,
    /// The last point evaluated and found outside, with all before it.
    outside: i64,
    outside_value: f64,
    steps: u32,
    hint: usize,
    /// The value wanted is that of the point before the hit.
    polishing: bool,
}

impl Tracer {
    /// Traces `rays` and appends what they meet to `hits`, in their order.
    pub(crate) fn trace(
        &mut self,
        surface: &Surface,
        goal: Goal,
        rays: &[Ray],
        scratch: &mut Scratch,
        cancel: &AtomicBool,
        counts: &mut Counts,
        hits: &mut Vec<Hit>,
    ) -> Result<(), Cancelled> {
        let first = hits.len();
        hits.resize(first + rays.len(), Hit::None);
        let hits = &mut hits[first..];
        let mut waiting = rays.iter().enumerate();
        self.lanes.clear();
        loop {
            while self.lanes.len() < BATCH {
                let Some((index, ray)) = waiting.next() else {
                    break;
                };
                self.lanes.extend(Lane::new(surface, index, ray));
            }
            if self.lanes.is_empty() {
                return Ok(());
            }
            if cancel.load(Ordering::Relaxed) {
                return Err(Cancelled);
            }
            self.batch.evaluate(surface, &self.lanes, scratch);
            counts.evaluations += self.lanes.len() as u64;
            for lane in (0..self.lanes.len()).rev() {
                let value = self.batch.value[lane];
                let distance = self.batch.distance[lane];
                let state = &mut self.lanes[lane];
                if let Some(hit) = state.step(surface, goal, value, distance, counts) {
                    hits[state.ray] = hit;
                    self.lanes.swap_remove(lane);
                }
            }
        }
    }
}

impl Batch {
    /// Evaluates the field where the lanes want it.
    fn evaluate(&mut self, surface: &Surface, lanes: &[Lane], scratch: &mut Scratch) {
        let n = lanes.len();
        for column in [
            &mut self.x,
            &mut self.y,
            &mut self.z,
            &mut self.footprint,
            &mut self.time,
            &mut self.distance,
            &mut self.value,
        ] {
            column.resize(n, 0.0);
        }
        for (i, lane) in lanes.iter().enumerate() {
            let t = lane.grid.place(lane.at);
            let place = lane.origin + lane.direction * t;
            let distance = (lane.eye_square + t * (lane.eye_along + t)).sqrt();
            self.x[i] = place.x;
            self.y[i] = place.y;
            self.z[i] = place.z;
            self.distance[i] = distance;
            self.footprint[i] = surface.footprint.at(distance);
            self.time[i] = lane.time;
        }
        surface.program.evaluate(
            surface.level,
            &Points {
                x: &self.x,
                y: &self.y,
                z: &self.z,
                footprint: &self.footprint,
                time: &self.time,
            },
            scratch,
            &mut [&mut self.value],
        );
    }
}

impl Lane {
    /// The lane of a ray; `None` for one that cannot meet the surface.
    fn new(surface: &Surface, index: usize, ray: &Ray) -> Option<Self> {
        let (start, end) = bound::clip(&surface.bound, ray.origin, ray.direction)?;
        let start = if ray.clear > start { ray.clear } else { start };
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
            inside: NOWHERE,
            inside_value: 0.0,
            outside: NOWHERE,
            outside_value: 0.0,
            steps: 0,
            hint: 0,
            polishing: false,
        })
    }

    /// Takes the value at the point that was wanted; returns the result, or wants another.
    fn step(
        &mut self,
        surface: &Surface,
        goal: Goal,
        value: f64,
        distance: f64,
        counts: &mut Counts,
    ) -> Option<Hit> {
        if self.polishing {
            return Some(self.polished(value));
        }
        counts.steps += 1;
        self.steps += 1;
        if self.steps > STEPS_MAX {
            counts.exhausted += 1;
            return Some(Hit::Surface(self.grid.place(self.clear)));
        }
        let place = self.origin + self.direction * self.grid.place(self.at);
        // A value that is not finite proves nothing about its surroundings.
        let proof = if bound::contains(&surface.bound, place) && value.is_finite() {
            value
        } else {
            0.0
        };
        if value > 0.0 || proof == 0.0 {
            self.passed(surface, place, proof, distance, counts);
        } else if self.at == self.clear {
            self.inside = self.at;
            self.inside_value = value;
        } else {
            counts.backtracks += 1;
            self.inside = self.at;
            self.inside_value = value;
            self.at = self.clear;
        }
        if self.clear >= self.inside {
            return self.found(surface, goal);
        }
        (self.clear > self.end).then_some(Hit::None)
    }

    /// The point is outside, with that value: what does it prove, and where to look next?
    fn passed(
        &mut self,
        surface: &Surface,
        place: DVec3,
        value: f64,
        distance: f64,
        counts: &mut Counts,
    ) {
        let clearances = &surface.clearances;
        let clearance = clearances.at(distance);
        let growth = clearances.known.growth(place, self.direction);
        let t = self.grid.place(self.at);
        if self.at > self.clear {
            let behind = clearance.behind(value, growth, &mut self.hint);
            if self.grid.place(self.clear) <= t - behind {
                counts.backtracks += 1;
                self.at = self.clear;
                return;
            }
        }
        let ahead = clearance.ahead(value, growth, &mut self.hint);
        self.outside = self.at;
        self.outside_value = value;
        self.clear = self.grid.first_from(t + ahead).max(self.at + 1);
        let next = self.grid.first_from(t + OVERSHOOT * ahead);
        self.at = next.min(self.inside - 1).min(self.end).max(self.clear);
    }

    /// The first point inside is known: polish it, or ask for the value before it.
    fn found(&mut self, surface: &Surface, goal: Goal) -> Option<Hit> {
        let t = self.grid.place(self.inside);
        if goal == Goal::Occlusion || self.inside == 0 {
            return Some(Hit::Surface(t));
        }
        let before = self.inside - 1;
        let place = self.origin + self.direction * self.grid.place(before);
        if !bound::contains(&surface.bound, place) {
            return Some(Hit::Face(t));
        }
        self.polishing = true;
        self.at = before;
        (self.outside == before).then(|| self.polished(self.outside_value))
    }

    /// The root of the chord between the hit and the point before it.
    fn polished(&self, before: f64) -> Hit {
        let (near, far) = (self.grid.place(self.inside - 1), self.grid.place(self.inside));
        let drop = before - self.inside_value;
        Hit::Surface(if before > 0.0 && before.is_finite() && drop > 0.0 {
            near + (far - near) * (before / drop)
        } else {
            far
        })
    }
}
