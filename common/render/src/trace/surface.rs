//! The surface of one image, ready to be traced.

use std::sync::Arc;

use field::{Interval, Points, Program, Scratch, SimdLevel};
use glam::DVec3;
use scene::Description;
use scene::description::{Bound, Seed};

use super::allowance::Allowance;
use super::clearance::{Around, Clearances};
use super::coarse;
use super::grid::Grid;
use super::ground::{Ground, Site};
use super::means::Means;
use super::search::STEPS_MAX;
use super::split::split;
use super::techniques::Technique;
use super::tracer::Ray;
#[cfg(test)]
use crate::crew::Alone;
use crate::crew::Crew;
use crate::error::{Cancelled, RenderError};
use crate::renderer::EvalSettings;
use crate::view::{Footprint, Sight, View};

/// Neighbouring points of a camera ray's grid are this share of a footprint apart, or down to half of it.
const SHARE: f64 = 1.0 / 2.0;

/// The same for rays towards the sun.
const SHADOW_SHARE: f64 = 1.0 / 2.0;

/// Where parallel rays stop having points at even distances, in points: 2⁴⁰.
const EVEN_POINTS: f64 = 1_099_511_627_776.0;

/// A compiled surface, its bounds and its grids.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    /// f.
    pub(crate) program: Program,
    /// How it is evaluated.
    pub(crate) level: SimdLevel,
    /// How far rays may step.
    pub(crate) clearances: Arc<Clearances>,
    /// Where it can be.
    pub(crate) bound: Bound,
    /// What heights are measured from.
    pub(crate) seed: Seed,
    /// How wide pixels are.
    pub(crate) footprint: Footprint,
    /// The grid of every camera ray.
    pub(crate) sight: Grid,
    /// Whether the field changes while the shutter is open.
    pub(crate) moves: bool,
    /// Where heights are tabled above which nothing need be looked at.
    pub(crate) ground: Option<Arc<Ground>>,
    /// The surface without half of its noises, where it pays to follow that.
    pub(crate) coarse: Option<Arc<Self>>,
    /// What an evaluation costs, over one of the whole field: less if this is a coarse one.
    pub(crate) cost: f64,
    /// How single rays find how far they may step.
    pub(crate) means: Means,
    /// Whether bundles are followed by gradients, not by values alone.
    pub(crate) gradients: bool,
    /// How camera rays look along themselves.
    pub(crate) looks: Looks,
    /// Most evaluations along one ray.
    pub(crate) steps_max: f64,
    /// What its rays may cost, where that is limited.
    pub(crate) allowance: Option<Arc<Allowance>>,
    /// Whether its program has been simplified, so that values outside are not those of the field.
    pub(crate) is_partial: bool,
    /// A technique that is left out.
    pub(crate) without: Option<Technique>,
}

/// How rays look along themselves where the field's ranges say how far it is clear.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub(crate) struct Looks {
    /// Whether they look behind, too.
    pub(crate) back: bool,
    /// Whether how far they look follows from how the field bends.
    pub(crate) bends: bool,
}

impl Surface {
    /// Compiles the surface for the instants, distances and footprints of one view.
    #[cfg(test)]
    pub(crate) fn new(
        description: &Description,
        view: &View,
        level: SimdLevel,
    ) -> Result<Self, RenderError> {
        let settings = EvalSettings {
            level,
            ..EvalSettings::default()
        };
        Self::prepared(&Alone, description, view, settings, None)
    }

    /// The same as the settings say, by a crew, with a technique left out.
    pub(crate) fn prepared(
        crew: &dyn Crew,
        description: &Description,
        view: &View,
        EvalSettings { level, means }: EvalSettings,
        without: Option<Technique>,
    ) -> Result<Self, RenderError> {
        let surface = &description.surface;
        let (start, end) = view.instants();
        let time = Interval::new(start, end);
        let compile = |graph, root| {
            Program::compile(graph, &[root], time).map_err(|source| RenderError::Field {
                what: "surface's field",
                source,
            })
        };
        let program = compile(&surface.graph, surface.field)?;
        let rest = match split(&surface.graph, surface.field, &surface.seed) {
            Some(split) if Technique::Growth.is_used(without) => {
                Some(compile(&split.graph, split.rest)?)
            }
            _ => None,
        };
        let footprint = view.footprint();
        let around = Around {
            field: &program,
            rest: rest.as_ref(),
            cut: None,
            bound: &surface.bound,
            seed: &surface.seed,
            footprint,
            time,
            eye: view.eye(),
            travel: view.travel(),
            without,
        };
        let nearest = nearest(&program, level, view);
        let [width, height] = view.size();
        let rays = f64::from(description.sampling.rays);
        let site = Site {
            field: &program,
            level,
            time,
            bound: &surface.bound,
            footprint,
            eye: view.eye(),
            travel: view.travel(),
            nearest,
            rays: width * height * rays * rays,
        };
        let has_ground = rest.is_some() && Technique::Ground.is_used(without);
        let ground = Some(site).filter(|_| has_ground);
        let ground = ground.and_then(|site| Ground::new(&site)).map(Arc::new);
        let clearances = Arc::new(Clearances::new(&around, nearest, crew));
        let sight = if footprint.angle > 0.0 {
            Grid::from_eye(footprint.angle * SHARE)
        } else {
            let spacing = footprint.base * SHARE;
            Grid::even(spacing, spacing * EVEN_POINTS)
        };
        let surface = Self {
            moves: program.moves(),
            ground: None,
            coarse: None,
            cost: 1.0,
            means: Means::Values,
            gradients: false,
            looks: Looks::default(),
            steps_max: STEPS_MAX,
            allowance: None,
            is_partial: false,
            without,
            program: program.clone(),
            level,
            clearances,
            bound: surface.bound,
            seed: surface.seed,
            footprint,
            sight,
        };
        let with_coarse = |surface: &Self| coarse::with(surface, &around, nearest, crew);
        Ok(surface.chosen(view, ground, with_coarse, means, crew))
    }

    /// Whether noises are left out of its field: then that is below the surface's.
    pub(crate) fn is_coarse(&self) -> bool {
        self.cost < 1.0
    }

    /// Whether rays are walked to their roots.
    pub(crate) fn walks(&self) -> bool {
        self.means == Means::Stretches && self.program.walks()
    }

    /// By what means single rays step: those that are walked go no farther by themselves than values say.
    pub(crate) fn steps_by(&self) -> Means {
        if self.walks() {
            Means::Values
        } else {
            self.means
        }
    }

    /// Takes evaluations from what its rays may cost.
    pub(crate) fn spend(&self, evaluations: u64) -> Result<(), Cancelled> {
        match &self.allowance {
            Some(allowance) => allowance.spend(evaluations),
            None => Ok(()),
        }
    }

    /// The camera ray of a sight.
    pub(crate) fn ray(&self, sight: &Sight) -> Ray {
        Ray {
            origin: sight.origin,
            direction: sight.direction,
            from_eye: DVec3::ZERO,
            time: sight.time,
            grid: self.sight,
        }
    }

    /// The grid of a ray that starts at the surface, at a distance from the eye.
    pub(crate) fn shadow_grid(&self, distance: f64) -> Grid {
        let spacing = self.footprint.at(distance) * SHADOW_SHARE;
        if self.footprint.angle > 0.0 {
            Grid::even(spacing, distance)
        } else {
            Grid::even(spacing, spacing * EVEN_POINTS)
        }
    }

    /// What heights are measured along, at a place; a unit vector.
    pub(crate) fn vertical(&self, place: DVec3) -> DVec3 {
        vertical(self.seed, place)
    }

    /// The height of a place over the seed, metres.
    pub(crate) fn height(&self, place: DVec3) -> f64 {
        match self.seed {
            Seed::Plane => place.z,
            Seed::Sphere { radius } => place.dot(place).sqrt() - radius,
        }
    }
}

/// What heights over a seed are measured along, at a place; a unit vector.
pub(crate) fn vertical(seed: Seed, place: DVec3) -> DVec3 {
    match seed {
        Seed::Plane => DVec3::Z,
        Seed::Sphere { .. } => {
            let square = place.dot(place);
            if square > 0.0 {
                place * (1.0 / square.sqrt())
            } else {
                DVec3::Z
            }
        }
    }
}

/// About how far the surface is from the eye: where tables of bounds begin to be of use.
///
/// It decides how fast rays are traced and nothing else.
fn nearest(program: &Program, level: SimdLevel, view: &View) -> f64 {
    const LEAST: f64 = 1.0 / 1024.0;
    let eye = view.eye();
    let mut value = [0.0];
    program.evaluate(
        level,
        &Points {
            x: &[eye.x],
            y: &[eye.y],
            z: &[eye.z],
            footprint: &[view.footprint().at(0.0)],
            time: &[view.instants().0],
        },
        &mut Scratch::new(),
        &mut [&mut value],
    );
    let near = value[0].abs() / 8.0;
    if near > LEAST && near < super::grid::FAR {
        near
    } else {
        LEAST
    }
}
