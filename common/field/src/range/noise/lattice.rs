//! Lattice noises in any arithmetic: gradient, value and value-gradient, thesis eqs. (4.9), (4.11), (4.12).
//!
//! Each kernel is (ξ₀ + ξ·d) h(d₁) h(d₂) h(d₃). The profiles h are single steps (Chebyshev bands of the quintic,
//! thesis §5.4.2), the product ξ·d keeps all correlation, and what symbols the kernel made besides are condensed when it
//! is done: standard affine arithmetic inside a kernel, reduced outside, gives the same as reduced throughout.

use super::FAR;
use crate::interval::{Interval, larger, smaller};
use crate::noise::lattice::{Corner, parts};
use crate::noise::{self, Lattice};
use crate::range::Arithmetic;
use crate::range::function::Function;

/// Beyond so many kernels the noise's range says as much as their sum.
pub(super) const KERNELS_MAX: usize = 64;

/// How far evaluation in f32 may be from the exact noise: its own rounding, and that of three offsets to 2⁻²⁵ at the steepest slope.
pub(crate) const BLUR: f64 = noise::ROUNDING + noise::SLOPE * super::OFFSETS;

/// All values of gradient noise, rounding included.
pub(crate) const RANGE: Interval = Interval::new(-noise::RANGE, noise::RANGE);

/// A plane's number, the way from it and the profile there.
type Plane<T> = (u32, T, T);

fn plane<T: Arithmetic>(at: &T, plane: f64) -> Plane<T> {
    let way = at.clone().minus(T::constant(plane));
    let profile = way.clone().apply(Function::Quintic);
    (noise::split(plane).0, way, profile)
}

/// All planes that a number is near.
fn many<T: Arithmetic>(at: &T, span: Interval) -> Vec<Plane<T>> {
    let first = span.low.floor();
    let last = larger(span.high.ceil(), first + 1.0);
    let mut planes = Vec::new();
    let mut next = first;
    while next <= last {
        planes.push(plane(at, next));
        next += 1.0;
    }
    planes
}

/// How many planes an interval touches.
#[inline(always)]
fn planes(span: Interval) -> f64 {
    smaller(span.high.ceil() - span.low.floor(), 1e9) + 1.0
}

/// Gradient noise at `at`.
pub(crate) fn gradient_noise<T: Arithmetic>(lattice: Lattice, at: [T; 3]) -> T {
    match T::kernels(Corner::Gradient, lattice, &at) {
        Some(sum) => sum.computed(BLUR).within(RANGE),
        None => T::any(RANGE),
    }
}

/// Whether coordinates are neither too far nor too wide.
#[inline(always)]
pub(super) fn near([x, y, z]: &[Interval; 3]) -> bool {
    let near = |span: &Interval| span.low <= span.high && span.magnitude() < FAR;
    let kernels = planes(*x) * planes(*y) * planes(*z);
    near(x) && near(y) && near(z) && kernels <= KERNELS_MAX as f64
}

/// The exact noise; `None` where it is too far or too wide.
pub(crate) fn sum<T: Arithmetic>(corner: Corner, lattice: Lattice, at: &[T; 3]) -> Option<T> {
    let spans = at.each_ref().map(T::range);
    if !near(&spans) {
        return None;
    }
    let within = |k: usize| planes(spans[k]) == 2.0;
    if within(0) && within(1) && within(2) {
        // Within one cell, as almost always along a short part of a ray.
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let first = spans[axis].low.floor();
            [plane(&at[axis], first), plane(&at[axis], first + 1.0)]
        });
        return Some(of_planes(corner, lattice, at, [&x, &y, &z]));
    }
    let [x, y, z] = [0, 1, 2].map(|axis| many(&at[axis], spans[axis]));
    Some(of_planes(corner, lattice, at, [&x, &y, &z]))
}

/// h₁ (Σ h₂ (Σ h₃ ξ·d)): the same sum with a third of the products, and tighter, since ranges only lose by being spread.
fn of_planes<T: Arithmetic>(
    corner: Corner,
    lattice: Lattice,
    at: &[T; 3],
    [x, y, z]: [&[Plane<T>]; 3],
) -> T {
    total(x, |i, dx| {
        total(y, |j, dy| {
            total(z, |k, dz| {
                let (height, xi) = parts(corner, noise::node_hash(lattice, [i, j, k]));
                let slope = along(xi, [dx, dy, dz]);
                match (corner, slope) {
                    (Corner::Gradient, Some(slope)) => slope,
                    (_, Some(slope)) => slope.plus(T::constant(height)),
                    (_, None) => T::constant(height),
                }
            })
        })
        .settled(at)
    })
}

/// Σ h(d) · term over the planes of an axis.
fn total<T: Arithmetic>(planes: &[Plane<T>], term: impl Fn(u32, &T) -> T) -> T {
    let mut sum: Option<T> = None;
    for (plane, way, profile) in planes {
        let part = profile.clone().mul(term(*plane, way));
        sum = Some(match sum {
            Some(sum) => sum.plus(part),
            None => part,
        });
    }
    sum.unwrap_or_else(|| T::constant(0.0))
}

/// ξ·d, of the components of ξ that are not zero; they are ±1.
pub(super) fn along<T: Arithmetic>(xi: [f64; 3], ways: [&T; 3]) -> Option<T> {
    let mut sum: Option<T> = None;
    for (part, way) in xi.into_iter().zip(ways) {
        if part != 0.0 {
            let way = way.clone();
            sum = Some(match (sum, part > 0.0) {
                (Some(sum), true) => sum.plus(way),
                (Some(sum), false) => sum.minus(way),
                (None, true) => way,
                (None, false) => way.neg(),
            });
        }
    }
    sum
}
