//! Leaving: let go, asked to stop, or for good.

use alloc::vec::Vec;

use model::{AttemptId, Timestamp};

use crate::held::Phase;
use crate::{Effect, ExitReason, Session};

/// Whether the session is on its way out.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Leaving {
    No,
    /// It finishes what runs and takes nothing new.
    Draining,
    /// It waits for answers to the blocks that are rendered, but not beyond `limit`.
    Stopping {
        limit: Timestamp,
    },
    /// It has exited.
    Gone,
}

impl Leaving {
    pub(crate) fn deadline(self) -> Option<Timestamp> {
        match self {
            Self::Stopping { limit } => Some(limit),
            Self::No | Self::Draining | Self::Gone => None,
        }
    }
}

impl Session {
    pub(crate) fn drain(&mut self, out: &mut Vec<Effect>) {
        if self.leaving != Leaving::No {
            return;
        }
        self.leaving = Leaving::Draining;
        self.say_no_more(out);
    }

    pub(crate) fn stop(&mut self, out: &mut Vec<Effect>) {
        if let Leaving::Stopping { .. } = self.leaving {
            return self.exit(ExitReason::Stopped, out);
        }
        if !self.link.is_up() {
            // Nobody hears; the coordinator leases the tiles again because the link is gone.
            return self.exit(ExitReason::Stopped, out);
        }
        let was_draining = self.leaving == Leaving::Draining;
        self.leaving = Leaving::Stopping {
            limit: self.now + self.config.stop_limit,
        };
        if !was_draining {
            self.say_no_more(out);
        }
        self.stop_threads(out);
    }

    /// Wants no more tiles, and gives back those that no thread has started.
    fn say_no_more(&mut self, out: &mut Vec<Effect>) {
        let attempts: Vec<AttemptId> = self.waiting.iter().copied().collect();
        self.forget_waiting();
        if self.link.is_up() {
            self.send_credit(out);
            if !attempts.is_empty() {
                out.push(Effect::GiveBack { attempts });
            }
        }
    }

    fn stop_threads(&mut self, out: &mut Vec<Effect>) {
        let running = self
            .held
            .iter_mut()
            .filter(|(_, held)| held.phase == Phase::Running);
        let mut stopped = Vec::new();
        for (&attempt, held) in running {
            held.phase = Phase::Stopped;
            self.running -= 1;
            out.push(Effect::CancelTile { attempt });
            stopped.push(attempt);
        }
        for attempt in stopped {
            self.settle(attempt, out);
        }
    }

    /// Ends a stop that has waited long enough.
    pub(crate) fn leaving_due(&mut self, out: &mut Vec<Effect>) {
        if self.leaving.deadline().is_some_and(|due| due <= self.now) {
            let attempts: Vec<AttemptId> = self.held.keys().copied().collect();
            out.push(Effect::GiveBack { attempts });
            out.push(Effect::SendGoodbye);
            self.exit(ExitReason::Stopped, out);
        }
    }

    /// Leaves when nothing is held any more, or when what is held can no longer be delivered.
    pub(crate) fn leave_if_done(&mut self, out: &mut Vec<Effect>) {
        let reason = match self.leaving {
            Leaving::Draining => ExitReason::Drained,
            Leaving::Stopping { .. } => ExitReason::Stopped,
            Leaving::No | Leaving::Gone => return,
        };
        let is_dead = !self.link.is_up() && self.coordinator.dead_at.is_none();
        if !self.held.is_empty() && !is_dead {
            return;
        }
        if self.link.is_up() {
            out.push(Effect::SendGoodbye);
        }
        self.exit(reason, out);
    }

    pub(crate) fn exit(&mut self, reason: ExitReason, out: &mut Vec<Effect>) {
        self.leaving = Leaving::Gone;
        out.push(Effect::Exit { reason });
    }
}
