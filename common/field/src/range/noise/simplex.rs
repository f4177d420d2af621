//! Simplex noise in any arithmetic, thesis §4.3.2, by skewed coordinates.

use super::lattice::along;
use super::{Near, REACHED, squares};
use crate::noise::Lattice;
use crate::noise::gradient_of;
use crate::noise::simplex::corner;
use crate::range::Arithmetic;
use crate::range::function::Function;
use crate::range::profile::Profile;

/// Beyond so many cells the noise's range says as much as the sum.
const CELLS_MAX: i32 = 125;

/// The exact noise; `None` where it is too far or too wide.
///
/// A corner's kernel ends before it leaves the tetrahedra around the corner: it is within 1 along every skewed axis.
pub(super) fn sum<T: Arithmetic>(lattice: Lattice, at: &[T; 3]) -> Option<T> {
    let near = Near::new(at, 1, CELLS_MAX)?;
    let mut sum: Option<T> = None;
    for step in near.steps(1) {
        let from = step.map(f64::from);
        if near.least(from).into_iter().any(|gap| gap > 1.0 + REACHED) {
            continue;
        }
        let skewed = near.from(from);
        let [x, y, z] = skewed.clone();
        let back = x.plus(y).plus(z).times(1.0 / 6.0);
        let d = skewed.map(|part| part.minus(back.clone()));
        let q = squares(d.clone());
        if q.range().low > 0.5 + REACHED {
            continue;
        }
        let [x, y, z] = &d;
        let xi = gradient_of(corner(lattice, near.cell(step)));
        let Some(slope) = along(xi, [x, y, z]) else {
            continue;
        };
        let part = q
            .apply(Function::Profile(Profile::Simplex))
            .mul(slope)
            .settled(at);
        sum = Some(match sum.take() {
            Some(sum) => sum.plus(part),
            None => part,
        });
    }
    Some(sum.unwrap_or_else(|| T::constant(0.0)).settled(at))
}
