//! From samples to the coefficients of the B-spline that goes through them: one banded system per line and axis.

use super::stored;
use super::surface::Edges;

/// Replaces the samples by coefficients, axis by axis.
pub(super) fn coefficients(degree: u32, edges: Edges, sides: [usize; 3], values: &mut [f32]) {
    // The basis at a sample: a at its neighbours', b at its own.
    let (a, b) = match degree {
        2 => (1.0 / 8.0, 6.0 / 8.0),
        3 => (1.0 / 6.0, 4.0 / 6.0),
        _ => return,
    };
    let strides = [1, sides[0], sides[0] * sides[1]];
    for (axis, stride) in strides.into_iter().enumerate() {
        let side = sides[axis];
        if side == 1 {
            continue;
        }
        let solver = Solver::new(a, b, edges, side);
        let mut line = vec![0.0; side];
        for start in 0..values.len() {
            if !(start / stride).is_multiple_of(side) {
                continue;
            }
            for (i, value) in line.iter_mut().enumerate() {
                *value = f64::from(values[start + i * stride]);
            }
            solver.solve(&mut line);
            for (i, value) in line.iter().enumerate() {
                values[start + i * stride] = stored(*value);
            }
        }
    }
}

/// The system a cᵢ₋₁ + b cᵢ + a cᵢ₊₁ = fᵢ of one length, by elimination; diagonally dominant, so without pivots.
struct Solver {
    a: f64,
    /// a/b.
    ratio: f64,
    /// Superdiagonal and reciprocal pivots after elimination.
    upper: Vec<f64>,
    pivots: Vec<f64>,
    /// Of a ring: the solution for its correction, and what it is divided by.
    ring: Option<(Vec<f64>, f64)>,
}

impl Solver {
    fn new(a: f64, b: f64, edges: Edges, side: usize) -> Self {
        // A held edge's neighbour outside is the edge itself; a ring is cut open by Sherman and
        // Morrison's formula, with γ = −b: u = (−b, 0 … 0, a), v = (1, 0 … 0, −a/b).
        let (first, last) = match edges {
            Edges::Hold => (a + b, a + b),
            Edges::Repeat => (2.0 * b, b + a * a / b),
        };
        let (mut upper, mut pivots) = (Vec::with_capacity(side), Vec::with_capacity(side));
        let mut before = 0.0;
        for i in 0..side {
            let diagonal = match i {
                0 => first,
                i if i + 1 == side => last,
                _ => b,
            };
            let pivot = 1.0 / (diagonal - a * before);
            before = a * pivot;
            pivots.push(pivot);
            upper.push(before);
        }
        let mut solver = Self {
            a,
            ratio: a / b,
            upper,
            pivots,
            ring: None,
        };
        if edges == Edges::Repeat {
            let mut q = vec![0.0; side];
            q[0] = -b;
            q[side - 1] = a;
            solver.eliminate(&mut q);
            let by = 1.0 + q[0] - solver.ratio * q[side - 1];
            solver.ring = Some((q, by));
        }
        solver
    }

    fn solve(&self, line: &mut [f64]) {
        self.eliminate(line);
        if let Some((q, by)) = &self.ring {
            let last = line.len() - 1;
            // v·y, where v's last component is a/γ = −a/b.
            let share = (line[0] - self.ratio * line[last]) / by;
            for (value, q) in line.iter_mut().zip(q) {
                *value -= share * q;
            }
        }
    }

    fn eliminate(&self, line: &mut [f64]) {
        let mut before = 0.0;
        for (value, pivot) in line.iter_mut().zip(&self.pivots) {
            *value = (*value - self.a * before) * pivot;
            before = *value;
        }
        for i in (0..line.len() - 1).rev() {
            line[i] -= self.upper[i] * line[i + 1];
        }
    }
}
