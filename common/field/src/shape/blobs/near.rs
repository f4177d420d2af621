//! A ball as some straight rays see it.
//!
//! Along a ray u = (d/r)² is a parabola of the way t: least + (t − middle)²/r², where the place at `middle` is the ray's
//! nearest to the ball's centre. So nothing large is taken from something large, however far away the ray begins.

use super::Point;
use super::piece::{Row, least, most};
use crate::shape::kernel::Kernel;
use crate::shape::lanes::WIDTH;

/// What is the same all along some rays, lane by lane.
pub(super) struct Rays {
    pub(super) start: [Row; 3],
    pub(super) direction: [Row; 3],
    /// ‖direction‖² and its inverse.
    pub(super) square: Row,
    pub(super) inverse: Row,
    /// How far they are wanted; 0 in lanes without a ray.
    pub(super) limit: Row,
}

/// A ball that some of the rays meet.
#[derive(Clone, Debug)]
pub(super) struct Near {
    /// Its weight, and 1/r².
    pub(super) weight: f64,
    pub(super) inverse: f64,
    /// Where each ray comes nearest, and u there.
    pub(super) middle: Row,
    pub(super) least: Row,
    /// Between which of their places the rays are within its support: from ∞ to −∞ where they miss it.
    pub(super) entry: Row,
    pub(super) exit: Row,
    /// No ray is within it before, none after: see [`Self::hull`].
    pub(super) first: f64,
    pub(super) last: f64,
}

impl Rays {
    pub(super) const NONE: Self = Self {
        start: [[0.0; WIDTH]; 3],
        direction: [[0.0; WIDTH]; 3],
        square: [0.0; WIDTH],
        inverse: [0.0; WIDTH],
        limit: [0.0; WIDTH],
    };

    /// Where each ray comes nearest to a place, and the square of the distance there.
    #[inline(always)]
    fn nearest(&self, centre: [f64; 3], middle: &mut Row, square: &mut Row) {
        let ([x, y, z], [dx, dy, dz]) = (&self.start, &self.direction);
        for i in 0..WIDTH {
            let (x, y, z) = (x[i] - centre[0], y[i] - centre[1], z[i] - centre[2]);
            let t = -(x * dx[i] + y * dy[i] + z * dz[i]) * self.inverse[i];
            let (x, y, z) = (x + dx[i] * t, y + dy[i] * t, z + dz[i] * t);
            middle[i] = t;
            square[i] = x * x + y * y + z * z;
        }
    }

    /// The ball of a point, if any ray meets it before its end.
    #[inline(always)]
    pub(super) fn meet(&self, kernel: Kernel, point: &Point, near: &mut Near) -> bool {
        let Point {
            centre,
            radius,
            weight,
            inverse,
        } = *point;
        let Near {
            middle, least: u, ..
        } = near;
        self.nearest(centre, middle, u);
        for u in &mut *u {
            *u *= inverse;
        }
        if kernel.ends() {
            let mut any = false;
            for u in &*u {
                any |= *u < 1.0;
            }
            if !any {
                return false;
            }
        }
        (near.weight, near.inverse) = (weight, inverse);
        if !kernel.ends() {
            (near.entry, near.exit) = ([f64::NEG_INFINITY; WIDTH], [f64::INFINITY; WIDTH]);
            return true;
        }
        let square = radius * radius;
        let mut any = false;
        for i in 0..WIDTH {
            let (u, middle) = (near.least[i], near.middle[i]);
            let half = (most(1.0 - u, 0.0) * square * self.inverse[i]).sqrt();
            let (entry, exit) = (middle - half, middle + half);
            let meets = (u < 1.0) & (exit > 0.0) & (entry < self.limit[i]);
            near.entry[i] = if meets { entry } else { f64::INFINITY };
            near.exit[i] = if meets { exit } else { f64::NEG_INFINITY };
            any |= meets;
        }
        any
    }
}

impl Near {
    pub(super) const NONE: Self = Self {
        weight: 0.0,
        inverse: 0.0,
        middle: [0.0; WIDTH],
        least: [0.0; WIDTH],
        entry: [f64::INFINITY; WIDTH],
        exit: [f64::NEG_INFINITY; WIDTH],
        first: f64::INFINITY,
        last: f64::NEG_INFINITY,
    };

    /// Adds the most that the term can be along each ray, for rows that start at no less than 0.
    #[inline(always)]
    pub(super) fn add_most(&self, kernel: Kernel, sums: &mut Row) {
        for (i, sum) in sums.iter_mut().enumerate() {
            let most = kernel.jet(self.least[i])[0] * self.weight;
            let counts = (self.entry[i] < self.exit[i]) & (most > 0.0);
            *sum += if counts { most } else { 0.0 };
        }
    }

    /// `ends`, brought forward to where each ray next comes into the support, or leaves it, after `begin`.
    #[inline(always)]
    pub(super) fn ends(&self, begin: &Row, ends: &Row) -> Row {
        let mut sooner = [0.0; WIDTH];
        for (i, sooner) in sooner.iter_mut().enumerate() {
            let (entry, exit) = (self.entry[i], self.exit[i]);
            let next = if entry > begin[i] { entry } else { exit };
            let is_ahead = (next > begin[i]) & (next < ends[i]);
            *sooner = if is_ahead { next } else { ends[i] };
        }
        sooner
    }

    /// Finds out before what none of the rays is within it, and after what.
    #[inline(always)]
    pub(super) fn hull(&mut self) {
        (self.first, self.last) = (least_of(&self.entry), most_of(&self.exit));
    }
}

/// The least number of a row, those left out that are none.
#[inline(always)]
pub(super) fn least_of(row: &Row) -> f64 {
    by_halves(row, least)
}

/// The greatest number of a row, those left out that are none.
#[inline(always)]
pub(super) fn most_of(row: &Row) -> f64 {
    by_halves(row, most)
}

/// One number of a row, as `chosen` between two at a time: a chain of comparisons would wait for every one.
#[inline(always)]
fn by_halves(row: &Row, chosen: impl Fn(f64, f64) -> f64) -> f64 {
    let mut row = *row;
    for width in HALVES {
        for lane in 0..width {
            row[lane] = chosen(row[lane + width], row[lane]);
        }
    }
    row[0]
}

const HALVES: [usize; 4] = [8, 4, 2, 1];

const _: () = assert!(WIDTH == 16, "lanes are halved four times");
