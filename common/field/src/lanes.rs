//! Noise over the lanes of a batch: the loops that a SIMD level vectorises.

use fearless_simd::Simd;

use crate::cascade::Octave;
use crate::noise::{self, Lattice};
use crate::points::BATCH;

/// One number per lane.
pub(crate) type Lanes = [f64; BATCH];

/// Lattice cells and the offsets within them.
#[derive(Debug)]
pub(crate) struct Cells {
    cell: [[u32; BATCH]; 3],
    offset: [[f32; BATCH]; 3],
}

impl Cells {
    pub(crate) const fn new() -> Self {
        Self {
            cell: [[0; BATCH]; 3],
            offset: [[0.0; BATCH]; 3],
        }
    }

    #[inline(always)]
    fn set(&mut self, i: usize, at: [f64; 3]) {
        let [x, y, z] = at;
        (self.cell[0][i], self.offset[0][i]) = noise::split(x);
        (self.cell[1][i], self.offset[1][i]) = noise::split(y);
        (self.cell[2][i], self.offset[2][i]) = noise::split(z);
    }
}

/// Splits places into cells and offsets.
pub(crate) fn split<S: Simd>(simd: S, n: usize, [x, y, z]: [&Lanes; 3], cells: &mut Cells) {
    simd.vectorize(
        #[inline(always)]
        || {
            assert!(n <= BATCH);
            for i in 0..n {
                cells.set(i, [x[i], y[i], z[i]]);
            }
        },
    );
}

/// Splits the places where an octave looks into cells and offsets.
pub(crate) fn place<S: Simd>(
    simd: S,
    n: usize,
    octave: &Octave,
    [x, y, z]: [&Lanes; 3],
    cells: &mut Cells,
) {
    simd.vectorize(
        #[inline(always)]
        || {
            assert!(n <= BATCH);
            for i in 0..n {
                cells.set(i, octave.place([x[i], y[i], z[i]]));
            }
        },
    );
}

/// The noise of every cell and offset.
pub(crate) fn values<S: Simd>(
    simd: S,
    n: usize,
    lattice: Lattice,
    cells: &Cells,
    out: &mut [f32; BATCH],
) {
    simd.vectorize(
        #[inline(always)]
        || {
            assert!(n <= BATCH);
            let Cells {
                cell: [x, y, z],
                offset: [u, v, w],
            } = cells;
            for i in 0..n {
                out[i] = noise::value(lattice, [x[i], y[i], z[i]], [u[i], v[i], w[i]]);
            }
        },
    );
}

/// The noise of every cell and offset, and its gradient.
pub(crate) fn values_gradients<S: Simd>(
    simd: S,
    n: usize,
    lattice: Lattice,
    cells: &Cells,
    out: &mut [f32; BATCH],
    gradient: &mut [[f32; BATCH]; 3],
) {
    simd.vectorize(
        #[inline(always)]
        || {
            assert!(n <= BATCH);
            let Cells {
                cell: [x, y, z],
                offset: [u, v, w],
            } = cells;
            let [gx, gy, gz] = gradient;
            for i in 0..n {
                (out[i], [gx[i], gy[i], gz[i]]) =
                    noise::value_gradient(lattice, [x[i], y[i], z[i]], [u[i], v[i], w[i]]);
            }
        },
    );
}
