//! Ranges and moduli of every step of a plan, by interval arithmetic and by bounds of differences.
//!
//! A step's *change* bounds |f(y) − f(x)| for any two places of the region by an affine function of
//! their distance. Rules are about differences, not derivatives, so the region need not be convex:
//! |ab − a′b′| ≤ |a||b − b′| + |b′||a − a′|, and so on. Wherever a step's range is narrower than its
//! change at the radius of interest, the range's width takes its place: that is how fine octaves stop
//! counting as slope far from a surface (Worley and Hart's early exit, as a table).
//!
//! All bounds are of what evaluation computes: ranges enclose computed values by induction, and each
//! operation adds twice its rounding error to the change.

mod cascade;

use crate::arithmetic::{Binary, Unary};
use crate::curve::Curve;
use crate::grid::Surface;
use crate::interval::{Interval, larger, smaller};
use crate::noise::{self, Noise};
use crate::program::fold;
use crate::program::plan::{Act, Plan, Step};
use crate::shape::{Shape, Within};
use crate::surroundings::{Region, Surroundings, WORLD};

/// Twice the rounding error of one operation, relative to its result.
const ROUNDING: f64 = 2.0 * f64::EPSILON;

/// Twice the error of an offset rounded to f32 in three coordinates: 2 · √3 · 2⁻²⁵.
const OFFSET_ROUNDING: f64 = 1.04e-7;

/// offset + slope · distance.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Change {
    pub(crate) offset: f64,
    pub(crate) slope: f64,
}

impl Change {
    pub(crate) const NONE: Self = Self {
        offset: 0.0,
        slope: 0.0,
    };

    fn new(offset: f64, slope: f64) -> Self {
        Self { offset, slope }
    }

    /// The bound at a distance.
    fn at(self, radius: f64) -> f64 {
        if self.slope.is_finite() {
            self.offset + self.slope * radius
        } else {
            f64::INFINITY
        }
    }

    fn plus(self, other: Self) -> Self {
        Self::new(self.offset + other.offset, self.slope + other.slope)
    }

    fn times(self, factor: f64) -> Self {
        let times = |a: f64| {
            if a == 0.0 || factor == 0.0 {
                0.0
            } else {
                a * factor
            }
        };
        Self::new(times(self.offset), times(self.slope))
    }

    /// With twice the rounding of a result of that magnitude, `operations` times.
    fn rounded(self, magnitude: f64, operations: f64) -> Self {
        Self::new(
            self.offset + magnitude * (ROUNDING * operations),
            self.slope,
        )
    }

    fn larger(self, other: Self) -> Self {
        Self::new(
            larger(self.offset, other.offset),
            larger(self.slope, other.slope),
        )
    }

    /// The norm of changes along axes at right angles.
    fn norm(parts: &[Self]) -> Self {
        let square = |f: fn(&Self) -> f64| {
            parts
                .iter()
                .map(|part| f(part) * f(part))
                .sum::<f64>()
                .sqrt()
        };
        Self::new(square(|part| part.offset), square(|part| part.slope)).times(1.0 + 1e-15)
    }
}

/// What is known of a step.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Bound {
    Scalar {
        range: Interval,
        change: Change,
    },
    Vector {
        parts: [Interval; 3],
        norm: Interval,
        change: Change,
    },
}

impl Bound {
    pub(crate) fn range(&self) -> Interval {
        match self {
            Self::Scalar { range, .. } => *range,
            Self::Vector { norm, .. } => *norm,
        }
    }

    pub(crate) fn change(&self) -> Change {
        match self {
            Self::Scalar { change, .. } | Self::Vector { change, .. } => *change,
        }
    }

    pub(crate) fn parts(&self) -> [Interval; 3] {
        match self {
            Self::Vector { parts, .. } => *parts,
            Self::Scalar { range, .. } => [*range; 3],
        }
    }

    fn magnitude(&self) -> f64 {
        self.range().magnitude()
    }
}

/// One pass over a plan, for changes over about `radius`.
pub(crate) struct Pass<'a> {
    around: &'a Surroundings,
    radius: f64,
    /// Whether places change, or only what the footprint does by itself.
    moving: bool,
    /// Whether slopes are wanted that bound derivatives, even where a range says more of changes.
    derivatives: bool,
    /// How many octaves each noise and cascade keeps, if some are left out.
    kept: std::slice::Iter<'a, usize>,
    /// The radii at which some step's range becomes narrower than its change.
    pub(crate) crossings: Vec<f64>,
}

impl<'a> Pass<'a> {
    pub(crate) fn new(around: &'a Surroundings, radius: f64) -> Self {
        Self {
            around,
            radius,
            moving: true,
            derivatives: false,
            kept: [].iter(),
            crossings: Vec::new(),
        }
    }

    /// A pass whose slopes bound derivatives, wherever second derivatives can be bounded.
    pub(crate) fn of_derivatives(around: &'a Surroundings) -> Self {
        Self {
            derivatives: true,
            ..Self::new(around, 0.0)
        }
    }

    /// A pass over what level-of-detail weights change by themselves, all else standing still.
    pub(crate) fn of_weights(around: &'a Surroundings) -> Self {
        Self {
            moving: false,
            ..Self::new(around, 0.0)
        }
    }

    /// A pass over what leaving out all octaves but `kept` changes, all else standing still.
    pub(crate) fn of_cut(around: &'a Surroundings, kept: &'a [usize]) -> Self {
        Self {
            kept: kept.iter(),
            ..Self::of_weights(around)
        }
    }

    /// The bounds of every step.
    pub(crate) fn run(&mut self, plan: &Plan) -> Vec<Bound> {
        let mut bounds: Vec<Bound> = Vec::with_capacity(plan.steps.len());
        for step in &plan.steps {
            let bound = self.step(step, &plan.steps, &bounds);
            bounds.push(bound);
        }
        bounds
    }

    fn step(&mut self, step: &Step, steps: &[Step], bounds: &[Bound]) -> Bound {
        let arg = |i: usize| &bounds[step.args[i]];
        match &step.act {
            Act::Constant(value) => Bound::Scalar {
                range: Interval::point(*value),
                change: Change::NONE,
            },
            Act::ConstantVector(value) => {
                vector(value.map(Interval::point), Interval::ALL, Change::NONE)
            }
            Act::Position => position(self.around.region, self.moving),
            Act::Time => Bound::Scalar {
                range: self.around.time,
                change: Change::NONE,
            },
            Act::Vector => {
                let parts = [0, 1, 2].map(|i| arg(i).range());
                vector(parts, Interval::ALL, joined(step, steps, bounds))
            }
            Act::Component(i) => self.scalar(arg(0).parts()[*i], arg(0).change()),
            Act::VectorAdd => {
                let parts = pairwise(arg(0), arg(1), Interval::add);
                self.summed(arg(0), arg(1), parts)
            }
            Act::VectorSub => {
                let parts = pairwise(arg(0), arg(1), Interval::sub);
                self.summed(arg(0), arg(1), parts)
            }
            Act::Scale => {
                let (v, factor) = (arg(0), arg(1));
                let parts = v.parts().map(|part| part.mul(factor.range()));
                let norm = v.range().mul(factor.range().abs());
                vector(
                    parts,
                    norm,
                    multiplied(v, factor).rounded(norm.magnitude(), 1.0),
                )
            }
            Act::Length => {
                let v = arg(0);
                self.scalar(v.range(), v.change().rounded(v.magnitude(), 4.0))
            }
            Act::Dot => {
                let (a, b) = (arg(0), arg(1));
                let [x, y, z] = pairwise(a, b, Interval::mul);
                let most = a.magnitude() * b.magnitude();
                let range = x.add(y).add(z).meet(Interval::new(-most, most).widen());
                self.scalar(range, multiplied(a, b).rounded(most, 4.0))
            }
            Act::OntoSphere(radius) => self.onto_sphere(*radius, arg(0)),
            Act::OntoPlane => {
                let [x, y, _] = arg(0).parts();
                let norm = Interval::new(0.0, arg(0).range().high);
                vector([x, y, Interval::point(0.0)], norm, arg(0).change())
            }
            Act::Unary(unary) => self.unary(*unary, arg(0)),
            Act::Binary(binary) => self.binary(*binary, arg(0), arg(1)),
            Act::Power(exponent) => self.power(*exponent, arg(0)),
            Act::SmoothStep(low, high) => {
                let a = arg(0);
                let range = a
                    .range()
                    .map_rising(|a| crate::arithmetic::smoothstep(*low, *high, a));
                let slope = 1.5 / (high - low);
                let input = a.change().rounded(a.magnitude() + low.abs(), 1.0);
                self.scalar(
                    range.clamp(0.0, 1.0).widen(),
                    input.times(slope).rounded(1.0, 8.0),
                )
            }
            Act::Curve(curve) => self.curve(curve, arg(0)),
            Act::Select => self.select(arg(0), arg(1), arg(2)),
            Act::Noise(_) if self.keeps() == 0 => left_out(NOISE),
            Act::Noise(_) => {
                let change = self.noise(arg(0).change());
                self.scalar(NOISE, change)
            }
            Act::AnyNoise(noise) if self.keeps() == 0 => left_out(noise.range()),
            Act::AnyNoise(noise) => {
                let at = skewed(noise, arg(0), 4.0);
                let change = self.any_noise(noise, at);
                self.scalar(noise.range(), change)
            }
            Act::NoiseGradient(noise) => {
                let change = skewed(noise, arg(0), 4.0).times(noise.bend());
                let slope = noise.slope() + noise.slope_rounding();
                let change = change.plus(Change::new(2.0 * noise.slope_rounding(), 0.0));
                let norm = Interval::new(0.0, slope).widen();
                let change = self.closer(change, Change::new(2.0 * slope, 0.0));
                vector([Interval::new(-slope, slope).widen(); 3], norm, change)
            }
            Act::Cascade(cascade) => self.cascade(cascade, arg(0)),
            Act::Shape(shape) => match step.args[..] {
                [_, _] => {
                    let within = Within::of_numbers(arg(0).range(), arg(1).range());
                    self.shape(shape, &within, arg(0).change().larger(arg(1).change()))
                }
                _ => {
                    let (parts, norm) = (arg(0).parts(), arg(0).range());
                    self.shape(shape, &Within { parts, norm }, arg(0).change())
                }
            },
            Act::Grid(surface) => {
                let (range, slopes) = surface.over(arg(0).parts());
                let rounding = Change::new(2.0 * surface.blur(range), 0.0);
                let change = arg(0).change().times(Surface::steepest(slopes));
                self.scalar(range, change.plus(rounding))
            }
        }
    }

    /// A number's bound, its change no more than its range allows.
    fn scalar(&mut self, range: Interval, change: Change) -> Bound {
        Bound::Scalar {
            range,
            change: self.limited(range, change),
        }
    }

    fn limited(&mut self, range: Interval, change: Change) -> Change {
        let width = Change::new(range.width(), 0.0);
        if self.derivatives || !width.offset.is_finite() {
            return change;
        }
        let crossing = (width.offset - change.offset) / change.slope;
        if crossing > 0.0 && crossing.is_finite() {
            self.crossings.push(crossing);
        }
        self.closer(change, width)
    }

    /// The smaller of two bounds at the radius of interest.
    fn closer(&self, a: Change, b: Change) -> Change {
        let b_is_no_slope = self.derivatives && a.slope.is_finite();
        if b.at(self.radius) < a.at(self.radius) && !b_is_no_slope {
            b
        } else {
            a
        }
    }

    fn summed(&mut self, a: &Bound, b: &Bound, parts: [Interval; 3]) -> Bound {
        let (p, q) = (a.range(), b.range());
        let least = larger(larger(p.low - q.high, q.low - p.high), 0.0);
        let norm = Interval::new(least, p.high + q.high).widen();
        let change = a.change().plus(b.change()).rounded(norm.high, 1.0);
        vector(
            parts,
            Interval::new(larger(norm.low, 0.0), norm.high),
            change,
        )
    }

    /// Points at least d away from the origin come R/d closer to each other, at most: the projection
    /// onto the ball of radius d, which moves no two points apart, and a scaling by R/d.
    fn onto_sphere(&mut self, radius: f64, v: &Bound) -> Bound {
        let parts = v.parts().map(|part| {
            let least = if part.low < 0.0 { -radius } else { 0.0 };
            let most = if part.high > 0.0 { radius } else { 0.0 };
            Interval::new(least, most).widen()
        });
        let outside = v.range().low > 0.0;
        let norm = Interval::new(if outside { radius } else { 0.0 }, radius).widen();
        let across = Change::new(2.0 * radius, 0.0);
        let change = if outside {
            self.closer(v.change().times(radius / v.range().low), across)
        } else {
            across
        };
        vector(parts, norm, change.rounded(radius, 6.0))
    }

    fn unary(&mut self, unary: Unary, a: &Bound) -> Bound {
        let (range, change) = (a.range(), a.change());
        match unary {
            Unary::Neg => self.scalar(range.neg(), change),
            Unary::Abs => self.scalar(range.abs(), change),
            Unary::Sqrt => {
                let rooted = range.sqrt();
                let change = self.root(0.5, 1.0, range.low, change);
                self.scalar(rooted, change.rounded(rooted.magnitude(), 1.0))
            }
            Unary::Sin | Unary::Cos => {
                let range = match fold::constant(&Act::Unary(unary), &[point(range)]) {
                    Some(fold::Value::Scalar(value)) => Interval::point(value).widen(),
                    _ => Interval::new(-1.0, 1.0),
                };
                self.scalar(range, change.rounded(1.0, 2.0))
            }
            Unary::Exp => {
                let image = range.map_rising(libm::exp);
                let image = Interval::new(larger(image.low, 0.0), image.high);
                self.scalar(image, change.times(image.high).rounded(image.high, 2.0))
            }
        }
    }

    /// The change of sign(a)|a|^exponent, exponent below 1, where a ≥ low: by the derivative at `low` if
    /// `low` is positive, else by |x^e − y^e| ≤ stretch · |x − y|^e and the tangent to that at the radius of interest.
    fn root(&self, exponent: f64, stretch: f64, low: f64, change: Change) -> Change {
        let here = change.at(self.radius);
        let mut best = Change::new(f64::INFINITY, 0.0);
        if low > 0.0 {
            best = change.times(exponent * libm::pow(low, exponent - 1.0) * (1.0 + 1e-14));
        }
        if here == 0.0 {
            return if low > 0.0 {
                best
            } else {
                Change::new(0.0, f64::INFINITY)
            };
        }
        let power = stretch * libm::pow(here, exponent) * (1.0 + 1e-14);
        let tangent = change
            .times(exponent * power / here)
            .plus(Change::new((1.0 - exponent) * power, 0.0));
        self.closer(best, tangent)
    }

    fn binary(&mut self, binary: Binary, a: &Bound, b: &Bound) -> Bound {
        let (p, q) = (a.range(), b.range());
        match binary {
            Binary::Add | Binary::Sub => {
                let range = if binary == Binary::Add {
                    p.add(q)
                } else {
                    p.sub(q)
                };
                self.scalar(
                    range,
                    a.change().plus(b.change()).rounded(range.magnitude(), 1.0),
                )
            }
            Binary::Mul => {
                let range = p.mul(q);
                self.scalar(range, multiplied(a, b).rounded(range.magnitude(), 1.0))
            }
            Binary::Div => {
                let range = p.div(q);
                let least = if q.low > 0.0 { q.low } else { -q.high };
                if least <= 0.0 {
                    return Bound::Scalar {
                        range,
                        change: Change::new(f64::INFINITY, 0.0),
                    };
                }
                let change = a
                    .change()
                    .plus(b.change().times(range.magnitude()))
                    .times(1.0 / least);
                self.scalar(range, change.rounded(range.magnitude(), 1.0))
            }
            Binary::Min => self.scalar(p.min(q), a.change().larger(b.change())),
            Binary::Max => self.scalar(p.max(q), a.change().larger(b.change())),
        }
    }

    fn power(&mut self, exponent: f64, a: &Bound) -> Bound {
        let range = a
            .range()
            .map_rising(|a| crate::arithmetic::power(exponent, a));
        let change = if exponent >= 1.0 {
            a.change()
                .times(exponent * libm::pow(a.magnitude(), exponent - 1.0) * (1.0 + 1e-14))
        } else {
            let low = larger(a.range().low, -a.range().high);
            // Two values of one sign obey it with 1, of two signs with 2^(1 − exponent).
            let stretch = if low >= 0.0 {
                1.0
            } else {
                libm::exp2(1.0 - exponent)
            };
            self.root(exponent, stretch, low, a.change())
        };
        self.scalar(range, change.rounded(range.magnitude(), 4.0))
    }

    fn curve(&mut self, curve: &Curve, a: &Bound) -> Bound {
        let most = curve.range(Interval::ALL).magnitude();
        let range = curve.range(a.range()).expand(16.0 * ROUNDING * most);
        let input = a.change().rounded(a.magnitude(), 1.0);
        let change = input.times(curve.slope_max(a.range())).rounded(most, 16.0);
        self.scalar(range, change)
    }

    /// Either branch may be taken at either place, unless the sign of `a` is certain.
    fn select(&mut self, a: &Bound, b: &Bound, c: &Bound) -> Bound {
        if a.range().high < 0.0 {
            return *b;
        }
        if a.range().low >= 0.0 {
            return *c;
        }
        let apart = b.range().sub(c.range()).magnitude();
        let change = b.change().larger(c.change()).plus(Change::new(apart, 0.0));
        self.scalar(b.range().hull(c.range()), change)
    }

    fn shape(&mut self, shape: &Shape, within: &Within, at: Change) -> Bound {
        let known = shape.bound(within);
        let change = at.times(known.slope).plus(Change::new(known.rounding, 0.0));
        self.scalar(known.range, change)
    }

    /// How many octaves the next noise or cascade keeps.
    fn keeps(&mut self) -> usize {
        self.kept.next().copied().unwrap_or(usize::MAX)
    }

    /// The change of the noise where its argument changes so.
    fn noise(&mut self, at: Change) -> Change {
        let at = at.plus(Change::new(OFFSET_ROUNDING, 0.0));
        let change = at
            .times(noise::SLOPE)
            .plus(Change::new(2.0 * noise::ROUNDING, 0.0));
        self.limited(NOISE, change)
    }

    /// The change of any other noise where its argument changes so.
    fn any_noise(&mut self, noise: &Noise, at: Change) -> Change {
        let at = at.plus(Change::new(OFFSET_ROUNDING, 0.0));
        let change = at
            .times(noise.slope())
            .plus(Change::new(2.0 * noise.rounding(), 0.0));
        self.limited(noise.range(), change)
    }
}

/// A number that counts as the middle of its range.
fn left_out(range: Interval) -> Bound {
    let change = Change::new(0.5 * range.width(), 0.0).rounded(range.magnitude(), 1.0);
    Bound::Scalar { range, change }
}

/// What stands for the octaves of a noise or cascade from one on: of a sum, the middle of what they can be; of others none.
pub(crate) fn middle(act: &Act, from: usize) -> f64 {
    match act {
        Act::Noise(_) if from == 0 => NOISE.middle(),
        Act::AnyNoise(noise) if from == 0 => noise.range().middle(),
        Act::Cascade(cascade) => (from..cascade.octaves.len())
            .map(|i| cascade::middle(cascade, i))
            .sum(),
        _ => 0.0,
    }
}

/// The change of the argument of a noise, the rounding of its skewing included.
fn skewed(noise: &Noise, at: &Bound, operations: f64) -> Change {
    let change = at.change();
    if noise.is_skewed() {
        change.rounded(2.0 * at.magnitude(), operations)
    } else {
        change
    }
}

/// All values of the noise; its supremum is further below than it rounds.
pub(crate) const NOISE: Interval = Interval::new(-noise::RANGE, noise::RANGE);

/// The change of a product.
fn multiplied(a: &Bound, b: &Bound) -> Change {
    a.change()
        .times(b.magnitude())
        .plus(b.change().times(a.magnitude()))
}

fn pairwise(a: &Bound, b: &Bound, f: impl Fn(Interval, Interval) -> Interval) -> [Interval; 3] {
    let (a, b) = (a.parts(), b.parts());
    [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2])]
}

fn point(range: Interval) -> Option<fold::Value> {
    (range.low == range.high).then_some(fold::Value::Scalar(range.low))
}

/// A vector's bound; parts and norm narrow each other.
fn vector(parts: [Interval; 3], norm: Interval, change: Change) -> Bound {
    let [x, y, z] = parts.map(Interval::square);
    let norm = x.add(y).add(z).sqrt().widen().meet(norm);
    let norm = Interval::new(larger(norm.low, 0.0), norm.high);
    let reach = Interval::new(-norm.high, norm.high).widen();
    Bound::Vector {
        parts: parts.map(|part| part.meet(reach)),
        norm,
        change,
    }
}

/// The change of a vector put together from numbers. Different components of one vector change together no more than it does.
fn joined(step: &Step, steps: &[Step], bounds: &[Bound]) -> Change {
    let source = |arg: usize| match &steps[arg].act {
        Act::Component(i) => Some((steps[arg].args[0], *i)),
        _ => None,
    };
    let mut changes: Vec<Change> = Vec::new();
    let mut taken: Vec<(usize, Vec<usize>)> = Vec::new();
    for &arg in &step.args {
        let Some((vector, component)) = source(arg) else {
            changes.push(bounds[arg].change());
            continue;
        };
        match taken
            .iter_mut()
            .find(|(known, parts)| *known == vector && !parts.contains(&component))
        {
            Some((_, parts)) => parts.push(component),
            None => {
                taken.push((vector, vec![component]));
                changes.push(bounds[vector].change());
            }
        }
    }
    Change::norm(&changes)
}

fn position(region: Region, moving: bool) -> Bound {
    let world = Interval::new(-WORLD, WORLD);
    let held = |range: Interval| range.meet(world);
    let (parts, norm) = match region {
        Region::All => ([world; 3], Interval::new(0.0, WORLD)),
        Region::Shell { inner, outer } => {
            let outer = smaller(outer, WORLD);
            (
                [Interval::new(-outer, outer); 3],
                Interval::new(inner, outer),
            )
        }
        Region::Slab { low, high } => (
            [world, world, held(Interval::new(low, high))],
            Interval::ALL,
        ),
        Region::Box { min, max } => (
            [0, 1, 2].map(|i| held(Interval::new(min[i], max[i]))),
            Interval::ALL,
        ),
    };
    vector(
        parts,
        norm,
        Change::new(0.0, if moving { 1.0 } else { 0.0 }),
    )
}
