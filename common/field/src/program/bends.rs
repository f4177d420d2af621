//! How a field bends along straight lines: bounds of its second derivative, for Taylor's theorem.
//!
//! With g the derivative that `evaluate_along` gives at a place x along a unit direction d,
//!
//! f(x + s d) ≥ f(x) + g s − offset − slope·s − ½ curvature·s²  for every s ≥ 0 within the region,
//!
//! and near a root this falls short by the square of the distance, where a Lipschitz bound falls
//! short by the distance: rays then close in like Newton's method and are as safe as before.
//!
//! Second derivatives are meant as measures along a line: where a derivative jumps up they are +∞
//! there, which the lower bound may ignore, and where it jumps down, −∞, which it may not. So
//! every rule keeps both ends apart: −(1 − |n|)² bends down no more than its smooth parts do.
//!
//! Level-of-detail weights count as constant in g; what they change by themselves is in `slope`.

use crate::arithmetic::{Binary, Unary};
use crate::cascade::{Cascade, Model};
use crate::interval::{Interval, larger};
use crate::noise;
use crate::op::Basis;
use crate::program::bounds::{Bound, Change, NOISE, Pass};
use crate::program::plan::{Act, Plan, Step};
use crate::shape::Within;
use crate::surroundings::Surroundings;

/// Error of a derivative that evaluation computes, as a share of the field's slope bound. Noises
/// and directions are f32, good to 3·10⁻⁶ of theirs; values that they are multiplied with to 3.4·10⁻⁶
/// of the noise's range, which may be some thirty times that of the value.
const SLOPE_ROUNDING: f64 = 1e-4;

/// Relative room for the roundings of the rules themselves.
const ROOM: f64 = 1.0 + 1e-12;

/// How far a field may fall below its tangent along a line, see the module.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Taylor {
    /// In the field's unit: rounding of its values.
    pub offset: f64,
    /// In the field's unit per metre: rounding of the derivative, and the level of detail.
    pub slope: f64,
    /// In the field's unit per square metre; infinite if the field may have creases that bend down.
    pub curvature: f64,
}

/// A number's slope and second derivative along unit directions.
#[derive(Clone, Copy, Debug)]
struct Bend {
    range: Interval,
    /// The derivative's greatest size.
    slope: f64,
    /// The second derivative, kinks included.
    bend: Interval,
}

/// The tangent bound of the first root.
pub(crate) fn taylor(plan: &Plan, around: &Surroundings) -> Option<Taylor> {
    let &root = plan.roots.first()?;
    let bounds = Pass::of_derivatives(around).run(plan);
    let by_weights = Pass::of_weights(around).run(plan);
    let bend = bends(plan, around, &bounds)[root];
    let (change, weights) = (bounds[root].change(), by_weights[root].change());
    let taylor = Taylor {
        offset: change.offset + weights.offset,
        slope: weights.slope + change.slope * SLOPE_ROUNDING,
        curvature: larger(-bend.low, 0.0) * ROOM,
    };
    (taylor.offset.is_finite() && taylor.slope.is_finite()).then_some(taylor)
}

/// The second derivatives of every step; of a vector, the norm's bound on either side.
fn bends(plan: &Plan, around: &Surroundings, bounds: &[Bound]) -> Vec<Interval> {
    let mut bends: Vec<Interval> = Vec::with_capacity(plan.steps.len());
    for (step, bound) in plan.steps.iter().zip(bounds) {
        let bend = if bound.change() == Change::NONE {
            FLAT
        } else {
            bend(step, around, bounds, &bends)
        };
        bends.push(bend);
    }
    bends
}

const FLAT: Interval = Interval::point(0.0);

fn either_way(magnitude: f64) -> Interval {
    Interval::new(-magnitude, magnitude)
}

fn bend(step: &Step, around: &Surroundings, bounds: &[Bound], bends: &[Interval]) -> Interval {
    let number = |i: usize| Bend {
        range: bounds[step.args[i]].range(),
        slope: bounds[step.args[i]].change().slope,
        bend: bends[step.args[i]],
    };
    let size = |i: usize| number(i).bend.magnitude();
    match &step.act {
        Act::Constant(_) | Act::ConstantVector(_) | Act::Position | Act::Time => FLAT,
        Act::Vector => {
            let square: f64 = (0..3).map(|i| size(i) * size(i)).sum();
            either_way(square.sqrt() * ROOM)
        }
        Act::Component(_) | Act::OntoPlane => number(0).bend,
        Act::VectorAdd | Act::VectorSub => either_way((size(0) + size(1)) * ROOM),
        Act::Scale | Act::Dot => {
            let (v, f) = (number(0), number(1));
            let cross = 2.0 * v.slope * f.slope;
            let ends = times(v.range.magnitude(), size(1)) + times(f.range.magnitude(), size(0));
            either_way((cross + ends) * ROOM)
        }
        Act::Length => {
            let v = number(0);
            let outward = v.slope * v.slope / v.range.low;
            Interval::new(
                0.0,
                if v.range.low > 0.0 {
                    outward
                } else {
                    f64::INFINITY
                },
            )
            .add(v.bend)
        }
        Act::OntoSphere(radius) => {
            // Along a line at distance d the direction turns with at most 2/√3 · 1/d² of second derivative.
            let v = number(0);
            let least = v.range.low;
            if least > 0.0 {
                let turn = 1.1548 * v.slope * v.slope / (least * least);
                either_way(radius * (turn + size(0) / least) * ROOM)
            } else {
                Interval::ALL
            }
        }
        Act::Unary(unary) => of_unary(*unary, number(0)),
        Act::Binary(binary) => of_binary(*binary, number(0), number(1)),
        Act::Power(exponent) => of_power(*exponent, number(0)),
        Act::SmoothStep(low, high) => {
            let a = number(0);
            let width = high - low;
            let turn = 6.0 * (a.slope / width) * (a.slope / width);
            either_way((turn + times(1.5 / width, size(0))) * ROOM)
        }
        Act::Noise(_) => {
            let a = number(0);
            of_noise(a.slope, size(0)).bend
        }
        Act::Cascade(cascade) if cascade.octaves.iter().any(|o| o.noise.is_some()) => Interval::ALL,
        Act::Cascade(cascade) => of_cascade(cascade, around, number(0).slope, size(0)).bend,
        // The derivatives of other noises are rounded to more than tangents allow for.
        Act::AnyNoise(_) | Act::NoiseGradient(_) => Interval::ALL,
        Act::Shape(shape) => match step.args[..] {
            [_, _] => Interval::ALL,
            _ => {
                let (v, parts) = (number(0), bounds[step.args[0]].parts());
                let within = Within {
                    parts,
                    norm: v.range,
                };
                let square = Interval::new(0.0, v.slope * v.slope * ROOM);
                let turn = times(shape.bound(&within).slope, size(0));
                shape.bend(&within).mul(square).add(either_way(turn))
            }
        },
        Act::Curve(_) | Act::Select | Act::Grid(_) => Interval::ALL,
    }
}

/// The product; 0 wherever a factor is.
fn times(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 { 0.0 } else { a * b }
}

fn of_unary(unary: Unary, a: Bend) -> Interval {
    let square = a.slope * a.slope;
    match unary {
        Unary::Neg => a.bend.neg(),
        Unary::Abs => a.abs().bend,
        Unary::Sqrt if a.range.low > 0.0 => {
            let root = a.range.low.sqrt();
            let slope = Interval::new(0.0, 0.5 / root);
            let turn = Interval::new(-0.25 * square / (a.range.low * root), 0.0);
            slope.mul(a.bend).add(turn)
        }
        Unary::Sqrt => Interval::ALL,
        Unary::Sin | Unary::Cos => Interval::new(-1.0, 1.0).mul(a.bend).add(either_way(square)),
        Unary::Exp => {
            let image = a.range.map_rising(libm::exp);
            let slope = Interval::new(0.0, image.high);
            slope
                .mul(a.bend)
                .add(Interval::new(0.0, times(image.high, square)))
        }
    }
}

fn of_binary(binary: Binary, a: Bend, b: Bend) -> Interval {
    match binary {
        Binary::Add => a.bend.add(b.bend),
        Binary::Sub => a.bend.sub(b.bend),
        Binary::Mul => a.mul(b).bend,
        Binary::Div => {
            let least = if b.range.low > 0.0 {
                b.range.low
            } else {
                -b.range.high
            };
            if least <= 0.0 {
                return Interval::ALL;
            }
            let inverse = Interval::point(1.0).div(b.range);
            let square = inverse.square();
            let turn = square.mul(Interval::new(0.0, 2.0 * b.slope * b.slope));
            let inverted = Bend {
                range: inverse,
                slope: b.slope * square.high * ROOM,
                bend: square.mul(b.bend.neg()).add(turn.mul(inverse)),
            };
            a.mul(inverted).bend
        }
        Binary::Min if a.range.high < b.range.low => a.bend,
        Binary::Min if b.range.high < a.range.low => b.bend,
        Binary::Min => Interval::new(f64::NEG_INFINITY, larger(a.bend.high, b.bend.high)),
        Binary::Max if a.range.low > b.range.high => a.bend,
        Binary::Max if b.range.low > a.range.high => b.bend,
        Binary::Max => Interval::new(
            crate::interval::smaller(a.bend.low, b.bend.low),
            f64::INFINITY,
        ),
    }
}

fn of_power(exponent: f64, a: Bend) -> Interval {
    if exponent == 1.0 {
        return a.bend;
    }
    let low = larger(a.range.low, -a.range.high);
    if low <= 0.0 && exponent < 2.0 {
        return Interval::ALL;
    }
    // Both derivatives of |x|ᵉ are greatest at an end of its range.
    let most = |power: f64| {
        let (near, far) = (if low > 0.0 { low } else { 0.0 }, a.range.magnitude());
        larger(libm::pow(near, power), libm::pow(far, power))
    };
    let slope = times(exponent.abs() * most(exponent - 1.0), a.bend.magnitude());
    let turn = times(
        (exponent * (exponent - 1.0)).abs() * most(exponent - 2.0),
        a.slope * a.slope,
    );
    either_way((slope + turn) * (1.0 + 1e-10))
}

/// The noise, where its argument has that slope and second derivative.
fn of_noise(slope: f64, bend: f64) -> Bend {
    Bend {
        range: NOISE,
        slope: noise::SLOPE * slope * ROOM,
        bend: either_way((noise::BEND * slope * slope + times(noise::SLOPE, bend)) * ROOM),
    }
}

fn of_cascade(cascade: &Cascade, around: &Surroundings, slope: f64, bend: f64) -> Bend {
    let mut pass = Pass::new(around, 0.0);
    let mut total = Bend::constant(FLAT);
    let mut rest = total;
    for (i, octave) in cascade.octaves.iter().enumerate() {
        let weight = pass.weight(cascade, i).range;
        if weight.high <= 0.0 {
            break;
        }
        let noise = of_noise(
            octave.frequency * slope * ROOM,
            times(octave.frequency * ROOM, bend),
        );
        let weight = Bend::constant(weight);
        let amplitude = Bend::constant(Interval::point(octave.amplitude));
        let weighted = |a: Bend| a.mul(weight).mul(amplitude);
        match cascade.model {
            Model::Sum(basis) => total = total.plus(weighted(noise.shaped(basis))),
            Model::AltitudeOne { basis, xi } => {
                let octave = weighted(noise.shaped(basis).raised(xi));
                total = if i == 0 {
                    octave
                } else {
                    total.mul(octave.raised(1.0))
                };
            }
            Model::AltitudeTwo { basis, xi } => {
                let raised = noise.shaped(basis).raised(xi).mul(amplitude);
                if i == 0 {
                    total = raised.mul(weight);
                    rest = Bend::constant(Interval::point(1.0));
                } else {
                    rest = rest.mul(raised).clamp01();
                    total = total.plus(rest.mul(weight));
                }
            }
            Model::Ridged { offset, gain } => {
                let ridge = noise.ridge(offset);
                rest = if i == 0 {
                    ridge
                } else {
                    let gain = Bend::constant(Interval::point(gain));
                    rest.mul(gain).clamp01().mul(ridge)
                };
                total = total.plus(weighted(rest));
            }
        }
    }
    total
}

impl Bend {
    fn constant(range: Interval) -> Self {
        Self {
            range,
            slope: 0.0,
            bend: FLAT,
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            range: self.range.add(other.range),
            slope: (self.slope + other.slope) * ROOM,
            bend: self.bend.add(other.bend),
        }
    }

    fn raised(self, by: f64) -> Self {
        Self {
            range: self.range.add(Interval::point(by)),
            ..self
        }
    }

    /// (ab)″ = a″b + 2a′b′ + ab″.
    fn mul(self, other: Self) -> Self {
        let slope =
            times(self.slope, other.range.magnitude()) + times(other.slope, self.range.magnitude());
        let cross = 2.0 * self.slope * other.slope;
        Self {
            range: self.range.mul(other.range),
            slope: slope * ROOM,
            bend: self
                .bend
                .mul(other.range)
                .add(either_way(cross))
                .add(other.bend.mul(self.range)),
        }
    }

    fn abs(self) -> Self {
        let Self { range, slope, bend } = self;
        let bend = if range.low >= 0.0 {
            bend
        } else if range.high <= 0.0 {
            bend.neg()
        } else {
            // Where it passes 0 its derivative jumps up.
            Interval::new(-bend.magnitude(), f64::INFINITY)
        };
        Self {
            range: range.abs(),
            slope,
            bend,
        }
    }

    fn shaped(self, basis: Basis) -> Self {
        match basis {
            Basis::Plain => self,
            Basis::Absolute => self.abs(),
            Basis::Ridged => self.ridge(1.0),
        }
    }

    /// (o − |n|)²: its second derivative is 2n′² − 2(o − |n|)|n|″, the jump at n = 0 included, where it is −4o n′.
    fn ridge(self, offset: f64) -> Self {
        let size = self.range.abs();
        let base = Interval::point(offset).sub(size);
        let smooth = times(2.0 * base.magnitude(), self.bend.magnitude());
        let turn = 2.0 * self.slope * self.slope;
        let crossed = self.range.low < 0.0 && self.range.high > 0.0;
        let jump = |sign: f64| {
            if crossed && sign * offset > 0.0 {
                f64::INFINITY
            } else {
                0.0
            }
        };
        Self {
            range: base.square(),
            slope: times(2.0 * base.magnitude(), self.slope) * ROOM,
            bend: Interval::new(-smooth - jump(1.0), turn + smooth + jump(-1.0)).widen(),
        }
    }

    /// Held between 0 and 1: its derivative may jump up at 0 and down at 1.
    fn clamp01(self) -> Self {
        let Self { range, slope, bend } = self;
        let low = if range.high > 1.0 {
            f64::NEG_INFINITY
        } else {
            bend.low
        };
        let high = if range.low < 0.0 {
            f64::INFINITY
        } else {
            bend.high
        };
        Self {
            range: range.clamp(0.0, 1.0),
            slope,
            bend: Interval::new(crate::interval::smaller(low, 0.0), larger(high, 0.0)),
        }
    }
}
