//! Where the ground is flat: the axes around an eye, and how high the surface can be over a part of the ground.

use field::Interval;
use glam::DVec3;
use scene::description::Bound;

/// Ground is no farther from the eye than this share of a planet's radius: so far its heights are one number for each place.
const ROUND_MAX: f64 = 0.5;

/// The axes of the ground around the eye, which is their origin: two along it, one up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) axes: [DVec3; 3],
    heights: Heights,
    /// How far the ground goes, by the larger of the first two coordinates.
    pub(super) limit: f64,
    /// How far it has to go.
    pub(super) farthest: f64,
}

#[derive(Clone, Copy, Debug)]
enum Heights {
    /// Between these, seen from the eye.
    Flat(Interval),
    /// Between two spheres around a centre that is `eye` below the eye.
    Round { inner: f64, outer: f64, eye: f64 },
}

impl Frame {
    /// The frame around an eye; `None` where no ground is flat.
    pub(super) fn new(bound: &Bound, eye: DVec3) -> Option<Self> {
        let flat = |low: f64, high: f64, farthest: f64| Self {
            axes: DVec3::AXES,
            heights: Heights::Flat(Interval::new(low - eye.z, high - eye.z)),
            limit: f64::INFINITY,
            farthest,
        };
        Some(match *bound {
            Bound::Slab { low, high } => flat(low, high, f64::INFINITY),
            Bound::Box { min, max } => {
                let corners = [
                    min[0] - eye.x,
                    min[1] - eye.y,
                    max[0] - eye.x,
                    max[1] - eye.y,
                ];
                let farthest = corners.into_iter().map(f64::abs);
                let farthest = farthest.fold(0.0, |most, far| if far > most { far } else { most });
                flat(min[2], max[2], farthest)
            }
            Bound::Shell { inner, outer } => {
                let up = eye.try_normalize()?;
                let (along, across) = up.any_orthonormal_pair();
                let limit = ROUND_MAX * inner;
                Self {
                    axes: [along, across, up],
                    heights: Heights::Round {
                        inner,
                        outer,
                        eye: eye.length(),
                    },
                    limit,
                    farthest: limit,
                }
            }
        })
    }

    /// Between these heights, seen from the eye, the surface is at those distances along the ground.
    pub(super) fn heights(&self, near: f64, far: f64) -> Interval {
        match self.heights {
            Heights::Flat(heights) => heights,
            Heights::Round { inner, outer, eye } => {
                // √(r² − d²) − eye, without losing a height to a radius.
                let height = |radius: f64, distance: f64| {
                    let square = distance * distance;
                    let root = (radius * radius - square).sqrt();
                    (radius - eye) - square / (radius + root)
                };
                Interval::new(height(inner, far), height(outer, near))
            }
        }
    }

    /// Below this height, seen from the eye, there is no ground: it would be a planet's other side.
    pub(super) fn floor(&self) -> f64 {
        match self.heights {
            Heights::Flat(_) => f64::NEG_INFINITY,
            Heights::Round { eye, .. } => -eye,
        }
    }

    /// A way in the frame's coordinates.
    pub(super) fn seen(&self, way: DVec3) -> DVec3 {
        DVec3::from(self.axes.map(|axis| axis.dot(way)))
    }

    /// A way of the frame's coordinates in the world's.
    pub(super) fn world(&self, way: DVec3) -> DVec3 {
        let [x, y, z] = self.axes;
        x * way.x + y * way.y + z * way.z
    }
}
