//! Noises over the lanes of a batch. Every lane is computed by the same code at every SIMD level.
//!
//! Gradient noise has loops of its own. The other lattice noises have no branches and their loops become vectors; those with scattered nodes look into
//! other cells at every place, so they run lane by lane.

use fearless_simd::Simd;

use super::jet::{Jet, Jet2, Real};
use super::kind::Noise;
use super::lattice::{self, Corner};
use super::simplex;
use crate::lanes::Cells;
use crate::points::BATCH;

/// The noise of every cell and offset.
pub(crate) fn values<S: Simd>(
    simd: S,
    n: usize,
    noise: &Noise,
    cells: &Cells,
    out: &mut [f32; BATCH],
) {
    each(simd, n, noise, cells, |i, value: f32| out[i] = value);
}

/// The noise of every cell and offset, and its gradient.
pub(crate) fn values_gradients<S: Simd>(
    simd: S,
    n: usize,
    noise: &Noise,
    cells: &Cells,
    out: &mut [f32; BATCH],
    gradient: &mut [[f32; BATCH]; 3],
) {
    let [x, y, z] = gradient;
    each(
        simd,
        n,
        noise,
        cells,
        #[inline(always)]
        |i, jet: Jet| {
            out[i] = jet.value;
            [x[i], y[i], z[i]] = jet.gradient;
        },
    );
}

/// The component of the noise's gradient along an axis, for every cell and offset.
pub(crate) fn slopes(n: usize, noise: &Noise, axis: usize, cells: &Cells, out: &mut [f32; BATCH]) {
    assert!(n <= BATCH);
    for (i, out) in out[..n].iter_mut().enumerate() {
        *out = noise.jet(cells.cell_at(i), cells.offset_at(i)).gradient[axis];
    }
}

/// The component of the noise's gradient along an axis, and that component's own gradient: a row of the Hessian (4.3).
pub(crate) fn slopes_gradients(
    n: usize,
    noise: &Noise,
    axis: usize,
    cells: &Cells,
    out: &mut [f32; BATCH],
    gradient: &mut [[f32; BATCH]; 3],
) {
    let [x, y, z] = gradient;
    assert!(n <= BATCH);
    for i in 0..n {
        let jet: Jet2 = noise.jet2(cells.cell_at(i), cells.offset_at(i));
        out[i] = jet.gradient[axis];
        [x[i], y[i], z[i]] = jet.row(axis);
    }
}

/// Hands every lane's noise to `set`.
#[inline(always)]
fn each<S: Simd, R: Lane>(
    simd: S,
    n: usize,
    noise: &Noise,
    cells: &Cells,
    mut set: impl FnMut(usize, R),
) {
    assert!(n <= BATCH);
    macro_rules! vector {
        ($at:expr) => {
            simd.vectorize(
                #[inline(always)]
                || {
                    for i in 0..n {
                        set(i, $at(cells.cell_at(i), cells.offset_at(i)));
                    }
                },
            )
        };
    }
    match noise {
        Noise::Lattice(Corner::Value, own) => {
            vector!(|cell, offset| lattice::at(Corner::Value, *own, cell, offset));
        }
        Noise::Lattice(Corner::ValueGradient, own) => {
            vector!(|cell, offset| lattice::at(Corner::ValueGradient, *own, cell, offset));
        }
        Noise::Simplex(own) => vector!(|cell, offset| simplex::at(*own, cell, offset)),
        scattered => {
            for i in 0..n {
                set(
                    i,
                    R::scattered(scattered, cells.cell_at(i), cells.offset_at(i)),
                );
            }
        }
    }
}

/// What a lane is asked for.
trait Lane: Real {
    /// One place of a noise with scattered nodes; compiled once, not once per SIMD level.
    fn scattered(noise: &Noise, cell: [u32; 3], offset: [f32; 3]) -> Self;
}

impl Lane for f32 {
    #[inline(never)]
    fn scattered(noise: &Noise, cell: [u32; 3], offset: [f32; 3]) -> Self {
        noise.value(cell, offset)
    }
}

impl Lane for Jet {
    #[inline(never)]
    fn scattered(noise: &Noise, cell: [u32; 3], offset: [f32; 3]) -> Self {
        noise.jet(cell, offset)
    }
}
