//! What will be due when.
//!
//! Most limits move on before they are reached: a worker is heard of every second, an attempt
//! makes progress. So an alarm that is put off stays where it is armed, and is
//! armed anew when that instant comes. Putting off costs nothing.

use alloc::collections::BTreeSet;

use model::{JobId, Timestamp};

use crate::roster::Place;

/// Something that a limit ends. At one instant a stuck attempt comes first: its
/// end is progress for those that wait behind it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) enum Timer {
    /// An attempt that runs has rendered no block for too long.
    Stuck(u64),
    /// A worker renders nothing of what it holds, and has delivered nothing, for too long.
    Waiting(Place),
    /// A worker that was set aside is let back.
    LetBack(Place),
    /// A worker was not heard of for too long.
    Lost(Place),
    /// Checks of a job wait for too long.
    Unverified(JobId),
}

/// When something is due, kept by whomever it concerns.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct Alarm {
    due: Option<Timestamp>,
    /// Where it stands among the timers; not later than `due`.
    armed: Option<Timestamp>,
}

impl Alarm {
    pub(crate) fn due(self) -> Option<Timestamp> {
        self.due
    }
}

/// Armed timers, in the order in which they go off.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timers(BTreeSet<(Timestamp, Timer)>);

impl Timers {
    /// Sets when `timer` is due; `None` is never.
    pub(crate) fn set(&mut self, timer: Timer, alarm: &mut Alarm, due: Option<Timestamp>) {
        alarm.due = due;
        if let Some(due) = due
            && alarm.armed.is_none_or(|armed| armed > due)
        {
            self.arm(timer, alarm, Some(due));
        }
    }

    /// Takes a timer out for good.
    pub(crate) fn remove(&mut self, timer: Timer, alarm: &mut Alarm) {
        alarm.due = None;
        self.arm(timer, alarm, None);
    }

    /// A timer went off at `now`: says whether it is due, and takes it out; else arms it for when it is.
    pub(crate) fn goes_off(&mut self, timer: Timer, alarm: &mut Alarm, now: Timestamp) -> bool {
        let is_due = alarm.due.is_some_and(|due| due <= now);
        if is_due {
            alarm.due = None;
        }
        self.arm(timer, alarm, alarm.due);
        is_due
    }

    fn arm(&mut self, timer: Timer, alarm: &mut Alarm, at: Option<Timestamp>) {
        if let Some(old) = alarm.armed {
            self.0.remove(&(old, timer));
        }
        if let Some(new) = at {
            self.0.insert((new, timer));
        }
        alarm.armed = at;
    }

    /// When the first one goes off.
    pub(crate) fn next(&self) -> Option<Timestamp> {
        self.0.first().map(|&(at, _)| at)
    }

    /// The first one that goes off at `now`. It stays until [`Self::goes_off`] is asked about it.
    pub(crate) fn first(&self, now: Timestamp) -> Option<Timer> {
        self.0
            .first()
            .filter(|&&(at, _)| at <= now)
            .map(|&(_, timer)| timer)
    }

    /// How many are armed.
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// Asserts that an alarm stands where it says; counts it if it does.
    pub(crate) fn check(&self, timer: Timer, alarm: Alarm) -> usize {
        if let Some(due) = alarm.due {
            assert!(
                alarm.armed.is_some_and(|armed| armed <= due),
                "{timer:?} goes off in time"
            );
        }
        let Some(armed) = alarm.armed else {
            return 0;
        };
        assert!(self.0.contains(&(armed, timer)), "{timer:?} is armed");
        1
    }
}
