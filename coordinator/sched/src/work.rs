//! An image in flight: its tiles, and which of them wait for a worker.

use alloc::collections::BTreeSet;
use alloc::vec::Vec;

use model::Rect;

use crate::pixels::PixelsDone;
use crate::tiling::TileGrid;

/// Most live attempts of one tile.
pub(crate) const LIVE_MAX: usize = 2;

/// What is kept of an image while its tiles are rendered.
#[derive(Clone, Debug)]
pub(crate) struct Work {
    pub(crate) pixels: PixelsDone,
    pub(crate) tiles: Vec<Tile>,
    grid: TileGrid,
    /// Tiles from here on have never been leased and wait.
    fresh: u32,
    /// Tiles before `fresh` that wait again.
    reopened: BTreeSet<u32>,
    /// Live attempts at any of its tiles.
    pub(crate) live: BTreeSet<u64>,
}

/// What is kept of a tile.
#[derive(Clone, Debug)]
pub(crate) struct Tile {
    /// Pixels that are not durable.
    pub(crate) missing: u64,
    /// Attempts that failed or got stuck.
    pub(crate) failures: u32,
    /// Attempts that ran on a worker that was then lost, since a pixel of it was last made durable.
    pub(crate) losses: u32,
    pub(crate) live: [Option<u64>; LIVE_MAX],
}

impl Work {
    pub(crate) fn new(grid: TileGrid) -> Self {
        let count = u32::try_from(grid.count()).expect("a submission's tiles are limited");
        Self {
            pixels: PixelsDone::none(grid.window()),
            tiles: (0..count)
                .map(|index| Tile {
                    missing: grid.tile(index).area(),
                    failures: 0,
                    losses: 0,
                    live: [None; LIVE_MAX],
                })
                .collect(),
            grid,
            fresh: 0,
            reopened: BTreeSet::new(),
            live: BTreeSet::new(),
        }
    }

    pub(crate) fn rect(&self, tile: u32) -> Rect {
        self.grid.tile(tile)
    }

    pub(crate) fn tile_of(&self, block: Rect) -> Option<u32> {
        self.grid.index_of(block)
    }

    /// Whether some tile waits for a worker.
    pub(crate) fn has_open(&self) -> bool {
        !self.reopened.is_empty() || (self.fresh as usize) < self.tiles.len()
    }

    /// The first tile that waits for a worker; it waits no more.
    pub(crate) fn take_open(&mut self) -> Option<u32> {
        self.reopened.pop_first().or_else(|| {
            let tile = self.fresh;
            ((tile as usize) < self.tiles.len()).then(|| {
                self.fresh += 1;
                tile
            })
        })
    }

    /// Lets a tile that was leased before wait for a worker, or no more.
    pub(crate) fn set_open(&mut self, tile: u32, open: bool) {
        if tile >= self.fresh {
            return;
        }
        if open {
            self.reopened.insert(tile);
        } else {
            self.reopened.remove(&tile);
        }
    }

    /// Whether a tile waits for a worker.
    pub(crate) fn is_open(&self, tile: u32) -> bool {
        tile >= self.fresh || self.reopened.contains(&tile)
    }

    /// The blocks of a tile that are missing, in order; empty where all are.
    pub(crate) fn wanted(&self, tile: u32) -> Vec<Rect> {
        let rect = self.rect(tile);
        if self.tiles[tile as usize].missing == rect.area() {
            return Vec::new();
        }
        rect.blocks()
            .filter(|&block| !self.pixels.covers(block))
            .collect()
    }
}

impl Tile {
    /// Live attempts.
    pub(crate) fn attempts(&self) -> impl Iterator<Item = u64> {
        self.live.into_iter().flatten()
    }

    pub(crate) fn begins(&mut self, attempt: u64) {
        let slot = self.live.iter_mut().find(|slot| slot.is_none());
        *slot.expect("a tile is leased only while it has room for an attempt") = Some(attempt);
    }

    pub(crate) fn ends(&mut self, attempt: u64) {
        for slot in &mut self.live {
            if *slot == Some(attempt) {
                *slot = None;
            }
        }
    }
}
