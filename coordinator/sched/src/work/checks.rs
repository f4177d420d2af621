//! What is known of an image's pixels from who made them, and what is rendered once more because of it.

use model::{Rect, Timestamp};

use super::{Amount, Ask, Piece, Work};
use crate::attempt::is_block_of;
use crate::check::{Check, Evidence, Known, Waiting};
use crate::costs::scale;
use crate::region::Region;
use crate::tile::Tile;

impl Work {
    /// What this worker may render once more.
    pub(super) fn check_for(&self, ask: &Ask) -> Option<usize> {
        if ask.queue.is_some() {
            return None;
        }
        self.checks.iter().position(|waiting| {
            waiting.check.suits(ask.worker) && self.part_of_check(waiting, ask).is_some()
        })
    }

    /// Whether a worker has time for some of a check.
    pub(crate) fn check_fits(&self, waiting: &Waiting, ask: &Ask) -> bool {
        self.part_of_check(waiting, ask).is_some()
    }

    /// The part of a check that a worker has time for: all of it, else its cheaper half, and so on.
    fn part_of_check(&self, waiting: &Waiting, ask: &Ask) -> Option<Region> {
        let mut region = waiting.region;
        loop {
            let rect = region.rect(self.grid);
            let left = waiting.check.wanted_in(rect, ask.worker);
            let of_all = |amount| scale(amount, left, rect.blocks().count() as u64);
            let Amount { pixels, cost } = self.amount(region);
            let amount = Amount {
                pixels: of_all(pixels),
                cost: of_all(cost),
            };
            if ask.fits.is_none_or(|fits| !self.is_more(amount, fits)) {
                return Some(region);
            }
            let (first, second) = region.split()?;
            let (cheaper, other) = self.choose(first, second, true);
            let rect = cheaper.rect(self.grid);
            region = match waiting.check.wanted_in(rect, ask.worker) {
                0 => other,
                _ => cheaper,
            };
        }
    }

    /// The tile that this worker is to render once more; the rest of what was one tile waits on.
    pub(super) fn take_check(&mut self, ask: &Ask) -> Option<u32> {
        let mut waiting = self.checks.remove(self.check_for(ask)?)?;
        let part = self.part_of_check(&waiting, ask)?;
        while waiting.region != part {
            let (first, second) = waiting.region.split()?;
            let (inside, outside) = match first.contains(part) {
                true => (first, second),
                false => (second, first),
            };
            let check = waiting.check.take(outside.rect(self.grid));
            if !check.is_done() {
                self.checks.push_front(Waiting {
                    region: outside,
                    check,
                    since: waiting.since,
                });
            }
            waiting.region = inside;
        }
        let Waiting { region, check, .. } = waiting;
        let rect = region.rect(self.grid);
        let tile = self.tiles.insert(Tile::to_check(region, rect, check));
        self.mark(region, tile);
        Some(tile)
    }

    /// Has pixels that are all durable wait to be rendered once more.
    pub(crate) fn put_check(&mut self, region: Region, check: Check, now: Timestamp) {
        self.checks.push_back(Waiting {
            region,
            check,
            since: now,
        });
    }

    /// What is known of a block's pixels, wherever it is; nothing where it is no block as the image is cut now.
    pub(crate) fn known_of(&mut self, block: Rect) -> Option<Known<'_>> {
        let cell = self.grid.tile(self.grid.index_of(block)?);
        if !is_block_of(cell, block) {
            return None;
        }
        if let Some(tile) = self.tile_of(block) {
            let tile = self.tiles.get_mut(tile)?;
            let live = tile.live_count();
            return Some(match &mut tile.check {
                Some(check) => Known::Check(check),
                None => Known::Evidence {
                    evidence: &mut tile.evidence,
                    region: tile.region,
                    live,
                },
            });
        }
        let grid = self.grid;
        let holds = |region: Region| region.rect(grid).contains(block);
        let mut waiting = self.checks.iter_mut();
        if let Some(waiting) = waiting.find(|waiting| holds(waiting.region)) {
            return Some(Known::Check(&mut waiting.check));
        }
        let mut pieces = self.pieces.values_mut().chain(&mut self.troubled);
        let piece = pieces.find(|piece| holds(piece.region))?;
        Some(Known::Evidence {
            evidence: &mut piece.evidence,
            region: piece.region,
            live: 0,
        })
    }

    /// Lets go of the piece around a block where nothing of it is missing; its pixels, and what was made of them.
    pub(crate) fn take_whole(&mut self, block: Rect) -> Option<(Region, Rect, Evidence)> {
        let grid = self.grid;
        let is_whole = |piece: &Piece| {
            let rect = piece.region.rect(grid);
            rect.contains(block) && self.missing(rect) == 0
        };
        let plain = self.pieces.iter().find(|(_, piece)| is_whole(piece));
        let plain = plain.map(|(&order, _)| order);
        let piece = match plain {
            Some(order) => self.pieces.remove(&order),
            None => {
                let index = self.troubled.iter().position(is_whole)?;
                self.troubled.remove(index)
            }
        }?;
        let amount = self.amount(piece.region);
        self.open.pixels -= amount.pixels;
        self.open.cost -= amount.cost;
        Some((piece.region, piece.region.rect(grid), piece.evidence))
    }

    /// Blocks of which two renderings differ and nobody knows which is right.
    pub(crate) fn doubts(&self) -> u64 {
        let tiles = self.tiles.iter().map(|(_, tile)| tile);
        let in_tiles = tiles.flat_map(|tile| {
            let check = tile.check.iter().map(|check| &check.evidence);
            check.chain([&tile.evidence])
        });
        let pieces = self.pieces.values().chain(&self.troubled);
        let in_pieces = pieces.map(|piece| &piece.evidence);
        let in_checks = self.checks.iter().map(|waiting| &waiting.check.evidence);
        let all = in_tiles.chain(in_pieces).chain(in_checks);
        all.map(|evidence| evidence.dissents().len() as u64).sum()
    }
}
