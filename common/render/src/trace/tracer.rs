//! Traces rays in three stages: bundles approach, single rays search, roots are polished.

use core::sync::atomic::{AtomicBool, Ordering};

use field::Scratch;
use glam::DVec3;

use super::bundle::{Bundles, Span};
use super::clip::Clips;
use super::grid::Grid;
use super::ground;
use super::means::Means;
use super::polish::{Found, Polish};
use super::ranges::Ranges;
use super::search::{Pause, Search};
use super::simplify;
use super::surface::Surface;
use super::techniques::Technique;
use super::walk::Walks;
use crate::counts::Counts;
use crate::error::Cancelled;
use crate::times::{Part, Stopwatch};

/// Rays that are traced together: between them it is looked whether to go on.
const TOGETHER: usize = 4096;

/// Evaluations after which a ray goes back to the cells of the ground; each round is twice as long as the one before.
const ROUND: f64 = 6.0;

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

/// What is asked of the stages.
#[derive(Clone, Copy)]
pub(crate) struct Wanted<'a> {
    pub(crate) surface: &'a Surface,
    pub(crate) goal: Goal,
    pub(crate) rays: &'a [Ray],
    /// Whether to stop.
    pub(crate) cancel: &'a AtomicBool,
}

/// Where the stages put what they find, and the memory of their evaluations.
pub(crate) struct Results<'a> {
    pub(crate) scratch: &'a mut Scratch,
    pub(crate) counts: &'a mut Counts,
    /// One for each ray.
    pub(crate) hits: &'a mut [Hit],
}

/// Memory in which rays are traced; one per thread.
#[derive(Default)]
pub(crate) struct Tracer {
    clips: Box<Clips>,
    spans: Vec<Span>,
    paused: Vec<Span>,
    bundles: Bundles,
    walks: Walks,
    search: Search,
    ranges: Ranges,
    polish: Polish,
    /// Memory of evaluations; also counts noises.
    pub(crate) scratch: Scratch,
    /// Told which part of the work begins.
    pub(crate) stopwatch: Stopwatch,
}

impl Tracer {
    /// How many evaluations were of coarse surfaces since this was last asked: of bundles, and of single rays.
    pub(crate) fn coarse_evaluations(&mut self) -> [f64; 2] {
        [&mut self.bundles.batch, &mut self.search.batch]
            .map(|batch| core::mem::take(&mut batch.coarse_evaluations) as f64)
    }

    /// Traces `rays` and appends what they meet to `hits`, in their order.
    ///
    /// Rays that stand next to each other should lie close to each other: that is
    /// what makes it fast. What a ray meets does not depend on its neighbours.
    pub(crate) fn trace(
        &mut self,
        surface: &Surface,
        goal: Goal,
        rays: &[Ray],
        cancel: &AtomicBool,
        counts: &mut Counts,
        hits: &mut Vec<Hit>,
    ) -> Result<(), Cancelled> {
        let has_choices = simplify::has_choices(surface);
        let together = if has_choices {
            simplify::TOGETHER
        } else {
            TOGETHER
        };
        for rays in rays.chunks(together) {
            if cancel.load(Ordering::Relaxed) {
                return Err(Cancelled);
            }
            let first = hits.len();
            hits.resize(first + rays.len(), Hit::None);
            let simplified = if has_choices {
                simplify::for_rays(surface, rays)
            } else {
                None
            };
            let wanted = Wanted {
                surface: simplified.as_ref().unwrap_or(surface),
                goal,
                rays,
                cancel,
            };
            self.trace_together(wanted, surface, counts, &mut hits[first..])?;
        }
        Ok(())
    }

    /// Traces rays, and polishes with the `whole` surface.
    fn trace_together(
        &mut self,
        wanted: Wanted<'_>,
        whole: &Surface,
        counts: &mut Counts,
        hits: &mut [Hit],
    ) -> Result<(), Cancelled> {
        let Wanted {
            surface,
            goal,
            rays,
            ..
        } = wanted;
        // Of rays towards the sun all parts are one.
        let part = |part: Part| match goal {
            Goal::Distance => part,
            Goal::Occlusion => Part::Shadows,
        };
        let Self {
            clips,
            spans,
            paused,
            bundles,
            walks,
            search,
            ranges,
            polish,
            scratch,
            stopwatch,
        } = self;
        stopwatch.begin(part(Part::Bundles));
        clips.clip(surface.level, &surface.bound, rays, spans);
        let ground = surface.ground.as_ref().filter(|_| !surface.walks());
        if ground.is_none() && Technique::Bundles.is_used(surface.without) && !surface.walks() {
            let before = counts.evaluations;
            bundles.approach(surface, rays, spans, scratch, counts);
            surface.spend(counts.evaluations - before)?;
        }
        let polished = Wanted {
            surface: whole,
            ..wanted
        };
        let goes_back = ground.is_some() && Technique::Rounds.is_used(surface.without);
        let mut after = if surface.walks() {
            // Where a walk ends there is a root, but for few.
            1.0
        } else if goes_back {
            ROUND
        } else {
            f64::INFINITY
        };
        // Close to the surface, where rays towards the sun begin, cells of the ground say nothing.
        let mut is_near = goal == Goal::Occlusion;
        // Bundles end near the surface; rays that come far from it again follow the coarse one.
        let mut is_first = true;
        loop {
            if let Some(ground) = ground.filter(|_| !is_near) {
                stopwatch.begin(part(Part::Bundles));
                let bounds = ground::Bounds {
                    field: &whole.program,
                    level: surface.level,
                    scratch,
                };
                ground.lead(bounds, rays, spans, wanted.cancel)?;
            }
            stopwatch.begin(part(Part::Search));
            if surface.walks() {
                walks.lead(surface, rays, spans, scratch, counts);
            }
            let mut found = |found: Found, results: Results<'_>| {
                let found = if surface.is_partial {
                    found.without_outside()
                } else {
                    found
                };
                if polish.push(found) {
                    stopwatch.begin(part(Part::Polish));
                    polish.run(polished, results);
                    stopwatch.begin(part(Part::Search));
                }
            };
            if let Some(coarse) = surface.coarse.as_deref().filter(|_| !is_first) {
                paused.clear();
                let pause = Pause {
                    after: surface.steps_max,
                    spans: paused,
                };
                let results = Results {
                    scratch,
                    counts,
                    hits,
                };
                let wanted = Wanted {
                    surface: coarse,
                    ..wanted
                };
                search.run::<true>(wanted, spans, pause, results, &mut found)?;
                std::mem::swap(spans, paused);
            }
            let results = Results {
                scratch,
                counts,
                hits,
            };
            paused.clear();
            let pause = Pause {
                after,
                spans: paused,
            };
            match surface.means {
                Means::Ranges(arithmetic) => {
                    ranges.run(wanted, arithmetic, spans, results, &mut found)?
                }
                _ if surface.coarse.is_some() => {
                    search.run::<true>(wanted, spans, pause, results, &mut found)?
                }
                _ => search.run::<false>(wanted, spans, pause, results, &mut found)?,
            }
            if paused.is_empty() {
                break;
            }
            std::mem::swap(spans, paused);
            is_near = false;
            is_first = false;
            after *= 2.0;
        }
        stopwatch.begin(part(Part::Polish));
        let results = Results {
            scratch,
            counts,
            hits,
        };
        polish.run(polished, results);
        Ok(())
    }
}
