//! Which pixels of an image are durable, whatever its tiling.
//!
//! One bit per grid square that is complete, and a mask of 32×32 bits for each
//! square that is begun. So an image that is half done can be cut into other tiles.

use alloc::boxed::Box;
use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;

use model::Rect;
use model::rect::GRID_SQUARE;

const SIDE: usize = GRID_SQUARE as usize;

/// Rows of a square, one bit per column.
type Mask = [u32; SIDE];

/// The durable pixels of one image's window.
#[derive(Clone, Debug)]
pub(crate) struct PixelsDone {
    window: Rect,
    /// One bit per grid square that the window touches, row by row: all its pixels in the window are done.
    complete: Vec<u64>,
    /// The squares that are begun and not complete.
    begun: BTreeMap<usize, Box<Mask>>,
    done: u64,
}

impl PixelsDone {
    /// None of the window's pixels.
    pub(crate) fn none(window: Rect) -> Self {
        let rows = window.y1.div_ceil(GRID_SQUARE) - window.y0 / GRID_SQUARE;
        let squares = columns(window) * rows as usize;
        Self {
            window,
            complete: vec![0; squares.div_ceil(64)],
            begun: BTreeMap::new(),
            done: 0,
        }
    }

    /// How many pixels are done.
    pub(crate) fn count(&self) -> u64 {
        self.done
    }

    /// Whether all are.
    pub(crate) fn is_complete(&self) -> bool {
        self.done == self.window.area()
    }

    /// Whether all pixels of a block inside the window are done.
    pub(crate) fn covers(&self, block: Rect) -> bool {
        let square = self.square(block);
        if self.complete[square / 64] >> (square % 64) & 1 == 1 {
            return true;
        }
        self.begun.get(&square).is_some_and(|mask| {
            let bits = column_bits(block);
            rows(block).all(|row| mask[row] & bits == bits)
        })
    }

    /// How many pixels of a block inside the window are not done.
    pub(crate) fn missing(&self, block: Rect) -> u64 {
        let square = self.square(block);
        if self.complete[square / 64] >> (square % 64) & 1 == 1 {
            return 0;
        }
        let bits = column_bits(block);
        let done = self.begun.get(&square).map_or(0, |mask| {
            rows(block).map(|row| (mask[row] & bits).count_ones()).sum()
        });
        block.area() - u64::from(done)
    }

    /// Adds a block inside the window; says how many of its pixels are new.
    pub(crate) fn add(&mut self, block: Rect) -> u64 {
        let square = self.square(block);
        if self.complete[square / 64] >> (square % 64) & 1 == 1 {
            return 0;
        }
        let whole = self.square_rect(block);
        if block == whole && !self.begun.contains_key(&square) {
            self.complete[square / 64] |= 1 << (square % 64);
            self.done += block.area();
            return block.area();
        }
        let mask = self
            .begun
            .entry(square)
            .or_insert_with(|| Box::new([0; SIDE]));
        let bits = column_bits(block);
        let mut new = 0;
        for row in rows(block) {
            new += u64::from((bits & !mask[row]).count_ones());
            mask[row] |= bits;
        }
        let done: u64 = mask.iter().map(|row| u64::from(row.count_ones())).sum();
        if done == whole.area() {
            self.begun.remove(&square);
            self.complete[square / 64] |= 1 << (square % 64);
        }
        self.done += new;
        new
    }

    /// The place of a block's grid square among those that the window touches.
    fn square(&self, block: Rect) -> usize {
        debug_assert!(block.is_block() && self.window.contains(block));
        let column = block.x0 / GRID_SQUARE - self.window.x0 / GRID_SQUARE;
        let row = block.y0 / GRID_SQUARE - self.window.y0 / GRID_SQUARE;
        row as usize * columns(self.window) + column as usize
    }

    /// The part of a block's grid square inside the window.
    fn square_rect(&self, block: Rect) -> Rect {
        let x0 = block.x0 / GRID_SQUARE * GRID_SQUARE;
        let y0 = block.y0 / GRID_SQUARE * GRID_SQUARE;
        Rect {
            x0: x0.max(self.window.x0),
            y0: y0.max(self.window.y0),
            x1: (x0 + GRID_SQUARE).min(self.window.x1),
            y1: (y0 + GRID_SQUARE).min(self.window.y1),
        }
    }
}

fn columns(window: Rect) -> usize {
    (window.x1.div_ceil(GRID_SQUARE) - window.x0 / GRID_SQUARE) as usize
}

fn column_bits(block: Rect) -> u32 {
    let from = block.x0 % GRID_SQUARE;
    u32::MAX >> (GRID_SQUARE - block.width()) << from
}

fn rows(block: Rect) -> core::ops::Range<usize> {
    let from = (block.y0 % GRID_SQUARE) as usize;
    from..from + block.height() as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::collections::BTreeSet;
    use proptest::prelude::*;

    fn pixels_of(block: Rect) -> impl Iterator<Item = (u32, u32)> {
        (block.y0..block.y1).flat_map(move |y| (block.x0..block.x1).map(move |x| (x, y)))
    }

    proptest! {
        /// Against a plain set of pixels, under tilings that change on the way.
        #[test]
        fn counts_every_pixel_once(
            x0 in 0_u32..70, y0 in 0_u32..70,
            width in 1_u32..100, height in 1_u32..100,
            tiles in prop::collection::vec((0_u32..170, 0_u32..170, 1_u32..80, 1_u32..80), 0..12),
        ) {
            let window = Rect { x0, y0, x1: x0 + width, y1: y0 + height };
            let mut done = PixelsDone::none(window);
            let mut model = BTreeSet::new();
            for (x0, y0, width, height) in tiles {
                let tile = Rect { x0, y0, x1: x0 + width, y1: y0 + height };
                for block in tile.intersection(window).into_iter().flat_map(Rect::blocks) {
                    let covered = pixels_of(block).all(|pixel| model.contains(&pixel));
                    prop_assert_eq!(done.covers(block), covered);
                    let missing = pixels_of(block).filter(|pixel| !model.contains(pixel)).count();
                    prop_assert_eq!(done.missing(block), missing as u64);
                    let before = model.len();
                    model.extend(pixels_of(block));
                    prop_assert_eq!(done.add(block), (model.len() - before) as u64);
                    prop_assert!(done.covers(block));
                    prop_assert_eq!(done.count(), model.len() as u64);
                }
            }
            for block in window.blocks() {
                done.add(block);
            }
            prop_assert!(done.is_complete() && done.begun.is_empty());
        }
    }
}
