//! Distance surfaces, thesis eq. (2.10): influences that fall with the distance to primitives.

use super::Refusal;
use super::local::{Local, along, dot, fixed, less};
use super::roots;
use super::skeleton::{self, Arc, Ball, Piece, Polygon, Primitive, Quadratic, Segment};
use super::sum::{Rules, Summed};
use super::supports::Supports;
use super::within::{Extent, Known, Within};
use crate::interval::{Interval, larger, smaller};

/// T − Σ aᵢ h(dᵢ(x)/rᵢ), dᵢ the distance to the nearest piece of primitive i.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Distances {
    rules: Rules,
    primitives: Vec<Covered>,
    supports: Supports,
}

#[derive(Clone, PartialEq, Debug)]
struct Covered {
    primitive: Primitive,
    balls: Vec<Ball>,
    /// 1/r².
    inverse: f64,
}

impl Distances {
    /// From the rules and the primitives.
    pub(crate) fn new(params: &[f64]) -> Result<Self, Refusal> {
        let (rules, list) = Rules::split(params)?;
        let mut primitives: Vec<Covered> = skeleton::primitives(list)?
            .into_iter()
            .map(|primitive| Covered {
                balls: primitive
                    .pieces
                    .iter()
                    .flat_map(|piece| piece.cover(0.25 * primitive.radius))
                    .collect(),
                inverse: 1.0 / (primitive.radius * primitive.radius),
                primitive,
            })
            .collect();
        let supports = Supports::sorted(&mut primitives, |covered| {
            if rules.kernel.ends() {
                covered.extent()
            } else {
                Extent::ALL
            }
        });
        Ok(Self {
            rules,
            primitives,
            supports,
        })
    }

    /// Its value.
    #[inline]
    pub(crate) fn value<N: Local>(&self, at: [N; 3]) -> N {
        let place = [at[0].at(), at[1].at(), at[2].at()];
        let mut sum = N::constant(0.0);
        let mut covered = false;
        self.supports.at(place, |i| {
            let term = &self.primitives[i];
            let u = term.square(&at).times(term.inverse);
            covered |= u.at() < 1.0;
            let weight = term.primitive.weight;
            sum = sum.clone().plus(self.rules.kernel.of(u).times(weight));
        });
        let inside = N::constant(self.rules.threshold).minus(sum);
        if self.rules.far && !covered {
            inside.plus(self.outside(&at))
        } else {
            inside
        }
    }

    /// The distance to the nearest support, 0 within one: the far field of (7.9).
    fn outside<N: Local>(&self, at: &[N; 3]) -> N {
        let place = [at[0].at(), at[1].at(), at[2].at()];
        let mut nearest: Option<(f64, &Covered)> = None;
        for term in &self.primitives {
            let distance = term.square(&place).sqrt() - term.primitive.radius;
            if nearest.is_none_or(|(least, _)| distance < least) {
                nearest = Some((distance, term));
            }
        }
        match nearest {
            Some((distance, term)) if distance > 0.0 => term
                .square(at)
                .sqrt()
                .minus(N::constant(term.primitive.radius)),
            _ => N::constant(0.0),
        }
    }

    pub(crate) fn bound(&self, within: &Within) -> Known {
        self.rules.bound(self, &self.supports, within)
    }

    pub(crate) fn bend(&self, within: &Within) -> Interval {
        self.rules.bend(self, &self.supports, within)
    }
}

impl Covered {
    fn extent(&self) -> Extent {
        self.primitive
            .pieces
            .iter()
            .map(|piece| piece.extent(self.primitive.radius))
            .reduce(Extent::hull)
            .unwrap_or(Extent::ALL)
    }

    /// The square of the distance to the nearest piece.
    fn square<N: Local>(&self, at: &[N; 3]) -> N {
        let pieces = &self.primitive.pieces;
        if let [piece] = &pieces[..] {
            return square(piece, at);
        }
        let place = [at[0].at(), at[1].at(), at[2].at()];
        let (mut least, mut nearest) = (f64::INFINITY, &pieces[0]);
        for piece in pieces {
            let here = square(piece, &place);
            if here < least {
                (least, nearest) = (here, piece);
            }
        }
        square(nearest, at)
    }

    /// All d/r.
    fn rho(&self, within: &Within) -> Interval {
        let inverse = Interval::point(1.0 / self.primitive.radius).widen();
        let rho = self.distance(within).mul(inverse);
        Interval::new(larger(rho.low, 0.0), rho.high)
    }

    fn distance(&self, within: &Within) -> Interval {
        let mut nearest = Interval::point(f64::INFINITY);
        for ball in &self.balls {
            // The ball's centre lies on the piece.
            let high = within.distance(ball.centre).high;
            let low = ball.distance(within).low;
            nearest = nearest.min(Interval::new(low, high));
        }
        nearest
    }
}

impl Summed for Distances {
    fn size(&self) -> f64 {
        let radii = self.primitives.iter().map(|term| term.primitive.radius);
        radii.fold(f64::INFINITY, smaller)
    }

    fn weight(&self) -> f64 {
        let weights = self
            .primitives
            .iter()
            .map(|term| term.primitive.weight.abs());
        weights.sum()
    }

    fn term(&self, i: usize, within: &Within) -> (Interval, f64) {
        let term = &self.primitives[i];
        let inverse = Interval::point(1.0 / term.primitive.radius).widen();
        let rho = term.rho(within);
        let weight = term.primitive.weight;
        let kernel = self.rules.kernel;
        (
            kernel.range(rho).mul(Interval::point(weight)),
            kernel.slope(rho) * weight.abs() * inverse.high,
        )
    }

    /// The square of the distance to one convex piece has second derivatives from 0 to 2; of several, and of
    /// curves and arcs, it bends down without a bound where the nearest point changes.
    fn bend(&self, i: usize, within: &Within) -> Interval {
        let term = &self.primitives[i];
        let Primitive {
            pieces,
            radius,
            weight,
        } = &term.primitive;
        let is_point = match &pieces[..] {
            [Piece::Point(_)] => true,
            [Piece::Segment(_) | Piece::Polygon(_)] => false,
            _ => return Interval::ALL,
        };
        let scale = Interval::point(weight / (radius * radius)).widen();
        let rho = term.rho(within);
        let kernel = self.rules.kernel;
        let bend = if is_point {
            kernel.bend(rho)
        } else {
            kernel.bend_of_convex(rho)
        };
        bend.mul(scale)
    }

    fn beyond(&self, within: &Within) -> Interval {
        let mut least = Interval::point(f64::INFINITY);
        for term in &self.primitives {
            let away = term.distance(within);
            least = least.min(away.sub(Interval::point(term.primitive.radius)));
        }
        least
    }
}

/// The square of the distance to a piece.
fn square<N: Local>(piece: &Piece, at: &[N; 3]) -> N {
    match piece {
        Piece::Point(place) => {
            let away = less(at.clone(), *place);
            dot(away.clone(), away)
        }
        Piece::Segment(segment) => to_segment(segment, at),
        Piece::Polygon(polygon) => to_polygon(polygon, at),
        Piece::Quadratic(curve) => to_curve(curve, at),
        Piece::Arc(arc) => to_arc(arc, at),
    }
}

fn to_segment<N: Local>(segment: &Segment, at: &[N; 3]) -> N {
    let away = less(at.clone(), segment.start);
    let share = along(away.clone(), segment.axis)
        .times(1.0 / segment.length)
        .clamp01();
    let t = share.times(segment.length);
    let [x, y, z] = away;
    let rest = [
        x.minus(t.clone().times(segment.axis[0])),
        y.minus(t.clone().times(segment.axis[1])),
        z.minus(t.times(segment.axis[2])),
    ];
    dot(rest.clone(), rest)
}

fn to_polygon<N: Local>(polygon: &Polygon, at: &[N; 3]) -> N {
    let place = [at[0].at(), at[1].at(), at[2].at()];
    if polygon.is_over(place) {
        let away = less(at.clone(), polygon.vertices[0]);
        return along(away, polygon.normal).square();
    }
    let (mut least, mut nearest) = (f64::INFINITY, &polygon.edges[0]);
    for edge in &polygon.edges {
        let here = to_segment(edge, &place);
        if here < least {
            (least, nearest) = (here, edge);
        }
    }
    to_segment(nearest, at)
}

/// The nearest point is where the way there is square to the curve, or an end. To first order the
/// distance does not see that it moves with the place; a step of Newton's makes the second order right.
fn to_curve<N: Local>(curve: &Quadratic, at: &[N; 3]) -> N {
    let place = [at[0].at(), at[1].at(), at[2].at()];
    let Quadratic { a, b, c } = *curve;
    let d = fixed::sub(c, place);
    let slope = [
        fixed::dot(b, d),
        fixed::dot(b, b) + 2.0 * fixed::dot(a, d),
        3.0 * fixed::dot(a, b),
        2.0 * fixed::dot(a, a),
        0.0,
    ];
    let distance = |t: f64| {
        let away = fixed::sub(place, curve.at(t));
        fixed::dot(away, away)
    };
    let (mut least, mut nearest) = (distance(0.0), 0.0);
    let mut consider = |t: f64| {
        let here = distance(t);
        if here < least {
            (least, nearest) = (here, t);
        }
    };
    consider(1.0);
    roots::between_0_and_1(&slope, &mut consider);
    let steepness = slope[1] + nearest * (2.0 * slope[2] + nearest * 3.0 * slope[3]);
    let free = nearest > 0.0 && nearest < 1.0 && steepness > 1e-9 * fixed::dot(b, b);
    if !free {
        let away = less(at.clone(), curve.at(nearest));
        return dot(away.clone(), away);
    }
    let [x, y, z] = less(c, [0.0; 3]).map(N::constant);
    let [px, py, pz] = at.clone();
    let d = [x.minus(px), y.minus(py), z.minus(pz)];
    let (bd, ad) = (along(d.clone(), b), along(d.clone(), a));
    let fixed = nearest * (fixed::dot(b, b) + nearest * (slope[2] + nearest * slope[3]));
    let here = bd.plus(ad.times(2.0 * nearest)).plus(N::constant(fixed));
    let t = N::constant(nearest).minus(here.times(1.0 / steepness));
    let [x, y, z] = d;
    let part = |d: N, k: usize| {
        let bend = t.clone().times(a[k]).plus(N::constant(b[k]));
        d.plus(t.clone().mul(bend))
    };
    let away = [part(x, 0), part(y, 1), part(z, 2)];
    dot(away.clone(), away)
}

fn to_arc<N: Local>(arc: &Arc, at: &[N; 3]) -> N {
    let away = less(at.clone(), arc.centre);
    let (x, y) = (along(away.clone(), arc.x), along(away.clone(), arc.y));
    let turn = libm::atan2(y.at(), x.at());
    let theta = if turn < 0.0 {
        turn + core::f64::consts::TAU
    } else {
        turn
    };
    if theta <= arc.angle {
        let up = along(away, arc.normal);
        let flat = x.square().plus(y.square()).sqrt();
        let out = flat.minus(N::constant(arc.radius));
        return out.square().plus(up.square());
    }
    let to = |end: f64| {
        let away = less(at.clone(), arc.at(end));
        dot(away.clone(), away)
    };
    let (first, last) = (to(0.0), to(arc.angle));
    if first.at() < last.at() { first } else { last }
}
