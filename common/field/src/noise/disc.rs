//! A Poisson-disc distribution of node points without end: one periodic tile, thesis §4.4 ("a Poisson-disc variant" is future work there).
//!
//! Nodes of a disc distribution cannot be drawn cell by cell, for each must know its neighbours. So one tile of 8³
//! cells is filled once by throwing darts, around its borders too, and repeated; every lattice shifts it by its key.
//! Only the nodes' *places* repeat: their heights come from the hash of the full cell, so the noise does not, and
//! with independent heights of mean 0 its spectrum is η|ĥ|² (4.15) as with Poisson's nodes.

use std::sync::OnceLock;

use super::gradient::Lattice;
use super::node::fraction;
use super::sparse::Kernel;
use crate::hash;

/// Cells of the tile along an axis; a power of two.
const SIDE: usize = 8;

/// No two nodes are nearer, in cells.
pub(crate) const APART: f32 = 0.8;

/// The most nodes within a distance of 1 from any place: balls of radius 0.4 about them do not overlap and lie
/// within one of radius 1.4, so there are fewer than 3.5³ = 42.9.
pub(crate) const NEAR_MAX: f64 = 42.0;

/// The nodes of one tile by cell.
#[derive(Debug)]
pub(crate) struct Tile {
    nodes: Vec<[f32; 3]>,
    /// Where each cell's nodes begin, and the end.
    starts: Vec<usize>,
}

impl Tile {
    /// The one tile; made when it is first asked for, always the same.
    pub(crate) fn shared() -> &'static Self {
        static TILE: OnceLock<Tile> = OnceLock::new();
        TILE.get_or_init(Self::new)
    }

    fn new() -> Self {
        /// Fills 0.27 of space with balls, well below the 0.38 where no dart finds room.
        const COUNT: usize = SIDE * SIDE * SIDE;
        #[expect(clippy::cast_possible_truncation, reason = "it is 8")]
        const CELLS: u32 = SIDE as u32;
        let mut cells: Vec<Vec<[f32; 3]>> = vec![Vec::new(); COUNT];
        let (mut placed, mut dart) = (0, 0u32);
        while placed < COUNT {
            dart += 1;
            let cell = [0, 1, 2].map(|axis| hash::hash(&[dart, axis]) % CELLS);
            let node = [3, 4, 5].map(|axis| fraction(hash::hash(&[dart, axis])));
            let clear = super::node::NEAR.into_iter().all(|step| {
                let near = super::node::neighbour(cell, step);
                cells[index(near)].iter().all(|other| {
                    let d = [0, 1, 2].map(|k| other[k] + f32::from(step[k]) - node[k]);
                    d[0] * d[0] + d[1] * d[1] + d[2] * d[2] >= APART * APART
                })
            });
            if clear {
                cells[index(cell)].push(node);
                placed += 1;
            }
        }
        let mut starts = vec![0];
        let mut nodes = Vec::with_capacity(COUNT);
        for cell in cells {
            nodes.extend(cell);
            starts.push(nodes.len());
        }
        Self { nodes, starts }
    }

    /// The nodes of a cell of that lattice, as places within it.
    #[inline(always)]
    pub(crate) fn nodes(&self, lattice: Lattice, [x, y, z]: [u32; 3]) -> &[[f32; 3]] {
        let shift = lattice.start();
        let at = index([
            x.wrapping_add(shift),
            y.wrapping_add(shift >> 3),
            z.wrapping_add(shift >> 6),
        ]);
        self.list(at)
    }

    #[inline(always)]
    fn list(&self, at: usize) -> &[[f32; 3]] {
        &self.nodes[self.starts[at]..self.starts[at + 1]]
    }

    /// The nodes of a cell of the tile itself.
    #[cfg(test)]
    pub(super) fn at(&self, cell: [u32; 3]) -> &[[f32; 3]] {
        self.list(index(cell))
    }
}

/// The place of a cell in the tile; the tile repeats.
#[inline(always)]
fn index([x, y, z]: [u32; 3]) -> usize {
    let wrap = |a: u32| a as usize % SIDE;
    (wrap(z) * SIDE + wrap(y)) * SIDE + wrap(x)
}

impl Kernel {
    /// The most that Σ h is anywhere in the tile.
    pub(super) fn disc_range(self) -> f64 {
        match self {
            Self::Lewis => 1.8,
            Self::Quintic => 1.75,
            Self::Linear => 2.08,
        }
    }

    /// The most that Σ |h′| is anywhere in the tile.
    pub(super) fn disc_slope(self) -> f64 {
        match self {
            Self::Lewis => 7.95,
            Self::Quintic => 8.2,
            Self::Linear => 11.0,
        }
    }
}
