//! Cones around rays that stay close to each other.

use glam::DVec3;

use super::larger;
use super::tracer::Ray;

/// Lengths are lengthened by this share, for the rounding of the operations that they come from.
const ROOM: f64 = 1.0 + 1e-12;

/// A ray that is so much to the side of the path may be this share of it farther along than computed, by rounding.
const LEAN: f64 = 1e-12;

/// A path along the middle of some rays, and how far from it they are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    /// Where the path begins, world metres.
    pub(crate) origin: DVec3,
    /// Unit vector, or 0 where the rays have no common direction.
    pub(crate) direction: DVec3,
    /// From the eye to the origin, in the middle of the rays.
    pub(crate) from_eye: DVec3,
    /// Seconds from image 0, of the first ray.
    pub(crate) time: f64,
    /// At distance t along them, rays are no farther than radius + spread · t from the path's place there, and no farther from the eye
    /// than that and the path's.
    pub(crate) radius: f64,
    pub(crate) spread: f64,
    /// How much of that is along the path: lean + leaning · t at most.
    pub(crate) lean: f64,
    pub(crate) leaning: f64,
}

impl From<&Ray> for Cone {
    /// The ray alone.
    fn from(ray: &Ray) -> Self {
        Self {
            origin: ray.origin,
            direction: ray.direction,
            from_eye: ray.from_eye,
            time: ray.time,
            radius: 0.0,
            spread: 0.0,
            lean: 0.0,
            leaning: 0.0,
        }
    }
}

impl Cone {
    /// The cone around others; `None` if there are none.
    #[inline]
    pub(crate) fn around(parts: impl Iterator<Item = Self> + Clone) -> Option<Self> {
        let first = parts.clone().next()?;
        let (mut origin, mut direction, mut from_eye) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        let mut count = 0.0;
        for part in parts.clone() {
            origin += part.origin - first.origin;
            direction += part.direction;
            from_eye += part.from_eye - first.from_eye;
            count += 1.0;
        }
        let share = 1.0 / count;
        let origin = first.origin + origin * share;
        let direction = direction.normalize_or_zero();
        let from_eye = first.from_eye + from_eye * share;
        let (mut radius, mut spread, mut lean, mut leaning) = (0.0, 0.0, 0.0, 0.0);
        for part in parts {
            let apart = part.origin - origin;
            let from_eye = part.from_eye - from_eye;
            let turned = part.direction - direction;
            let turn = turned.length();
            // Footprints are measured from the eye: places as far from each other as their ways from it.
            let square = larger(apart.dot(apart), from_eye.dot(from_eye));
            radius = larger(radius, square.sqrt() + part.radius);
            spread = larger(spread, turn + part.spread);
            let along = apart.dot(direction).abs();
            lean = larger(lean, along + part.lean + part.radius * turn);
            let along = turned.dot(direction).abs();
            leaning = larger(leaning, along + part.leaning + part.spread * turn);
        }
        Some(Self {
            origin,
            direction,
            from_eye,
            time: first.time,
            radius: radius * ROOM,
            spread: spread * ROOM,
            lean: lean * ROOM + radius * LEAN,
            leaning: leaning * ROOM + spread * LEAN,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::grid::Grid;

    /// A number between −1 and 1.
    fn number(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (*seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(seed: &mut u64, size: f64) -> DVec3 {
        DVec3::new(number(seed), number(seed), number(seed)) * size
    }

    #[test]
    fn a_cone_holds_its_rays_and_those_of_the_cones_in_it() {
        let mut seed = 7;
        for (apart, turned) in [(0.0, 1e-3), (1e-2, 0.0), (1e-2, 1e-3), (3.0, 0.3)] {
            let eye = vector(&mut seed, 1e3);
            let ahead = vector(&mut seed, 1.0).normalize();
            let rays: Vec<Ray> = (0..61)
                .map(|_| {
                    let from_eye = vector(&mut seed, apart);
                    Ray {
                        origin: eye + from_eye,
                        direction: (ahead + vector(&mut seed, turned)).normalize(),
                        from_eye,
                        time: 0.0,
                        grid: Grid::from_eye(1e-3),
                    }
                })
                .collect();
            let around = |parts: &[Cone]| {
                let parts = parts.chunks(4);
                let cones = parts.filter_map(|parts| Cone::around(parts.iter().copied()));
                cones.collect::<Vec<_>>()
            };
            let mut cones: Vec<Cone> = rays.iter().map(Cone::from).collect();
            for size in [4, 16, 64] {
                cones = around(&cones);
                for (cone, rays) in cones.iter().zip(rays.chunks(size)) {
                    for (ray, t) in rays
                        .iter()
                        .flat_map(|ray| [0.0, 1.0, 50.0].map(|t| (ray, t)))
                    {
                        let at = |origin: DVec3, direction: DVec3| origin + direction * t;
                        let rounding = 1e-12;
                        for way in [
                            at(ray.origin, ray.direction) - at(cone.origin, cone.direction),
                            at(ray.from_eye, ray.direction) - at(cone.from_eye, cone.direction),
                        ] {
                            let radius = cone.radius + cone.spread * t;
                            assert!(way.length() <= radius + rounding, "{size}: {way}");
                        }
                        let way = at(ray.origin, ray.direction) - at(cone.origin, cone.direction);
                        let lean = cone.lean + cone.leaning * t;
                        assert!(way.dot(cone.direction).abs() <= lean + rounding, "{size}");
                    }
                }
            }
            assert!(Cone::around(core::iter::empty()).is_none());
        }
    }
}
