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
    let (origin, direction) = (origin.to_array(), direction.to_array());
    let (start, end) = match Region::of(bound) {
        Region::Ball(ball) => ball.span(origin, direction),
        Region::Shell(shell) => shell.span(origin, direction),
        Region::Slab(slab) => slab.span(origin, direction),
        Region::Block(block) => block.span(origin, direction),
    };
    (start <= end).then_some((start, end))
}

/// A bound, one type for each way of clipping rays to it. Each clips without a branch, for loops over many rays.
pub(super) enum Region {
    Ball(Ball),
    Shell(Shell),
    Slab(Slab),
    Block(Block),
}

impl Region {
    pub(super) fn of(bound: &Bound) -> Self {
        match *bound {
            Bound::Shell { inner, outer } => {
                let outer = Ball(outer * (1.0 + ROOM));
                if inner > 0.0 {
                    let inner = Ball(inner * (1.0 - ROOM));
                    Self::Shell(Shell { inner, outer })
                } else {
                    Self::Ball(outer)
                }
            }
            Bound::Slab { low, high } => Self::Slab(Slab { low, high }),
            Bound::Box { min, max } => Self::Block(Block { min, max }),
        }
    }
}

/// What holds the surface.
pub(super) trait Holds {
    /// The distances between which a ray is inside, neither below 0 nor above [`FAR`]; the first is above the second where it
    /// never is.
    fn span(&self, origin: [f64; 3], direction: [f64; 3]) -> (f64, f64);
}

/// Where nothing is inside.
const NONE: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

/// The part of a span in front of the origin.
#[inline(always)]
fn ahead((start, end): (f64, f64)) -> (f64, f64) {
    (
        if start > 0.0 { start } else { 0.0 },
        if end < FAR { end } else { FAR },
    )
}

/// A ball about the origin of that radius.
pub(super) struct Ball(f64);

impl Holds for Ball {
    #[inline(always)]
    fn span(&self, origin: [f64; 3], direction: [f64; 3]) -> (f64, f64) {
        ahead(self.within(origin, direction))
    }
}

impl Ball {
    /// Without losing an eye close above a planet to rounding.
    #[inline(always)]
    fn within(&self, origin: [f64; 3], direction: [f64; 3]) -> (f64, f64) {
        let Self(radius) = *self;
        let ([x, y, z], [dx, dy, dz]) = (origin, direction);
        let towards = -(x * dx + y * dy + z * dz);
        let distance = (x * x + y * y + z * z).sqrt();
        let power = (distance - radius) * (distance + radius);
        let discriminant = towards * towards - power;
        let misses = discriminant < 0.0;
        let root = if misses { 0.0 } else { discriminant }.sqrt();
        // The root of larger size first: the other follows without cancellation.
        let large = if towards >= 0.0 {
            towards + root
        } else {
            towards - root
        };
        let other = if large == 0.0 { 0.0 } else { power / large };
        let is_last = large >= other;
        let near = if is_last { other } else { large };
        let far = if is_last { large } else { other };
        (
            if misses { NONE.0 } else { near },
            if misses { NONE.1 } else { far },
        )
    }
}

/// A ball without another one inside.
pub(super) struct Shell {
    inner: Ball,
    outer: Ball,
}

impl Holds for Shell {
    #[inline(always)]
    fn span(&self, origin: [f64; 3], direction: [f64; 3]) -> (f64, f64) {
        let (start, end) = self.outer.within(origin, direction);
        // What goes into the inner sphere has met the surface before.
        let (near, far) = self.inner.within(origin, direction);
        let enters = (near > 0.0) & (near <= far) & (start <= end);
        ahead((start, if enters { near } else { end }))
    }
}

/// Between two levels.
pub(super) struct Slab {
    low: f64,
    high: f64,
}

impl Holds for Slab {
    #[inline(always)]
    fn span(&self, [_, _, z]: [f64; 3], [_, _, dz]: [f64; 3]) -> (f64, f64) {
        let room = ROOM * (self.low.abs() + self.high.abs() + z.abs());
        ahead(between(self.low - room, self.high + room, z, dz))
    }
}

/// A box.
pub(super) struct Block {
    min: [f64; 3],
    max: [f64; 3],
}

impl Holds for Block {
    #[inline(always)]
    fn span(&self, origin: [f64; 3], direction: [f64; 3]) -> (f64, f64) {
        let mut span = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let (min, max, at) = (self.min[axis], self.max[axis], origin[axis]);
            let room = (min.abs() + max.abs() + at.abs()) * ROOM;
            let (near, far) = between(min - room, max + room, at, direction[axis]);
            span = (
                if near > span.0 { near } else { span.0 },
                if far < span.1 { far } else { span.1 },
            );
        }
        ahead(span)
    }
}

/// Between two parallel planes.
#[inline(always)]
fn between(low: f64, high: f64, origin: f64, direction: f64) -> (f64, f64) {
    let (a, b) = ((low - origin) / direction, (high - origin) / direction);
    let rises = a < b;
    let (near, far) = (if rises { a } else { b }, if rises { b } else { a });
    let is_inside = (origin >= low) & (origin <= high);
    let (always, never) = (
        if is_inside { f64::NEG_INFINITY } else { NONE.0 },
        if is_inside { f64::INFINITY } else { NONE.1 },
    );
    let stays = direction == 0.0;
    (
        if stays { always } else { near },
        if stays { never } else { far },
    )
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
