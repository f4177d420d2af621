//! What distance and convolution surfaces are drawn around: points, lines, polygons, curves, arcs.

use super::Refusal;
use super::local::fixed::{self, Place};
use super::within::{Extent, Within};
use crate::interval::{Interval, larger, smaller};

/// Most vertices of one line, polygon or curve.
const VERTICES_MAX: usize = 1_024;

/// Most balls that cover one piece.
const COVER_MAX: u32 = 24;

/// One piece of a skeleton.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Piece {
    Point(Place),
    Segment(Segment),
    Polygon(Polygon),
    Quadratic(Quadratic),
    Arc(Arc),
}

/// A straight line from `start` along the unit vector `axis`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Segment {
    pub(crate) start: Place,
    pub(crate) axis: Place,
    pub(crate) length: f64,
}

/// A flat convex polygon, its vertices anticlockwise about `normal`.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Polygon {
    pub(crate) vertices: Vec<Place>,
    pub(crate) edges: Vec<Segment>,
    pub(crate) normal: Place,
    area: f64,
}

/// a t² + b t + c, t from 0 to 1: a quadratic Bézier piece of a B-spline curve.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Quadratic {
    pub(crate) a: Place,
    pub(crate) b: Place,
    pub(crate) c: Place,
}

/// Part of a circle: centre + radius (cos θ x + sin θ y), θ from 0 to `angle`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Arc {
    pub(crate) centre: Place,
    pub(crate) x: Place,
    pub(crate) y: Place,
    pub(crate) normal: Place,
    pub(crate) radius: f64,
    pub(crate) angle: f64,
}

/// Some pieces with a radius of influence and a weight.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Primitive {
    pub(crate) pieces: Vec<Piece>,
    pub(crate) radius: f64,
    pub(crate) weight: f64,
}

/// A ball that holds part of a piece; its centre lies on the piece.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Ball {
    pub(crate) centre: Place,
    pub(crate) reach: f64,
    /// The length or area of the part; 1 for a point.
    pub(crate) measure: f64,
}

/// The primitives of a list: each is its kind, radius, weight, count of numbers, and these.
pub(crate) fn primitives(mut list: &[f64]) -> Result<Vec<Primitive>, Refusal> {
    let mut primitives = Vec::new();
    while let [kind, radius, weight, count, rest @ ..] = list {
        let counted =
            (0..=rest.len()).find(|n| u32::try_from(*n).is_ok_and(|n| f64::from(n) == *count));
        let Some((numbers, after)) = counted.and_then(|n| rest.split_at_checked(n)) else {
            return Err(("as many numbers as it is said to have", *count));
        };
        if !(1e-6..=1e8).contains(radius) {
            return Err(("radii from a millionth to a hundred million", *radius));
        }
        primitives.push(Primitive {
            pieces: pieces(*kind, numbers)?,
            radius: *radius,
            weight: *weight,
        });
        list = after;
    }
    if primitives.is_empty() || !list.is_empty() {
        return Err(("at least one whole primitive", 0.0));
    }
    Ok(primitives)
}

fn pieces(kind: f64, numbers: &[f64]) -> Result<Vec<Piece>, Refusal> {
    let count = numbers.len() / 3;
    if kind == 4.0 {
        return arc(numbers).map(|arc| vec![Piece::Arc(arc)]);
    }
    let shown = f64::from(u32::try_from(count).unwrap_or(u32::MAX));
    if !numbers.len().is_multiple_of(3) || count > VERTICES_MAX {
        return Err(("at most 1024 places of three numbers", shown));
    }
    let places: Vec<Place> = numbers
        .chunks_exact(3)
        .map(|p| [p[0], p[1], p[2]])
        .collect();
    if kind == 0.0 && count == 1 {
        Ok(vec![Piece::Point(places[0])])
    } else if kind == 1.0 && count >= 2 {
        let segment = |pair: &[Place]| Segment::new(pair[0], pair[1]).map(Piece::Segment);
        places.windows(2).map(segment).collect()
    } else if kind == 2.0 && count >= 3 {
        Ok(vec![Piece::Polygon(Polygon::new(places)?)])
    } else if kind == 3.0 && count >= 3 {
        Ok(spline(&places))
    } else {
        Err((
            "1 place for a point, 2 for a line, 3 for a polygon or curve",
            shown,
        ))
    }
}

/// The uniform quadratic B-spline of control points, ending at the first and the last: a Bézier piece about each inner one.
fn spline(points: &[Place]) -> Vec<Piece> {
    let middle = |i: usize| fixed::scale(fixed::add(points[i], points[i + 1]), 0.5);
    let last = points.len() - 1;
    (1..last)
        .map(|i| {
            let from = if i == 1 { points[0] } else { middle(i - 1) };
            let to = if i == last - 1 {
                points[last]
            } else {
                middle(i)
            };
            let bend = fixed::sub(points[i], from);
            let a = fixed::sub(fixed::sub(to, points[i]), bend);
            Piece::Quadratic(Quadratic {
                a,
                b: fixed::scale(bend, 2.0),
                c: from,
            })
        })
        .collect()
}

/// Centre, a point on the circle, normal, angle.
fn arc(numbers: &[f64]) -> Result<Arc, Refusal> {
    let &[cx, cy, cz, sx, sy, sz, nx, ny, nz, angle] = numbers else {
        return Err((
            "ten numbers for an arc",
            f64::from(u32::try_from(numbers.len()).unwrap_or(0)),
        ));
    };
    let start = fixed::sub([sx, sy, sz], [cx, cy, cz]);
    let radius = fixed::length(start);
    let up = fixed::length([nx, ny, nz]);
    if radius <= 0.0 || up <= 0.0 {
        return Err(("an arc with a radius and a normal", 0.0));
    }
    let (x, normal) = (
        fixed::scale(start, 1.0 / radius),
        fixed::scale([nx, ny, nz], 1.0 / up),
    );
    if fixed::dot(x, normal).abs() > 1e-9 {
        return Err(("an arc's start square to its normal", fixed::dot(x, normal)));
    }
    if !(angle > 0.0 && angle <= core::f64::consts::TAU) {
        return Err(("an arc's angle above 0 and up to a full turn", angle));
    }
    Ok(Arc {
        centre: [cx, cy, cz],
        x,
        y: fixed::cross(normal, x),
        normal,
        radius,
        angle,
    })
}

impl Segment {
    fn new(from: Place, to: Place) -> Result<Self, Refusal> {
        let way = fixed::sub(to, from);
        let length = fixed::length(way);
        if length <= 1e-9 {
            return Err(("neighbouring places that differ", length));
        }
        Ok(Self {
            start: from,
            axis: fixed::scale(way, 1.0 / length),
            length,
        })
    }

    fn at(&self, share: f64) -> Place {
        fixed::add(self.start, fixed::scale(self.axis, self.length * share))
    }
}

impl Polygon {
    fn new(vertices: Vec<Place>) -> Result<Self, Refusal> {
        let next = |i: usize| vertices[(i + 1) % vertices.len()];
        // Newell's normal: twice the area long.
        let mut normal = [0.0; 3];
        for i in 0..vertices.len() {
            let (p, q) = (
                fixed::sub(vertices[i], vertices[0]),
                fixed::sub(next(i), vertices[0]),
            );
            normal = fixed::add(normal, fixed::cross(p, q));
        }
        let twice = fixed::length(normal);
        if twice <= 1e-12 {
            return Err(("a polygon with an area", 0.5 * twice));
        }
        let normal = fixed::scale(normal, 1.0 / twice);
        let size = twice.sqrt();
        let mut edges = Vec::with_capacity(vertices.len());
        for i in 0..vertices.len() {
            let off = fixed::dot(fixed::sub(vertices[i], vertices[0]), normal);
            if off.abs() > 1e-6 * size {
                return Err(("a flat polygon", off));
            }
            let edge = Segment::new(vertices[i], next(i))?;
            let left = fixed::cross(normal, edge.axis);
            let least = vertices
                .iter()
                .map(|vertex| fixed::dot(fixed::sub(*vertex, vertices[i]), left))
                .fold(0.0, smaller);
            if least < -1e-6 * size {
                return Err(("a convex polygon", least));
            }
            edges.push(edge);
        }
        Ok(Self {
            vertices,
            edges,
            normal,
            area: 0.5 * twice,
        })
    }

    /// Whether the place lies over or under it.
    pub(crate) fn is_over(&self, place: Place) -> bool {
        self.edges.iter().all(|edge| {
            let left = fixed::cross(self.normal, edge.axis);
            fixed::dot(fixed::sub(place, edge.start), left) >= 0.0
        })
    }
}

impl Quadratic {
    pub(crate) fn at(&self, t: f64) -> Place {
        [0, 1, 2].map(|k| self.c[k] + t * (self.b[k] + t * self.a[k]))
    }

    /// A bound of its speed |c′(t)| between two parameters: c′ is linear, so it is fastest at an end.
    fn speed(&self, from: f64, to: f64) -> f64 {
        let at = |t: f64| fixed::length([0, 1, 2].map(|k| self.b[k] + 2.0 * t * self.a[k]));
        larger(at(from), at(to))
    }
}

impl Arc {
    pub(crate) fn at(&self, theta: f64) -> Place {
        let (cos, sin) = (libm::cos(theta), libm::sin(theta));
        [0, 1, 2].map(|k| self.centre[k] + self.radius * (cos * self.x[k] + sin * self.y[k]))
    }
}

impl Piece {
    /// A box around it.
    pub(crate) fn extent(&self, margin: f64) -> Extent {
        match self {
            Self::Point(place) => Extent::around(&[*place], margin),
            Self::Segment(segment) => Extent::around(&[segment.start, segment.at(1.0)], margin),
            Self::Polygon(polygon) => Extent::around(&polygon.vertices, margin),
            Self::Quadratic(curve) => {
                let control = fixed::add(curve.c, fixed::scale(curve.b, 0.5));
                Extent::around(&[curve.c, control, curve.at(1.0)], margin)
            }
            Self::Arc(arc) => Extent::around(&[arc.centre], arc.radius + margin),
        }
    }

    /// Balls that cover it, each not much larger than `size`. Their measures add up to no less than its own.
    pub(crate) fn cover(&self, size: f64) -> Vec<Ball> {
        const ROOM: f64 = 1.0 + 1e-9;
        let shares = |length: f64| {
            let wanted = 0.5 * length / size;
            let count = (1..COVER_MAX)
                .find(|n| f64::from(*n) >= wanted)
                .unwrap_or(COVER_MAX);
            (0..count).map(move |i| {
                let part = 1.0 / f64::from(count);
                (f64::from(i) * part, f64::from(i + 1) * part)
            })
        };
        let line = |length: f64, at: &dyn Fn(f64) -> Place, speed: &dyn Fn(f64, f64) -> f64| {
            shares(length)
                .map(|(from, to)| {
                    let long = (to - from) * speed(from, to) * ROOM;
                    Ball {
                        centre: at(0.5 * (from + to)),
                        reach: 0.5 * long,
                        measure: long,
                    }
                })
                .collect::<Vec<_>>()
        };
        match self {
            Self::Point(place) => vec![Ball {
                centre: *place,
                reach: 0.0,
                measure: 1.0,
            }],
            Self::Segment(segment) => {
                line(segment.length, &|t| segment.at(t), &|_, _| segment.length)
            }
            Self::Quadratic(curve) => line(curve.speed(0.0, 1.0), &|t| curve.at(t), &|from, to| {
                curve.speed(from, to)
            }),
            Self::Arc(arc) => {
                let length = arc.radius * arc.angle;
                line(length, &|t| arc.at(t * arc.angle), &|_, _| length)
            }
            Self::Polygon(polygon) => {
                let mut balls = Vec::new();
                for k in 1..polygon.vertices.len() - 1 {
                    let corners = [
                        polygon.vertices[0],
                        polygon.vertices[k],
                        polygon.vertices[k + 1],
                    ];
                    cover_triangle(corners, size, 3, &mut balls);
                }
                balls
            }
        }
    }

    /// Its length or area; 1 for a point.
    pub(crate) fn measure(&self) -> f64 {
        match self {
            Self::Polygon(polygon) => polygon.area,
            _ => self
                .cover(f64::INFINITY)
                .iter()
                .map(|ball| ball.measure)
                .sum(),
        }
    }
}

fn cover_triangle([a, b, c]: [Place; 3], size: f64, depth: u32, balls: &mut Vec<Ball>) {
    let centre = fixed::scale(fixed::add(fixed::add(a, b), c), 1.0 / 3.0);
    let reach = [a, b, c]
        .map(|corner| fixed::length(fixed::sub(corner, centre)))
        .into_iter()
        .fold(0.0, larger);
    if reach <= size || depth == 0 {
        let area = 0.5 * fixed::length(fixed::cross(fixed::sub(b, a), fixed::sub(c, a)));
        balls.push(Ball {
            centre,
            reach: reach * (1.0 + 1e-9),
            measure: area * (1.0 + 1e-9),
        });
        return;
    }
    let middle = |p: Place, q: Place| fixed::scale(fixed::add(p, q), 0.5);
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    for corners in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
        cover_triangle(corners, size, depth - 1, balls);
    }
}

impl Ball {
    /// The distances of a region's places from any point of its part.
    pub(crate) fn distance(&self, within: &Within) -> Interval {
        let away = within.distance(self.centre);
        let least = larger(away.low - self.reach, 0.0);
        Interval::new(least, away.high + self.reach)
    }
}
