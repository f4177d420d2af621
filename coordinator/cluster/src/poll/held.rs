//! What a polled site holds: tiles, and the arrays that they are in.

use std::collections::BTreeSet;

use model::{AttemptId, Lease, Rect, Span};

/// A tile that is leased to the site.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    pub(super) lease: Lease,
    pub(super) missing: BTreeSet<Rect>,
    /// Blocks that have arrived, those that were there before it was taken up among them.
    pub(super) arrived: u32,
    pub(super) inherited: u32,
    /// Blocks that were durable at some hello, and may lie in its file all the same.
    pub(super) found: Vec<Rect>,
    /// How long they took one thread.
    pub(super) took: Span,
    /// Bytes of its file that are done with.
    pub(super) offset: u64,
    pub(super) runs: bool,
    /// In so many looks in a row its host was gone.
    pub(super) away: u32,
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
            found: Vec::new(),
            took: Span(0),
            offset: 0,
            runs: false,
            away: 0,
            place,
        }
    }

    /// Only these blocks are still wanted of it.
    pub(super) fn lacks(&mut self, missing: &BTreeSet<Rect>) {
        let found: Vec<Rect> = self.missing.difference(missing).copied().collect();
        self.missing.retain(|block| missing.contains(block));
        self.found.extend(&found);
        let found = u32::try_from(found.len()).unwrap_or(u32::MAX);
        self.inherited += found;
        self.arrived += found;
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
