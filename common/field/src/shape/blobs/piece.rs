//! Blobs bounded from below over a piece of a straight line, by a polynomial.
//!
//! Along a line u = (d/r)² is a quadratic of the way, and by Taylor's theorem
//!
//! h(u) ≤ h(v) + h′(v) (u − v) + ½ M (u − v)²,  M no less than h″ anywhere on the piece,
//!
//! which is a quartic of the way. Where the support ends on the piece, v = 1 and both h and h′ are 0 there;
//! then max(0, 1 − u) takes the place of 1 − u, by its Bernstein coefficients: those of 1 − u that are
//! negative become 0, which raises the polynomial. For h = (1 − u)² all of this is exact but for that.

use super::Point;
use crate::shape::kernel::Kernel;
use crate::shape::lanes::WIDTH;

/// One number per lane.
pub(super) type Row = [f64; WIDTH];

/// Roundings of one term, counted with much room.
const ROUNDINGS: f64 = 256.0 * f64::EPSILON;

/// The share of a polynomial's largest coefficients by which subdividing it may go wrong.
const SUBDIVISION: f64 = 64.0 * f64::EPSILON;

/// Pieces of lines, one per lane, and the sum of the terms' bounds over each.
pub(super) struct Pieces {
    /// Where they begin.
    pub(super) at: [Row; 3],
    pub(super) direction: [Row; 3],
    pub(super) length: Row,
    /// ‖direction‖² and its inverse.
    pub(super) square: Row,
    pub(super) inverse: Row,
    /// The bounds' sum, by powers of u − v: constants, Bernstein coefficients of degree 2 and of degree 4.
    constant: Row,
    linear: [Row; 3],
    quartic: [Row; 5],
    /// What rounding may have made of it.
    room: Row,
}

impl Pieces {
    pub(super) fn new() -> Self {
        Self {
            at: [[0.0; WIDTH]; 3],
            direction: [[0.0; WIDTH]; 3],
            length: [0.0; WIDTH],
            square: [0.0; WIDTH],
            inverse: [0.0; WIDTH],
            constant: [0.0; WIDTH],
            linear: [[0.0; WIDTH]; 3],
            quartic: [[0.0; WIDTH]; 5],
            room: [0.0; WIDTH],
        }
    }

    /// Forgets all terms.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.constant = [0.0; WIDTH];
        self.linear = [[0.0; WIDTH]; 3];
        self.quartic = [[0.0; WIDTH]; 5];
        self.room = [0.0; WIDTH];
    }

    /// Adds a term; `size` is the greatest coordinate that its places were computed from.
    #[inline(always)]
    pub(super) fn add(&mut self, kernel: Kernel, point: &Point, size: f64) {
        let Point {
            centre,
            radius,
            weight,
            inverse,
        } = *point;
        let roundings = ROUNDINGS * weight.abs() * (1.0 + size / radius);
        let adds = weight > 0.0;
        let ([x, y, z], [dx, dy, dz]) = (&self.at, &self.direction);
        let [linear0, linear1, linear2] = &mut self.linear;
        let [quartic0, quartic1, quartic2, quartic3, quartic4] = &mut self.quartic;
        for i in 0..WIDTH {
            let (x, y, z) = (x[i] - centre[0], y[i] - centre[1], z[i] - centre[2]);
            let (square, length) = (self.square[i], self.length[i]);
            let along = x * dx[i] + y * dy[i] + z * dz[i];
            let first = (x * x + y * y + z * z) * inverse;
            // The Bernstein coefficients of u, and its least and greatest values.
            let half = along * length * inverse;
            let turn = square * length * length * inverse;
            let middle = first + half;
            let last = middle + half + turn;
            let passes = (half < 0.0) & (half + turn > 0.0);
            let nearest = first - along * along * self.inverse[i] * inverse;
            let ends = least(first, last);
            let low = if passes { nearest } else { ends };
            let high = most(first, last);
            let crosses = kernel.ends() & (high >= 1.0);
            let v = if crosses { 1.0 } else { first };
            let [value, slope, _] = kernel.jet(v);
            // What is taken off is bounded from below: by a tangent, or by the least value.
            let is_flat = !adds & !kernel.is_convex();
            let value = if is_flat { kernel.jet(high)[0] } else { value };
            let slope = if is_flat { 0.0 } else { slope };
            let bend = if adds {
                kernel.bend_most(low, high)
            } else {
                0.0
            };
            let (p, q, r) = (v - first, v - middle, v - last);
            let p = if crosses { most(p, 0.0) } else { p };
            let q = if crosses { most(q, 0.0) } else { q };
            let r = if crosses { most(r, 0.0) } else { r };
            let (slope, bend) = (-slope * weight, 0.5 * bend * weight);
            self.constant[i] += value * weight;
            linear0[i] += slope * p;
            linear1[i] += slope * q;
            linear2[i] += slope * r;
            quartic0[i] += bend * (p * p);
            quartic1[i] += bend * (p * q);
            quartic2[i] += bend * ((2.0 * (q * q) + p * r) * (1.0 / 3.0));
            quartic3[i] += bend * (q * r);
            quartic4[i] += bend * (r * r);
            let size = 1.0 + high + half.abs();
            self.room[i] += roundings * size * size;
        }
    }

    /// The Bernstein coefficients, over every lane's piece, of polynomials that are nowhere above `threshold`
    /// less an offset and the terms.
    #[inline(always)]
    pub(super) fn below(&self, threshold: f64, offset: &Row) -> [Row; 5] {
        let [linear0, linear1, linear2] = &self.linear;
        let [quartic0, quartic1, quartic2, quartic3, quartic4] = &self.quartic;
        let [mut c0, mut c1, mut c2, mut c3, mut c4] = [[0.0; WIDTH]; 5];
        for i in 0..WIDTH {
            let (a, b, c) = (linear0[i], linear1[i], linear2[i]);
            let (p, q, r) = (quartic0[i], quartic1[i], quartic2[i]);
            let (s, t) = (quartic3[i], quartic4[i]);
            let constant = self.constant[i];
            let sizes = threshold.abs()
                + constant.abs()
                + (a.abs() + b.abs() + c.abs())
                + (p.abs() + q.abs() + r.abs() + s.abs() + t.abs());
            let room = self.room[i] + SUBDIVISION * sizes;
            let rest = threshold - offset[i] - constant - room;
            c0[i] = rest - (a + p);
            c1[i] = rest - (0.5 * (a + b) + q);
            c2[i] = rest - ((a + 4.0 * b + c) * (1.0 / 6.0) + r);
            c3[i] = rest - (0.5 * (b + c) + s);
            c4[i] = rest - (c + t);
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
