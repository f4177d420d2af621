//! Blobs bounded from below over pieces of straight rays, by a polynomial.
//!
//! No piece crosses the end of a support, so that every term is smooth there or 0. By Taylor's theorem about the piece's start
//!
//! h(u) ≤ h(v) + h′(v) (u − v) + ½ M (u − v)²,  M no less than h″ anywhere on the piece,
//!
//! which is a quartic of the way, for u is a quadratic of it. h = (1 − u)² is one itself: then nothing is lost.

use super::near::Near;
use crate::shape::kernel::Kernel;
use crate::shape::lanes::WIDTH;

/// One number per lane.
pub(super) type Row = [f64; WIDTH];

/// Roundings of one term, counted with much room.
pub(super) const ROUNDINGS: f64 = 256.0 * f64::EPSILON;

/// The share of a polynomial's largest coefficients by which subdividing it may go wrong.
const SUBDIVISION: f64 = 64.0 * f64::EPSILON;

/// Pieces of rays, one per lane, and the sum of the terms' bounds over each.
#[derive(Debug)]
pub(super) struct Pieces {
    /// Where they begin and end on their rays; at the same place where there is none.
    pub(super) begin: Row,
    pub(super) end: Row,
    /// The bounds' sum, by powers of u − v: constants, Bernstein coefficients of degree 2 but for the first, which is 0, and of degree 4.
    constant: Row,
    linear: [Row; 2],
    quartic: [Row; 5],
    /// What rounding may have made of it.
    room: Row,
}

impl Pieces {
    pub(super) fn new() -> Self {
        Self {
            begin: [0.0; WIDTH],
            end: [0.0; WIDTH],
            constant: [0.0; WIDTH],
            linear: [[0.0; WIDTH]; 2],
            quartic: [[0.0; WIDTH]; 5],
            room: [0.0; WIDTH],
        }
    }

    /// Forgets all terms.
    #[inline(always)]
    pub(super) fn clear(&mut self, kernel: Kernel) {
        self.quartic = [[0.0; WIDTH]; 5];
        if !kernel.is_parabola() {
            self.constant = [0.0; WIDTH];
            self.linear = [[0.0; WIDTH]; 2];
        }
        if !kernel.ends() {
            self.room = [0.0; WIDTH];
        }
    }

    /// Adds a term, along rays with those squares of their directions.
    #[inline(always)]
    pub(super) fn add(&mut self, kernel: Kernel, near: &Near, square: &Row) {
        let [quartic0, quartic1, quartic2, quartic3, quartic4] = &mut self.quartic;
        let [linear1, linear2] = &mut self.linear;
        for i in 0..WIDTH {
            let (begin, end) = (self.begin[i], self.end[i]);
            let counts = (near.entry[i] <= begin) & (end <= near.exit[i]);
            let weight = if counts { near.weight } else { 0.0 };
            let scale = square[i] * near.inverse;
            let (a, b) = (begin - near.middle[i], end - near.middle[i]);
            // The Bernstein coefficients of u.
            let turn = scale * a;
            let first = near.least[i] + turn * a;
            let middle = near.least[i] + turn * b;
            let last = near.least[i] + scale * b * b;
            let (v, bend) = if kernel.is_parabola() {
                (1.0, weight)
            } else {
                let passes = (a < 0.0) & (b > 0.0);
                let low = if passes {
                    near.least[i]
                } else {
                    least(first, last)
                };
                let high = most(first, last);
                let [value, slope, _] = kernel.jet(first);
                let adds = near.weight > 0.0;
                // What is taken off is bounded from below: by a tangent, or by the least value.
                let is_flat = !adds & !kernel.is_convex();
                let value = if is_flat { kernel.jet(high)[0] } else { value };
                let slope = if is_flat { 0.0 } else { slope };
                let bend = if adds {
                    kernel.bend_most(low, high)
                } else {
                    0.0
                };
                self.constant[i] += value * weight;
                let slope = -slope * weight;
                linear1[i] += slope * (first - middle);
                linear2[i] += slope * (first - last);
                if !kernel.ends() {
                    let size = 1.0 + high + scale * (a * (b - a)).abs();
                    self.room[i] += ROUNDINGS * weight.abs() * size * size;
                }
                (first, 0.5 * bend * weight)
            };
            let (p, q, r) = (v - first, v - middle, v - last);
            quartic0[i] += bend * (p * p);
            quartic1[i] += bend * (p * q);
            quartic2[i] += bend * ((2.0 * (q * q) + p * r) * (1.0 / 3.0));
            quartic3[i] += bend * (q * r);
            quartic4[i] += bend * (r * r);
        }
    }

    /// The Bernstein coefficients, over every lane's piece, of polynomials that are nowhere above `rest` less the terms; `share`
    /// is what multiplies a lane's own room for roundings.
    #[inline(always)]
    pub(super) fn below(&self, kernel: Kernel, rest: &Row, share: f64) -> [Row; 5] {
        let [linear1, linear2] = &self.linear;
        let [quartic0, quartic1, quartic2, quartic3, quartic4] = &self.quartic;
        let [mut c0, mut c1, mut c2, mut c3, mut c4] = [[0.0; WIDTH]; 5];
        for i in 0..WIDTH {
            let (p, q, r) = (quartic0[i], quartic1[i], quartic2[i]);
            let (s, t) = (quartic3[i], quartic4[i]);
            let sizes = rest[i].abs() + (p.abs() + q.abs() + r.abs() + s.abs() + t.abs());
            let mut rest = rest[i] - SUBDIVISION * sizes;
            if kernel.is_parabola() {
                (c0[i], c1[i], c2[i], c3[i], c4[i]) =
                    (rest - p, rest - q, rest - r, rest - s, rest - t);
            } else {
                let (b, c, constant) = (linear1[i], linear2[i], self.constant[i]);
                rest -= SUBDIVISION * (constant.abs() + (b.abs() + c.abs()));
                rest -= constant;
                if !kernel.ends() {
                    rest -= share * self.room[i];
                }
                c0[i] = rest - p;
                c1[i] = rest - (0.5 * b + q);
                c2[i] = rest - ((4.0 * b + c) * (1.0 / 6.0) + r);
                c3[i] = rest - (0.5 * (b + c) + s);
                c4[i] = rest - (c + t);
            }
        }
        [c0, c1, c2, c3, c4]
    }
}

#[inline(always)]
pub(super) fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
