//! Which pixels of a window are done, each counted once however often it came.

use std::collections::BTreeMap;

use model::Rect;
use model::rect::GRID_SQUARE;

use super::grid::Grid;

/// One bit per pixel of a square: a word per row, the lowest bit for its first column.
type Mask = [u32; GRID_SQUARE as usize];

/// The pixels done: a bit per square that is whole, a mask for each that is begun.
#[derive(Debug)]
pub(super) struct Coverage {
    grid: Grid,
    whole: Vec<u64>,
    begun: BTreeMap<usize, Mask>,
    done: u64,
}

impl Coverage {
    /// Nothing done.
    pub(super) fn new(grid: Grid) -> Self {
        Self {
            grid,
            whole: vec![0; grid.len().div_ceil(64)],
            begun: BTreeMap::new(),
            done: 0,
        }
    }

    /// Number of pixels done.
    pub(super) fn done(&self) -> u64 {
        self.done
    }

    fn is_whole(&self, square: usize) -> bool {
        self.whole[square / 64] >> (square % 64) & 1 == 1
    }

    /// Whether every pixel of a block is done.
    pub(super) fn contains(&self, block: Rect) -> bool {
        let square = self.grid.square_of(block);
        self.is_whole(square)
            || self.begun.get(&square).is_some_and(|done| {
                let wanted = mask(block);
                wanted
                    .iter()
                    .zip(done)
                    .all(|(want, done)| want & !done == 0)
            })
    }

    /// Counts the pixels of a block of the window as done.
    pub(super) fn add(&mut self, block: Rect) {
        let square = self.grid.square_of(block);
        if self.is_whole(square) {
            return;
        }
        let mut done = self.begun.remove(&square).unwrap_or_default();
        let before = count(&done);
        for (row, more) in done.iter_mut().zip(mask(block)) {
            *row |= more;
        }
        let after = count(&done);
        self.done += after - before;
        if after == self.grid.whole_block(square).area() {
            self.whole[square / 64] |= 1 << (square % 64);
        } else {
            self.begun.insert(square, done);
        }
    }

    /// What is missing: whole blocks of the window where nothing of them is done, else their
    /// missing parts, in the order of the squares. No two overlap.
    pub(super) fn missing(&self) -> Vec<Rect> {
        let mut missing = Vec::new();
        for square in (0..self.grid.len()).filter(|square| !self.is_whole(*square)) {
            let block = self.grid.whole_block(square);
            match self.begun.get(&square) {
                None => missing.push(block),
                Some(done) => cut(block, done, &mut missing),
            }
        }
        missing
    }
}

/// The bits of a block's pixels in its square.
fn mask(block: Rect) -> Mask {
    let first = block.x0 % GRID_SQUARE;
    let row = (u32::MAX >> (GRID_SQUARE - block.width())) << first;
    let top = (block.y0 % GRID_SQUARE) as usize;
    let mut mask = [0; GRID_SQUARE as usize];
    mask[top..top + block.height() as usize].fill(row);
    mask
}

fn count(mask: &Mask) -> u64 {
    mask.iter().map(|row| u64::from(row.count_ones())).sum()
}

/// Cuts the pixels of `block` that are not in `done` into rectangles: each run of a row, taken as
/// far down as it goes.
fn cut(block: Rect, done: &Mask, out: &mut Vec<Rect>) {
    let mut left = mask(block);
    for (row, done) in left.iter_mut().zip(done) {
        *row &= !done;
    }
    let origin = (
        block.x0 / GRID_SQUARE * GRID_SQUARE,
        block.y0 / GRID_SQUARE * GRID_SQUARE,
    );
    for top in 0..GRID_SQUARE {
        while left[top as usize] != 0 {
            let row = left[top as usize];
            let first = row.trailing_zeros();
            let width = (row >> first).trailing_ones();
            let run = (u32::MAX >> (GRID_SQUARE - width)) << first;
            let mut bottom = top;
            while bottom < GRID_SQUARE && left[bottom as usize] & run == run {
                left[bottom as usize] &= !run;
                bottom += 1;
            }
            out.push(Rect {
                x0: origin.0 + first,
                y0: origin.1 + top,
                x1: origin.0 + first + width,
                y1: origin.1 + bottom,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WINDOW: Rect = Rect {
        x0: 10,
        y0: 20,
        x1: 100,
        y1: 90,
    };

    proptest! {
        /// Against a plain set of pixels: counted once, and what is missing is exactly the rest.
        #[test]
        fn counts_pixels_and_names_the_rest(
            tiles in prop::collection::vec((10_u32..100, 20_u32..90, 1_u32..50, 1_u32..50), 0..12)
        ) {
            let grid = Grid::new(WINDOW);
            let mut coverage = Coverage::new(grid);
            let mut pixels = std::collections::BTreeSet::new();
            for (x0, y0, width, height) in tiles {
                let tile = Rect { x0, y0, x1: x0 + width, y1: y0 + height };
                for block in tile.intersection(WINDOW).unwrap().blocks() {
                    coverage.add(block);
                    prop_assert!(coverage.contains(block));
                    pixels.extend((block.y0..block.y1).flat_map(|y| (block.x0..block.x1).map(move |x| (x, y))));
                }
            }
            prop_assert_eq!(coverage.done(), pixels.len() as u64);
            for block in coverage.missing() {
                prop_assert!(block.is_block() && WINDOW.contains(block));
                prop_assert!(!coverage.contains(block));
                for y in block.y0..block.y1 {
                    for x in block.x0..block.x1 {
                        prop_assert!(pixels.insert((x, y)));
                    }
                }
            }
            prop_assert_eq!(pixels.len() as u64, WINDOW.area());
        }
    }
}
