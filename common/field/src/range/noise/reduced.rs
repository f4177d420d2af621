//! Lattice noises in reduced affine arithmetic: the sums of `lattice` by their formulas, in lanes, for a guaranteed search spends its time here.
//!
//! Every number is the form that operations one by one would give, but for rounding: within a cell no number is greater than 40, over several
//! none than 10⁴, and none has more than a few hundred operations behind it, so that a constant, added once, is more than all their rounding.
//! Within one cell the profiles of an axis's two planes add up to 1, so that one band says both.

use super::lattice::{KERNELS_MAX, near};
use crate::interval::Interval;
use crate::noise::lattice::{Corner, parts};
use crate::noise::{self, Lattice};
use crate::range::Reduced;
use crate::range::function::quintic_band;
use crate::simd::SimdLevel;

/// More than the rounding of a sum of kernels.
const ROUNDING: f64 = 1e-9;

/// The corners of a cell, x fastest.
const CORNERS: usize = 8;

/// 1 for each corner that is on the upper plane of an axis.
const UPPER: [[f64; CORNERS]; 3] = [
    [0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0],
    [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0],
    [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0],
];

/// Room for three axes, as many lanes as registers have.
const LANES: usize = 4;

/// Most planes of an axis: the others have two at least.
const PLANES: usize = KERNELS_MAX / 4;

/// The exact noise; `None` where it is too far or too wide.
pub(crate) fn sum<const N: usize>(
    corner: Corner,
    lattice: Lattice,
    at: &[Reduced<N>; 3],
) -> Option<Reduced<N>> {
    SimdLevel::best().vectorize(
        #[inline(always)]
        || {
            let spans = [at[0].interval(), at[1].interval(), at[2].interval()];
            if !near(&spans) {
                return None;
            }
            let [x, y, z] = &spans;
            let [i, j, k] = [x.low.floor(), y.low.floor(), z.low.floor()];
            let one = x.high <= i + 1.0 && y.high <= j + 1.0 && z.high <= k + 1.0;
            let sum = if one {
                in_cell(corner, lattice, [i, j, k], at)
            } else {
                over_cells(corner, lattice, at, &spans)?
            };
            Some(Reduced {
                error: sum.error + ROUNDING,
                ..sum
            })
        },
    )
}

/// Forms side by side.
struct Terms<const N: usize, const L: usize> {
    centre: [f64; L],
    along: [[f64; L]; N],
    error: [f64; L],
}

impl<const N: usize, const L: usize> Terms<N, L> {
    const NONE: Self = Self {
        centre: [0.0; L],
        along: [[0.0; L]; N],
        error: [0.0; L],
    };

    #[inline(always)]
    fn get(&self, i: usize) -> Reduced<N> {
        let mut along = [0.0; N];
        for (part, lanes) in along.iter_mut().zip(&self.along) {
            *part = lanes[i];
        }
        Reduced {
            centre: self.centre[i],
            along,
            error: self.error[i],
        }
    }

    /// The first half by 1 − `weight` and the second half by it: thesis eqs. (5.20), (5.21).
    #[inline(always)]
    fn joined<const HALF: usize>(&self, weight: &Reduced<N>) -> Terms<N, HALF> {
        let mut sum = Terms::NONE;
        let (to, from) = (weight.centre, 1.0 - weight.centre);
        let (most, least) = (to.abs(), from.abs());
        let radius = weight.radius();
        for i in 0..HALF {
            let j = i + HALF;
            let (a, b) = (self.centre[i], self.centre[j]);
            let (mut ra, mut rb) = (self.error[i], self.error[j]);
            sum.centre[i] = from * a + to * b;
            for n in 0..N {
                let (x, y) = (self.along[n][i], self.along[n][j]);
                sum.along[n][i] = from * x + to * y + weight.along[n] * (b - a);
                ra += x.abs();
                rb += y.abs();
            }
            sum.error[i] = least * self.error[i]
                + most * self.error[j]
                + weight.error * (a.abs() + b.abs())
                + radius * (ra + rb);
        }
        sum
    }
}

/// 1 − h over the ways t from a cell's lower planes, each as the line that it stays closest to: thesis §5.4.2.
///
/// With u = t − ½ it is ½ + F(u), F(u) = u(15/8 − 5u² + 6u⁴). The slope β of its chord and the chord's middle are polynomials of the
/// middle m and half the width r; what is left beside the chord is 0 at its ends and turns where F′ = β, at ±√(¼ − √(β/30)).
#[inline(always)]
fn fades<const N: usize>(ways: &[Reduced<N>; 3]) -> Terms<N, LANES> {
    let (mut m, mut r) = ([0.0; LANES], [0.0; LANES]);
    for k in 0..3 {
        (m[k], r[k]) = (ways[k].centre - 0.5, ways[k].radius());
    }
    let (mut centre, mut slope, mut error) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for k in 0..LANES {
        let (m, r) = (m[k], r[k]);
        let (m2, r2) = (m * m, r * r);
        let f = |u: f64| {
            let u2 = u * u;
            u * (1.875 + u2 * (6.0 * u2 - 5.0))
        };
        let flat = 0.25 - m2;
        let beta = 30.0 * flat * flat + r2 * (60.0 * m2 - 5.0 + 6.0 * r2);
        let beta = if beta > 0.0 { beta } else { 0.0 };
        let chord = f(m) + r2 * m * (60.0 * m2 - 15.0 + 30.0 * r2);
        let turn = 0.25 - (beta * (1.0 / 30.0)).sqrt();
        let turn = if turn > 0.0 { turn } else { 0.0 }.sqrt();
        let (above, beside) = (f(turn) - beta * turn, chord - beta * m);
        let (high, low) = (above - beside, -above - beside);
        let high = if (turn - m).abs() < r && high > 0.0 {
            high
        } else {
            0.0
        };
        let low = if (turn + m).abs() < r && low < 0.0 {
            low
        } else {
            0.0
        };
        centre[k] = 0.5 + chord + 0.5 * (low + high);
        slope[k] = beta;
        error[k] = 0.5 * (high - low);
    }
    let mut fades = Terms {
        centre,
        along: [[0.0; LANES]; N],
        error,
    };
    for k in 0..3 {
        for n in 0..N {
            fades.along[n][k] = slope[k] * ways[k].along[n];
        }
        fades.error[k] += slope[k] * ways[k].error;
    }
    fades
}

/// The sum of a cell's corners.
#[inline(always)]
fn in_cell<const N: usize>(
    corner: Corner,
    lattice: Lattice,
    cell: [f64; 3],
    at: &[Reduced<N>; 3],
) -> Reduced<N> {
    let mut ways = *at;
    for k in 0..3 {
        ways[k].centre -= cell[k];
    }
    let weights = fades(&ways);
    let [i, j, k] = cell;
    let first = [noise::split(i).0, noise::split(j).0, noise::split(k).0];
    let mut nodes = [0; CORNERS];
    for (node, upper) in nodes.iter_mut().zip(0u32..) {
        let [x, y, z] = first;
        let x = x.wrapping_add(upper & 1);
        let y = y.wrapping_add((upper >> 1) & 1);
        let z = z.wrapping_add(upper >> 2);
        *node = noise::node_hash(lattice, [x, y, z]);
    }
    let mut terms = Terms::<N, CORNERS>::NONE;
    let xi = all_parts(corner, nodes, &mut terms.centre);
    for (way, (xi, upper)) in ways.iter().zip(xi.iter().zip(&UPPER)) {
        for i in 0..CORNERS {
            terms.centre[i] += xi[i] * (way.centre - upper[i]);
            terms.error[i] += xi[i].abs() * way.error;
        }
        for (lanes, part) in terms.along.iter_mut().zip(way.along) {
            for i in 0..CORNERS {
                lanes[i] += xi[i] * part;
            }
        }
    }
    let [u, v, w] = [weights.get(0), weights.get(1), weights.get(2)];
    let squares: Terms<N, 4> = terms.joined(&w);
    let edges: Terms<N, 2> = squares.joined(&v);
    let sum: Terms<N, 1> = edges.joined(&u);
    sum.get(0)
}

/// ξ of the corners, and ξ₀ into `height`.
#[inline(always)]
fn all_parts(
    corner: Corner,
    nodes: [u32; CORNERS],
    height: &mut [f64; CORNERS],
) -> [[f64; CORNERS]; 3] {
    let mut xi = [[0.0; CORNERS]; 3];
    for i in 0..CORNERS {
        let own;
        (height[i], own) = parts(corner, nodes[i]);
        for k in 0..3 {
            xi[k][i] = own[k];
        }
    }
    xi
}

/// The planes that a number is near.
struct Planes<const N: usize> {
    /// The first, and the way from it.
    first: u32,
    way: Reduced<N>,
    count: usize,
    /// h of the way from each.
    profile: [Reduced<N>; PLANES],
}

impl<const N: usize> Planes<N> {
    /// `None` if there are too many.
    #[inline(always)]
    fn new(at: &Reduced<N>, span: &Interval) -> Option<Self> {
        let first = span.low.floor();
        let mut way = *at;
        way.centre -= first;
        let mut planes = Self {
            first: noise::split(first).0,
            count: 0,
            way,
            profile: [Reduced::point(0.0); PLANES],
        };
        let (low, high) = (span.low - first, span.high - first);
        let mut plane = 0.0;
        while plane < 2.0 || plane < high + 1.0 {
            let band = quintic_band(Interval::new(low - plane, high - plane));
            let mut along = way.along;
            for x in &mut along {
                *x *= band.alpha;
            }
            *planes.profile.get_mut(planes.count)? = Reduced {
                centre: band.alpha * (way.centre - plane) + band.beta,
                along,
                error: band.alpha.abs() * way.error + band.delta,
            };
            planes.count += 1;
            plane += 1.0;
        }
        Some(planes)
    }

    /// Σ h · term over them, thesis eqs. (5.20), (5.21).
    #[inline(always)]
    fn total(&self, term: impl Fn(u32, f64) -> Reduced<N>) -> Reduced<N> {
        let mut sum = Reduced::point(0.0);
        let (mut plane, mut from) = (self.first, self.way.centre);
        for h in &self.profile[..self.count] {
            let a = term(plane, from);
            sum.centre += h.centre * a.centre;
            for n in 0..N {
                sum.along[n] += h.centre * a.along[n] + h.along[n] * a.centre;
            }
            sum.error +=
                h.centre.abs() * a.error + a.centre.abs() * h.error + h.radius() * a.radius();
            plane = plane.wrapping_add(1);
            from -= 1.0;
        }
        sum
    }
}

/// The sum over the planes near a place that may be in several cells.
#[inline(always)]
fn over_cells<const N: usize>(
    corner: Corner,
    lattice: Lattice,
    at: &[Reduced<N>; 3],
    spans: &[Interval; 3],
) -> Option<Reduced<N>> {
    let x = Planes::new(&at[0], &spans[0])?;
    let y = Planes::new(&at[1], &spans[1])?;
    let z = Planes::new(&at[2], &spans[2])?;
    let ways = [&x.way, &y.way, &z.way];
    Some(x.total(
        #[inline(always)]
        |i, dx| {
            y.total(
                #[inline(always)]
                |j, dy| {
                    z.total(
                        #[inline(always)]
                        |k, dz| {
                            let hash = noise::node_hash(lattice, [i, j, k]);
                            let (height, xi) = parts(corner, hash);
                            let (mut along, mut error) = ([0.0; N], 0.0);
                            for (part, way) in xi.into_iter().zip(ways) {
                                for (sum, own) in along.iter_mut().zip(way.along) {
                                    *sum += part * own;
                                }
                                error += part.abs() * way.error;
                            }
                            Reduced {
                                centre: height + xi[0] * dx + xi[1] * dy + xi[2] * dz,
                                along,
                                error,
                            }
                        },
                    )
                },
            )
        },
    ))
}
