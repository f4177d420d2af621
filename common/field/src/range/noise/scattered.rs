//! Sparse convolution and spot noise in any arithmetic, thesis eqs. (4.13), (4.17) and §5.4.2.
//!
//! A kernel is ξ h(√q), q the squared distance from its node in units of its own. As the thesis says, the symbols that
//! the three squares make are the kernel's alone, so that reduced arithmetic loses nothing by condensing them.

use super::{Near, OFFSETS, REACHED, dot, square, squares, unless_wide};
use crate::interval::Interval;
use crate::noise::disc::Tile;
use crate::noise::lattice::height;
use crate::noise::node::{cell_state, draw, fraction};
use crate::noise::sparse::{HEIGHT, Scatter, Sparse};
use crate::noise::spot::Spot;
use crate::range::Arithmetic;
use crate::range::function::Function;
use crate::range::profile::Profile;

/// Beyond so many cells the noise's range says as much as the sum.
const CELLS_MAX: i32 = 216;

/// How far a profile and a height that are computed in f32 are from the exact ones, and a distance besides its offset.
const PROFILE: f64 = 4e-7;
const DISTANCE: f64 = 5.5e-7;

/// Sparse convolution noise at `at`; `range` is all of its values.
pub(super) fn sparse<T: Arithmetic>(sparse: &Sparse, at: &[T; 3], range: Interval) -> T {
    nodes(sparse, at, range, 1.0, |_, _, d| squares(d))
}

/// Spot noise: q is measured along a spot's axis and across it.
pub(super) fn spot<T: Arithmetic>(spot: &Spot, at: &[T; 3], range: Interval) -> T {
    let rougher = 4.0 * spot.squeeze();
    let across = f64::from(spot.stretch);
    nodes(&spot.nodes, at, range, rougher, |state, index, d| {
        let (axis, radius) = spot.form(state, index);
        let [a, b, c] = frame(axis);
        let [a, b, c] = [
            dot(a.map(|part| part / radius), &d),
            dot(b.map(|part| part * across / radius), &d),
            dot(c.map(|part| part * across / radius), &d),
        ];
        squares([a, b, c])
    })
}

/// The sum over the nodes in reach, whose kernels are `rougher` times as steep and as hard to round as plain ones.
fn nodes<T: Arithmetic>(
    sparse: &Sparse,
    at: &[T; 3],
    range: Interval,
    rougher: f64,
    measure: impl Fn(u32, u32, [T; 3]) -> T,
) -> T {
    let planar = sparse.scatter == Scatter::Plane;
    let flat = [at[0].clone(), at[1].clone(), T::constant(0.0)];
    let at = if planar { &flat } else { at };
    let Some(near) = Near::new(at, 1, CELLS_MAX) else {
        return T::any(range);
    };
    let profile = Function::Profile(Profile::Radial(sparse.kernel));
    let mut sum: Option<T> = None;
    let (mut count, mut heights) = (0.0, 0.0);
    let mut add = |state: u32, index: u32, node: [f64; 3]| {
        if square(near.least(node)) > 1.0 + REACHED {
            return;
        }
        let q = measure(state, index, near.from(node));
        let far = q.range();
        // Spots are nowhere wider than plain kernels.
        let far = far.meet(Interval::new(square(near.least(node)), f64::INFINITY).widen());
        if far.low > 1.0 + REACHED * rougher {
            return;
        }
        let xi = f64::from(height(draw(state, index, 3)) * HEIGHT);
        count += 1.0;
        heights += xi.abs();
        let image = profile.image(far);
        let part = unless_wide(q.apply(profile), image).times(xi).settled(at);
        sum = Some(match sum.take() {
            Some(sum) => sum.plus(part),
            None => part,
        });
    };
    for step in near.steps(1) {
        if square(near.gap(step)) > 1.0 + REACHED {
            continue;
        }
        let cell = near.cell(step);
        if planar && cell[2] != 0 {
            continue;
        }
        let state = cell_state(sparse.lattice, cell);
        let place = |node: [f32; 3]| [0, 1, 2].map(|k| f64::from(node[k]) + f64::from(step[k]));
        match sparse.scatter {
            Scatter::Uniform => {
                for index in 0..sparse.nodes {
                    let node = [0, 1, 2].map(|axis| fraction(draw(state, index, axis)));
                    add(state, index, place(node));
                }
            }
            Scatter::Plane => {
                for index in 0..sparse.nodes {
                    let [x, y] = [0, 1].map(|axis| fraction(draw(state, index, axis)));
                    add(state, index, place([x, y, 0.0]));
                }
            }
            Scatter::Disc => {
                for (index, node) in (0..).zip(Tile::shared().nodes(sparse.lattice, cell)) {
                    add(state, index, place(*node));
                }
            }
        }
    }
    let kernel = sparse.kernel.steepest() * (DISTANCE + OFFSETS) + PROFILE;
    // A sum of n terms adds n · 2⁻²⁴ of their total.
    let blur = heights * (rougher * kernel + count * 6e-8);
    match sum {
        Some(sum) => sum.settled(at).computed(blur).within(range),
        None => T::constant(0.0),
    }
}

/// An orthonormal frame whose first vector is the direction of `axis`.
fn frame(axis: [f64; 3]) -> [[f64; 3]; 3] {
    let normed = |v: [f64; 3]| {
        let length = square(v).sqrt();
        v.map(|part| part / length)
    };
    let a = normed(axis);
    // Across the axis that `a` is farthest from.
    let other = if a[0].abs() < 0.6 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let b = normed(cross(a, other));
    [a, b, cross(a, b)]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
