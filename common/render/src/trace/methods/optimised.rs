//! Reduced affine ray casting with interval optimisation, thesis §5.4.1.

use field::Interval;

use super::subdivision::{Grain, optimised, subdivide};
use super::{Along, Hit, Method, Tally, Wanted};

/// Fig. 5.8 with reduced affine forms, each interval first made as small as eq. (5.27) allows.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Optimised {
    /// Widths below this are not searched.
    pub epsilon: f64,
    /// When it stops.
    pub hit: Hit,
}

impl Method for Optimised {
    fn name(&self) -> &'static str {
        "reduced AA + int. opt."
    }

    fn search(
        &self,
        ray: &dyn Along,
        span: Interval,
        wanted: Wanted,
        tally: &mut Tally,
    ) -> Vec<f64> {
        let grain = Grain {
            epsilon: self.epsilon,
            hit: self.hit,
        };
        subdivide(ray, span, wanted, grain, tally, |t| {
            optimised(t, &ray.reduced(t))
        })
    }
}
