//! One live try at one tile.

use alloc::vec;
use alloc::vec::Vec;

use model::rect::GRID_SQUARE;
use model::{AttemptId, ImageRef, Rect, Span, Timestamp};

use crate::roster::Place;
use crate::timers::Alarm;

/// A live attempt; it is removed when it ends.
#[derive(Clone, Debug)]
pub(crate) struct Attempt {
    /// What its worker calls it, where that is not its number in this epoch.
    pub(crate) name: Option<AttemptId>,
    pub(crate) worker: Place,
    pub(crate) image: ImageRef,
    /// Number of the tile in its image.
    pub(crate) tile: u32,
    pub(crate) rect: Rect,
    pub(crate) leased: Timestamp,
    /// What it was expected to cost; 0 where nothing was measured.
    pub(crate) cost: u64,
    /// When it is expected to be done.
    pub(crate) finish: Timestamp,
    /// Where it stands among the attempts of its job that could be helped.
    pub(crate) enlisted: Option<Timestamp>,
    /// When it was first known to run.
    pub(crate) started: Option<Timestamp>,
    pub(crate) phase: Phase,
    /// Blocks that its worker said it has rendered.
    pub(crate) rendered: u32,
    /// Blocks that it was leased for.
    wanted: u32,
    /// Blocks that arrived under it and are durable.
    pub(crate) delivered: u32,
    /// One bit per block of the tile, row by row: arrived under this attempt. The first 64 of them…
    arrived: u64,
    /// …and those after them.
    arrived_more: Vec<u64>,
    /// How long it may take over the next block.
    pub(crate) limit: Span,
    /// When it counts as stuck; due while it is [`Phase::Running`].
    pub(crate) stuck: Alarm,
}

/// What its worker is known to do with an attempt.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) enum Phase {
    /// Holds it, and has not started.
    Ahead,
    /// Renders it; it must make progress by itself.
    Running,
    /// Has rendered it, and its last blocks wait their turn on the link.
    Delivering,
}

/// What an attempt starts with.
pub(crate) struct Start {
    pub(crate) worker: Place,
    pub(crate) image: ImageRef,
    pub(crate) tile: u32,
    pub(crate) rect: Rect,
    pub(crate) leased: Timestamp,
    pub(crate) wanted: u32,
    pub(crate) cost: u64,
    pub(crate) finish: Timestamp,
    pub(crate) limit: Span,
}

impl Attempt {
    pub(crate) fn new(start: Start) -> Self {
        let (columns, rows) = squares(start.rect);
        Self {
            name: None,
            worker: start.worker,
            image: start.image,
            tile: start.tile,
            rect: start.rect,
            leased: start.leased,
            cost: start.cost,
            finish: start.finish,
            enlisted: None,
            started: None,
            phase: Phase::Ahead,
            rendered: 0,
            wanted: start.wanted,
            delivered: 0,
            arrived: 0,
            arrived_more: vec![0; (columns * rows).div_ceil(64) - 1],
            limit: start.limit,
            stuck: Alarm::default(),
        }
    }

    /// Notes how many blocks its worker says to have rendered; says whether that is progress.
    pub(crate) fn reports(&mut self, rendered: u32) -> bool {
        let rendered = rendered.min(self.wanted);
        let moved = self.phase == Phase::Ahead || rendered > self.rendered;
        self.rendered = self.rendered.max(rendered);
        moved
    }

    /// The phase that the reports so far amount to, once it is known to have started.
    pub(crate) fn phase_now(&self) -> Phase {
        if self.rendered >= self.wanted {
            Phase::Delivering
        } else {
            Phase::Running
        }
    }

    /// Notes that a block of the tile arrived; says whether it is the first time.
    pub(crate) fn arrives(&mut self, block: Rect) -> bool {
        let first = self.note(block);
        self.delivered += u32::from(first);
        first
    }

    /// Notes that a block of the tile had arrived before the attempt was taken up: it may be sent again.
    pub(crate) fn had_arrived(&mut self, block: Rect) {
        self.note(block);
    }

    fn note(&mut self, block: Rect) -> bool {
        let column = (block.x0 / GRID_SQUARE - self.rect.x0 / GRID_SQUARE) as usize;
        let row = (block.y0 / GRID_SQUARE - self.rect.y0 / GRID_SQUARE) as usize;
        let index = row * squares(self.rect).0 + column;
        let bit = 1 << (index % 64);
        let word = match index / 64 {
            0 => &mut self.arrived,
            more => &mut self.arrived_more[more - 1],
        };
        let first = *word & bit == 0;
        *word |= bit;
        first
    }

    /// Blocks that it was leased for.
    pub(crate) fn wanted(&self) -> u32 {
        self.wanted
    }

    /// Blocks that are rendered, as far as is known.
    pub(crate) fn done(&self) -> u32 {
        self.rendered.max(self.delivered)
    }

    /// Whether its worker has nothing left to send.
    pub(crate) fn is_delivered(&self) -> bool {
        self.delivered >= self.wanted
    }
}

/// Columns and rows of grid squares that a tile touches.
fn squares(tile: Rect) -> (usize, usize) {
    let columns = tile.x1.div_ceil(GRID_SQUARE) - tile.x0 / GRID_SQUARE;
    let rows = tile.y1.div_ceil(GRID_SQUARE) - tile.y0 / GRID_SQUARE;
    (columns as usize, rows as usize)
}

/// The block of `tile` in the grid square of `rect`, if `rect` is that block.
pub(crate) fn is_block_of(tile: Rect, rect: Rect) -> bool {
    let square = |from: u32| {
        (
            from / GRID_SQUARE * GRID_SQUARE,
            (from / GRID_SQUARE + 1).saturating_mul(GRID_SQUARE),
        )
    };
    let ((x0, x1), (y0, y1)) = (square(rect.x0), square(rect.y0));
    !rect.is_empty() && tile.intersection(Rect { x0, y0, x1, y1 }) == Some(rect)
}
