//! Casting rays with each method and counting what it takes.

use field::Interval;
use render::methods::{FieldAlong, Method, Tally};
use serde::Serialize;

use super::clock::Clock;
use super::thesis::Setting;

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
    /// Microseconds of one thread per ray on this machine.
    pub(crate) microseconds: f64,
}

/// Casts the rays of a grid of `side`² places of the image by a method of the thesis.
pub(crate) fn cast(
    setting: &Setting,
    side: u32,
    method: &dyn Method,
    (lipschitz, epsilon): (Option<f64>, f64),
) -> Count {
    let count = cast_by(setting, side, method.name(), |ray, span, tally| {
        method.first(ray, span, tally)
    });
    Count {
        lipschitz,
        epsilon,
        ..count
    }
}

/// The same by anything that finds a first root.
pub(crate) fn cast_by(
    setting: &Setting,
    side: u32,
    method: &'static str,
    first: impl Fn(&FieldAlong<'_>, Interval, &mut Tally) -> Option<f64>,
) -> Count {
    let mut tally = Tally::default();
    let (mut rays, mut hits) = (0, 0);
    let clock = Clock::start();
    for y in 0..side {
        for x in 0..side {
            let at = |i: u32| (f64::from(i) + 0.5) / f64::from(side) - 0.5;
            let (origin, direction) = setting.ray([at(x), at(y)]);
            let Some(span) = within(setting.radius, origin, direction) else {
                continue;
            };
            let ray = FieldAlong {
                program: &setting.program,
                origin,
                direction,
                time: 0.0,
            };
            rays += 1;
            hits += u64::from(first(&ray, span, &mut tally).is_some());
        }
    }
    let seconds = clock.seconds();
    let per_ray = |count: u64| count as f64 / rays as f64;
    Count {
        method,
        lipschitz: None,
        epsilon: 0.0,
        evaluations: per_ray(tally.evaluations()),
        steps: per_ray(tally.steps),
        backtracks: per_ray(tally.backtracks),
        subdivisions: per_ray(tally.subdivisions),
        hits,
        rays,
        microseconds: 1e6 * seconds / rays as f64,
    }
}

/// The part of a ray within a sphere about the origin.
fn within(radius: f64, origin: [f64; 3], direction: [f64; 3]) -> Option<Interval> {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let middle = -dot(origin, direction);
    let square = radius * radius - dot(origin, origin) + middle * middle;
    (square > 0.0).then(|| {
        let half = square.sqrt();
        Interval::new(middle - half, middle + half)
    })
}
