//! Undoing a bend: where the bent body's points come from, thesis §2.3.3 (Barr 1984).

use core::f64::consts::{FRAC_PI_2, PI};

use super::Refusal;
use super::local::{Local, atan};
use super::within::{Known, Within};
use crate::arithmetic::Unary;
use crate::interval::{Interval, larger, smaller};
use crate::number::Number;

/// Sharpest and gentlest bend, in radians a metre: a gentler one has its axis out of sight.
const RATES: [f64; 2] = [1e-6, 1e6];

/// More than an angle rounds by.
const ANGLE_ROUNDING: f64 = 1e-14;

/// Which coordinate of the straight body's place is wanted; the bend leaves y as it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Part {
    X,
    Z,
}

/// A body along z that is bent towards +x between two heights, and goes on straight beyond them.
///
/// With u = axis − x and w = z − centre, both as the bent body has them, and θ the angle of (u, w) held between
/// those of the two heights, the straight body's place is (axis − (u cos θ + w sin θ), y, centre + θ/rate +
/// (w cos θ − u sin θ)). On the far side of the axis θ jumps from one end to the other.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Bend {
    part: Part,
    /// Radians a metre.
    rate: f64,
    /// The height that stays where it is.
    centre: f64,
    /// The x of the axis about which it bends: 1/rate.
    axis: f64,
    /// The least and the greatest angle, with their cosines and sines.
    ends: [End; 2],
}

/// An end of the bend: from here on the body is straight again.
#[derive(Clone, Copy, PartialEq, Debug)]
struct End {
    angle: f64,
    cos: f64,
    sin: f64,
}

impl Bend {
    /// From the part (0 for x, 1 for z), the rate, the two heights and the centre between them.
    pub(crate) fn new(params: &[f64]) -> Result<Self, Refusal> {
        let [part, rate, low, high, centre] = *params else {
            return Err(("five constants", 0.0));
        };
        let part = match part {
            0.0 => Part::X,
            1.0 => Part::Z,
            other => return Err(("a part, 0 or 1", other)),
        };
        if !(RATES[0]..=RATES[1]).contains(&rate.abs()) {
            return Err(("a rate from a millionth to a million radians a metre", rate));
        }
        if !(low <= centre && centre <= high && low < high) {
            return Err(("a low below its high, and its centre between them", centre));
        }
        let angles = [rate * (low - centre), rate * (high - centre)];
        if let Some(&angle) = angles.iter().find(|angle| angle.abs() > PI) {
            return Err(("less than half a turn on each side of its centre", angle));
        }
        let end = |angle: f64| End {
            angle,
            cos: libm::cos(angle),
            sin: libm::sin(angle),
        };
        let ends = [smaller(angles[0], angles[1]), larger(angles[0], angles[1])];
        Ok(Self {
            part,
            rate,
            centre,
            axis: 1.0 / rate,
            ends: ends.map(end),
        })
    }

    /// Its value.
    #[inline]
    pub(crate) fn value<N: Local>(&self, [x, _, z]: [N; 3]) -> N {
        let u = N::constant(self.axis).minus(x);
        let w = z.minus(N::constant(self.centre));
        // A bend towards −x has its axis there: both are turned by half a turn.
        let side = if self.rate < 0.0 { -1.0 } else { 1.0 };
        let (u, w) = (u.times(side), w.times(side));
        let angle = angle(u.clone(), w.clone());
        let [low, high] = self.ends;
        for (end, beyond) in [
            (low, angle.at() < low.angle),
            (high, angle.at() > high.angle),
        ] {
            if beyond {
                return self.straight(end, side, u, w);
            }
        }
        match self.part {
            Part::X => {
                let away = if u.at() == 0.0 && w.at() == 0.0 {
                    N::constant(0.0)
                } else {
                    u.square().plus(w.square()).unary(Unary::Sqrt)
                };
                N::constant(self.axis).minus(away.times(side))
            }
            Part::Z => N::constant(self.centre).plus(angle.times(self.axis)),
        }
    }

    /// Beyond an end: turned by its angle.
    #[inline]
    fn straight<N: Number>(&self, end: End, side: f64, u: N, w: N) -> N {
        match self.part {
            Part::X => {
                let across = u.times(end.cos).plus(w.times(end.sin));
                N::constant(self.axis).minus(across.times(side))
            }
            Part::Z => {
                let along = w.times(end.cos).minus(u.times(end.sin));
                N::constant(self.centre + end.angle * self.axis).plus(along.times(side))
            }
        }
    }

    /// x is nowhere steeper than 1; z is by 1/(|rate| ρ), ρ away from the axis, where that is more.
    pub(crate) fn bound(&self, within: &Within) -> Known {
        let [x, _, z] = within.parts;
        let u = Interval::point(self.axis).sub(x);
        let w = z.sub(Interval::point(self.centre));
        let away = u.square().add(w.square()).sqrt();
        let turn = larger(self.ends[1].angle, -self.ends[0].angle) * self.axis.abs();
        let largest = away.high + turn + self.axis.abs() + self.centre.abs();
        let rounding = 32.0 * f64::EPSILON * largest;
        // Everything lies within ρ of the axis, or of its part of the straight line.
        let range = match self.part {
            Part::X => Interval::new(self.axis - away.high, self.axis + away.high),
            Part::Z => Interval::new(
                self.centre - turn - away.high,
                self.centre + turn + away.high,
            ),
        }
        .expand(rounding);
        // The sides of the far half-plane have nothing to do with each other.
        let far = if self.rate < 0.0 {
            u.high >= 0.0
        } else {
            u.low <= 0.0
        };
        if w.contains(0.0) && far {
            return Known {
                range,
                slope: f64::INFINITY,
                rounding,
            };
        }
        let slope = match self.part {
            Part::Z if !self.is_beyond(u, w) => larger(1.0, self.axis.abs() / away.low),
            _ => 1.0,
        } * (1.0 + 1e-9);
        if !within.is_bounded() {
            return Known {
                range,
                slope,
                rounding,
            };
        }
        let middle = within.parts.map(|part| 0.5 * (part.low + part.high));
        let reach = 0.5 * (x.width() * x.width() + z.width() * z.width()).sqrt();
        let about = Interval::point(self.value(middle)).expand(slope * reach * (1.0 + 1e-9));
        Known {
            range: range.meet(about.expand(rounding)),
            slope,
            rounding,
        }
    }
}

impl Bend {
    /// Whether a box of (u, w) lies beyond one end: what lies there is convex, so its corners tell.
    fn is_beyond(&self, u: Interval, w: Interval) -> bool {
        let side = if self.rate < 0.0 { -1.0 } else { 1.0 };
        let corners = [
            (u.low, w.low),
            (u.low, w.high),
            (u.high, w.low),
            (u.high, w.high),
        ];
        let angles = corners.map(|(u, w)| angle(u * side, w * side));
        let [low, high] = self.ends;
        angles
            .iter()
            .all(|angle| *angle < low.angle - ANGLE_ROUNDING)
            || angles
                .iter()
                .all(|angle| *angle > high.angle + ANGLE_ROUNDING)
    }
}

/// The angle of (u, w) from the first axis, −π to π.
#[inline]
fn angle<N: Local>(u: N, w: N) -> N {
    let (a, b) = (u.at(), w.at());
    if a == 0.0 && b == 0.0 {
        return N::constant(0.0);
    }
    let up = if b < 0.0 { -1.0 } else { 1.0 };
    if a.abs() < b.abs() {
        return N::constant(up * FRAC_PI_2).minus(atan(u.over(w)));
    }
    let turned = atan(w.over(u));
    if a < 0.0 {
        turned.plus(N::constant(up * PI))
    } else {
        turned
    }
}
