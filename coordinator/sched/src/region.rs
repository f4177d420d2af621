//! Parts of an image's cells, cut in halves over and over.
//!
//! All regions of an image are the nodes of one tree: the whole, its halves across the
//! longer side, and so on down to single cells. Nodes are numbered in the order in which
//! a walk meets them, so that a table with a row per node needs no links.

use model::Rect;

use crate::tiling::TileGrid;

/// Some columns and rows of cells.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Region {
    /// Its number in the tree; no two regions share one.
    pub(crate) node: u32,
    x0: u32,
    y0: u32,
    x1: u32,
    y1: u32,
}

impl Region {
    /// All cells.
    pub(crate) fn whole(grid: TileGrid) -> Self {
        Self {
            node: 0,
            x0: 0,
            y0: 0,
            x1: grid.columns(),
            y1: grid.rows(),
        }
    }

    /// How many cells.
    pub(crate) fn cells(self) -> u32 {
        (self.x1 - self.x0) * (self.y1 - self.y0)
    }

    /// Its halves; none of a single cell.
    pub(crate) fn split(self) -> Option<(Self, Self)> {
        if self.cells() < 2 {
            return None;
        }
        let (columns, rows) = (self.x1 - self.x0, self.y1 - self.y0);
        let (mut first, mut second) = (self, self);
        if columns > rows {
            let middle = self.x0 + columns.div_ceil(2);
            (first.x1, second.x0) = (middle, middle);
        } else {
            let middle = self.y0 + rows.div_ceil(2);
            (first.y1, second.y0) = (middle, middle);
        }
        // A tree of n cells has 2n - 1 nodes.
        first.node = self.node + 1;
        second.node = self.node + 2 * first.cells();
        Some((first, second))
    }

    /// The region of these pixels; `None` where there is none of exactly them.
    pub(crate) fn at(rect: Rect, grid: TileGrid) -> Option<Self> {
        let mut region = Self::whole(grid);
        loop {
            let there = region.rect(grid);
            if there == rect {
                return Some(region);
            }
            let (first, second) = region.split()?;
            region = [first, second]
                .into_iter()
                .find(|half| half.rect(grid).contains(rect))?;
        }
    }

    /// Whether all of another region is part of it.
    pub(crate) fn contains(self, other: Self) -> bool {
        self.x0 <= other.x0 && other.x1 <= self.x1 && self.y0 <= other.y0 && other.y1 <= self.y1
    }

    /// Its pixels.
    pub(crate) fn rect(self, grid: TileGrid) -> Rect {
        grid.span((self.x0, self.y0), (self.x1, self.y1))
    }

    /// The indices of its cells, row by row.
    pub(crate) fn indices(self, grid: TileGrid) -> impl Iterator<Item = usize> {
        let columns = grid.columns();
        (self.y0..self.y1)
            .flat_map(move |row| (self.x0..self.x1).map(move |column| row * columns + column))
            .map(|index| index as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::collections::BTreeSet;
    use alloc::vec::Vec;

    #[test]
    fn the_tree_meets_every_cell_once_and_numbers_its_nodes_in_order() {
        for (columns, rows) in [(1, 1), (2, 1), (1, 2), (5, 3), (25, 19), (64, 64)] {
            let window = model::Resolution {
                width: columns * 10,
                height: rows * 7,
            }
            .rect();
            let grid = TileGrid::new(window, (10, 7));
            let mut nodes = Vec::new();
            let mut cells = BTreeSet::new();
            let mut left = alloc::vec![Region::whole(grid)];
            while let Some(region) = left.pop() {
                nodes.push(region.node);
                assert_eq!(Region::at(region.rect(grid), grid), Some(region));
                match region.split() {
                    Some((first, second)) => {
                        assert_eq!(first.cells() + second.cells(), region.cells());
                        let area = first.rect(grid).area() + second.rect(grid).area();
                        assert_eq!(area, region.rect(grid).area());
                        left.extend([second, first]);
                    }
                    None => assert!(cells.insert(region.indices(grid).next())),
                }
            }
            assert_eq!(u32::try_from(cells.len()), Ok(columns * rows));
            assert!(nodes.iter().copied().eq(0..2 * columns * rows - 1));
        }
    }
}
