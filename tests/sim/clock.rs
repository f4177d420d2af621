//! A worker's clock: it begins with its process, may jump ahead and stand still, and never goes back.

use model::{Span, Timestamp};

/// Turns the world's time into that of one process.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    /// How far it is ahead of the world's; behind it where negative.
    offset: i64,
    /// It stands still before, by the world's time.
    still_until: Timestamp,
}

impl Clock {
    /// One that begins now.
    pub(crate) fn new(now: Timestamp) -> Self {
        Self {
            offset: -signed(now.0),
            still_until: now,
        }
    }

    pub(crate) fn read(self, now: Timestamp) -> Timestamp {
        let goes = now.max(self.still_until);
        Timestamp(goes.0.saturating_add_signed(self.offset))
    }

    /// When, by the world's time, it shows this.
    pub(crate) fn shows(self, time: Timestamp) -> Timestamp {
        let shown = time.0.saturating_sub_signed(self.offset);
        Timestamp(shown).max(self.still_until)
    }

    pub(crate) fn jumps(&mut self, ahead: Span) {
        self.offset += signed(ahead.0);
    }

    /// Stands still for a while, and then goes on from there.
    pub(crate) fn stands_still(&mut self, now: Timestamp, until: Timestamp) {
        let from = now.max(self.still_until);
        let until = until.max(from);
        self.offset -= signed((until - from).0);
        self.still_until = until;
    }
}

fn signed(microseconds: u64) -> i64 {
    i64::try_from(microseconds).expect("a farm lives for days")
}

#[test]
fn it_never_goes_back() {
    let mut clock = Clock::new(Timestamp(50));
    assert_eq!(clock.read(Timestamp(60)), Timestamp(10));
    clock.stands_still(Timestamp(60), Timestamp(80));
    // Still already: the shorter while is over before.
    clock.stands_still(Timestamp(65), Timestamp(70));
    assert_eq!(clock.read(Timestamp(79)), Timestamp(10));
    assert_eq!(clock.shows(Timestamp(10)), Timestamp(80));
    assert_eq!(clock.read(Timestamp(81)), Timestamp(11));
    assert_eq!(clock.shows(Timestamp(11)), Timestamp(81));
    clock.jumps(Span(5));
    assert_eq!(clock.read(Timestamp(81)), Timestamp(16));
}
