//! Blobby surfaces, thesis eq. (2.9): points whose influences add up.

mod lanes;
mod near;
mod piece;
mod walk;

#[cfg(test)]
mod tests;

use super::Refusal;
use super::local::{Local, dot, less};
use super::sum::{Rules, Summed};
use super::supports::Supports;
use super::within::{Extent, Known, Within};
use crate::interval::{Interval, smaller};
pub(crate) use walk::{Met, Walk};

/// T − Σ aᵢ h(‖x − xᵢ‖/rᵢ), and beyond all supports the far field of (7.9).
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Blobs {
    rules: Rules,
    points: Vec<Point>,
    least_radius: f64,
    supports: Supports,
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Point {
    centre: [f64; 3],
    radius: f64,
    weight: f64,
    /// 1/r².
    inverse: f64,
}

impl Blobs {
    /// From the rules and five numbers a point: its place, radius and weight.
    pub(crate) fn new(params: &[f64]) -> Result<Self, Refusal> {
        let (rules, points) = Rules::split(params)?;
        if points.is_empty() || !points.len().is_multiple_of(5) {
            return Err((
                "points of five numbers: a place, a radius and a weight",
                0.0,
            ));
        }
        let mut points = points
            .chunks_exact(5)
            .map(|point| {
                let radius = point[3];
                if !(1e-6..=1e8).contains(&radius) {
                    return Err(("radii from a millionth to a hundred million", radius));
                }
                Ok(Point {
                    centre: [point[0], point[1], point[2]],
                    radius,
                    weight: point[4],
                    inverse: 1.0 / (radius * radius),
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let supports = Supports::sorted(&mut points, |point| {
            if rules.kernel.ends() {
                Extent::of_ball(point.centre, point.radius)
            } else {
                Extent::ALL
            }
        });
        let radii = points.iter().map(|point| point.radius);
        Ok(Self {
            rules,
            least_radius: radii.fold(f64::INFINITY, smaller),
            points,
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
            let point = &self.points[i];
            let u = self.square(point, &at);
            covered |= u.at() < 1.0;
            sum = sum
                .clone()
                .plus(self.rules.kernel.of(u).times(point.weight));
        });
        let inside = N::constant(self.rules.threshold).minus(sum);
        if self.rules.far && !covered {
            inside.plus(self.beyond(&at))
        } else {
            inside
        }
    }

    /// (d/r)².
    #[inline(always)]
    fn square<N: Local>(&self, point: &Point, at: &[N; 3]) -> N {
        let away = less(at.clone(), point.centre);
        dot(away.clone(), away).times(point.inverse)
    }

    /// ‖x − xᵢ‖ − rᵢ of the nearest ball, 0 within it.
    fn beyond<N: Local>(&self, at: &[N; 3]) -> N {
        let place = [at[0].at(), at[1].at(), at[2].at()];
        let mut nearest: Option<(f64, &Point)> = None;
        for point in &self.points {
            let away = less(place, point.centre);
            let distance = dot(away, away).sqrt() - point.radius;
            if nearest.is_none_or(|(least, _)| distance < least) {
                nearest = Some((distance, point));
            }
        }
        match nearest {
            Some((distance, point)) if distance > 0.0 => point.beyond(at),
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

impl Point {
    /// ‖x − xᵢ‖ − rᵢ.
    #[inline(always)]
    fn beyond<N: Local>(&self, at: &[N; 3]) -> N {
        let away = less(at.clone(), self.centre);
        dot(away.clone(), away)
            .sqrt()
            .minus(N::constant(self.radius))
    }

    /// All d/r.
    fn rho(&self, within: &Within) -> Interval {
        let inverse = Interval::point(1.0 / self.radius).widen();
        let rho = within.distance(self.centre).mul(inverse);
        Interval::new(if rho.low > 0.0 { rho.low } else { 0.0 }, rho.high)
    }
}

impl Summed for Blobs {
    fn size(&self) -> f64 {
        self.least_radius
    }

    fn weight(&self) -> f64 {
        self.points.iter().map(|point| point.weight.abs()).sum()
    }

    fn term(&self, i: usize, within: &Within) -> (Interval, f64) {
        let point = &self.points[i];
        let inverse = Interval::point(1.0 / point.radius).widen();
        let rho = point.rho(within);
        let weight = Interval::point(point.weight);
        let kernel = self.rules.kernel;
        (
            kernel.range(rho).mul(weight),
            kernel.slope(rho) * point.weight.abs() * inverse.high,
        )
    }

    fn bend(&self, i: usize, within: &Within) -> Interval {
        let point = &self.points[i];
        let scale = Interval::point(point.weight * point.inverse).widen();
        self.rules.kernel.bend(point.rho(within)).mul(scale)
    }

    fn beyond(&self, within: &Within) -> Interval {
        let mut least = Interval::point(f64::INFINITY);
        for point in &self.points {
            let away = within.distance(point.centre);
            least = least.min(away.sub(Interval::point(point.radius)));
        }
        least
    }
}
