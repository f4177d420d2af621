//! How the rays of one image are traced: some of them are traced in every way that may pay, and the cheapest is taken.
//!
//! It decides how fast rays are traced and nothing else.

use core::slice::from_ref;
use std::sync::Arc;

use super::coarse;
use super::ground::{self, Ground};
use super::means::{Means, Trial};
use super::surface::{Looks, Surface};
use super::techniques::Technique;
use crate::crew::Crew;
use crate::view::View;

impl Surface {
    /// The surface with the means by which the rays of `view` need least: those given, or the cheapest, with or without the
    /// ground, and with the coarse surface that `with_coarse` adds where that pays.
    pub(crate) fn chosen(
        self,
        view: &View,
        ground: Option<Arc<Ground>>,
        with_coarse: impl FnOnce(&Self) -> Option<Self>,
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
        let bare = self.by(allowed[0]);
        if given.is_some() && ground.is_none() {
            return bare;
        }
        let trial = Trial::new(&bare, view, crew);
        let (best, cost) = match ground {
            None => {
                let (means, cost) = trial.cheapest(&bare, &allowed, f64::INFINITY);
                (bare.by(means), cost)
            }
            Some(ground) => {
                let led = Self {
                    ground: Some(ground),
                    ..bare.clone()
                };
                // Rays that are led need fewer steps, so that the others need not be tried to their ends.
                let (led_means, led_cost) = trial.cheapest(&led, &allowed, f64::INFINITY);
                let limit = led_cost + ground::COST;
                let (means, cost) = trial.cheapest(&bare, &allowed, limit);
                if cost <= limit {
                    (bare.by(means), cost)
                } else {
                    (led.by(led_means), led_cost)
                }
            }
        };
        let (best, cost) = best.bundled(&trial, cost);
        if best.means == Means::Stretches && !best.walks() {
            return best.looking(&trial, cost);
        }
        let is_stepped = matches!(best.means, Means::Values | Means::Tangents);
        let is_tried = is_stepped && best.ground.is_none();
        if !is_tried || !Technique::EarlyExit.is_used(best.without) {
            return best;
        }
        match with_coarse(&best) {
            Some(other) if trial.costs(from_ref(&other), cost)[0] < coarse::WORTH * cost => other,
            _ => best,
        }
    }

    /// Whether means say anything of this surface.
    pub(crate) fn knows(&self, means: Means) -> bool {
        let is_used = |technique: Technique| technique.is_used(self.without);
        let is_bounded = self.program.looks_ahead() || self.program.walks();
        let looks_ahead = self.clearances.have_errors() && is_bounded;
        match means {
            Means::Values | Means::Ranges(_) => true,
            Means::Tangents => self.clearances.have_tangents() && is_used(Technique::Tangents),
            Means::Stretches => looks_ahead && is_used(Technique::Stretches),
        }
    }

    /// Traced by these means; bundles by gradients where single rays have derivatives.
    pub(crate) fn by(&self, means: Means) -> Self {
        let has_derivatives = matches!(means, Means::Tangents | Means::Stretches);
        Self {
            means,
            gradients: has_derivatives && self.knows_gradients(),
            ..self.clone()
        }
    }

    /// Whether gradients say how far bundles are clear.
    fn knows_gradients(&self) -> bool {
        self.clearances.have_tangents() && Technique::Gradients.is_used(self.without)
    }

    /// With the bundles by which rays need less, those by gradients or those by values; and what a ray then costs.
    fn bundled(self, trial: &Trial<'_>, cost: f64) -> (Self, f64) {
        let has_bundles = self.ground.is_none() && !self.walks();
        let is_tried = has_bundles && Technique::Bundles.is_used(self.without);
        if !is_tried || !self.knows_gradients() || matches!(self.means, Means::Ranges(_)) {
            return (self, cost);
        }
        let other = Self {
            gradients: !self.gradients,
            ..self.clone()
        };
        let other_cost = trial.costs(from_ref(&other), cost)[0];
        if other_cost < cost {
            (other, other_cost)
        } else {
            (self, cost)
        }
    }

    /// With the looks along camera rays that need least, where rays cost so much without any.
    fn looking(self, trial: &Trial<'_>, cost: f64) -> Self {
        let is_used = |technique: Technique| technique.is_used(self.without);
        let (back, bends) = (is_used(Technique::Hindsight), is_used(Technique::Bends));
        let looks = [(back, false), (false, bends), (back, bends)];
        let looks = looks.map(|(back, bends)| Looks { back, bends });
        let tried = looks.map(|looks| Self {
            looks,
            ..self.clone()
        });
        let costs = trial.costs(&tried, cost);
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
