//! Casting rays with each method and counting what it takes.

use std::time::Instant;

use field::{Interval, Program};
use render::methods::{FieldAlong, Method, Tally};
use serde::Serialize;

use super::thesis;

/// What one method took, on average over the rays that meet the bounding sphere.
#[derive(Serialize, Clone, Debug)]
pub(crate) struct Count {
    /// The method.
    pub(crate) method: &'static str,
    /// λ, for sphere tracing.
    pub(crate) lipschitz: Option<f64>,
    /// The width below which it stops.
    pub(crate) epsilon: f64,
    /// Evaluations per ray; one with a derivative counts twice.
    pub(crate) evaluations: f64,
    /// Steps forward per ray.
    pub(crate) steps: f64,
    /// Steps taken back per ray.
    pub(crate) backtracks: f64,
    /// Intervals cut in two, per ray.
    pub(crate) subdivisions: f64,
    /// Rays with a root, of all that were cast.
    pub(crate) hits: u64,
    /// Rays that were cast.
    pub(crate) rays: u64,
    /// Microseconds per ray on this machine, one thread.
    pub(crate) microseconds: f64,
}

/// Casts the rays of a grid of `side`² pixels.
pub(crate) fn cast(
    program: &Program,
    radius: f64,
    side: u32,
    method: &dyn Method,
    (lipschitz, epsilon): (Option<f64>, f64),
) -> Count {
    let mut tally = Tally::default();
    let (mut rays, mut hits) = (0, 0);
    let started = Instant::now();
    for y in 0..side {
        for x in 0..side {
            let at = |i: u32| ((f64::from(i) + 0.5) / f64::from(side) - 0.5) * thesis::WIDTH;
            let (across, up) = (at(x), at(y));
            let square = radius * radius - across * across - up * up;
            if square <= 0.0 {
                continue;
            }
            let half = square.sqrt();
            let ray = FieldAlong {
                program,
                origin: [across, -thesis::DISTANCE, up],
                direction: [0.0, 1.0, 0.0],
                time: 0.0,
            };
            let span = Interval::new(thesis::DISTANCE - half, thesis::DISTANCE + half);
            rays += 1;
            hits += u64::from(method.first(&ray, span, &mut tally).is_some());
        }
    }
    let seconds = started.elapsed().as_secs_f64();
    let per_ray = |count: u64| count as f64 / rays as f64;
    Count {
        method: method.name(),
        lipschitz,
        epsilon,
        evaluations: per_ray(tally.evaluations()),
        steps: per_ray(tally.steps),
        backtracks: per_ray(tally.backtracks),
        subdivisions: per_ray(tally.subdivisions),
        hits,
        rays,
        microseconds: 1e6 * seconds / rays as f64,
    }
}
