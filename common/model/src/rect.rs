//! Rectangles of pixels, and the fixed grid of squares that every image is cut along.
//!
//! The grid is anchored at pixel (0, 0) of the whole image, whatever part of it
//! is rendered and however it is cut into tiles. A *block* is the part of one
//! grid square inside one tile: it is what streams, and what survives.

/// Side of a grid square in pixels.
pub const GRID_SQUARE: u32 = 32;

/// Most pixels along either side of an image.
pub const SIDE_MAX: u32 = 65_536;

/// Size of a whole image in pixels.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Resolution {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
}

impl Resolution {
    /// The rectangle of all pixels.
    pub const fn rect(self) -> Rect {
        Rect {
            x0: 0,
            y0: 0,
            x1: self.width,
            y1: self.height,
        }
    }
}

/// A half-open rectangle of pixels: `x0 <= x < x1`, `y0 <= y < y1`, row 0 at the top.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Rect {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

impl Rect {
    /// Columns; 0 for a rectangle that is turned inside out.
    pub const fn width(self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    /// Rows; 0 for a rectangle that is turned inside out.
    pub const fn height(self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }

    /// Number of pixels.
    pub const fn area(self) -> u64 {
        self.width() as u64 * self.height() as u64
    }

    /// Whether it holds no pixel.
    pub const fn is_empty(self) -> bool {
        self.area() == 0
    }

    /// The pixels in both, if there are any.
    pub fn intersection(self, other: Self) -> Option<Self> {
        let both = Self {
            x0: self.x0.max(other.x0),
            y0: self.y0.max(other.y0),
            x1: self.x1.min(other.x1),
            y1: self.y1.min(other.y1),
        };
        (!both.is_empty()).then_some(both)
    }

    /// Whether every pixel of `other` is one of these.
    pub fn contains(self, other: Self) -> bool {
        other.is_empty() || self.intersection(other) == Some(other)
    }

    /// The blocks of a tile: its parts along the image's grid, row by row from the top left.
    pub fn blocks(self) -> impl Iterator<Item = Self> {
        let squares = |from: u32, to: u32| (from / GRID_SQUARE)..to.div_ceil(GRID_SQUARE);
        let tile = self;
        let rows = if self.is_empty() {
            0..0
        } else {
            squares(self.y0, self.y1)
        };
        rows.flat_map(move |row| {
            squares(tile.x0, tile.x1).filter_map(move |column| {
                tile.intersection(Self {
                    x0: column * GRID_SQUARE,
                    y0: row * GRID_SQUARE,
                    x1: (column + 1) * GRID_SQUARE,
                    y1: (row + 1) * GRID_SQUARE,
                })
            })
        })
    }

    /// Its left and right or its upper and lower half, across the longer side; the first is the larger, and the second
    /// empty where there is one pixel.
    pub const fn halves(self) -> [Self; 2] {
        let (mut first, mut second) = (self, self);
        if self.width() > self.height() {
            first.x1 = self.x0 + self.width().div_ceil(2);
            second.x0 = first.x1;
        } else {
            first.y1 = self.y0 + self.height().div_ceil(2);
            second.y0 = first.y1;
        }
        [first, second]
    }

    /// Whether it lies inside one grid square, as every block does.
    pub fn is_block(self) -> bool {
        !self.is_empty()
            && self.x0 / GRID_SQUARE == (self.x1 - 1) / GRID_SQUARE
            && self.y0 / GRID_SQUARE == (self.y1 - 1) / GRID_SQUARE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    #[test]
    fn blocks_cover_a_tile_once_and_follow_the_grid() {
        for tile in [
            Rect {
                x0: 0,
                y0: 0,
                x1: 64,
                y1: 64,
            },
            Rect {
                x0: 40,
                y0: 60,
                x1: 80,
                y1: 120,
            },
            Rect {
                x0: 31,
                y0: 31,
                x1: 33,
                y1: 33,
            },
            Rect {
                x0: 200,
                y0: 25,
                x1: 400,
                y1: 50,
            },
        ] {
            let blocks: Vec<_> = tile.blocks().collect();
            assert_eq!(
                blocks.iter().map(|block| block.area()).sum::<u64>(),
                tile.area()
            );
            for (index, block) in blocks.iter().enumerate() {
                assert!(block.is_block() && tile.contains(*block));
                assert!(
                    blocks[..index]
                        .iter()
                        .all(|other| other.intersection(*block).is_none())
                );
            }
        }
        let empty = Rect {
            x0: 5,
            y0: 5,
            x1: 5,
            y1: 9,
        };
        assert_eq!(empty.blocks().count(), 0);
    }

    #[test]
    fn halves_are_a_block_s_two_parts() {
        for (x1, y1) in [(64, 64), (64, 33), (33, 64), (35, 33), (33, 33)] {
            let block = Rect {
                x0: 32,
                y0: 32,
                x1,
                y1,
            };
            let [first, second] = block.halves();
            assert!(first.is_block() && block.contains(first) && block.contains(second));
            assert!(first.area() >= second.area());
            assert_eq!(first.area() + second.area(), block.area());
            assert_eq!(first.intersection(second), None);
            assert_eq!(second.is_empty(), block.area() == 1);
        }
    }
}
