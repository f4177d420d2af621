//! Mitchell's method, thesis §5.4: once the derivative keeps its sign over an interval, its one root is sought by Newton's.

use field::Interval;

use super::subdivision::{Grain, crosses, starts_inside};
use super::{Along, Hit, Method, Tally, Wanted, inside};

/// Fig. 5.8 by intervals of the function and of its derivative.
///
/// The derivative is asked for where the function's range holds 0, and counts as an evaluation of its own (thesis §5.4).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Mitchell {
    /// Widths below this are not searched.
    pub epsilon: f64,
    /// When it stops.
    pub hit: Hit,
}

impl Method for Mitchell {
    fn name(&self) -> &'static str {
        "Mitchell"
    }

    fn search(
        &self,
        ray: &dyn Along,
        span: Interval,
        wanted: Wanted,
        tally: &mut Tally,
    ) -> Vec<f64> {
        let begun = tally.evaluations();
        let grain = Grain {
            epsilon: self.epsilon,
            hit: self.hit,
        };
        let mut roots = Vec::new();
        if starts_inside(ray, span, grain, tally) {
            roots.push(span.low);
        }
        let mut stack = vec![span];
        while let Some(t) = stack.pop() {
            if (wanted == Wanted::First && !roots.is_empty()) || tally.spent(begun) {
                break;
            }
            tally.ranges += 1;
            if !ray.interval(t).contains(0.0) {
                continue;
            }
            tally.ranges += 1;
            let slope = ray.slope(t);
            if !slope.value.contains(0.0) {
                continue;
            }
            let monotone = !slope.slopes[0].contains(0.0);
            let middle = 0.5 * (t.low + t.high);
            let atom = !(t.low < middle && middle < t.high);
            if t.high - t.low < self.epsilon || atom {
                if self.hit == Hit::Converged || crosses(ray, t, tally) {
                    roots.push(t.low);
                }
            } else if monotone {
                if crosses(ray, t, tally) {
                    roots.push(self.only(ray, t, slope.slopes[0], tally));
                }
            } else {
                tally.subdivisions += 1;
                stack.push(Interval::new(middle, t.high));
                stack.push(Interval::new(t.low, middle));
            }
        }
        roots
    }
}

impl Mitchell {
    /// The near end of an interval below ε around the one root: Newton's interval, or half where that is shorter.
    fn only(&self, ray: &dyn Along, t: Interval, slope: Interval, tally: &mut Tally) -> f64 {
        let Interval { mut low, mut high } = t;
        tally.points += 1;
        let start = inside(ray.value(low));
        while high - low >= self.epsilon {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            tally.points += 1;
            let value = ray.value(middle);
            // The root is where a line through here with one of the slopes meets 0.
            let (p, q) = (middle - value / slope.low, middle - value / slope.high);
            let (near, far) = if p < q { (p, q) } else { (q, p) };
            let room = 0.1 * self.epsilon;
            if inside(value) == start {
                low = middle;
            } else {
                high = middle;
            }
            for place in [near - room, far + room] {
                if low < place && place < high {
                    tally.points += 1;
                    if inside(ray.value(place)) == start {
                        low = place;
                    } else {
                        high = place;
                    }
                }
            }
            tally.steps += 1;
        }
        low
    }
}
