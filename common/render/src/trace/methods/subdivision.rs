//! Ray casting by range estimates, thesis fig. 5.8: halves of an interval, the nearer first, until none is left that may hold a root.

use field::{Interval, Reduced};

use super::{Along, Hit, Method, Tally, Wanted, inside};

/// Fig. 5.8 with one of three arithmetics.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Subdivision {
    arithmetic: Arithmetic,
    epsilon: f64,
    hit: Hit,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Arithmetic {
    Interval,
    Affine,
    Reduced,
}

impl Subdivision {
    /// By intervals (thesis §5.3.1), down to widths below `epsilon`.
    pub const fn interval(epsilon: f64, hit: Hit) -> Self {
        Self {
            arithmetic: Arithmetic::Interval,
            epsilon,
            hit,
        }
    }

    /// By standard affine forms (thesis §5.3.2).
    pub const fn affine(epsilon: f64, hit: Hit) -> Self {
        Self {
            arithmetic: Arithmetic::Affine,
            epsilon,
            hit,
        }
    }

    /// By reduced affine forms (thesis §5.3.3).
    pub const fn reduced(epsilon: f64, hit: Hit) -> Self {
        Self {
            arithmetic: Arithmetic::Reduced,
            epsilon,
            hit,
        }
    }
}

impl Method for Subdivision {
    fn name(&self) -> &'static str {
        match self.arithmetic {
            Arithmetic::Interval => "IA",
            Arithmetic::Affine => "standard AA",
            Arithmetic::Reduced => "reduced AA",
        }
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
            let range = match self.arithmetic {
                Arithmetic::Interval => ray.interval(t),
                Arithmetic::Affine => ray.affine(t).interval(),
                Arithmetic::Reduced => ray.reduced(t).interval(),
            };
            range.contains(0.0).then_some(t)
        })
    }
}

/// How fine a search is.
#[derive(Clone, Copy)]
pub(super) struct Grain {
    pub(super) epsilon: f64,
    pub(super) hit: Hit,
}

/// The roots in `span`; `part` says which part of an interval may hold any, `None` for no part.
///
/// As in the thesis, an interval is measured before it is made smaller.
pub(super) fn subdivide(
    ray: &dyn Along,
    span: Interval,
    wanted: Wanted,
    grain: Grain,
    tally: &mut Tally,
    part: impl Fn(Interval) -> Option<Interval>,
) -> Vec<f64> {
    let begun = tally.evaluations();
    let mut roots = Vec::new();
    if starts_inside(ray, span, grain, tally) {
        roots.push(span.low);
        if wanted == Wanted::First {
            return roots;
        }
    }
    let started = roots.len();
    let mut stack = vec![span];
    while let Some(t) = stack.pop() {
        if tally.spent(begun) {
            break;
        }
        tally.ranges += 1;
        let Some(held) = part(t) else { continue };
        let middle = 0.5 * (held.low + held.high);
        let atom = !(held.low < middle && middle < held.high);
        if t.high - t.low < grain.epsilon || atom {
            if grain.hit == Hit::Converged || crosses(ray, t, tally) {
                add(&mut roots, started, t.low, grain);
                if wanted == Wanted::First {
                    break;
                }
            }
            continue;
        }
        tally.subdivisions += 1;
        stack.push(Interval::new(middle, held.high));
        stack.push(Interval::new(held.low, middle));
    }
    roots
}

/// Adds a root that comes after those that are there, of which `started` are no crossings.
///
/// Two crossings less than ε apart are not told: a surface that rounding makes rough changes its side three
/// times where it does once, and the two that go too far and come back mean nothing.
fn add(roots: &mut Vec<f64>, started: usize, root: f64, grain: Grain) {
    let last = roots[started..].last();
    if grain.hit == Hit::Crossing && last.is_some_and(|last| root - last < grain.epsilon) {
        roots.pop();
    } else {
        roots.push(root);
    }
}

/// Whether the span begins in the solid, which counts as a crossing there.
pub(super) fn starts_inside(
    ray: &dyn Along,
    span: Interval,
    grain: Grain,
    tally: &mut Tally,
) -> bool {
    if grain.hit == Hit::Converged {
        return false;
    }
    tally.points += 1;
    inside(ray.value(span.low))
}

/// Whether an interval's ends are on different sides.
pub(super) fn crosses(ray: &dyn Along, t: Interval, tally: &mut Tally) -> bool {
    tally.points += 2;
    inside(ray.value(t.low)) != inside(ray.value(t.high))
}

/// The part of `t` in which a form can be zero, thesis eqs. (5.25)–(5.27), rounded outward.
pub(super) fn optimised(t: Interval, g: &Reduced<1>) -> Option<Interval> {
    if !g.interval().contains(0.0) {
        return None;
    }
    let rise = g.along[0];
    let middle = 0.5 * (t.low + t.high);
    let half = 0.5 * (t.high - t.low);
    let centre = middle - g.centre / rise * half;
    let reach = (g.error / rise).abs() * half;
    // Forms are widened by more than this by their own rounding.
    let room = 1e-12 * (centre.abs() + reach + t.low.abs() + t.high.abs());
    let low = centre - reach - room;
    let high = centre + reach + room;
    let held = Interval::new(
        if low > t.low { low } else { t.low },
        if high < t.high { high } else { t.high },
    );
    (held.low <= held.high).then_some(held)
}
