//! How an image's window is cut into tiles.
//!
//! The rule is that of thesis C.3.2 with its order mended: among the tiles that divide the
//! window exactly, have at least `min_tile_pixels` and make at most `max_array_size`, the squarest is
//! taken, then the smallest. The thesis says smallest first, which does not give the
//! arrays that it shows: 192 tiles and, on Snowdon, 48.
//!
//! Where the sides share too few divisors (801×599 would be one tile) the tile is
//! the smallest square that is large enough, and a last column and row of smaller ones stay over.

use model::Rect;
use model::rect::GRID_SQUARE;

/// How many times the wanted pixels a tile that divides exactly may have, and how many times as
/// long as wide it may be, before smaller tiles at the edge are the lesser evil.
const EXACT_EXCESS_MAX: u64 = 4;

/// What the rule must obey.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileRule {
    /// Fewest pixels of a tile, unless the window has fewer.
    pub(crate) min_tile_pixels: u64,
    /// Most tiles.
    pub(crate) max_array_size: u64,
}

impl TileRule {
    /// Columns and rows of the tiles of a window that is not empty.
    pub(crate) fn tile_size(self, window: Rect) -> (u32, u32) {
        let wanted = self
            .min_tile_pixels
            .max(window.area().div_ceil(self.max_array_size.max(1)))
            .clamp(1, window.area());
        match self.exact(window, wanted) {
            Some(size) if is_fair(size, wanted) => size,
            _ => self.ragged(window, wanted),
        }
    }

    /// The squarest, then smallest tile of at least `wanted` pixels that divides the window.
    fn exact(self, window: Rect, wanted: u64) -> Option<(u32, u32)> {
        divisors(window.width())
            .flat_map(|width| divisors(window.height()).map(move |height| (width, height)))
            .filter(|&(width, height)| area(width, height) >= wanted)
            .filter(|&size| TileGrid::new(window, size).count() <= self.max_array_size.max(1))
            .min_by_key(|&(width, height)| (width.abs_diff(height), area(width, height), width))
    }

    /// The smallest square of at least `wanted` pixels, cut to the window where
    /// that is narrower, that makes no more tiles than there may be.
    fn ragged(self, window: Rect, wanted: u64) -> (u32, u32) {
        let side_max = window.width().max(window.height());
        (1..=side_max)
            .map(|side| {
                let width = side.min(window.width());
                let height = side.min(window.height());
                (width, height)
            })
            .find(|&(width, height)| {
                area(width, height) >= wanted
                    && TileGrid::new(window, (width, height)).count() <= self.max_array_size.max(1)
            })
            .unwrap_or((window.width(), window.height()))
    }
}

fn is_fair((width, height): (u32, u32), wanted: u64) -> bool {
    let (short, long) = (width.min(height), width.max(height));
    area(width, height) <= EXACT_EXCESS_MAX * wanted
        && u64::from(long) <= EXACT_EXCESS_MAX * u64::from(short)
}

fn area(width: u32, height: u32) -> u64 {
    u64::from(width) * u64::from(height)
}

fn divisors(number: u32) -> impl Iterator<Item = u32> {
    (1..=number).filter(move |divisor| number.is_multiple_of(*divisor))
}

/// A window cut into equal cells, row by row from its top left; those at its edges may be smaller.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct TileGrid {
    window: Rect,
    /// Where the lines start that the window is cut along; not beyond the window's own corner.
    x0: u32,
    y0: u32,
    width: u32,
    height: u32,
}

impl TileGrid {
    /// A window that is not empty, cut into cells of `size`: columns and rows, at least 1 each.
    pub(crate) fn new(window: Rect, size: (u32, u32)) -> Self {
        Self {
            window,
            x0: window.x0,
            y0: window.y0,
            width: size.0.clamp(1, window.width().max(1)),
            height: size.1.clamp(1, window.height().max(1)),
        }
    }

    /// A window that is not empty, cut along the image's fixed grid.
    pub(crate) fn squares(window: Rect) -> Self {
        Self {
            window,
            x0: window.x0 / GRID_SQUARE * GRID_SQUARE,
            y0: window.y0 / GRID_SQUARE * GRID_SQUARE,
            width: GRID_SQUARE,
            height: GRID_SQUARE,
        }
    }

    /// The pixels that are cut.
    pub(crate) fn window(self) -> Rect {
        self.window
    }

    /// Columns and rows of pixels in a whole cell.
    pub(crate) fn size(self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Number of cells.
    pub(crate) fn count(self) -> u64 {
        u64::from(self.columns()) * u64::from(self.rows())
    }

    /// Columns of cells.
    pub(crate) fn columns(self) -> u32 {
        (self.window.x1 - self.x0).div_ceil(self.width)
    }

    /// Rows of cells.
    pub(crate) fn rows(self) -> u32 {
        (self.window.y1 - self.y0).div_ceil(self.height)
    }

    /// The cell at `index`, counting row by row; `index` is below [`Self::count`].
    pub(crate) fn tile(self, index: u32) -> Rect {
        let (column, row) = (index % self.columns(), index / self.columns());
        self.span((column, row), (column + 1, row + 1))
    }

    /// The pixels of the cells from one column and row up to, and without, another.
    pub(crate) fn span(self, from: (u32, u32), to: (u32, u32)) -> Rect {
        let x = |column: u32| self.x0.saturating_add(column * self.width);
        let y = |row: u32| self.y0.saturating_add(row * self.height);
        Rect {
            x0: x(from.0).max(self.window.x0),
            y0: y(from.1).max(self.window.y0),
            x1: x(to.0).min(self.window.x1),
            y1: y(to.1).min(self.window.y1),
        }
    }

    /// The index of the cell that holds all of `rect`.
    pub(crate) fn index_of(self, rect: Rect) -> Option<u32> {
        if rect.is_empty() || !self.window.contains(rect) {
            return None;
        }
        let column = (rect.x0 - self.x0) / self.width;
        let row = (rect.y0 - self.y0) / self.height;
        let cell = self.span((column, row), (column + 1, row + 1));
        (rect.x1 <= cell.x1 && rect.y1 <= cell.y1).then(|| row * self.columns() + column)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use model::Resolution;
    use proptest::prelude::*;

    fn window(width: u32, height: u32) -> Rect {
        Resolution { width, height }.rect()
    }

    fn rule(min_tile_pixels: u64) -> TileRule {
        TileRule {
            min_tile_pixels,
            max_array_size: 75_000,
        }
    }

    fn tiles(width: u32, height: u32, min_tile_pixels: u64) -> u64 {
        let window = window(width, height);
        TileGrid::new(window, rule(min_tile_pixels).tile_size(window)).count()
    }

    #[test]
    fn the_thesis_arrays() {
        assert_eq!(tiles(800, 600, 2_500), 192);
        assert_eq!(tiles(800, 600, 1_600), 300);
        assert_eq!(tiles(800, 600, 5_000), 48);
        assert_eq!(rule(5_000).tile_size(window(800, 600)), (100, 100));
    }

    #[test]
    fn sides_without_common_divisors_leave_a_smaller_last_column_and_row() {
        assert_eq!(rule(2_500).tile_size(window(801, 599)), (50, 50));
        assert_eq!(tiles(801, 599, 2_500), 17 * 12);
        let grid = TileGrid::new(window(801, 599), (50, 50));
        assert_eq!(grid.tile(16).width(), 1);
        assert_eq!(grid.tile(17 * 12 - 1).height(), 49);
    }

    #[test]
    fn a_small_window_is_one_tile_and_a_narrow_one_is_cut_across() {
        assert_eq!(rule(2_500).tile_size(window(10, 10)), (10, 10));
        assert_eq!(rule(2_500).tile_size(window(10, 1_009)), (10, 250));
        assert_eq!(rule(2_500).tile_size(window(1, 1)), (1, 1));
    }

    #[test]
    fn no_more_tiles_than_there_may_be() {
        let few = TileRule {
            min_tile_pixels: 1,
            max_array_size: 7,
        };
        for (width, height) in [
            (800, 600),
            (801, 599),
            (1, 97),
            (65_536, 3),
            (65_536, 65_536),
        ] {
            let window = window(width, height);
            let count = TileGrid::new(window, few.tile_size(window)).count();
            assert!((1..=7).contains(&count), "{width}x{height}: {count}");
        }
    }

    #[test]
    fn squares_follow_the_images_grid() {
        let window = Rect {
            x0: 40,
            y0: 70,
            x1: 100,
            y1: 97,
        };
        let grid = TileGrid::squares(window);
        assert_eq!((grid.columns(), grid.rows()), (3, 2));
        let first = Rect {
            x0: 40,
            y0: 70,
            x1: 64,
            y1: 96,
        };
        let last = Rect {
            x0: 96,
            y0: 96,
            x1: 100,
            y1: 97,
        };
        assert_eq!((grid.tile(0), grid.tile(5)), (first, last));
        assert_eq!(grid.span((0, 0), (3, 2)), window);
        let blocks: Vec<Rect> = window.blocks().collect();
        let tiles: Vec<Rect> = (0..6).map(|index| grid.tile(index)).collect();
        assert_eq!(tiles, blocks);
    }

    proptest! {
        #[test]
        fn the_rule_obeys_its_limits(
            width in 1_u32..3_000,
            height in 1_u32..3_000,
            min_tile_pixels in 1_u64..20_000,
            max_array_size in 1_u64..2_000,
        ) {
            let window = window(width, height);
            let rule = TileRule { min_tile_pixels, max_array_size };
            let size = rule.tile_size(window);
            let grid = TileGrid::new(window, size);
            prop_assert!(area(size.0, size.1) >= min_tile_pixels.min(window.area()));
            prop_assert!(grid.count() <= max_array_size);
        }

        #[test]
        fn tiles_cover_a_window_once(
            x0 in 0_u32..100, y0 in 0_u32..100,
            width in 1_u32..90, height in 1_u32..90,
            tile in (1_u32..100, 1_u32..100),
        ) {
            let window = Rect { x0, y0, x1: x0 + width, y1: y0 + height };
            let grid = TileGrid::new(window, tile);
            let count = u32::try_from(grid.count()).unwrap();
            let tiles: Vec<Rect> = (0..count).map(|index| grid.tile(index)).collect();
            prop_assert_eq!(tiles.iter().map(|tile| tile.area()).sum::<u64>(), window.area());
            for (index, tile) in (0..).zip(&tiles) {
                prop_assert!(window.contains(*tile) && !tile.is_empty());
                for block in tile.blocks() {
                    prop_assert_eq!(grid.index_of(block), Some(index));
                }
            }
        }
    }
}
