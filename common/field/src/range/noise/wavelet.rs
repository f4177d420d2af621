//! Wavelet noise in any arithmetic, thesis §4.6: a sum of quadratic B-splines, axis by axis.

use super::Near;
use crate::interval::Interval;
use crate::noise::Lattice;
use crate::noise::wavelet::coefficient_of;
use crate::range::Arithmetic;
use crate::range::function::Function;
use crate::range::profile::Profile;

/// Beyond so many coefficients the noise's range says as much as their sum.
const COEFFICIENTS_MAX: i32 = 125;

/// The exact noise; `None` where it is too far or too wide.
pub(super) fn sum<T: Arithmetic>(lattice: Lattice, at: &[T; 3]) -> Option<T> {
    let near = Near::new(at, 1, COEFFICIENTS_MAX)?;
    let [x, y, z] = [0, 1, 2].map(|k| {
        let steps = near.first[k] - 1..=near.last[k] + 1;
        let weights = steps.map(|step| {
            let way = near.ways[k]
                .clone()
                .minus(T::constant(f64::from(step) + 0.5));
            (step, way.apply(Function::Profile(Profile::Spline)))
        });
        weights.collect::<Vec<_>>()
    });
    let mut reached: Option<Interval> = None;
    // The weights are positive and add up to 1: no sum leaves the range of its coefficients.
    let mut sum = total(&z, |k| {
        total(&y, |j| {
            total(&x, |i| {
                let value = coefficient_of(lattice, near.cell([i, j, k]));
                let here = Interval::point(value);
                reached = Some(reached.map_or(here, |all| all.hull(here)));
                T::constant(value)
            })
        })
        .settled(at)
    })
    .settled(at);
    if let Some(reached) = reached {
        sum = sum.within(reached);
    }
    Some(sum)
}

/// Σ weight · term over the coefficients along an axis.
fn total<T: Arithmetic>(weights: &[(i32, T)], mut term: impl FnMut(i32) -> T) -> T {
    let mut sum: Option<T> = None;
    for (step, weight) in weights {
        let part = weight.clone().mul(term(*step));
        sum = Some(match sum {
            Some(sum) => sum.plus(part),
            None => part,
        });
    }
    sum.unwrap_or_else(|| T::constant(0.0))
}
