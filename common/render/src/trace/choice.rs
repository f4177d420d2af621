//! How the rays of one image are traced: some of them are traced in every way that may pay, and the cheapest is taken.
//!
//! It decides how fast rays are traced and nothing else.

use std::sync::Arc;

use super::ground::{self, Ground};
use super::means::{Means, STEPS_MAX, Trial};
use super::surface::{Looks, Surface};
use super::techniques::Technique;
use crate::crew::{Crew, in_order};
use crate::view::View;

/// Beside cells of the ground, rays without them are tried as far as so many times what they must not cost on average.
const PATIENCE: f64 = 4.0;

impl Surface {
    /// The surface with the means by which the rays of `view` need least: those given, or the cheapest, with or without the
    /// ground.
    pub(crate) fn chosen(
        self,
        view: &View,
        ground: Option<Arc<Ground>>,
        given: Option<Means>,
        crew: &dyn Crew,
    ) -> Self {
        let all = [Means::Values, Means::Tangents, Means::Stretches];
        let allowed: Vec<_> = match given {
            Some(means) if self.knows(means) => vec![means],
            Some(_) => vec![Means::Values],
            None => all.into_iter().filter(|means| self.knows(*means)).collect(),
        };
        let ranges = allowed
            .iter()
            .any(|means| matches!(means, Means::Ranges(_)));
        let ground = ground.filter(|_| !ranges);
        let bare = Self {
            means: allowed[0],
            ..self
        };
        if given.is_some() && ground.is_none() {
            return bare;
        }
        let trial = Trial::new(&bare, view, crew);
        // Rays that are led need fewer steps, and so less time to be tried.
        let led = ground.map(|ground| {
            let led = Self {
                ground: Some(ground),
                ..bare.clone()
            };
            let (means, cost) = trial.cheapest(&led, &allowed, STEPS_MAX);
            (Self { means, ..led }, cost + ground::COST)
        });
        let steps_max = led.as_ref().map_or(STEPS_MAX, |(_, cost)| PATIENCE * cost);
        let (means, cost) = trial.cheapest(&bare, &allowed, steps_max);
        let (best, cost) = match led {
            Some((led, led_cost)) if led_cost < cost => (led, led_cost - ground::COST),
            _ => (Self { means, ..bare }, cost),
        };
        if best.means == Means::Stretches && !best.walks() {
            return best.looking(&trial, cost, crew);
        }
        best
    }

    /// Whether means say anything of this surface.
    fn knows(&self, means: Means) -> bool {
        let is_used = |technique: Technique| technique.is_used(self.without);
        let looks_ahead = self.clearances.have_errors() && self.program.looks_ahead();
        match means {
            Means::Values | Means::Ranges(_) => true,
            Means::Tangents => self.clearances.have_tangents() && is_used(Technique::Tangents),
            Means::Stretches => looks_ahead && is_used(Technique::Stretches),
        }
    }

    /// With the looks along camera rays that need least, where rays cost so much without any.
    fn looking(self, trial: &Trial, cost: f64, crew: &dyn Crew) -> Self {
        let is_used = |technique: Technique| technique.is_used(self.without);
        let (back, bends) = (is_used(Technique::Hindsight), is_used(Technique::Bends));
        let looks = [(back, false), (false, bends), (back, bends)];
        let looks = looks.map(|(back, bends)| Looks { back, bends });
        let costs = in_order(crew, &looks, |&looks| {
            let other = Self {
                looks,
                ..self.clone()
            };
            trial.cost(&other, Means::Stretches, STEPS_MAX)
        });
        let mut best = (self.looks, cost);
        for (looks, cost) in looks.into_iter().zip(costs) {
            if cost < best.1 {
                best = (looks, cost);
            }
        }
        Self {
            looks: best.0,
            ..self
        }
    }
}
