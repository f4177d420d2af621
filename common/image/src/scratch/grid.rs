//! Where the grid squares of a window lie, in the image and in its scratch file.

use model::Rect;
use model::film::{BLOCK_BYTES_MAX, PIXEL_BYTES};
use model::rect::GRID_SQUARE;

/// Bytes before the first slot; a multiple of the page, so that slots lie on pages.
pub(super) const HEADER_BYTES: u64 = 4096;

/// Bytes of the slot of one grid square: `[channel][row 0..32][column 0..32]` of `f32`.
pub(super) const SLOT_BYTES: usize = BLOCK_BYTES_MAX;

/// Samples of one channel in a slot.
const PLANE: usize = (GRID_SQUARE * GRID_SQUARE) as usize;

/// The grid squares that a window touches, numbered row by row from its top left.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    window: Rect,
    first_column: u32,
    first_row: u32,
    columns: u32,
    rows: u32,
}

impl Grid {
    /// The squares of a window that is not empty.
    pub(super) fn new(window: Rect) -> Self {
        let first_column = window.x0 / GRID_SQUARE;
        let first_row = window.y0 / GRID_SQUARE;
        Self {
            window,
            first_column,
            first_row,
            columns: window.x1.div_ceil(GRID_SQUARE) - first_column,
            rows: window.y1.div_ceil(GRID_SQUARE) - first_row,
        }
    }

    pub(super) fn window(&self) -> Rect {
        self.window
    }

    /// Number of squares.
    pub(super) fn len(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Number of the square in which a block of the window lies.
    pub(super) fn square_of(&self, block: Rect) -> usize {
        let column = block.x0 / GRID_SQUARE - self.first_column;
        let row = block.y0 / GRID_SQUARE - self.first_row;
        row as usize * self.columns as usize + column as usize
    }

    /// The pixels of a square, those outside the window included.
    pub(super) fn square(&self, index: usize) -> Rect {
        let columns = self.columns as usize;
        let place = |at: usize, first: u32| {
            let at = u32::try_from(at).expect("a square's row and column fit, as its index did");
            (first + at) * GRID_SQUARE
        };
        let x0 = place(index % columns, self.first_column);
        let y0 = place(index / columns, self.first_row);
        Rect {
            x0,
            y0,
            x1: x0 + GRID_SQUARE,
            y1: y0 + GRID_SQUARE,
        }
    }

    /// The block that a square is when nothing but the window cuts it.
    pub(super) fn whole_block(&self, index: usize) -> Rect {
        self.square(index)
            .intersection(self.window)
            .expect("every square of the grid touches the window")
    }

    /// Where a square's slot begins in the file.
    pub(super) fn slot_offset(&self, index: usize) -> u64 {
        HEADER_BYTES + index as u64 * SLOT_BYTES as u64
    }

    /// Length of the whole scratch file.
    pub(super) fn file_bytes(&self) -> u64 {
        self.slot_offset(self.len())
    }
}

/// Calls `run(in_payload, in_slot)` for each run of consecutive bytes that a block's payload and
/// its square's slot share.
fn runs(block: Rect, mut run: impl FnMut(std::ops::Range<usize>, std::ops::Range<usize>)) {
    let (width, height) = (block.width() as usize, block.height() as usize);
    let column = (block.x0 % GRID_SQUARE) as usize;
    let row = (block.y0 % GRID_SQUARE) as usize;
    for channel in 0..model::film::CHANNEL_COUNT {
        for y in 0..height {
            let from = (channel * height + y) * width * 4;
            let to = (channel * PLANE + (row + y) * GRID_SQUARE as usize + column) * 4;
            run(from..from + width * 4, to..to + width * 4);
        }
    }
}

/// Copies a block's payload into the slot of its square.
pub(super) fn scatter(block: Rect, payload: &[u8], slot: &mut [u8]) {
    runs(block, |in_payload, in_slot| {
        slot[in_slot].copy_from_slice(&payload[in_payload]);
    });
}

/// Copies a block's payload out of the slot of its square.
pub(super) fn gather(block: Rect, slot: &[u8], payload: &mut Vec<u8>) {
    payload.clear();
    payload.resize(payload_bytes(block), 0);
    runs(block, |in_payload, in_slot| {
        payload[in_payload].copy_from_slice(&slot[in_slot]);
    });
}

/// Bytes of a block's payload.
pub(super) fn payload_bytes(block: Rect) -> usize {
    block.width() as usize * block.height() as usize * PIXEL_BYTES
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_numbered_like_the_blocks_of_the_window() {
        let window = Rect {
            x0: 40,
            y0: 70,
            x1: 131,
            y1: 129,
        };
        let grid = Grid::new(window);
        assert_eq!(grid.len(), window.blocks().count());
        for (index, block) in window.blocks().enumerate() {
            assert_eq!(grid.square_of(block), index);
            assert_eq!(grid.whole_block(index), block);
        }
        assert_eq!(grid.file_bytes(), 4096 + 32768 * grid.len() as u64);
    }

    #[test]
    fn scatter_and_gather_are_inverse() {
        let block = Rect {
            x0: 35,
            y0: 66,
            x1: 60,
            y1: 69,
        };
        let payload: Vec<u8> = (0..payload_bytes(block))
            .map(|i| u8::try_from(i % 251).unwrap())
            .collect();
        let mut slot = vec![0; SLOT_BYTES];
        scatter(block, &payload, &mut slot);
        let mut back = Vec::new();
        gather(block, &slot, &mut back);
        assert_eq!(back, payload);
        assert_eq!(
            slot.iter().filter(|byte| **byte != 0).count(),
            payload.iter().filter(|byte| **byte != 0).count()
        );
    }
}
