//! Every noise in any arithmetic: the sum of the kernels that a place or range touches, thesis eq. (4.1).
//!
//! What symbols a kernel makes are condensed when it is done: standard affine arithmetic inside a kernel, reduced
//! outside (thesis §5.3.3, §5.5). Gradient noise has `lattice` to itself; [`any`] does all the others.
//!
//! Ranges hold the exact noise and the one that is computed in f32. Where kernels are few, so are rounding errors:
//! scattered noises count those of the nodes in reach instead of the most that there can be.

pub(crate) mod cellular;
pub(crate) mod lattice;
pub(crate) mod line;
pub(crate) mod reduced;
mod scattered;
mod simplex;
mod wavelet;

use crate::interval::Interval;
use crate::noise::{self, Noise};
use crate::range::Arithmetic;

/// Beyond so many cells from the origin there are no offsets within cells.
const FAR: f64 = 1e15;

/// The rounding of three offsets to f32, as a distance.
pub(crate) const OFFSETS: f64 = 5.2e-8;

/// Room for f32 where it is asked whether a node is in reach.
const REACHED: f64 = 1e-6;

/// The noise at a place, by skewed coordinates if it is skewed.
pub(crate) fn any<T: Arithmetic>(noise: &Noise, at: [T; 3]) -> T {
    let range = noise.range();
    let sum = match noise {
        Noise::Lattice(corner, own) => T::kernels(*corner, *own, &at),
        Noise::Simplex(own) => simplex::sum(*own, &at),
        Noise::Sparse(sparse) => return scattered::sparse(sparse, &at, range),
        Noise::Spot(spot) => return scattered::spot(spot, &at, range),
        Noise::Wavelet(own) => wavelet::sum(*own, &at),
        Noise::Cellular(cellular) => cellular::sum(cellular, &at),
    };
    match sum {
        Some(sum) => sum
            .computed(noise.rounding() + noise.slope() * OFFSETS)
            .within(range),
        None => T::any(range),
    }
}

/// A place or range as cells see it.
pub(crate) struct Near<T> {
    /// The cell that everything is counted from.
    cell: [u32; 3],
    /// The way from its corner.
    ways: [T; 3],
    /// All values of that.
    spans: [Interval; 3],
    /// The first and the last cell that it touches, along each axis.
    first: [i32; 3],
    last: [i32; 3],
}

impl<T: Arithmetic> Near<T> {
    /// `None` if it is too far from the origin, or touches or neighbours (`reach` cells away) more than `cells_max` cells.
    pub(crate) fn new(at: &[T; 3], reach: i32, cells_max: i32) -> Option<Self> {
        let known = at.each_ref().map(T::range);
        let near = known
            .iter()
            .all(|span| span.low <= span.high && span.magnitude() < FAR);
        if !near {
            return None;
        }
        let corner = known.map(|span| span.low.floor());
        let ways = [0, 1, 2].map(|k| at[k].clone().minus(T::constant(corner[k])));
        let spans = ways.each_ref().map(T::range);
        if spans.iter().any(|span| span.width() > f64::from(cells_max)) {
            return None;
        }
        let first = spans.map(|span| whole(span.low));
        let last = spans.map(|span| whole(span.high));
        let cells: i32 = [0, 1, 2]
            .map(|k| last[k] - first[k] + 1 + 2 * reach)
            .into_iter()
            .product();
        (cells <= cells_max).then_some(Self {
            cell: corner.map(|corner| noise::split(corner).0),
            ways,
            spans,
            first,
            last,
        })
    }

    /// A cell's number on the lattice.
    fn cell(&self, step: [i32; 3]) -> [u32; 3] {
        [0, 1, 2].map(|k| self.cell[k].wrapping_add_signed(step[k]))
    }

    /// The cells within `reach` of those that it touches, along each axis.
    fn steps(&self, reach: i32) -> impl Iterator<Item = [i32; 3]> + use<T> {
        let (first, last) = (self.first, self.last);
        let along = move |k: usize| first[k] - reach..=last[k] + reach;
        along(2).flat_map(move |z| along(1).flat_map(move |y| along(0).map(move |x| [x, y, z])))
    }

    /// How near it may come to a cell, along each axis.
    fn gap(&self, step: [i32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| {
            let low = f64::from(step[k]);
            apart(self.spans[k], Interval::new(low, low + 1.0))
        })
    }

    /// How near it may come to a point, along each axis.
    fn least(&self, point: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| apart(self.spans[k], Interval::point(point[k])))
    }

    /// The way from a point of the cells' own coordinates.
    fn from(&self, point: [f64; 3]) -> [T; 3] {
        [0, 1, 2].map(|k| self.ways[k].clone().minus(T::constant(point[k])))
    }
}

/// The form, or some number of `range` where the form is much wider: over wide spans a band says less than an image.
fn unless_wide<T: Arithmetic>(form: T, range: Interval) -> T {
    if form.range().width() > 1.5 * range.width() {
        T::any(range)
    } else {
        form
    }
}

/// The least distance of two intervals.
fn apart(a: Interval, b: Interval) -> f64 {
    if a.low > b.high {
        a.low - b.high
    } else if b.low > a.high {
        b.low - a.high
    } else {
        0.0
    }
}

fn square([x, y, z]: [f64; 3]) -> f64 {
    x * x + y * y + z * z
}

/// The sum of three squares.
fn squares<T: Arithmetic>([x, y, z]: [T; 3]) -> T {
    x.square().plus(y.square()).plus(z.square())
}

/// Σ vᵢ dᵢ.
fn dot<T: Arithmetic>(v: [f64; 3], ways: &[T; 3]) -> T {
    let [x, y, z] = ways.clone();
    x.times(v[0]).plus(y.times(v[1])).plus(z.times(v[2]))
}

/// The whole number below; small, as the caller has seen.
#[expect(
    clippy::cast_possible_truncation,
    reason = "spans of ways are a few cells wide"
)]
fn whole(a: f64) -> i32 {
    a.floor() as i32
}
