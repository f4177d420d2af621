//! A grid as a function: values, derivatives, and bounds of both.

use super::basis::{Order, Taps, first, taps};
use super::pyramid::Pyramid;
use super::{Samples, filter};
use crate::interval::{Interval, larger};

/// Rounding errors of one evaluation, relative to the largest coefficient: sums of at most 64 products, twice over.
const ROUNDING: f64 = 256.0 * f64::EPSILON;

/// What a grid is beyond its last samples.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Edges {
    /// The same again: it is periodic, and the sample after the last is the first.
    Repeat,
    /// What it is at its edge: it is bounded, and constant outward.
    Hold,
}

impl Edges {
    /// The edges of that number among a node's parameters.
    pub fn from_number(number: f64) -> Option<Self> {
        [Self::Repeat, Self::Hold]
            .into_iter()
            .find(|edges| edges.number() == number)
    }

    /// The number that stands for them.
    pub fn number(self) -> f64 {
        match self {
            Self::Repeat => 0.0,
            Self::Hold => 1.0,
        }
    }

    /// The sample that stands at `i`.
    fn sample(self, i: i64, side: usize) -> usize {
        let side = i64::try_from(side).unwrap_or(i64::MAX);
        let inside = match self {
            Self::Repeat => i.rem_euclid(side),
            Self::Hold => i.clamp(0, side - 1),
        };
        usize::try_from(inside).unwrap_or(0)
    }

    /// The samples that stand from `from` to `to`, as at most two runs.
    fn runs(self, from: i64, to: i64, side: usize) -> [Option<[usize; 2]>; 2] {
        let last = side - 1;
        let (a, b) = (self.sample(from, side), self.sample(to, side));
        let whole = to.saturating_sub(from) >= i64::try_from(last).unwrap_or(i64::MAX);
        match self {
            Self::Hold => [Some([a, b]), None],
            Self::Repeat if whole => [Some([0, last]), None],
            Self::Repeat if a <= b => [Some([a, b]), None],
            Self::Repeat => [Some([0, b]), Some([a, last])],
        }
    }
}

/// A tensor-product B-spline through samples.
#[derive(Clone, PartialEq, Debug)]
pub struct Surface {
    degree: u32,
    edges: Edges,
    sides: [usize; 3],
    coefficients: Vec<f32>,
    pyramid: Pyramid,
}

/// Value, gradient and Hessian at a place.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Bent {
    pub(crate) value: f64,
    pub(crate) gradient: [f64; 3],
    pub(crate) hessian: [[f64; 3]; 3],
}

impl Surface {
    /// The spline of that degree, 1 to 3, through the samples. Costs a few passes over them.
    pub fn new(samples: &Samples, degree: u32, edges: Edges) -> Self {
        let degree = degree.clamp(1, 3);
        let sides = samples.sides();
        let mut coefficients = samples.values().to_vec();
        filter::coefficients(degree, edges, sides, &mut coefficients);
        let pyramid = Pyramid::new(edges, sides, &coefficients);
        Self {
            degree,
            edges,
            sides,
            coefficients,
            pyramid,
        }
    }

    /// How many axes it depends on.
    fn axes(&self) -> usize {
        if self.sides[2] == 1 { 2 } else { 3 }
    }

    fn sum(&self, [x, y, z]: [&Taps; 3]) -> f64 {
        let count = self.degree as usize + 1;
        let layers = if self.axes() == 2 { 1 } else { count };
        let place = |taps: &Taps, axis: usize| {
            let mut places = [0; 4];
            for (k, place) in (0i64..).zip(&mut places) {
                *place = self
                    .edges
                    .sample(taps.first.saturating_add(k), self.sides[axis]);
            }
            places
        };
        let (columns, rows, sheets) = (place(x, 0), place(y, 1), place(z, 2));
        let mut sum = 0.0;
        for (sheet, w) in sheets.iter().zip(z.weights).take(layers) {
            let mut rows_sum = 0.0;
            for (row, v) in rows.iter().zip(y.weights).take(count) {
                let start = (sheet * self.sides[1] + row) * self.sides[0];
                let mut row_sum = 0.0;
                for (column, u) in columns.iter().zip(x.weights).take(count) {
                    row_sum += u * f64::from(self.coefficients[start + column]);
                }
                rows_sum += v * row_sum;
            }
            sum += w * rows_sum;
        }
        sum
    }

    fn taps(&self, order: Order, axis: usize, at: f64) -> Taps {
        if axis < self.axes() {
            return taps(self.degree, order, at);
        }
        let weight = if order == Order::Value { 1.0 } else { 0.0 };
        Taps {
            first: 0,
            weights: [weight, 0.0, 0.0, 0.0],
        }
    }

    /// The value at a place.
    pub fn value(&self, at: [f64; 3]) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|axis| self.taps(Order::Value, axis, at[axis]));
        self.sum([&x, &y, &z])
    }

    /// The value, to the bit, and the gradient.
    pub fn value_gradient(&self, at: [f64; 3]) -> (f64, [f64; 3]) {
        let [x, y, z] = [0, 1, 2].map(|axis| self.taps(Order::Value, axis, at[axis]));
        let [u, v, w] = [0, 1, 2].map(|axis| self.taps(Order::Slope, axis, at[axis]));
        let value = self.sum([&x, &y, &z]);
        let rise = if self.axes() == 2 {
            0.0
        } else {
            self.sum([&x, &y, &w])
        };
        (
            value,
            [self.sum([&u, &y, &z]), self.sum([&x, &v, &z]), rise],
        )
    }

    /// The value, to the bit, and all derivatives of first and second order.
    pub(crate) fn bent(&self, at: [f64; 3]) -> Bent {
        let order = |order| [0, 1, 2].map(|axis| self.taps(order, axis, at[axis]));
        let (plain, slope, bend) = (order(Order::Value), order(Order::Slope), order(Order::Bend));
        let (value, gradient) = self.value_gradient(at);
        let mut hessian = [[0.0; 3]; 3];
        let axes = self.axes();
        for (i, row) in hessian.iter_mut().enumerate().take(axes) {
            for (j, entry) in row.iter_mut().enumerate().take(axes) {
                let pick = |axis: usize| match (axis == i, axis == j) {
                    (true, true) => &bend[axis],
                    (false, false) => &plain[axis],
                    _ => &slope[axis],
                };
                *entry = self.sum([pick(0), pick(1), pick(2)]);
            }
        }
        Bent {
            value,
            gradient,
            hessian,
        }
    }

    /// All values over a box of places, rounding included, and all slopes along each axis.
    pub fn over(&self, at: [Interval; 3]) -> (Interval, [Interval; 3]) {
        // Before its first sample a held grid is level, which no difference of samples says.
        let mut level = [false; 3];
        let runs = [0, 1, 2].map(|axis| {
            let side = self.sides[axis];
            if axis >= self.axes() {
                return [Some([0, 0]), None];
            }
            let Interval { low, high } = at[axis];
            if low.is_nan() || high.is_nan() {
                return [Some([0, side - 1]), None];
            }
            let from = first(self.degree, low).0;
            let to = first(self.degree, high).0;
            level[axis] = self.edges == Edges::Hold && from < 0;
            self.edges
                .runs(from, to.saturating_add(i64::from(self.degree)), side)
        });
        let none = Interval::new(f64::INFINITY, f64::NEG_INFINITY);
        let mut all = [none; 4];
        for x in runs[0].into_iter().flatten() {
            for y in runs[1].into_iter().flatten() {
                for z in runs[2].into_iter().flatten() {
                    let known = self.pyramid.over([x[0], y[0], z[0]], [x[1], y[1], z[1]]);
                    for (all, known) in all.iter_mut().zip(known) {
                        let known = Interval::new(known.low.into(), known.high.into());
                        *all = all.hull(known);
                    }
                }
            }
        }
        let [range, x, y, z] = all;
        let blur = self.blur(range);
        let zero = Interval::point(0.0);
        let steep = |axis: usize, slopes: Interval| {
            let slopes = if level[axis] {
                slopes.hull(zero)
            } else {
                slopes
            };
            slopes.expand(2.0 * blur)
        };
        (
            range.expand(blur),
            [
                steep(0, x),
                steep(1, y),
                if self.axes() == 2 { zero } else { steep(2, z) },
            ],
        )
    }

    /// How far computed values may be from exact ones where coefficients lie in `range`.
    pub(crate) fn blur(&self, range: Interval) -> f64 {
        ROUNDING * range.magnitude()
    }

    /// The steepest slope in any direction, given those along the axes.
    pub(crate) fn steepest(slopes: [Interval; 3]) -> f64 {
        let [x, y, z] = slopes.map(Interval::magnitude);
        larger((x * x + y * y + z * z).sqrt() * (1.0 + 1e-12), 0.0)
    }
}
