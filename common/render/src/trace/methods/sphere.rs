//! Sphere tracing, thesis §5.2.1: steps that no root can lie in.

use field::Interval;

use super::{Along, Hit, Method, Tally, Wanted, inside};

/// Steps of |g|/λ, thesis eq. (5.8).
///
/// For crossings, and for all roots (footnote 2 of the thesis), steps are at least ε.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SphereTracing {
    /// λ: no slope of the field is greater.
    pub lipschitz: f64,
    /// Steps shorter than this are not taken.
    pub epsilon: f64,
    /// When it stops.
    pub hit: Hit,
}

impl Method for SphereTracing {
    fn name(&self) -> &'static str {
        "sphere tracing"
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
            ray.value(t)
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
            if self.hit == Hit::Converged && wanted == Wanted::First && radius < self.epsilon {
                roots.push(t + radius);
                break;
            }
            let step = if radius > self.epsilon {
                radius
            } else {
                self.epsilon
            };
            let next = if t + step < span.high {
                t + step
            } else {
                span.high
            };
            tally.steps += 1;
            let there = value(next, tally);
            if inside(here) != inside(there) {
                roots.push(t);
            }
            (t, here) = (next, there);
        }
        roots
    }
}
