//! By what means single rays find how far they may step.
//!
//! Each costs more per step than the one before and needs fewer of them; how many, depends on the field and on
//! where it is seen from. So some rays of the image are traced by each, and their steps counted
//! ([`super::choice`]).

use core::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

use field::{Interval, Segment};

use super::allowance::{Allowance, Least};
use super::surface::Surface;
use super::tracer::{Goal, Ray, Tracer};
use crate::counts::Counts;
use crate::crew::Crew;
use crate::sample::Sample;
use crate::view::View;

/// By what means single rays find how far they may step. None changes a pixel: all end at the same point of the ray's grid.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Means {
    /// Values, and the bound of the field's change between two places: speculative sphere tracing, thesis fig. 5.5.
    Values,
    /// Also the derivative along the ray, and the bound of the field's fall below its tangent. Values where no such bound is known.
    Tangents,
    /// Also the range of that derivative on the stretch ahead, from every noise at the place; where the field is blobs
    /// alone, the whole way to the first root. Values where a field has operations that cannot be looked ahead of.
    Stretches,
    /// Ranges over ever shorter stretches, thesis fig. 5.8, in one of three arithmetics.
    Ranges(Arithmetic),
}

/// How ranges of a field are computed along a ray.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Arithmetic {
    /// Intervals, thesis §5.3.1.
    Intervals,
    /// Affine forms with a symbol for every rounding, thesis §5.3.2.
    Affine,
    /// Affine forms with the ray's symbol and one other, thesis §5.3.3.
    Reduced,
}

impl Arithmetic {
    /// All values of the field on a stretch.
    pub(crate) fn range(self, surface: &Surface, segment: &Segment) -> Interval {
        let program = &surface.program;
        match self {
            Self::Intervals => program.along_interval(segment),
            Self::Affine => program.along_affine(segment).interval(),
            Self::Reduced => program.along_reduced(segment).interval(),
        }
    }
}

impl Means {
    /// Every means.
    pub const ALL: [Self; 6] = [
        Self::Values,
        Self::Tangents,
        Self::Stretches,
        Self::Ranges(Arithmetic::Intervals),
        Self::Ranges(Arithmetic::Affine),
        Self::Ranges(Arithmetic::Reduced),
    ];

    /// What it is called on command lines and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Values => "values",
            Self::Tangents => "tangents",
            Self::Stretches => "stretches",
            Self::Ranges(Arithmetic::Intervals) => "intervals",
            Self::Ranges(Arithmetic::Affine) => "affine",
            Self::Ranges(Arithmetic::Reduced) => "reduced",
        }
    }

    /// The means of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|means| means.name() == name)
    }

    /// What a step costs, beside the evaluation of a value.
    fn cost(self) -> f64 {
        match self {
            Self::Values => 1.0,
            Self::Tangents => 1.5,
            Self::Stretches => 2.3,
            Self::Ranges(_) => 50.0,
        }
    }

    /// What a step along a surface's ray costs.
    fn cost_for(self, surface: &Surface) -> f64 {
        if self == Self::Stretches && surface.program.walks() {
            WALK
        } else {
            self.cost()
        }
    }
}

/// What a step of a bundle by gradients costs, beside the evaluation of a value.
const BUNDLE_STEP: f64 = 2.0;

/// What a step costs that walks to the ray's first root or its end, beside the evaluation of a value.
const WALK: f64 = 4.0;

/// Where the cheapest of the others costs a ray so many values, ranges are tried too,
const DEAR: f64 = 200.0;

/// along one of so many rays, since they take so long,
const FEW: usize = 8;

/// and no longer on any than this many times what it must not cost on average.
const PATIENCE: f64 = 4.0;

/// Squares of pixels whose rays are tried, across the image and down.
const SQUARES: [u32; 2] = [6, 5];

/// Pixels along the side of a square.
const SIDE: u32 = 4;

/// Rays that are tried together, half of them all: what a crew shares. Smaller pieces cost more, since few rays fill the lanes
/// of a search badly.
const PIECE: usize = (SQUARES[0] * SQUARES[1] * SIDE * SIDE / 2) as usize;

/// Most evaluations along a ray that is tried: where all means need more, it matters little which is taken, and
/// no field can make preparing an image take long.
pub(crate) const STEPS_MAX: f64 = 1024.0;

/// Some rays of an image, to be traced in several ways.
pub(crate) struct Trial<'a> {
    rays: Vec<Ray>,
    crew: &'a dyn Crew,
}

impl<'a> Trial<'a> {
    /// Rays from all over the image.
    pub(crate) fn new(surface: &Surface, view: &View, crew: &'a dyn Crew) -> Self {
        Self {
            rays: rays(surface, view),
            crew,
        }
    }

    /// The means by which the rays need least, of those allowed, or ranges where all of them need many; and what a
    /// ray then costs, in evaluations of a value. Of no interest is what costs more than `limit`: it may count as infinitely dear.
    pub(crate) fn cheapest(
        &self,
        surface: &Surface,
        allowed: &[Means],
        limit: f64,
    ) -> (Means, f64) {
        let tried: Vec<_> = allowed.iter().map(|&means| surface.by(means)).collect();
        let costs = self.costs(&tried, limit);
        let mut best = (Means::Values, f64::INFINITY);
        for (&means, cost) in allowed.iter().zip(costs) {
            if cost < best.1 {
                best = (means, cost);
            }
        }
        if best.1 > DEAR && best.1 < f64::INFINITY {
            let ranges = Means::Ranges(Arithmetic::Reduced);
            let few: Vec<_> = self.rays.iter().copied().step_by(FEW).collect();
            let steps_max = PATIENCE * best.1 / ranges.cost();
            let tried = surface.by(ranges);
            let cost = self.costs_along(&few, &[tried], steps_max, best.1)[0];
            if cost < best.1 {
                return (ranges, cost);
            }
        }
        best
    }

    /// What a ray costs on average with each of some surfaces, in evaluations of a value. What costs more than `limit`, or than
    /// another one, may count as infinitely dear: its trial ends where that is clear.
    pub(crate) fn costs(&self, surfaces: &[Surface], limit: f64) -> Vec<f64> {
        self.costs_along(&self.rays, surfaces, STEPS_MAX, limit)
    }

    /// The same along other rays, with so many steps of each at most.
    fn costs_along(
        &self,
        rays: &[Ray],
        surfaces: &[Surface],
        steps_max: f64,
        limit: f64,
    ) -> Vec<f64> {
        let pieces: Vec<&[Ray]> = rays.chunks(PIECE).collect();
        let costs: Vec<OnceLock<f64>> = (0..surfaces.len() * pieces.len())
            .map(|_| OnceLock::new())
            .collect();
        // Once all of a surface's pieces are done; summed in their order, whichever ended first.
        let total = |surface: usize| {
            let costs = &costs[surface * pieces.len()..][..pieces.len()];
            let total = costs.iter().map(|cost| cost.get().copied());
            Some(total.sum::<Option<f64>>()? / rays.len() as f64)
        };
        let least = Arc::new(Least::new(limit));
        let allow = |surface: &Surface| Surface {
            steps_max,
            allowance: Some(Arc::new(Allowance::new(rays.len(), &least))),
            ..surface.clone()
        };
        let allowed: Vec<Surface> = surfaces.iter().map(allow).collect();
        self.crew.each(costs.len(), &|index| {
            let (surface, piece) = (index / pieces.len(), index % pieces.len());
            costs[index].get_or_init(|| cost(&allowed[surface], pieces[piece]));
            if let Some(total) = total(surface) {
                least.hear(total);
            }
        });
        (0..surfaces.len())
            .map(|surface| total(surface).unwrap_or(f64::INFINITY))
            .collect()
    }
}

/// What rays cost, in evaluations of a value; infinitely much where the surface allows less.
fn cost(surface: &Surface, rays: &[Ray]) -> f64 {
    let (mut counts, mut hits) = (Counts::default(), Vec::new());
    let never = AtomicBool::new(false);
    let goal = Goal::Distance;
    let mut tracer = Tracer::default();
    let done = tracer.trace(surface, goal, rays, &never, &mut counts, &mut hits);
    if done.is_err() {
        return f64::INFINITY;
    }
    let steps = counts.steps as f64;
    let step_cost = surface.means.cost_for(surface);
    let together = if surface.gradients {
        counts.cone_steps as f64 * (BUNDLE_STEP - 1.0)
    } else {
        0.0
    };
    let values = (counts.evaluations as f64 - steps) + steps * step_cost + together;
    let spared = surface.coarse.as_ref().map_or(0.0, |coarse| {
        let [together, alone] = tracer.coarse_evaluations();
        together * (1.0 - coarse.cost) + alone * (step_cost - coarse.cost)
    });
    values - spared
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
