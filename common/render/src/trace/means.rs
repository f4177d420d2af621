//! By what means single rays find how far they may step.
//!
//! Each costs more per step than the one before and needs fewer of them; how many, depends on the field and on
//! where it is seen from. So some rays of the image are traced by each, their steps counted, and the cheapest
//! is taken. It decides how fast rays are traced and nothing else.

use core::sync::atomic::AtomicBool;

use super::surface::Surface;
use super::tracer::{Goal, Ray, Tracer};
use crate::counts::Counts;
use crate::sample::Sample;
use crate::view::View;

/// What a step of the search evaluates.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Means {
    /// The value: the bound of the field's change does the rest.
    Values,
    /// Also the derivative along the ray, for the bound of the field's fall below its tangent.
    Tangents,
    /// Also the range of that derivative on the stretch ahead.
    Stretches,
}

impl Means {
    /// What a step costs, beside the evaluation of a value.
    fn cost(self) -> f64 {
        match self {
            Self::Values => 1.0,
            Self::Tangents => 1.5,
            Self::Stretches => 2.3,
        }
    }
}

/// Squares of pixels whose rays are tried, across the image and down.
const SQUARES: [u32; 2] = [6, 5];

/// Pixels along the side of a square.
const SIDE: u32 = 4;

/// Most evaluations along a ray that is tried: where all means need more, it matters little which is taken, and
/// no field can make preparing an image take long.
pub(crate) const STEPS_MAX: f64 = 1024.0;

/// The means by which the rays of `view` need least.
pub(crate) fn cheapest(surface: &Surface, view: &View, allowed: &[Means]) -> Means {
    let rays = rays(surface, view);
    let mut tracer = Tracer::default();
    let mut best = (Means::Values, f64::INFINITY);
    for &means in allowed {
        let surface = Surface {
            means,
            steps_max: STEPS_MAX,
            ..surface.clone()
        };
        let (mut counts, mut hits) = (Counts::default(), Vec::new());
        let never = AtomicBool::new(false);
        let done = tracer.trace(
            &surface,
            Goal::Distance,
            &rays,
            &never,
            &mut counts,
            &mut hits,
        );
        if done.is_err() {
            continue;
        }
        let steps = counts.steps as f64;
        let cost = (counts.evaluations as f64 - steps) + steps * means.cost();
        if cost < best.1 {
            best = (means, cost);
        }
    }
    best.0
}

/// Rays through squares of pixels all over the image, at its first instant.
pub(crate) fn rays(surface: &Surface, view: &View) -> Vec<Ray> {
    let [width, height] = view.size();
    let mut rays = Vec::new();
    for square in 0..SQUARES[0] * SQUARES[1] {
        let (column, row) = (square % SQUARES[0], square / SQUARES[0]);
        let middle = |i: u32, n: u32, size: f64| (f64::from(i) + 0.5) / f64::from(n) * size;
        let x = middle(column, SQUARES[0], width);
        let y = middle(row, SQUARES[1], height);
        for pixel in 0..SIDE * SIDE {
            let (dx, dy) = (pixel % SIDE, pixel / SIDE);
            let sight = view.sight(&Sample {
                place: [x + f64::from(dx), y + f64::from(dy)],
                instant: 0.0,
            });
            rays.push(surface.ray(&sight));
        }
    }
    rays
}
