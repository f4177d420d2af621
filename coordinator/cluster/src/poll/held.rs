//! What a polled site holds: tiles, and the arrays that they are in.

use std::collections::BTreeSet;

use model::{AttemptId, Lease, Rect, Span};

use crate::orders::Had;

/// A tile that is leased to the site.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    pub(super) lease: Lease,
    pub(super) missing: BTreeSet<Rect>,
    /// Blocks that have arrived, those that an earlier coordinator had among them.
    pub(super) arrived: u32,
    pub(super) inherited: u32,
    /// How long they took one thread.
    pub(super) took: Span,
    /// Bytes of its file that are done with.
    pub(super) offset: u64,
    pub(super) runs: bool,
    pub(super) place: Option<(String, u32)>,
}

/// An array that is there, or may be.
#[derive(Clone, Debug)]
pub(super) struct Array {
    /// The tile of each task, as long as it is wanted.
    pub(super) tiles: Vec<Option<AttemptId>>,
    /// Whether it is known that it was submitted.
    pub(super) is_sure: bool,
    /// Tasks that had not begun when it was last seen.
    pub(super) waiting: u32,
    pub(super) time_limit: Option<Span>,
    /// Tasks that were deleted from here.
    pub(super) deleted: BTreeSet<u32>,
}

/// What became of a tile before.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct History {
    /// Tries in a row that brought nothing.
    pub(super) tries: u32,
    /// What one block takes one thread.
    pub(super) block: Span,
    /// The last limit.
    pub(super) limit: Option<Span>,
    /// When it was last of use.
    pub(super) observation: u64,
}

impl Tile {
    pub(super) fn new(lease: Lease, place: Option<(String, u32)>) -> Self {
        Self {
            missing: lease.blocks().collect(),
            lease,
            arrived: 0,
            inherited: 0,
            took: Span(0),
            offset: 0,
            runs: false,
            place,
        }
    }

    /// An earlier coordinator had this of it already.
    pub(super) fn inherits(&mut self, had: &Had) {
        self.offset = had.0;
        for block in had.blocks() {
            self.inherited += u32::from(self.missing.remove(&block));
        }
        self.arrived = self.inherited;
    }
}

impl Array {
    /// One of which no task has begun.
    pub(super) fn new(tiles: Vec<Option<AttemptId>>) -> Self {
        Self {
            is_sure: true,
            waiting: u32::try_from(tiles.len()).unwrap_or(u32::MAX),
            time_limit: None,
            deleted: BTreeSet::new(),
            tiles,
        }
    }

    pub(super) fn has_begun(&self) -> bool {
        usize::try_from(self.waiting).unwrap_or(usize::MAX) < self.tiles.len()
    }

    pub(super) fn place(&self, task: u32) -> Option<usize> {
        let place = usize::try_from(task.checked_sub(1)?).ok()?;
        (place < self.tiles.len()).then_some(place)
    }

    pub(super) fn attempt(&self, task: u32) -> Option<AttemptId> {
        self.tiles[self.place(task)?]
    }
}
