//! How many tiles a worker holds beyond those that it renders, so that no thread waits (thesis C.3.5).
//!
//! While a tile is delivered and the next one comes, a round trip passes in which each thread may
//! finish what it has. So a worker wants as many tiles ahead as its threads render in
//! two round trips, and one more. Both times are measured: a round trip from a block's sending to
//! its acknowledgement, with which the next lease comes; a tile from its start to its last block.
//!
//! What is measured is not all: where a machine is busy, or a disk slow for a while, it says too little. So a worker that holds all it
//! asked for, and a thread of which has nothing to begin, *starves*: it asks for twice as many ahead at once, again as soon as
//! it has those and starves still, and comes back to what is measured bit by bit.

use model::{AttemptId, Rect, Span, Timestamp};

/// The weight of the newest measurement: one in so many.
const NEWEST: u64 = 8;

/// Round trips that what is held ahead must last for.
const ROUND_TRIPS: u64 = 2;

/// What was measured.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ahead {
    round_trip: Option<Span>,
    tile: Option<Span>,
    /// What it took lately that no thread waits, as far as was found by waiting.
    reach: u64,
    /// A block on its way, and when it was sent. One at a time is watched.
    watched: Option<(AttemptId, Rect, Timestamp)>,
}

impl Ahead {
    /// A block was sent for the first time.
    pub(crate) fn sends(&mut self, attempt: AttemptId, rect: Rect, now: Timestamp) {
        self.watched.get_or_insert((attempt, rect, now));
    }

    /// A block was acknowledged.
    pub(crate) fn hears(&mut self, attempt: AttemptId, rect: Rect, now: Timestamp) {
        if let Some((_, _, sent)) = self
            .watched
            .take_if(|(of, block, _)| (*of, *block) == (attempt, rect))
        {
            note(&mut self.round_trip, now - sent);
        }
    }

    /// What is on its way says nothing any more: it may be sent again.
    pub(crate) fn forgets(&mut self) {
        self.watched = None;
    }

    /// A thread rendered a tile.
    pub(crate) fn renders(&mut self, took: Span) {
        note(&mut self.tile, took);
    }

    /// So many tiles ahead are not enough.
    pub(crate) fn starves(&mut self, tiles: u32) {
        self.reach = self.reach.max(u64::from(tiles.max(1)) * 2);
    }

    /// A while has passed.
    pub(crate) fn settles(&mut self) {
        self.reach -= self.reach.div_ceil(NEWEST);
    }

    /// How many tiles to hold ahead, `unmeasured` where nothing is known.
    pub(crate) fn tiles(&self, threads: u32, unmeasured: u32) -> u64 {
        let measured = self.round_trip.zip(self.tile).map(|(round_trip, tile)| {
            let wait = round_trip.times(ROUND_TRIPS).times(u64::from(threads));
            1 + wait.0.div_ceil(tile.0.max(1))
        });
        let measured = measured.unwrap_or(u64::from(unmeasured));
        measured.max(self.reach)
    }
}

fn note(mean: &mut Option<Span>, newest: Span) {
    *mean = Some(match *mean {
        Some(old) => Span(old.0 - old.0 / NEWEST + newest.0 / NEWEST),
        None => newest,
    });
}
