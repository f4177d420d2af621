//! Speculative sphere tracing, thesis §5.2.2: longer steps, taken back where the spheres do not meet.

use field::Interval;

use super::{Along, Hit, Method, Tally, Wanted, inside};

/// Steps of η|g|/λ, thesis eqs. (5.9), (5.10) and fig. 5.5.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Speculative {
    /// λ: no slope of the field is greater.
    pub lipschitz: f64,
    /// η ≥ 1; 1.46 after Worley and Hart.
    pub overshoot: f64,
    /// Steps shorter than this are not taken.
    pub epsilon: f64,
    /// When it stops.
    pub hit: Hit,
}

impl Method for Speculative {
    fn name(&self) -> &'static str {
        "speculative sphere tracing"
    }

    fn search(
        &self,
        ray: &dyn Along,
        span: Interval,
        wanted: Wanted,
        tally: &mut Tally,
    ) -> Vec<f64> {
        let begun = tally.evaluations();
        let mut roots = Vec::new();
        let value = |t: f64, tally: &mut Tally| {
            tally.points += 1;
            ray.value(if t < span.high { t } else { span.high })
        };
        let mut t = span.low;
        let mut here = value(t, tally);
        if inside(here) {
            roots.push(t);
        }
        while t < span.high && (wanted == Wanted::All || roots.is_empty()) {
            if tally.spent(begun) {
                break;
            }
            let radius = here.abs() / self.lipschitz;
            // Below ε there is nothing to speculate with: a step of ε is the search's grain.
            let crawl = radius <= self.epsilon;
            let mut step = if crawl {
                self.epsilon
            } else {
                self.overshoot * radius
            };
            let mut there = value(t + step, tally);
            if !crawl && step > radius + there.abs() / self.lipschitz {
                tally.backtracks += 1;
                step = radius;
                there = value(t + step, tally);
            }
            tally.steps += 1;
            if inside(here) != inside(there) {
                roots.push(t);
            } else if self.hit == Hit::Converged && wanted == Wanted::First {
                // fig. 5.5: the step that was taken is shorter than ε.
                if crawl || step < self.epsilon {
                    roots.push(t + step);
                }
            }
            (t, here) = (t + step, there);
        }
        roots
    }
}
