//! Noises whose nodes are the corners of a cubic lattice: gradient, value and value-gradient, thesis §4.3.
//!
//! Written over any `Real`, so that they have Hessians (4.10b) too. Gradient noise is here once more, equal to
//! its own file to the bit; that one is faster.

use super::gradient::{FIRST, Lattice, THIRD, corners};
use super::jet::Real;
use crate::hash;

/// What stands at a corner of the lattice.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Corner {
    /// ξ·d, thesis eq. (4.9).
    Gradient,
    /// ξ₀, thesis eq. (4.11).
    Value,
    /// ξ₀ + ξ·d, thesis eq. (4.12).
    ValueGradient,
}

/// No value of value noise is farther from zero: ξ₀ is uniform over [−1, 1), and the weights of a cell's corners add up to 1.
pub const VALUE_RANGE: f64 = 1.0;

/// No slope of value noise is greater.
///
/// Along a unit direction e the slope is Σ w ξ₀ Σₖ eₖ ± h′ₖ/wₖ over the corners, whose weights w = Πwₖ are the
/// probabilities of three independent choices; by Cauchy and Schwarz it is at most √(Σ eₖ² h′ₖ²/(wₖ(1 − wₖ))), and
/// |h′|/√(w(1 − w)) is greatest, 3.75, midway. Reached at a cell's centre.
pub const VALUE_SLOPE: f64 = 3.75;

/// No value of value-gradient noise is farther from zero: ξ₀ and ξ are independent, so the suprema add up.
pub const VALUE_GRADIENT_RANGE: f64 = VALUE_RANGE + super::gradient::RANGE;

/// No slope of value-gradient noise is greater: again both suprema, reached at one place.
pub const VALUE_GRADIENT_SLOPE: f64 = VALUE_SLOPE + super::gradient::SLOPE;

/// No second derivative of gradient noise along a direction is greater.
///
/// Σ over the corners of 2√2‖∇w‖ + |ξ·d|‖∇∇w‖, the most that any gradients give, is below it at every place of a cell.
pub const GRADIENT_BEND: f64 = 55.0;

/// No second derivative of value noise along a direction is greater: Σ‖∇∇w‖ over the corners is below it.
pub const VALUE_BEND: f64 = 35.0;

/// The noise at an offset within a cell.
#[inline(always)]
pub(crate) fn at<R: Real>(corner: Corner, lattice: Lattice, cell: [u32; 3], offset: [f32; 3]) -> R {
    let h = corners(lattice, cell);
    let [x, y, z] = [0, 1, 2].map(
        #[inline(always)]
        |axis| R::variable(offset[axis], axis),
    );
    let (x1, y1, z1) = (x.raised(-1.0), y.raised(-1.0), z.raised(-1.0));
    let (u, v, w) = (fade(x), fade(y), fade(z));
    let a = lerp(u, node(corner, h[0], x, y, z), node(corner, h[1], x1, y, z));
    let b = lerp(
        u,
        node(corner, h[2], x, y1, z),
        node(corner, h[3], x1, y1, z),
    );
    let c = lerp(
        u,
        node(corner, h[4], x, y, z1),
        node(corner, h[5], x1, y, z1),
    );
    let d = lerp(
        u,
        node(corner, h[6], x, y1, z1),
        node(corner, h[7], x1, y1, z1),
    );
    lerp(w, lerp(v, a, b), lerp(v, c, d))
}

#[inline(always)]
fn node<R: Real>(corner: Corner, hash: u32, x: R, y: R, z: R) -> R {
    match corner {
        Corner::Gradient => slope(hash, x, y, z),
        Corner::Value => R::constant(height(hash)),
        Corner::ValueGradient => {
            // The gradient takes the hash's good bits; the height needs its own.
            let own = hash::finish_high(hash::absorb(hash, 1));
            slope(hash, x, y, z).raised(height(own))
        }
    }
}

/// ξ₀ and ξ of a lattice point, from its hash; 0 for what the noise does not have.
#[inline(always)]
pub(crate) fn parts(corner: Corner, hash: u32) -> (f64, [f64; 3]) {
    let own = || f64::from(height(hash::finish_high(hash::absorb(hash, 1))));
    match corner {
        Corner::Gradient => (0.0, super::gradient::gradient_of(hash)),
        Corner::Value => (f64::from(height(hash)), [0.0; 3]),
        Corner::ValueGradient => (own(), super::gradient::gradient_of(hash)),
    }
}

/// ξ₀ from a hash, in [−1, 1), a multiple of 2⁻²³.
#[inline(always)]
#[expect(
    clippy::cast_precision_loss,
    reason = "24 bits are what an f32 holds exactly"
)]
pub(crate) fn height(hash: u32) -> f32 {
    (hash.cast_signed() >> 8) as f32 * (1.0 / 8_388_608.0)
}

/// The product of a corner's gradient, one of twelve, with the way to it.
#[inline(always)]
pub(crate) fn slope<R: Real>(hash: u32, x: R, y: R, z: R) -> R {
    let axis = hash.cast_signed();
    let a = if axis < FIRST { y } else { x };
    let b = if axis < THIRD { z } else { y };
    a.times(sign(hash << 13)).plus(b.times(sign(hash << 14)))
}

/// −1 where the top bit is set, else 1.
#[inline(always)]
fn sign(bits: u32) -> f32 {
    f32::from_bits(1.0f32.to_bits() | (bits & 0x8000_0000))
}

/// 6t⁵ − 15t⁴ + 10t³ in the form of positive terms, with its derivatives.
#[inline(always)]
fn fade<R: Real>(t: R) -> R {
    let t0 = t.value();
    let s = t0 - 1.0;
    let p = t0 * s;
    t.chain(
        t0 * t0 * t0 * (s * (t0 * 6.0 - 9.0) + 1.0),
        30.0 * (p * p),
        60.0 * p * (t0 + s),
    )
}

#[inline(always)]
fn lerp<R: Real>(t: R, a: R, b: R) -> R {
    a.plus(t.by(b.minus(a)))
}
