//! Gradient noise over an unbounded lattice, thesis §4.3.
//!
//! A coordinate is split into a lattice cell, counted in f64, and an offset
//! within it in f32: at the Earth's radius the offset still resolves a
//! nanometre of a one-metre cell. All that follows is 32-bit arithmetic
//! without branches. Cells are numbered modulo 2³²: the noise repeats every
//! 4,294,967,296 cells, and nowhere nearer.
//!
//! These functions are the definition; the batch kernels of `program` are
//! loops around them, compiled once per SIMD level.

use crate::hash;

/// No value of the noise is farther from zero. The supremum is 1.0363, between
/// eight gradients that all point at one place in the cell.
pub const RANGE: f64 = 1.037;

/// No slope of the noise is greater: a Lipschitz constant, reached at a cell's
/// centre. The thesis's 2.75 (§5.2.3) is not one.
pub const SLOPE: f64 = 3.75;

/// No second derivative along a unit direction is greater or less: the supremum is 14.4652, between
/// eight gradients chosen for it, at (0.5, 0.399, 0.601) along (0.569, −0.582, −0.582).
pub const BEND: f64 = 14.48;

/// No value is farther from the exact one at its f32 offset.
///
/// With u = 2⁻²⁴: a kernel's product is good to 2u and the fade to 3.3u (every f32 in [0, 1] was tried).
/// The three interpolations, of differences up to 4, 3 and 2.5, add that many fade errors and 10u, 7.5u and
/// 6u of their own rounding: 57u in all. Seen over three million places: 4.2 · 10⁻⁷.
pub const ROUNDING: f64 = 3.4e-6;

/// A lattice's name: the hash's state after its key.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Lattice(u32);

impl Lattice {
    pub(crate) const fn new(key: u32) -> Self {
        Self(hash::start(key))
    }

    /// The hash's state before the first coordinate.
    #[inline(always)]
    pub(super) const fn start(self) -> u32 {
        self.0
    }
}

/// f_N at `p` over the lattice of `key`, thesis eq. (4.9).
pub fn noise(key: u32, p: [f64; 3]) -> f64 {
    let [(x, u), (y, v), (z, w)] = p.map(split);
    f64::from(value(corners(Lattice::new(key), [x, y, z]), [u, v, w]))
}

/// f_N and its gradient at `p`, thesis eqs. (4.9), (4.10a).
pub fn noise_gradient(key: u32, p: [f64; 3]) -> (f64, [f64; 3]) {
    let [(x, u), (y, v), (z, w)] = p.map(split);
    let h = corners(Lattice::new(key), [x, y, z]);
    let (value, bend) = value_bend(h, [u, v, w]);
    let mean = mean_gradient(h, [u, v, w]);
    let gradient = [0, 1, 2].map(|i| f64::from(mean[i] + bend[i]));
    (f64::from(value), gradient)
}

/// The lattice cell of a coordinate, modulo 2³², and the offset within it, in [0, 1].
///
/// Beyond 2⁵¹ cells, where f64 has no offsets left, the cell's number is
/// arbitrary but the same everywhere. The offset of an infinity is NaN.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    reason = "the low word is the cell; the offset is meant to be f32"
)]
pub(crate) fn split(x: f64) -> (u32, f32) {
    /// Added to a whole number below 2⁵¹, leaves it in the low bits of the sum.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    let floor = x.floor();
    ((floor + WHOLE).to_bits() as u32, (x - floor) as f32)
}

/// 6t⁵ − 15t⁴ + 10t³, the rising half of the kernel's profile: h(t − 1), thesis fig. 4.4. `s` is t − 1.
///
/// Written as t³(1 + (1 − t)(9 − 6t)), of positive terms: the usual Horner form cancels and is seven times worse.
#[inline(always)]
fn fade(t: f32, s: f32) -> f32 {
    t * t * t * (s * (t * 6.0 - 9.0) + 1.0)
}

/// Its derivative, 30t²(t − 1)².
#[inline(always)]
fn fade_slope(t: f32, s: f32) -> f32 {
    let p = t * s;
    30.0 * (p * p)
}

/// The bounds between the three equal parts of a hash's upper thirteen bits.
pub(super) const FIRST: i32 = -1365 << 19;
pub(super) const THIRD: i32 = 1366 << 19;

/// The product of a lattice point's gradient with the way to it.
///
/// The upper thirteen bits of the hash choose which component of the gradient
/// is zero (2731, 2731 and 2730 parts of 8192), the next two the signs of the others.
#[inline(always)]
fn kernel(hash: u32, x: f32, y: f32, z: f32) -> f32 {
    let axis = hash.cast_signed();
    let a = if axis < FIRST { y } else { x };
    let b = if axis < THIRD { z } else { y };
    flip(a, hash << 13) + flip(b, hash << 14)
}

/// The [`kernel`] of each of a cell's corners at an offset in it; x runs fastest.
#[inline(always)]
fn kernels(h: [u32; 8], [x, y, z]: [f32; 3]) -> [f32; 8] {
    let (x1, y1, z1) = (x - 1.0, y - 1.0, z - 1.0);
    [
        kernel(h[0], x, y, z),
        kernel(h[1], x1, y, z),
        kernel(h[2], x, y1, z),
        kernel(h[3], x1, y1, z),
        kernel(h[4], x, y, z1),
        kernel(h[5], x1, y, z1),
        kernel(h[6], x, y1, z1),
        kernel(h[7], x1, y1, z1),
    ]
}

/// `value` with its sign turned where the top bit of `sign` is set.
#[inline(always)]
fn flip(value: f32, sign: u32) -> f32 {
    f32::from_bits(value.to_bits() ^ (sign & 0x8000_0000))
}

#[inline(always)]
fn lerp(t: f32, a: f32, b: f32) -> f32 {
    a + t * (b - a)
}

/// The hash of a cell's corner, good in its upper fifteen bits.
#[inline(always)]
fn corner(row: u32, z: u32) -> u32 {
    hash::finish_high(hash::absorb(row, z))
}

/// The hash of a lattice point.
#[inline(always)]
pub(crate) fn node_hash(lattice: Lattice, [x, y, z]: [u32; 3]) -> u32 {
    let row = hash::absorb(hash::absorb(lattice.0, x), y);
    corner(row, z)
}

/// The gradient that a lattice point's hash stands for: two components are ±1, one is 0.
#[inline(always)]
pub(crate) fn gradient_of(hash: u32) -> [f64; 3] {
    let mut gradient = [0.0; 3];
    add_gradient(&mut gradient, hash, 1.0);
    gradient.map(f64::from)
}

/// The hashes of a cell's eight corners; x runs fastest.
#[inline(always)]
pub(crate) fn corners(lattice: Lattice, [x, y, z]: [u32; 3]) -> [u32; 8] {
    let x0 = hash::absorb(lattice.0, x);
    let x1 = hash::absorb(lattice.0, x.wrapping_add(1));
    let (y1, z1) = (y.wrapping_add(1), z.wrapping_add(1));
    let a = hash::absorb(x0, y);
    let b = hash::absorb(x1, y);
    let c = hash::absorb(x0, y1);
    let d = hash::absorb(x1, y1);
    [
        corner(a, z),
        corner(b, z),
        corner(c, z),
        corner(d, z),
        corner(a, z1),
        corner(b, z1),
        corner(c, z1),
        corner(d, z1),
    ]
}

/// The noise at an offset within the cell of these corners.
#[inline(always)]
pub(crate) fn value(h: [u32; 8], [x, y, z]: [f32; 3]) -> f32 {
    let (x1, y1, z1) = (x - 1.0, y - 1.0, z - 1.0);
    let (u, v, w) = (fade(x, x1), fade(y, y1), fade(z, z1));
    let [a0, a1, b0, b1, c0, c1, d0, d1] = kernels(h, [x, y, z]);
    let (a, b) = (lerp(u, a0, a1), lerp(u, b0, b1));
    let (c, d) = (lerp(u, c0, c1), lerp(u, d0, d1));
    lerp(w, lerp(v, a, b), lerp(v, c, d))
}

/// The noise as [`value`] gives it, to the bit, and the second part of its gradient, thesis eq. (4.10a):
/// what comes of the kernels' profiles.
#[inline(always)]
pub(crate) fn value_bend(h: [u32; 8], [x, y, z]: [f32; 3]) -> (f32, [f32; 3]) {
    let (x1, y1, z1) = (x - 1.0, y - 1.0, z - 1.0);
    let (u, v, w) = (fade(x, x1), fade(y, y1), fade(z, z1));
    let [a0, a1, b0, b1, c0, c1, d0, d1] = kernels(h, [x, y, z]);
    let (a, b) = (lerp(u, a0, a1), lerp(u, b0, b1));
    let (c, d) = (lerp(u, c0, c1), lerp(u, d0, d1));
    let (near, far) = (lerp(v, a, b), lerp(v, c, d));
    let along_x = lerp(w, lerp(v, a1 - a0, b1 - b0), lerp(v, c1 - c0, d1 - d0));
    let along_y = lerp(w, b - a, d - c);
    let bend = [
        fade_slope(x, x1) * along_x,
        fade_slope(y, y1) * along_y,
        fade_slope(z, z1) * (far - near),
    ];
    (lerp(w, near, far), bend)
}

/// The noise as [`value`] gives it, to the bit, and its derivative along `e`.
///
/// A kernel is a product of a corner's gradient with the way to it, so its derivative along `e` is
/// the kernel of `e` itself.
#[inline(always)]
pub(crate) fn value_along(h: [u32; 8], [x, y, z]: [f32; 3], [p, q, r]: [f32; 3]) -> (f32, f32) {
    let (x1, y1, z1) = (x - 1.0, y - 1.0, z - 1.0);
    let (u, v, w) = (fade(x, x1), fade(y, y1), fade(z, z1));
    let [a0, a1, b0, b1, c0, c1, d0, d1] = kernels(h, [x, y, z]);
    let (a, b) = (lerp(u, a0, a1), lerp(u, b0, b1));
    let (c, d) = (lerp(u, c0, c1), lerp(u, d0, d1));
    let (near, far) = (lerp(v, a, b), lerp(v, c, d));
    let us = fade_slope(x, x1) * p;
    let (vs, ws) = (fade_slope(y, y1) * q, fade_slope(z, z1) * r);
    let e = [p, q, r];
    let (sa, sb) = (
        edge(u, us, e, [h[0], h[1]], a1 - a0),
        edge(u, us, e, [h[2], h[3]], b1 - b0),
    );
    let (sc, sd) = (
        edge(u, us, e, [h[4], h[5]], c1 - c0),
        edge(u, us, e, [h[6], h[7]], d1 - d0),
    );
    let near_slope = lerp(v, sa, sb) + vs * (b - a);
    let far_slope = lerp(v, sc, sd) + vs * (d - c);
    let slope = lerp(w, near_slope, far_slope) + ws * (far - near);
    (lerp(w, near, far), slope)
}

/// The derivative along `e` of two corners' kernels, joined by the fade `u` of slope `us`.
#[inline(always)]
fn edge(u: f32, us: f32, [p, q, r]: [f32; 3], h: [u32; 2], apart: f32) -> f32 {
    lerp(u, kernel(h[0], p, q, r), kernel(h[1], p, q, r)) + us * apart
}

/// The first part of the noise's gradient: the corners' own gradients, weighted.
#[inline(always)]
pub(crate) fn mean_gradient(h: [u32; 8], [x, y, z]: [f32; 3]) -> [f32; 3] {
    let (u, v, w) = (fade(x, x - 1.0), fade(y, y - 1.0), fade(z, z - 1.0));
    let (u0, v0, w0) = (1.0 - u, 1.0 - v, 1.0 - w);
    let (a, b, c, d) = (u0 * v0, u * v0, u0 * v, u * v);
    let mut sum = [0.0; 3];
    add_gradient(&mut sum, h[0], a * w0);
    add_gradient(&mut sum, h[1], b * w0);
    add_gradient(&mut sum, h[2], c * w0);
    add_gradient(&mut sum, h[3], d * w0);
    add_gradient(&mut sum, h[4], a * w);
    add_gradient(&mut sum, h[5], b * w);
    add_gradient(&mut sum, h[6], c * w);
    add_gradient(&mut sum, h[7], d * w);
    sum
}

/// Adds `weight` times the gradient that [`kernel`] multiplies with.
#[inline(always)]
fn add_gradient(sum: &mut [f32; 3], hash: u32, weight: f32) {
    let axis = hash.cast_signed();
    let (a, b) = (flip(weight, hash << 13), flip(weight, hash << 14));
    let y = if axis < THIRD { 0.0 } else { b };
    sum[0] += if axis < FIRST { 0.0 } else { a };
    sum[1] += if axis < FIRST { a } else { y };
    sum[2] += if axis < THIRD { b } else { 0.0 };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::{hash, unit};

    fn place(i: u32) -> [f64; 3] {
        [0, 1, 2].map(|k| 4000.0 * unit(hash(&[i, k])) - 2000.0)
    }

    #[test]
    fn the_noise_is_the_sum_of_its_kernels() {
        let h = |t: f64| profile(t).0;
        for i in 0..20_000 {
            // Offsets that are f32, so that only the kernel's arithmetic differs.
            let p = place(i).map(|x| x.floor() + f64::from(split(x).1));
            let mut exact = 0.0;
            for corner in 0..8 {
                let node = [0, 1, 2].map(|k| p[k].floor() + f64::from((corner >> k) & 1));
                // At a node the gradient is the node's own (thesis §4.3).
                let (value, xi) = noise_gradient(7, node);
                assert_eq!(value, 0.0);
                assert!(
                    xi.iter().filter(|part| part.abs() == 1.0).count() == 2 && xi.contains(&0.0),
                    "{xi:?}"
                );
                let d = [0, 1, 2].map(|k| p[k] - node[k]);
                exact += (xi[0] * d[0] + xi[1] * d[1] + xi[2] * d[2]) * h(d[0]) * h(d[1]) * h(d[2]);
            }
            let value = noise(7, p);
            assert!(
                (value - exact).abs() < ROUNDING / 4.0,
                "{p:?}: {value} {exact}"
            );
            assert_eq!(value, noise_gradient(7, p).0);
        }
    }

    #[test]
    fn values_and_slopes_stay_below_their_bounds_and_come_near() {
        let (mut highest, mut steepest, mut mean) = (0.0f64, 0.0f64, 0.0);
        for i in 0..400_000 {
            let (value, [x, y, z]) = noise_gradient(3, place(i));
            highest = highest.max(value.abs());
            steepest = steepest.max((x * x + y * y + z * z).sqrt());
            mean += value / 400_000.0;
        }
        assert!(highest > 0.9 && highest <= RANGE, "{highest}");
        assert!(steepest > 2.75 && steepest <= SLOPE, "{steepest}");
        assert!(mean.abs() < 3e-3, "{mean}");
    }

    /// h, h′ and h″.
    fn profile(t: f64) -> (f64, f64, f64) {
        let a = t.abs();
        let slope = -30.0 * (a * (1.0 - a)) * (a * (1.0 - a));
        (
            1.0 - a * a * a * (a * (6.0 * a - 15.0) + 10.0),
            slope.copysign(-t),
            -60.0 * a * (1.0 - a) * (1.0 - 2.0 * a),
        )
    }

    /// The highest value at an offset, and the steepest slope and the greatest second derivative along a
    /// direction, that any choice of gradients gives.
    fn suprema(t: [f64; 3], along: [f64; 3]) -> [f64; 3] {
        // The best of the twelve gradients adds up the two largest components of what it is multiplied with.
        let best = |mut v: [f64; 3]| {
            v = v.map(f64::abs);
            v.sort_by(f64::total_cmp);
            v[1] + v[2]
        };
        let [p, q, r] = along;
        let mut most = [0.0; 3];
        for corner in 0..8 {
            let d = [0, 1, 2].map(|k| t[k] - f64::from((corner >> k) & 1));
            let [(hx, sx, bx), (hy, sy, by), (hz, sz, bz)] = d.map(profile);
            let weight = hx * hy * hz;
            let slope = sx * hy * hz * p + hx * sy * hz * q + hx * hy * sz * r;
            let bend = bx * hy * hz * p * p
                + hx * by * hz * q * q
                + hx * hy * bz * r * r
                + 2.0 * (sx * sy * hz * p * q + sx * hy * sz * p * r + hx * sy * sz * q * r);
            most[0] += weight * best(d);
            most[1] += best([0, 1, 2].map(|k| weight * along[k] + slope * d[k]));
            most[2] += best([0, 1, 2].map(|k| 2.0 * slope * along[k] + bend * d[k]));
        }
        most
    }

    #[test]
    fn no_choice_of_gradients_exceeds_the_bounds() {
        let mut most = [0.0f64; 3];
        for i in 0..300_000 {
            let part = |k: u32| unit(hash(&[i, k]));
            let along = [3, 4, 5].map(|k| part(k) - 0.5);
            let length = (along[0] * along[0] + along[1] * along[1] + along[2] * along[2]).sqrt();
            let here = suprema([part(0), part(1), part(2)], along.map(|a| a / length));
            most = [0, 1, 2].map(|k| most[k].max(here[k]));
        }
        let [highest, steepest, bent] = most;
        assert!(highest > 1.03 && highest < RANGE - 5e-4, "{highest}");
        assert!(steepest > 3.5 && steepest <= SLOPE, "{steepest}");
        assert!(bent > 13.9 && bent <= BEND, "{bent}");
        let [_, centre, _] = suprema([0.5; 3], [1.0, 0.0, 0.0]);
        assert!((centre - SLOPE).abs() < 1e-12, "{centre}");
        let corner = [0.568_708_58, -0.581_622_96, -0.581_622_97];
        let [.., bent] = suprema([0.5, 0.399_191_96, 0.600_803_68], corner);
        assert!(bent > 14.465_14 && bent < BEND, "{bent}");
    }

    #[test]
    fn all_twelve_gradients_are_alike() {
        let mut counts = std::collections::BTreeMap::new();
        for i in 0..120_000 {
            let node = [0, 1, 2].map(|k| f64::from(hash(&[i, k]).cast_signed()));
            let (_, g) = noise_gradient(1, node);
            *counts
                .entry(g.map(|part| {
                    if part > 0.5 {
                        1
                    } else if part < -0.5 {
                        -1
                    } else {
                        0
                    }
                }))
                .or_insert(0) += 1;
        }
        assert_eq!(counts.len(), 12);
        assert!(
            counts.values().all(|count| (9_500..10_500).contains(count)),
            "{counts:?}"
        );
    }

    #[test]
    fn neighbours_in_the_lattice_are_independent() {
        for axis in 0..3 {
            let (mut dot, mut n) = (0.0, 0.0);
            for i in 0..60_000 {
                let node = [0, 1, 2].map(|k| f64::from(hash(&[i, k]) % 512) - 256.0);
                let mut next = node;
                next[axis] += 1.0;
                let ((_, g), (_, k)) = (noise_gradient(2, node), noise_gradient(2, next));
                dot += g[0] * k[0] + g[1] * k[1] + g[2] * k[2];
                n += 1.0;
            }
            // Each product has variance 4/3, so the mean 0.0047.
            assert!((dot / n).abs() < 0.02, "axis {axis}: {}", dot / n);
        }
    }

    #[test]
    fn cells_are_told_apart_at_planetary_distances_and_wrap_at_two_to_the_32() {
        let far = 6_371_000.0 * 8.0;
        assert_ne!(noise(1, [far + 0.3, 0.2, 0.6]), noise(1, [0.3, 0.2, 0.6]));
        let step = noise(1, [far + 0.3 + 1e-6, 0.2, 0.6]) - noise(1, [far + 0.3, 0.2, 0.6]);
        assert!(step.abs() < 1e-5);
        let around = 4_294_967_296.0;
        assert_eq!(
            noise(1, [0.25, 0.5, 0.75]),
            noise(1, [around + 0.25, 0.5 - around, 0.75])
        );
        assert_eq!(split(-0.0), (0, -0.0));
        assert_eq!(split(-1.5), (u32::MAX - 1, 0.5));
        assert_eq!(noise(1, [1e300, -1e300, 4e18]), 0.0);
        assert!(noise(1, [f64::INFINITY, 0.0, 0.0]).is_nan());
    }
}
