//! Trivariate Bernstein polynomials over a box: free-form deformation, thesis §2.3.3 (Sederberg and Parry 1986).

use super::Refusal;
use super::within::{Known, Within};
use crate::interval::{Interval, larger};
use crate::number::Number;

/// Highest degree along an axis.
const DEGREE_MAX: usize = 8;

/// Σ cᵢⱼₖ Bᵢ(u) Bⱼ(v) Bₖ(w), where u, v and w go from 0 to 1 through the box and stay at 0 or 1 beyond it.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Bernstein {
    degrees: [usize; 3],
    min: [f64; 3],
    /// 1/width.
    inverse: [f64; 3],
    /// i fastest.
    values: Vec<f64>,
    known: Known,
}

impl Bernstein {
    /// From three degrees, the box's least and greatest corner, and the control values, i fastest.
    pub(crate) fn new(params: &[f64]) -> Result<Self, Refusal> {
        let [l, m, n, x0, y0, z0, x1, y1, z1, values @ ..] = params else {
            return Err(("degrees, a box and control values", 0.0));
        };
        let mut degrees = [0; 3];
        for (degree, &value) in degrees.iter_mut().zip([l, m, n]) {
            *degree = (1..=DEGREE_MAX)
                .find(|whole| u32::try_from(*whole).is_ok_and(|whole| f64::from(whole) == value))
                .ok_or(("degrees from 1 to 8", value))?;
        }
        let count: usize = degrees.iter().map(|degree| degree + 1).product();
        if values.len() != count {
            let given = u32::try_from(values.len()).unwrap_or(u32::MAX);
            return Err((
                "one control value for each point of its lattice",
                f64::from(given),
            ));
        }
        let (min, max) = ([*x0, *y0, *z0], [*x1, *y1, *z1]);
        let widths = [0, 1, 2].map(|k| max[k] - min[k]);
        if let Some(&width) = widths.iter().find(|width| **width < 1e-6) {
            return Err(("a box with its first corner below its second", width));
        }
        let inverse = widths.map(|width| 1.0 / width);
        Ok(Self {
            degrees,
            min,
            inverse,
            known: known(degrees, inverse, values),
            values: values.to_vec(),
        })
    }

    /// Its value.
    #[inline]
    pub(crate) fn value<N: Number>(&self, [x, y, z]: [N; 3]) -> N {
        let weights = |a: N, k: usize| {
            let share = a.minus(N::constant(self.min[k])).times(self.inverse[k]);
            weights(share.clamp01(), self.degrees[k])
        };
        let (x, y, z) = (weights(x, 0), weights(y, 1), weights(z, 2));
        let [l, m, n] = self.degrees;
        let mut rows = self.values.chunks_exact(l + 1);
        let mut sum = N::constant(0.0);
        for z in &z[..=n] {
            let mut layer = N::constant(0.0);
            for y in &y[..=m] {
                let mut row = N::constant(0.0);
                let values = rows.next().unwrap_or_default();
                for (x, value) in x.iter().zip(values) {
                    row = row.plus(x.clone().times(*value));
                }
                layer = layer.plus(row.mul(y.clone()));
            }
            sum = sum.plus(layer.mul(z.clone()));
        }
        sum
    }

    /// The same everywhere: it never leaves its control values, nor its slopes their differences.
    pub(crate) fn bound(&self, _: &Within) -> Known {
        self.known
    }
}

fn known(degrees: [usize; 3], inverse: [f64; 3], values: &[f64]) -> Known {
    let low = values
        .iter()
        .fold(f64::INFINITY, |a, b| if *b < a { *b } else { a });
    let high = values.iter().fold(f64::NEG_INFINITY, |a, b| larger(*b, a));
    let range = Interval::new(low, high);
    let rounding = 256.0 * f64::EPSILON * range.magnitude();
    let strides = [1, degrees[0] + 1, (degrees[0] + 1) * (degrees[1] + 1)];
    let steepest = [0, 1, 2].map(|axis| {
        let (stride, degree) = (strides[axis], degrees[axis]);
        let mut most = 0.0;
        for (at, value) in values.iter().enumerate() {
            if (at / stride) % (degree + 1) < degree {
                most = larger((values[at + stride] - value).abs(), most);
            }
        }
        let degree = f64::from(u32::try_from(degree).unwrap_or(u32::MAX));
        most * degree * inverse[axis]
    });
    let [x, y, z] = steepest;
    Known {
        range: range.expand(rounding),
        slope: (x * x + y * y + z * z).sqrt() * (1.0 + 1e-9),
        rounding,
    }
}

/// B₀ … B_degree at u.
#[inline]
fn weights<N: Number>(u: N, degree: usize) -> [N; DEGREE_MAX + 1] {
    let rest = N::constant(1.0).minus(u.clone());
    let mut list: [N; DEGREE_MAX + 1] = std::array::from_fn(|_| N::constant(0.0));
    list[0] = N::constant(1.0);
    for d in 1..=degree {
        for i in (0..=d).rev() {
            let stay = list[i].clone().mul(rest.clone());
            list[i] = if i > 0 {
                stay.plus(list[i - 1].clone().mul(u.clone()))
            } else {
                stay
            };
        }
    }
    list
}
