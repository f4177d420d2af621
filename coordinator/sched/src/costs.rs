//! What the parts of a job's images cost, as far as it was measured.
//!
//! A *cost* is the time that one thread of a worker of speed 1 takes, in microseconds. Images
//! of a flyby resemble their neighbours, so the newest time of each grid
//! square, from whichever image, is what the next image is expected to take there.

use alloc::vec;
use alloc::vec::Vec;

use model::Rect;
use model::rect::GRID_SQUARE;

use crate::region::Region;
use crate::tiling::TileGrid;

/// Pixels of a whole grid square.
const SQUARE_PIXELS: u64 = (GRID_SQUARE * GRID_SQUARE) as u64;

/// Of how many squares one must have been measured before a map is worth following.
const MEASURED_LEAST: u32 = 4;

/// The newest costs of one job.
#[derive(Clone, Debug)]
pub(crate) struct Costs {
    squares: TileGrid,
    /// By grid square, of all its pixels in the window; 0 where nothing was measured. Empty before anything was.
    newest: Vec<u32>,
    measured: u32,
    /// Pixels whose cost was ever measured, and their cost.
    pixels: u64,
    cost: u64,
    /// The greatest cost of a grid square that was ever measured, of all its pixels in the window.
    dearest: u64,
}

impl Costs {
    /// Nothing is known of the images of this window.
    pub(crate) fn unknown(window: Rect) -> Self {
        Self {
            squares: TileGrid::squares(window),
            newest: Vec::new(),
            measured: 0,
            pixels: 0,
            cost: 0,
            dearest: 0,
        }
    }

    /// The greatest cost of a whole grid square that was ever measured; 0 before anything was.
    pub(crate) fn dearest(&self) -> u64 {
        self.dearest
    }

    /// Notes what a block cost.
    pub(crate) fn note(&mut self, block: Rect, cost: u64) {
        let cost = cost.max(1);
        self.pixels = self.pixels.saturating_add(block.area());
        self.cost = self.cost.saturating_add(cost);
        let (square, whole) = self.square(block);
        if self.newest.is_empty() {
            let count = usize::try_from(self.squares.count()).expect("images are limited");
            self.newest = vec![0; count];
        }
        let cost = scale(cost, whole, block.area()).max(1);
        self.dearest = self.dearest.max(cost);
        let Some(slot) = self.newest.get_mut(square) else {
            return;
        };
        self.measured += u32::from(*slot == 0);
        *slot = u32::try_from(cost).unwrap_or(u32::MAX);
    }

    /// The mean cost of so many pixels, if anything was measured.
    pub(crate) fn mean(&self, pixels: u64) -> Option<u64> {
        (self.pixels > 0).then(|| scale(self.cost, pixels, self.pixels))
    }

    /// The mean cost of a whole grid square.
    pub(crate) fn mean_square(&self) -> Option<u64> {
        self.mean(SQUARE_PIXELS)
    }

    /// How many pixels cost so much in the mean, if anything was measured.
    pub(crate) fn pixels_for(&self, cost: u64) -> Option<u64> {
        (self.cost > 0).then(|| scale(self.pixels, cost, self.cost))
    }

    /// What a block is expected to cost, if anything was measured.
    pub(crate) fn of_block(&self, block: Rect) -> Option<u64> {
        let (square, whole) = self.square(block);
        let newest = self.newest.get(square).copied().unwrap_or(0);
        match newest > 0 {
            true => Some(scale(u64::from(newest), block.area(), whole)),
            false => self.mean(block.area()),
        }
    }

    /// The index of a block's grid square, and how many pixels that has in the window. As [`TileGrid::index_of`], whose
    /// divisions would be counted here at every event.
    fn square(&self, block: Rect) -> (usize, u64) {
        let window = self.squares.window();
        debug_assert!(block.is_block() && window.contains(block));
        let (left, top) = (block.x0 / GRID_SQUARE, block.y0 / GRID_SQUARE);
        let first = (window.x0 / GRID_SQUARE, window.y0 / GRID_SQUARE);
        let columns = window.x1.div_ceil(GRID_SQUARE) - first.0;
        let index = (top - first.1) * columns + left - first.0;
        let side = |square: u32, (from, to): (u32, u32)| {
            let end = (square + 1).saturating_mul(GRID_SQUARE);
            u64::from(end.min(to) - (square * GRID_SQUARE).max(from))
        };
        let whole = side(left, (window.x0, window.x1)) * side(top, (window.y0, window.y1));
        (index as usize, whole)
    }

    /// What blocks are expected to cost together, if anything was measured.
    pub(crate) fn of_blocks(&self, mut blocks: impl Iterator<Item = Rect>) -> Option<u64> {
        blocks.try_fold(0_u64, |sum, block| {
            Some(sum.saturating_add(self.of_block(block)?))
        })
    }

    /// A map of the costs over the cells of a grid, if enough was measured.
    pub(crate) fn map(&self, grid: TileGrid) -> Option<CostMap> {
        let wanted = u32::try_from(self.squares.count()).unwrap_or(u32::MAX) / MEASURED_LEAST;
        if self.measured == 0 || self.measured < wanted {
            return None;
        }
        let is_squares = grid == self.squares;
        let of_cell = |index: usize| {
            let cell = grid.tile(u32::try_from(index).expect("cells are limited"));
            let cost = match is_squares {
                true => self.of_block(cell),
                false => self.of_blocks(cell.blocks()),
            };
            u32::try_from(cost.unwrap_or(0)).unwrap_or(u32::MAX)
        };
        let whole = Region::whole(grid);
        let mut map = CostMap(vec![Node::default(); 2 * whole.cells() as usize - 1]);
        map.fill(whole, grid, &of_cell);
        Some(map)
    }
}

/// The cost of every region of an image's cells.
#[derive(Clone, Debug)]
pub(crate) struct CostMap(Vec<Node>);

#[derive(Clone, Copy, Debug, Default)]
struct Node {
    sum: u64,
    peak: u32,
}

impl CostMap {
    /// Of all its cells together.
    pub(crate) fn sum(&self, region: Region) -> u64 {
        self.0[region.node as usize].sum
    }

    /// Of the dearest of its cells.
    pub(crate) fn peak(&self, region: Region) -> u32 {
        self.0[region.node as usize].peak
    }

    fn fill(&mut self, region: Region, grid: TileGrid, of_cell: &impl Fn(usize) -> u32) -> Node {
        let node = match region.split() {
            Some((first, second)) => {
                let first = self.fill(first, grid, of_cell);
                let second = self.fill(second, grid, of_cell);
                Node {
                    sum: first.sum + second.sum,
                    peak: first.peak.max(second.peak),
                }
            }
            None => {
                let cost = region.indices(grid).next().map_or(0, of_cell);
                Node {
                    sum: u64::from(cost),
                    peak: cost,
                }
            }
        };
        self.0[region.node as usize] = node;
        node
    }
}

/// `value · part / whole`, without overflow; the largest number where it does not fit.
pub(crate) fn scale(value: u64, part: u64, whole: u64) -> u64 {
    let whole = whole.max(1);
    if part == whole {
        return value;
    }
    if let Some(product) = value.checked_mul(part) {
        return product / whole;
    }
    let scaled = u128::from(value) * u128::from(part) / u128::from(whole);
    u64::try_from(scaled).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window() -> Rect {
        Rect {
            x0: 0,
            y0: 0,
            x1: 96,
            y1: 48,
        }
    }

    #[test]
    fn a_square_costs_what_it_cost_last_and_the_others_the_mean() {
        let mut costs = Costs::unknown(window());
        let blocks: Vec<Rect> = window().blocks().collect();
        assert_eq!((costs.of_block(blocks[0]), costs.mean(5)), (None, None));
        costs.note(blocks[0], 2_048);
        costs.note(blocks[0], 1_024);
        assert_eq!(costs.of_block(blocks[0]), Some(1_024));
        assert_eq!(costs.of_block(blocks[1]), Some(1_536));
        let half = Rect {
            x1: 16,
            ..blocks[0]
        };
        assert_eq!(costs.of_block(half), Some(512));
        assert_eq!(costs.pixels_for(1_536), Some(1_024));
    }

    #[test]
    fn a_map_needs_a_quarter_of_the_squares_and_adds_up() {
        let mut costs = Costs::unknown(window());
        let grid = TileGrid::squares(window());
        let blocks: Vec<Rect> = window().blocks().collect();
        assert!(costs.map(grid).is_none());
        costs.note(blocks[0], 100);
        let map = costs.map(grid).unwrap();
        let whole = Region::whole(grid);
        // Three squares of 32 by 32 pixels, three of 32 by 16.
        assert_eq!((map.sum(whole), map.peak(whole)), (3 * 100 + 3 * 50, 100));
        costs.note(blocks[5], 5_000);
        let map = costs.map(grid).unwrap();
        assert_eq!(map.peak(whole), 5_000);
        let (first, second) = whole.split().unwrap();
        assert_eq!(map.sum(first) + map.sum(second), map.sum(whole));
        assert_eq!(map.peak(second), 5_000);
    }
}
