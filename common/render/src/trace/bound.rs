//! Which part of a ray can meet the surface at all.

use glam::DVec3;
use scene::description::Bound;

use super::grid::FAR;

/// Relative room for rounding around every bound: a centimetre on the Earth.
const ROOM: f64 = 1e-9;

/// The distances between which a ray is inside a bound; `None` where it never is.
///
/// The first is never too large and the last never too small: f > 0 before and
/// beyond, by the bound's own promise.
pub(crate) fn clip(bound: &Bound, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
    let (start, end) = match *bound {
        Bound::Shell { inner, outer } => {
            let (start, end) = sphere(outer * (1.0 + ROOM), origin, direction)?;
            // What goes into the inner sphere has met the surface before.
            match sphere(inner * (1.0 - ROOM), origin, direction) {
                Some((near, _)) if near > 0.0 && inner > 0.0 => (start, near),
                _ => (start, end),
            }
        }
        Bound::Slab { low, high } => {
            let room = ROOM * (low.abs() + high.abs() + origin.z.abs());
            slab(low - room, high + room, origin.z, direction.z)?
        }
        Bound::Box { min, max } => {
            let (min, max) = (DVec3::from(min), DVec3::from(max));
            let room = (min.abs() + max.abs() + origin.abs()) * ROOM;
            let (low, high) = (min - room, max + room);
            let mut span = (f64::NEG_INFINITY, f64::INFINITY);
            for axis in 0..3 {
                let (near, far) = slab(low[axis], high[axis], origin[axis], direction[axis])?;
                span = (
                    if near > span.0 { near } else { span.0 },
                    if far < span.1 { far } else { span.1 },
                );
            }
            span
        }
    };
    let start = if start > 0.0 { start } else { 0.0 };
    let end = if end < FAR { end } else { FAR };
    (start <= end).then_some((start, end))
}

/// Whether a bound cuts the surface off, and not only holds it.
pub(crate) fn cuts(bound: &Bound) -> bool {
    matches!(bound, Bound::Box { .. })
}

/// Whether the surface may be at a place: outside of a box it is cut off.
#[inline]
pub(crate) fn contains(bound: &Bound, place: DVec3) -> bool {
    match *bound {
        Bound::Shell { .. } | Bound::Slab { .. } => true,
        Bound::Box { min, max } => {
            (0..3).all(|axis| place[axis] >= min[axis] && place[axis] <= max[axis])
        }
    }
}

/// Inside a sphere about the origin, without losing an eye close above a planet to rounding.
fn sphere(radius: f64, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
    let towards = -origin.dot(direction);
    let distance = origin.dot(origin).sqrt();
    let power = (distance - radius) * (distance + radius);
    let discriminant = towards * towards - power;
    if discriminant < 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    // The root of larger size first: the other follows without cancellation.
    let large = if towards >= 0.0 {
        towards + root
    } else {
        towards - root
    };
    let other = if large == 0.0 { 0.0 } else { power / large };
    Some(if large >= other {
        (other, large)
    } else {
        (large, other)
    })
}

/// Between two parallel planes.
fn slab(low: f64, high: f64, origin: f64, direction: f64) -> Option<(f64, f64)> {
    if direction == 0.0 {
        return (origin >= low && origin <= high).then_some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let (a, b) = ((low - origin) / direction, (high - origin) / direction);
    Some(if a < b { (a, b) } else { (b, a) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grazing_ray_over_a_planet_is_clipped_to_millimetres() {
        const RADIUS: f64 = 6_371_000.0;
        let bound = Bound::Shell {
            inner: RADIUS - 5.0,
            outer: RADIUS + 5.0,
        };
        let eye = DVec3::new(RADIUS + 25.0, 0.0, 0.0);
        let down = DVec3::new(-0.01, 1.0, 0.0).normalize();
        let (start, end) = clip(&bound, eye, down).unwrap();
        for (t, expected) in [(start, 5.0), (end, -5.0)] {
            let height = (eye + down * t).length() - RADIUS;
            assert!((height - expected).abs() < 0.01, "{height}");
        }
        let above = clip(&bound, eye, DVec3::new(-0.0028, 1.0, 0.0).normalize()).unwrap();
        let height = (eye + DVec3::new(-0.0028, 1.0, 0.0).normalize() * above.1).length() - RADIUS;
        assert!((height - 5.0).abs() < 0.01, "it leaves upwards: {height}");
        let inside = DVec3::new(RADIUS, 0.0, 0.0);
        let (start, end) = clip(&bound, inside, DVec3::X).unwrap();
        assert!(start == 0.0 && (end - 5.0).abs() < 0.01);
        assert!(clip(&bound, eye, DVec3::X).is_none());
        let level = DVec3::new(0.0, 1.0, 0.0);
        assert!(clip(&bound, eye, level).is_none());
    }

    #[test]
    fn slabs_and_boxes_clip_to_their_faces() {
        let slab = Bound::Slab {
            low: -1.0,
            high: 2.0,
        };
        let eye = DVec3::new(0.0, 0.0, 10.0);
        let (start, end) = clip(&slab, eye, -DVec3::Z).unwrap();
        assert!((start - 8.0).abs() < 1e-6 && (end - 11.0).abs() < 1e-6);
        assert!(clip(&slab, eye, DVec3::Z).is_none());
        assert!(clip(&slab, eye, DVec3::X).is_none());
        let cube = Bound::Box {
            min: [-1.0; 3],
            max: [1.0; 3],
        };
        let (start, end) = clip(&cube, DVec3::new(-4.0, 0.5, 0.5), DVec3::X).unwrap();
        assert!((start - 3.0).abs() < 1e-6 && (end - 5.0).abs() < 1e-6);
        assert!(clip(&cube, DVec3::new(-4.0, 1.5, 0.5), DVec3::X).is_none());
        assert!(!contains(&cube, DVec3::new(1.1, 0.0, 0.0)) && contains(&cube, DVec3::ZERO));
    }
}
