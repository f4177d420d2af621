//! How many tiles a worker holds beyond those that it renders, so that no thread waits (thesis C.3.5).
//!
//! While a tile is delivered and the next one comes, a round trip passes in which each thread may
//! finish what it has. So a worker wants as many tiles ahead as its threads render in
//! two round trips, and one more. Both times are measured: a round trip from a block's sending to
//! its acknowledgement, with which the next lease comes; a tile from its start to its last block.

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

    /// How many tiles to hold ahead; `None` while that is not known.
    pub(crate) fn tiles(&self, threads: u32) -> Option<u64> {
        let (round_trip, tile) = (self.round_trip?, self.tile?);
        let wait = round_trip.times(ROUND_TRIPS).times(u64::from(threads));
        Some(1 + wait.0.div_ceil(tile.0.max(1)))
    }
}

fn note(mean: &mut Option<Span>, newest: Span) {
    *mean = Some(match *mean {
        Some(old) => Span(old.0 - old.0 / NEWEST + newest.0 / NEWEST),
        None => newest,
    });
}
