//! What will be due when.

use alloc::collections::BTreeSet;

use model::{Timestamp, WorkerId};

/// Something that a limit ends. At one instant a stuck attempt comes first: its
/// end is progress for those that wait behind it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) enum Timer {
    /// An attempt that runs has rendered no block for too long.
    Stuck(u64),
    /// A worker renders nothing of what it holds, and has delivered nothing, for too long.
    Waiting(WorkerId),
    /// A worker was not heard of for too long.
    Lost(WorkerId),
}

/// Timers in the order in which they are due; whoever sets one remembers when it is due.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timers(BTreeSet<(Timestamp, Timer)>);

impl Timers {
    /// Moves `timer` from where it is due now, if anywhere, to `due`, if anywhere.
    pub(crate) fn set(
        &mut self,
        timer: Timer,
        slot: &mut Option<Timestamp>,
        due: Option<Timestamp>,
    ) {
        if *slot == due {
            return;
        }
        if let Some(old) = *slot {
            self.0.remove(&(old, timer));
        }
        if let Some(new) = due {
            self.0.insert((new, timer));
        }
        *slot = due;
    }

    /// When the first one is due.
    pub(crate) fn next(&self) -> Option<Timestamp> {
        self.0.first().map(|&(due, _)| due)
    }

    /// The first one that is due at `now`. It stays until it is set anew.
    pub(crate) fn due(&self, now: Timestamp) -> Option<Timer> {
        self.0
            .first()
            .filter(|&&(due, _)| due <= now)
            .map(|&(_, timer)| timer)
    }

    /// How many are set.
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether `timer` is set for `due`.
    pub(crate) fn contains(&self, due: Timestamp, timer: Timer) -> bool {
        self.0.contains(&(due, timer))
    }
}
