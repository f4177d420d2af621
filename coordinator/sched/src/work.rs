//! An image in flight: which of its pixels are durable, its tiles, and the pieces that wait to become some.
//!
//! A *piece* is a region of cells that nobody renders. At first the whole image is one; a tile
//! is cut from a piece when it is leased, as large as the worker that gets it should have it,
//! and becomes a piece again when its last attempt ends before it is done.

mod checks;

use alloc::collections::{BTreeMap, BTreeSet, VecDeque};
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Reverse;

use model::{Rect, Timestamp, WorkerId};

use crate::check::{Checks, Evidence};
use crate::costs::CostMap;
use crate::pixels::PixelsDone;
use crate::region::Region;
use crate::tile::{Tile, Tiles, Trouble};
use crate::tiling::TileGrid;

/// The mark of a cell that is part of no tile.
const NO_TILE: u32 = u32::MAX;

/// Pieces that failed on some worker and are looked at for one that suits another, at most.
const LOOKED_AT_MAX: usize = 16;

/// What is kept of an image while its tiles are rendered.
#[derive(Clone, Debug)]
pub(crate) struct Work {
    pub(crate) pixels: PixelsDone,
    pub(crate) tiles: Tiles,
    /// What its durable blocks cost.
    pub(crate) spent: u64,
    /// No more of it is leased: it is about to fail, or to be rendered again.
    pub(crate) given_up: bool,
    grid: TileGrid,
    /// The queue that it was cut for.
    queue: Option<WorkerId>,
    map: Option<Arc<CostMap>>,
    focus: Option<Rect>,
    /// The tile of each cell.
    cells: Vec<u32>,
    /// Pieces, those that come first first.
    pieces: BTreeMap<Order, Piece>,
    /// Pieces at which some worker failed, in the order in which they did.
    troubled: VecDeque<Piece>,
    /// What is done and is to be rendered once more, by somebody else.
    pub(crate) checks: Checks,
    /// Checks that were given up.
    pub(crate) unverified: u32,
    /// Who rendered some of it, where that may matter.
    pub(crate) makers: BTreeSet<WorkerId>,
    /// Tiles that are open to a second attempt, because the worker of the first is away.
    shared: BTreeSet<u32>,
    /// Of all pieces.
    open: Amount,
}

/// Which piece comes first: one in the region of interest, then the one with the
/// dearest cell, so that what takes longest is not begun last, then from the top left.
type Order = (Reverse<bool>, Reverse<u32>, u32);

#[derive(Clone, Debug)]
struct Piece {
    region: Region,
    trouble: Trouble,
    evidence: Evidence,
}

/// What becomes of a tile that nobody renders.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Reopened {
    /// It waits to be rendered, or is done.
    Plain,
    /// It waits to be rendered once more.
    Checks,
}

/// An amount of work, in both of its measures.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct Amount {
    pub(crate) pixels: u64,
    /// By the image's cost map; 0 where it has none.
    pub(crate) cost: u64,
}

/// Who asks for a tile, and how large it may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ask {
    pub(crate) worker: WorkerId,
    /// Workers that there are for this job.
    pub(crate) able: u32,
    /// A tile of more than one cell is not larger than this; absent, none has more than one.
    pub(crate) most: Option<Amount>,
    /// A tile is not larger than this, in the time that the worker has left.
    pub(crate) fits: Option<Amount>,
    /// What costs more than this, others had better begin: here it would be done after all else.
    pub(crate) lasts: Option<u64>,
    /// Where it is asked for a queue.
    pub(crate) queue: Option<OfQueue>,
}

/// What a queue may have: whole images.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OfQueue {
    /// How an image is cut for it.
    pub(crate) grid: TileGrid,
    /// Whether it may have another image.
    pub(crate) has_room: bool,
    /// Whether nobody else is there for what others have begun.
    pub(crate) is_last: bool,
}

impl Work {
    pub(crate) fn new(grid: TileGrid, map: Option<Arc<CostMap>>, focus: Option<Rect>) -> Self {
        let count = usize::try_from(grid.count()).expect("a submission's tiles are limited");
        let mut work = Self {
            pixels: PixelsDone::none(grid.window()),
            tiles: Tiles::default(),
            spent: 0,
            given_up: false,
            grid,
            queue: None,
            map,
            focus,
            cells: vec![NO_TILE; count],
            pieces: BTreeMap::new(),
            troubled: VecDeque::new(),
            checks: Checks::new(),
            unverified: 0,
            makers: BTreeSet::new(),
            shared: BTreeSet::new(),
            open: Amount::default(),
        };
        work.put(Piece {
            region: Region::whole(grid),
            trouble: Trouble::default(),
            evidence: Evidence::default(),
        });
        work
    }

    /// Whether any tile or piece waits for a worker, or a check does.
    pub(crate) fn has_open(&self) -> bool {
        self.has_missing() || (!self.checks.is_empty() && !self.given_up)
    }

    /// Whether any pixel that is not durable waits for a worker.
    pub(crate) fn has_missing(&self) -> bool {
        let waits = !self.shared.is_empty() || !self.pieces.is_empty() || !self.troubled.is_empty();
        waits && !self.given_up
    }

    /// Whether one waits in the region of interest.
    pub(crate) fn has_focused(&self) -> bool {
        let first = self.pieces.first_key_value();
        self.has_open() && first.is_some_and(|(order, _)| order.0.0)
    }

    /// How much waits for a worker.
    pub(crate) fn open(&self) -> Amount {
        self.open
    }

    /// Whether its costs are known.
    pub(crate) fn is_measured(&self) -> bool {
        self.map.is_some()
    }

    /// Whether one waits for this worker.
    pub(crate) fn has_for(&self, ask: &Ask) -> bool {
        !self.given_up
            && self.suits(ask)
            && (self.shared_for(ask).is_some()
                || self.troubled_for(ask).is_some()
                || self.piece_for(ask).is_some()
                || self.check_for(ask).is_some())
    }

    /// The tile of which this worker is to make an attempt.
    pub(crate) fn take(&mut self, ask: &Ask) -> Option<u32> {
        while !self.given_up && self.suits(ask) {
            if let Some(tile) = self.shared_for(ask) {
                self.shared.remove(&tile);
                return Some(tile);
            }
            let cheap = self.wants_cheap(ask);
            let piece = match self.troubled_for(ask) {
                Some(index) => self.troubled.remove(index),
                None => match self.piece_for(ask) {
                    Some(order) => self.pieces.remove(&order),
                    None => return self.take_check(ask),
                },
            }?;
            let amount = self.amount(piece.region);
            self.open.pixels -= amount.pixels;
            self.open.cost -= amount.cost;
            let piece = self.cut(piece, ask, cheap);
            // What other attempts delivered late is not rendered again.
            let rect = piece.region.rect(self.grid);
            let missing = self.missing(rect);
            let Piece {
                region,
                trouble,
                evidence,
            } = piece;
            if missing > 0 {
                let tile = Tile::new((region, rect), missing, (trouble, evidence));
                let tile = self.tiles.insert(tile);
                self.mark(region, tile);
                return Some(tile);
            }
        }
        None
    }

    /// Whether whoever asks may have of it: a queue has what was cut for it, and the rest where nobody else is there.
    fn suits(&self, ask: &Ask) -> bool {
        ask.queue
            .is_none_or(|queue| self.queue == Some(ask.worker) || (queue.has_room && queue.is_last))
    }

    /// Has it taken by a queue.
    pub(crate) fn is_for(&mut self, queue: WorkerId) {
        self.queue = Some(queue);
    }

    /// Cuts it anew, where nobody holds a tile of it and nothing is to be known of what they made.
    pub(crate) fn cut_anew(&mut self, grid: TileGrid, map: Option<Arc<CostMap>>) {
        let is_free = self.tiles.is_empty() && self.checks.is_empty() && !self.given_up;
        if self.grid != grid && is_free {
            let pixels = core::mem::replace(&mut self.pixels, PixelsDone::none(grid.window()));
            let (spent, makers) = (self.spent, core::mem::take(&mut self.makers));
            *self = Self {
                pixels,
                spent,
                makers,
                ..Self::new(grid, map, self.focus)
            };
        }
    }

    /// Whether these pixels are a tile's that could have been cut, and not all durable.
    pub(crate) fn may_claim(&self, rect: Rect) -> bool {
        Region::at(rect, self.grid).is_some() && self.missing(rect) > 0
    }

    /// Makes a tile of these pixels for an attempt that is there already; `None` where they are no tile's that could
    /// have been cut, are in another tile, or are all durable.
    pub(crate) fn claim(&mut self, rect: Rect) -> Option<u32> {
        let region = Region::at(rect, self.grid).filter(|_| !self.given_up)?;
        let is_free = |cell: usize| self.cells[cell] == NO_TILE;
        let missing = self.missing(rect);
        if missing == 0 || !region.indices(self.grid).all(is_free) {
            return None;
        }
        let known = self.take_out(region);
        let tile = self.tiles.insert(Tile::new((region, rect), missing, known));
        self.mark(region, tile);
        Some(tile)
    }

    /// Takes a region that no tile holds out of the pieces; what went wrong in it, and what was made of it.
    fn take_out(&mut self, region: Region) -> (Trouble, Evidence) {
        let touches =
            |piece: &Piece| piece.region.contains(region) || region.contains(piece.region);
        let plain = self.pieces.iter().filter(|(_, piece)| touches(piece));
        let plain: Vec<Order> = plain.map(|(&order, _)| order).collect();
        let mut touched: Vec<Piece> = plain
            .iter()
            .filter_map(|order| self.pieces.remove(order))
            .collect();
        let (troubled, others) = core::mem::take(&mut self.troubled)
            .into_iter()
            .partition::<VecDeque<_>, _>(touches);
        self.troubled = others;
        touched.extend(troubled);
        let (mut trouble, mut evidence) = (Trouble::default(), Evidence::default());
        for mut piece in touched {
            let amount = self.amount(piece.region);
            self.open.pixels -= amount.pixels;
            self.open.cost -= amount.cost;
            trouble.add(&piece.trouble);
            // What of it lies outside waits on.
            while piece.region != region && piece.region.contains(region) {
                let Some((first, second)) = piece.region.split() else {
                    break;
                };
                let (inside, outside) = match first.contains(region) {
                    true => (first, second),
                    false => (second, first),
                };
                self.put(Piece {
                    region: outside,
                    trouble: piece.trouble.clone(),
                    evidence: piece.evidence.take(outside.rect(self.grid)),
                });
                piece.region = inside;
            }
            evidence.add(piece.evidence);
        }
        (trouble, evidence)
    }

    /// Live attempts at tiles that hold any of these pixels.
    pub(crate) fn attempts_in(&self, rect: Rect) -> Vec<u64> {
        let tiles = self.tiles.iter().map(|(_, tile)| tile);
        let touched = tiles.filter(|tile| tile.rect.intersection(rect).is_some());
        touched.flat_map(Tile::attempts).collect()
    }

    fn shared_for(&self, ask: &Ask) -> Option<u32> {
        let fits = |&&tile: &&u32| {
            let tile = self.tiles.get(tile);
            tile.is_some_and(|tile| self.fits(tile.region, ask))
        };
        self.shared.iter().find(fits).copied()
    }

    fn troubled_for(&self, ask: &Ask) -> Option<usize> {
        let first = self.troubled.iter().take(LOOKED_AT_MAX);
        first.into_iter().position(|piece| {
            piece.trouble.suits(ask.worker, ask.able) && self.fits_smallest(piece.region, ask)
        })
    }

    /// A worker that has time enough gets the first piece, others the cheapest.
    fn piece_for(&self, ask: &Ask) -> Option<Order> {
        if !self.wants_cheap(ask) {
            return self.pieces.first_key_value().map(|(&order, _)| order);
        }
        let (&order, piece) = self.pieces.last_key_value()?;
        self.fits_smallest(piece.region, ask).then_some(order)
    }

    /// Whether a worker is near its end, or so slow that the dearest cell would keep it for longer
    /// than the job still takes.
    fn wants_cheap(&self, ask: &Ask) -> bool {
        let lasts = |most: u64| {
            let first = self.pieces.first_key_value();
            first.is_some_and(|(order, _)| u64::from(order.1.0) > most)
        };
        ask.fits.is_some() || ask.lasts.is_some_and(lasts)
    }

    /// Whether the last cell that a piece is cut down to fits.
    fn fits_smallest(&self, mut region: Region, ask: &Ask) -> bool {
        if ask.fits.is_none() {
            return true;
        }
        while let Some((first, second)) = region.split() {
            region = self.choose(first, second, true).0;
        }
        self.fits(region, ask)
    }

    /// Whether a worker has time for all of a region.
    pub(crate) fn fits(&self, region: Region, ask: &Ask) -> bool {
        ask.fits.is_none_or(|fits| !self.exceeds(region, fits))
    }

    /// Cuts a piece down to what is asked for; the rest waits on.
    fn cut(&mut self, mut piece: Piece, ask: &Ask, cheap: bool) -> Piece {
        loop {
            let is_large = ask.most.is_none_or(|most| self.exceeds(piece.region, most))
                || !self.fits(piece.region, ask);
            let halves = piece.region.split().filter(|_| is_large);
            let Some((first, second)) = halves else {
                return piece;
            };
            let (taken, left) = self.choose(first, second, cheap);
            self.put(Piece {
                region: left,
                trouble: piece.trouble.clone(),
                evidence: piece.evidence.take(left.rect(self.grid)),
            });
            piece.region = taken;
        }
    }

    /// Of two halves the one that is taken, and the other.
    fn choose(&self, first: Region, second: Region, cheap: bool) -> (Region, Region) {
        let in_order = self.order(first) <= self.order(second);
        match in_order != cheap {
            true => (first, second),
            false => (second, first),
        }
    }

    fn order(&self, region: Region) -> Order {
        let focus = self
            .focus
            .map(|focus| focus.intersection(region.rect(self.grid)));
        let peak = self.map.as_ref().map_or(0, |map| map.peak(region));
        (
            Reverse(focus.flatten().is_some()),
            Reverse(peak),
            region.node,
        )
    }

    fn amount(&self, region: Region) -> Amount {
        Amount {
            pixels: region.rect(self.grid).area(),
            cost: self.map.as_ref().map_or(0, |map| map.sum(region)),
        }
    }

    fn exceeds(&self, region: Region, most: Amount) -> bool {
        self.is_more(self.amount(region), most)
    }

    fn is_more(&self, amount: Amount, most: Amount) -> bool {
        match self.map {
            Some(_) => amount.cost > most.cost,
            None => amount.pixels > most.pixels,
        }
    }

    fn put(&mut self, piece: Piece) {
        let amount = self.amount(piece.region);
        self.open.pixels += amount.pixels;
        self.open.cost += amount.cost;
        if piece.trouble.failed_on.is_empty() {
            self.pieces.insert(self.order(piece.region), piece);
        } else {
            self.troubled.push_back(piece);
        }
    }

    fn mark(&mut self, region: Region, tile: u32) {
        for index in region.indices(self.grid) {
            self.cells[index] = tile;
        }
    }

    /// Lets a tile that nobody renders wait again, if something of it is to be rendered.
    pub(crate) fn reopen(&mut self, tile: u32, now: Timestamp) -> Reopened {
        let Some(tile) = self.close(tile) else {
            return Reopened::Plain;
        };
        let Tile {
            region,
            trouble,
            evidence,
            ..
        } = tile;
        if tile.missing > 0 {
            self.put(Piece {
                region,
                trouble,
                evidence,
            });
        } else if let Some(check) = tile.check.filter(|check| !check.is_done()) {
            self.put_check(region, *check, now);
            return Reopened::Checks;
        }
        Reopened::Plain
    }

    /// Forgets a tile that is done.
    pub(crate) fn close(&mut self, tile: u32) -> Option<Tile> {
        self.shared.remove(&tile);
        let closed = self.tiles.remove(tile)?;
        self.mark(closed.region, NO_TILE);
        Some(closed)
    }

    /// Opens a tile to a second attempt, or no more.
    pub(crate) fn share(&mut self, tile: u32, shared: bool) {
        // Who helped with a check might have made what it checks.
        let checks = self
            .tiles
            .get(tile)
            .is_some_and(|tile| tile.check.is_some());
        if shared && !checks {
            self.shared.insert(tile);
        } else {
            self.shared.remove(&tile);
        }
    }

    pub(crate) fn is_shared(&self, tile: u32) -> bool {
        self.shared.contains(&tile)
    }

    /// Moves what lies in a region of interest to the front.
    pub(crate) fn focus(&mut self, focus: Option<Rect>) {
        self.focus = focus;
        for piece in core::mem::take(&mut self.pieces).into_values() {
            self.pieces.insert(self.order(piece.region), piece);
        }
    }

    /// Whether every pixel is durable, and nothing is to be rendered once more.
    pub(crate) fn is_finished(&self) -> bool {
        self.pixels.is_complete() && self.checks.is_empty() && self.tiles.is_empty()
    }

    /// The tile that a block is part of, if one is.
    pub(crate) fn tile_of(&self, block: Rect) -> Option<u32> {
        let cell = self.grid.index_of(block)?;
        let tile = self.cells[cell as usize];
        (tile != NO_TILE).then_some(tile)
    }

    /// Whether pixels are part of one cell: those of a block are, unless the image was cut anew since.
    pub(crate) fn is_in_a_cell(&self, block: Rect) -> bool {
        self.grid.index_of(block).is_some()
    }

    /// Counts anew what is missing of the tiles around some pixels; those of which nothing is.
    pub(crate) fn count_anew(&mut self, rect: Rect) -> Vec<u32> {
        let tiles = self.tiles.iter();
        let touched = tiles.filter(|(_, tile)| tile.rect.intersection(rect).is_some());
        let missing = touched.map(|(number, tile)| (number, self.missing(tile.rect)));
        let missing: Vec<(u32, u64)> = missing.collect();
        let mut done = Vec::new();
        for (number, missing) in missing {
            if let Some(tile) = self.tiles.get_mut(number) {
                let was_missing = core::mem::replace(&mut tile.missing, missing);
                if missing == 0 && was_missing > 0 {
                    done.push(number);
                }
            }
        }
        done
    }

    /// The blocks of a tile that a worker is to render, in order; empty where all are.
    pub(crate) fn wanted(&self, tile: &Tile, worker: WorkerId) -> Vec<Rect> {
        if let Some(check) = &tile.check {
            let wanted = check.wanted(worker);
            let is_all = wanted.len() == tile.rect.blocks().count();
            return if is_all { Vec::new() } else { wanted };
        }
        if tile.missing == tile.rect.area() {
            return Vec::new();
        }
        let blocks = tile.rect.blocks();
        blocks.filter(|&block| !self.pixels.covers(block)).collect()
    }

    fn missing(&self, rect: Rect) -> u64 {
        if self.pixels.count() == 0 {
            return rect.area();
        }
        rect.blocks().map(|block| self.pixels.missing(block)).sum()
    }

    /// What waits around a pixel, if it is part of a piece: what went wrong there.
    pub(crate) fn trouble_at(&self, block: Rect) -> Option<&Trouble> {
        let holds = |piece: &&Piece| piece.region.rect(self.grid).contains(block);
        let mut pieces = self.troubled.iter().chain(self.pieces.values());
        pieces.find(holds).map(|piece| &piece.trouble)
    }

    /// Asserts what must hold of it.
    pub(crate) fn check(&self) {
        let mut pixels = 0;
        let mut open = Amount::default();
        for (number, tile) in self.tiles.iter() {
            let mut cells = tile.region.indices(self.grid);
            assert!(cells.all(|cell| self.cells[cell] == number));
            assert_eq!(tile.missing, self.missing(tile.rect));
            assert!(
                (tile.missing > 0) != tile.check.is_some(),
                "a tile that is done is forgotten, or rendered once more"
            );
            assert!(tile.live_count() > 0, "somebody renders a tile");
            pixels += tile.rect.area();
        }
        for piece in self.pieces.values().chain(&self.troubled) {
            let mut cells = piece.region.indices(self.grid);
            assert!(cells.all(|cell| self.cells[cell] == NO_TILE));
            open.pixels += self.amount(piece.region).pixels;
            open.cost += self.amount(piece.region).cost;
        }
        for (&order, piece) in &self.pieces {
            assert_eq!(order, self.order(piece.region));
        }
        assert_eq!(open, self.open);
        assert!(
            pixels + open.pixels <= self.grid.window().area(),
            "no pixel is in two tiles"
        );
        assert!(
            self.shared
                .iter()
                .all(|&tile| self.tiles.get(tile).is_some())
        );
        for waiting in &self.checks {
            let mut cells = waiting.region.indices(self.grid);
            assert!(cells.all(|cell| self.cells[cell] == NO_TILE));
            let rect = waiting.region.rect(self.grid);
            assert_eq!(self.missing(rect), 0, "it was done");
            assert!(!waiting.check.is_done());
            assert!(waiting.check.blocks().all(|block| rect.contains(block)));
        }
        assert!(!self.is_finished(), "a complete image is encoded");
    }
}
