//! Leaving for want of work: a queue's processors are given back while nobody needs them.

use alloc::vec::Vec;

use model::Timestamp;

use crate::leave::Leaving;
use crate::{Effect, ExitReason, Session};

impl Session {
    /// Notes since when there is nothing to do: nothing is held, or what is held is rendered and cannot be delivered.
    pub(crate) fn note_idleness(&mut self) {
        let rests = self.held.is_empty() || (!self.link.is_up() && self.running == 0);
        match rests && self.leaving == Leaving::No {
            true => {
                self.idle_since.get_or_insert(self.now);
            }
            false => self.idle_since = None,
        }
    }

    /// When it leaves for want of work.
    pub(crate) fn idle_until(&self) -> Option<Timestamp> {
        Some(self.idle_since? + self.config.idle?)
    }

    pub(crate) fn idle_due(&mut self, out: &mut Vec<Effect>) {
        if self.idle_until().is_none_or(|until| until > self.now) {
            return;
        }
        if self.link.is_up() {
            out.push(Effect::SendGoodbye);
        }
        self.exit(ExitReason::Idle, out);
    }
}
