//! Noise over the lanes of a batch: the loops that a SIMD level vectorises.

use std::ops::{Deref, DerefMut};

use fearless_simd::Simd;

use crate::cascade::Octave;
use crate::noise::{self, Lattice};
use crate::points::BATCH;

/// One number per lane.
pub(crate) type Lanes = [f64; BATCH];

/// What begins where a cache line does, as rows of lanes do here and in the renderer: a vector that lies across two lines is
/// loaded twice.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Aligned<T>(pub(crate) T);

impl<T> Deref for Aligned<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T> DerefMut for Aligned<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.0
    }
}

/// Lattice cells, the offsets within them, and room for the hashes of their corners.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Cells {
    cell: [[u32; BATCH]; 3],
    offset: [[f32; BATCH]; 3],
    corners: [[u32; BATCH]; 8],
}

impl Cells {
    pub(crate) const fn new() -> Self {
        Self {
            cell: [[0; BATCH]; 3],
            offset: [[0.0; BATCH]; 3],
            corners: [[0; BATCH]; 8],
        }
    }

    #[inline(always)]
    fn set(&mut self, i: usize, at: [f64; 3]) {
        let [x, y, z] = at;
        (self.cell[0][i], self.offset[0][i]) = noise::split(x);
        (self.cell[1][i], self.offset[1][i]) = noise::split(y);
        (self.cell[2][i], self.offset[2][i]) = noise::split(z);
    }

    /// Hashing and interpolating in two loops keeps both within the machine's registers.
    #[inline(always)]
    fn hash(&mut self, n: usize, lattice: Lattice) {
        let [x, y, z] = &self.cell;
        let [a, b, c, d, e, f, g, h] = &mut self.corners;
        for i in 0..n {
            let hashes = noise::corners(lattice, [x[i], y[i], z[i]]);
            [a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]] = hashes;
        }
    }

    #[inline(always)]
    fn corners_at(&self, i: usize) -> [u32; 8] {
        let [a, b, c, d, e, f, g, h] = &self.corners;
        [a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i]]
    }

    /// The cell of a lane.
    #[inline(always)]
    pub(crate) fn cell_at(&self, i: usize) -> [u32; 3] {
        let [x, y, z] = &self.cell;
        [x[i], y[i], z[i]]
    }

    /// The offset of a lane within its cell.
    #[inline(always)]
    pub(crate) fn offset_at(&self, i: usize) -> [f32; 3] {
        let [x, y, z] = &self.offset;
        [x[i], y[i], z[i]]
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
    cells: &mut Cells,
    out: &mut [f32; BATCH],
) {
    simd.vectorize(
        #[inline(always)]
        || {
            assert!(n <= BATCH);
            cells.hash(n, lattice);
            for (i, out) in out[..n].iter_mut().enumerate() {
                *out = noise::value(cells.corners_at(i), cells.offset_at(i));
            }
        },
    );
}

/// The noise of every cell and offset, and its gradient.
pub(crate) fn values_gradients<S: Simd>(
    simd: S,
    n: usize,
    lattice: Lattice,
    cells: &mut Cells,
    out: &mut [f32; BATCH],
    [gx, gy, gz]: [&mut [f32; BATCH]; 3],
) {
    simd.vectorize(
        #[inline(always)]
        || {
            assert!(n <= BATCH);
            cells.hash(n, lattice);
            for i in 0..n {
                let (corners, offset) = (cells.corners_at(i), cells.offset_at(i));
                let mean = noise::mean_gradient(corners, offset);
                let (value, bend) = noise::value_bend(corners, offset);
                out[i] = value;
                [gx[i], gy[i], gz[i]] = [mean[0] + bend[0], mean[1] + bend[1], mean[2] + bend[2]];
            }
        },
    );
}

/// The noise of every cell and offset, and its derivative along a direction of each lane's own.
pub(crate) fn values_along<S: Simd>(
    simd: S,
    n: usize,
    lattice: Lattice,
    cells: &mut Cells,
    [p, q, r]: &[[f32; BATCH]; 3],
    out: &mut [f32; BATCH],
    slope: &mut [f32; BATCH],
) {
    simd.vectorize(
        #[inline(always)]
        || {
            assert!(n <= BATCH);
            cells.hash(n, lattice);
            for i in 0..n {
                (out[i], slope[i]) =
                    noise::value_along(cells.corners_at(i), cells.offset_at(i), [p[i], q[i], r[i]]);
            }
        },
    );
}
