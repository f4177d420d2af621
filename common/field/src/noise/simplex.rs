//! Simplex noise, thesis §4.3.2 after Perlin: gradients at the corners of a skewed lattice.
//!
//! The skewed cube falls into six congruent, irregular tetrahedra (thesis §4.3.2, mended: ERRATA row 1467); the
//! kernel (½ − d²)⁴ ξ·d of a corner ends before it leaves the tetrahedra around that corner, so only the four
//! corners of a place's tetrahedron count, and the noise has three continuous derivatives.
//!
//! Everything here is a function of the skewed coordinates q = (I + J/3) p, J all ones, in which cells are cubes.

use super::gradient::Lattice;
use super::jet::Real;
use super::lattice::slope;
use crate::hash;

/// Brings the greatest value close to 1: the supremum of the plain sum over all gradients is 0.013007.
pub(crate) const SCALE: f32 = 76.0;

/// No value is farther from zero.
pub const RANGE: f64 = 1.0;

/// No slope is greater, by the place itself (not the skewed one).
///
/// A corner's slope is at most √2·m³·max(m, |m − 8d²|) with m = ½ − d²; the sum over four corners is below it everywhere.
pub const SLOPE: f64 = 7.9;

/// No second derivative along a direction is greater.
///
/// Of a corner it is at most 2√2‖∇w‖ + |ξ·d|‖∇∇w‖, w the weight; the sum over four corners is below it everywhere.
pub const BEND: f64 = 136.0;

/// The skewed coordinates of a place.
#[inline(always)]
pub(crate) fn skew([x, y, z]: [f64; 3]) -> [f64; 3] {
    let s = (x + y + z) * SKEW;
    [x + s, y + s, z + s]
}

/// What of the sum of a place's coordinates each of them is skewed by.
pub(crate) const SKEW: f64 = 1.0 / 3.0;

/// The noise at an offset within a skewed cell, by the skewed coordinates.
#[inline(always)]
pub(crate) fn at<R: Real>(lattice: Lattice, cell: [u32; 3], offset: [f32; 3]) -> R {
    let [u, v, w] = offset;
    let q = [0, 1, 2].map(
        #[inline(always)]
        |axis| R::variable(offset[axis], axis),
    );
    let back = q[0].plus(q[1]).plus(q[2]).times(1.0 / 6.0);
    let d = q.map(
        #[inline(always)]
        |q| q.minus(back),
    );
    // How many of the other two coordinates each is above: the way from corner to corner goes by rank.
    let rank = [
        u32::from(u >= v) + u32::from(u >= w),
        u32::from(v > u) + u32::from(v >= w),
        u32::from(w > u) + u32::from(w > v),
    ];
    let mut total = kernel(corner(lattice, cell), d);
    for (step, back) in [(2, 1.0 / 6.0), (1, 2.0 / 6.0), (0, 0.5)] {
        let moved = rank.map(
            #[inline(always)]
            |rank| rank >= step,
        );
        let at = [0, 1, 2].map(
            #[inline(always)]
            |k| cell[k].wrapping_add(u32::from(moved[k])),
        );
        let d = [0, 1, 2].map(
            #[inline(always)]
            |k| d[k].raised(if moved[k] { back - 1.0 } else { back }),
        );
        total = total.plus(kernel(corner(lattice, at), d));
    }
    total
}

#[inline(always)]
pub(crate) fn corner(lattice: Lattice, [x, y, z]: [u32; 3]) -> u32 {
    let row = hash::absorb(hash::absorb(lattice.start(), x), y);
    hash::finish_high(hash::absorb(row, z))
}

#[inline(always)]
fn kernel<R: Real>(hash: u32, [x, y, z]: [R; 3]) -> R {
    let d2 = x.by(x).plus(y.by(y)).plus(z.by(z));
    let m = 0.5 - d2.value();
    let m = if m > 0.0 { m } else { 0.0 };
    let (m2, m4) = (m * m, (m * m) * (m * m));
    let weight = d2.chain(SCALE * m4, -4.0 * SCALE * (m2 * m), 12.0 * SCALE * m2);
    weight.by(slope(hash, x, y, z))
}
