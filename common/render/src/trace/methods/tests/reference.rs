//! What is certain about a ray: bisection in outward-rounded f64.
//!
//! A part of a ray is *decided* where the field certainly keeps its side, or certainly rises or falls from one side to
//! the other. Noises are computed in f32, so what methods evaluate is only within a stated rounding of the exact field; a
//! bracket here is certain for both. What is left is *rough*: the exact field comes so near to 0 that f32 cannot
//! tell. There the exact field is looked at alone, down to 10⁻⁹, and only what even that does not tell is undecided.

use field::Interval;

use super::super::{Along, FieldAlong, Wanted};

/// How finely the exact field is looked at.
pub(crate) const FINEST: f64 = 1e-9;

/// Parts wider than this are cut before their slopes are asked for.
const WIDE: f64 = 0.15;

/// Most parts of a rough stretch that are looked at.
const PARTS_MAX: u32 = 20_000;

/// A part of a ray that is not certainly free of roots.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Part {
    /// Just one root of the exact field lies within, and all of what is computed; its ends are certain.
    Root(Interval),
    /// None, one or many: the field is within its rounding of 0.
    Rough(Interval),
}

/// What is known of a ray, up to its first certain root or all along.
#[derive(Debug)]
pub(crate) struct Truth {
    /// In order; apart.
    pub(crate) parts: Vec<Part>,
    /// Whether the ray begins inside.
    pub(crate) begins: bool,
    /// Whether the exact field's roots are all known to 10⁻⁹, with their number.
    pub(crate) exact: Option<usize>,
}

impl Truth {
    /// The brackets of the roots that are certain.
    pub(crate) fn roots(&self) -> impl Iterator<Item = Interval> {
        self.parts.iter().filter_map(|part| match part {
            Part::Root(t) => Some(*t),
            Part::Rough(_) => None,
        })
    }

    /// The stretches that are not.
    pub(crate) fn rough(&self) -> impl Iterator<Item = Interval> {
        self.parts.iter().filter_map(|part| match part {
            Part::Root(_) => None,
            Part::Rough(t) => Some(*t),
        })
    }
}

/// Looks at a ray: for its first root, or for all of them.
pub(crate) fn truth(ray: &FieldAlong<'_>, span: Interval, finest: f64, wanted: Wanted) -> Truth {
    let parts: Vec<Part> = decided(ray, span, finest, wanted)
        .into_iter()
        .map(|part| match part {
            Part::Root(t) => Part::Root(narrowed(ray, t)),
            rough => rough,
        })
        .collect();
    let mut exact = Some(0);
    for part in &parts {
        let here = match part {
            Part::Root(_) => Some(1),
            Part::Rough(t) => roots_of_exact(ray, *t),
        };
        exact = exact.zip(here).map(|(sum, here)| sum + here);
    }
    Truth {
        begins: side(ray, span.low) == Some(true),
        parts,
        exact,
    }
}

/// Certainly outside, certainly inside, or neither; computed and exact alike.
fn side(ray: &dyn Along, t: f64) -> Option<bool> {
    sign(ray.interval(Interval::point(t)))
}

/// The same of the exact field alone.
fn exact_side(ray: &FieldAlong<'_>, t: f64) -> Option<bool> {
    sign(ray.exact(Interval::point(t)).value)
}

fn sign(value: Interval) -> Option<bool> {
    if value.low > 0.0 {
        Some(false)
    } else if value.high < 0.0 {
        Some(true)
    } else {
        None
    }
}

/// Not in the middle: a root there would be at an end of all that follows.
fn halves(t: Interval) -> [Interval; 2] {
    let middle = t.low + 0.481_3 * t.width();
    [Interval::new(t.low, middle), Interval::new(middle, t.high)]
}

/// Bisection, down to `finest`.
fn decided(ray: &dyn Along, span: Interval, finest: f64, wanted: Wanted) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    let mut stack = vec![span];
    while let Some(t) = stack.pop() {
        if !ray.interval(t).contains(0.0) {
            continue;
        }
        // A wide part does not only rise or only fall, and it costs more to ask.
        let monotone = t.width() < WIDE && !ray.slope(t).slopes[0].contains(0.0);
        if monotone && let (Some(a), Some(b)) = (side(ray, t.low), side(ray, t.high)) {
            if a != b {
                parts.push(Part::Root(t));
                if wanted == Wanted::First {
                    break;
                }
            }
            continue;
        }
        if t.width() < finest {
            match parts.last_mut() {
                Some(Part::Rough(last)) if last.high == t.low => last.high = t.high,
                _ => parts.push(Part::Rough(t)),
            }
            continue;
        }
        let [near, far] = halves(t);
        stack.push(far);
        stack.push(near);
    }
    parts
}

/// A root's bracket as short as the rounding lets its ends be certain, around where secants find it.
fn narrowed(ray: &FieldAlong<'_>, bracket: Interval) -> Interval {
    let Interval { mut low, mut high } = bracket;
    let (mut a, mut b) = (ray.value(low), ray.value(high));
    // Illinois: an end that stays is halved.
    for _ in 0..40 {
        if high - low < FINEST {
            break;
        }
        let root = low + (high - low) * (a / (a - b));
        let inner = 0.1 * FINEST;
        let root = if root < high - inner {
            root
        } else {
            high - inner
        };
        let root = if root > low + inner {
            root
        } else {
            low + inner
        };
        let here = ray.value(root);
        if here.abs() < 1e-7 {
            (low, high) = (root, root);
        } else if (here > 0.0) == (a > 0.0) {
            (low, a, b) = (root, here, 0.5 * b);
        } else {
            (high, b, a) = (root, here, 0.5 * a);
        }
    }
    let middle = 0.5 * (low + high);
    let begins = side(ray, bracket.low);
    let mut reach = 1e-7;
    loop {
        let (near, far) = (middle - reach, middle + reach);
        if near <= bracket.low || far >= bracket.high {
            return bracket;
        }
        if let (Some(a), Some(b)) = (side(ray, near), side(ray, far))
            && Some(a) == begins
            && a != b
        {
            return Interval::new(near, far);
        }
        reach *= 4.0;
    }
}

/// How many roots the exact field has in a rough stretch; `None` if that cannot be told to 10⁻⁹.
fn roots_of_exact(ray: &FieldAlong<'_>, stretch: Interval) -> Option<usize> {
    let (mut roots, mut parts) = (0, 0);
    let mut stack = vec![stretch];
    while let Some(t) = stack.pop() {
        parts += 1;
        let known = ray.exact(t);
        let slopes = known.slopes[0];
        let middle = 0.5 * (t.low + t.high);
        let centre = ray.exact(Interval::point(middle)).value;
        // The mean value theorem: near an extremum it says far more than the interval.
        let reach = slopes.magnitude() * 0.5 * t.width() * (1.0 + 1e-12);
        let apart = Interval::new(centre.low - reach, centre.high + reach);
        if !known.value.contains(0.0) || !apart.contains(0.0) {
            continue;
        }
        let ends = (exact_side(ray, t.low), exact_side(ray, t.high));
        if !slopes.contains(0.0)
            && let (Some(a), Some(b)) = ends
        {
            roots += usize::from(a != b);
            continue;
        }
        if t.width() < FINEST || parts > PARTS_MAX {
            return None;
        }
        let [near, far] = halves(t);
        stack.push(far);
        stack.push(near);
    }
    Some(roots)
}
