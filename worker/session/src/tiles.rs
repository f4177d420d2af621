//! Tiles and blocks: starting, sending, sending again, and forgetting.

use alloc::vec;
use alloc::vec::Vec;

use model::{AttemptId, Lease, Rect};

use crate::held::{Held, Phase};
use crate::leave::Leaving;
use crate::{BlockVerdict, Config, Effect, Session};

impl Session {
    /// How many tiles the worker wants to hold in all (thesis C.3.5).
    pub(crate) fn credit(&self) -> u32 {
        match self.leaving {
            Leaving::No => self.config.threads.saturating_add(self.ahead()),
            _ => 0,
        }
    }

    /// How many of them it does not render.
    fn ahead(&self) -> u32 {
        let Config {
            threads,
            ahead,
            ahead_least,
            ahead_max,
            ..
        } = self.config;
        let tiles = u32::try_from(self.ahead.tiles(threads, ahead)).unwrap_or(u32::MAX);
        tiles.max(ahead_least).min(ahead_max)
    }

    /// Asks for more where a thread has nothing to begin though all that was asked for is here, or where there is
    /// room again after a lease was given back.
    pub(crate) fn ask_for_more(&mut self, out: &mut Vec<Effect>) {
        if !self.link.is_up() || self.leaving != Leaving::No {
            return;
        }
        let held = self.held.len();
        let waits = self.running < self.config.threads && !self.paused;
        let starves = waits && held >= self.credit_told as usize;
        if starves {
            let ahead = self.credit_told.saturating_sub(self.config.threads);
            self.ahead.starves(ahead);
        }
        let credit = self.credit();
        let has_room = self.turned_away && held < credit as usize;
        if (starves && credit > self.credit_told) || has_room {
            self.send_credit(out);
        }
    }

    pub(crate) fn send_credit(&mut self, out: &mut Vec<Effect>) {
        self.turned_away = false;
        self.credit_told = self.credit();
        out.push(Effect::SendCredit {
            credit: self.credit_told,
        });
    }

    pub(crate) fn leased(&mut self, lease: Lease, out: &mut Vec<Effect>) {
        let attempt = lease.attempt;
        if !self.link.is_up() || self.held.contains_key(&attempt) {
            return;
        }
        // Acknowledgements may come after the lease that they made room for, so a
        // worker takes up to twice what it wants. An attempt is leased once: an
        // older one that is not held is over.
        let has_room = self.held.len() < (self.credit() as usize).saturating_mul(2);
        if !has_room || self.newest.is_some_and(|newest| attempt <= newest) {
            let attempts = vec![attempt];
            self.turned_away = true;
            return out.push(Effect::GiveBack { attempts });
        }
        self.newest = Some(attempt);
        self.waiting.insert(attempt);
        self.held.insert(attempt, Held::new(lease));
    }

    /// Starts what waits while threads are free, in the order in which it was leased.
    pub(crate) fn start_tiles(&mut self, out: &mut Vec<Effect>) {
        while self.running < self.config.threads && !self.paused {
            let Some(attempt) = self.waiting.pop_first() else {
                return;
            };
            if let Some(held) = self.held.get_mut(&attempt) {
                held.phase = Phase::Running;
                held.started = self.now;
                self.running += 1;
                let lease = held.lease.clone();
                out.push(Effect::StartTile { lease });
            }
        }
    }

    pub(crate) fn block_rendered(&mut self, attempt: AttemptId, rect: Rect, out: &mut Vec<Effect>) {
        let Some(held) = self.held.get_mut(&attempt) else {
            return out.push(Effect::DropBlock { attempt, rect });
        };
        if held.renders(rect) {
            self.unacked += 1;
            if self.link.is_up() {
                self.ahead.sends(attempt, rect, self.now);
                out.push(Effect::SendBlock { attempt, rect });
            }
            self.press_back(out);
        }
    }

    /// A thread is done with a tile, one way or the other.
    pub(crate) fn tile_ends(&mut self, attempt: AttemptId, phase: Phase, out: &mut Vec<Effect>) {
        if let Some(held) = self.held.get_mut(&attempt)
            && held.phase == Phase::Running
        {
            if phase == Phase::Rendered {
                self.ahead.renders(self.now - held.started);
            }
            held.phase = phase;
            self.running -= 1;
            self.settle(attempt, out);
        }
    }

    pub(crate) fn acked(&mut self, attempt: AttemptId, rect: Rect, out: &mut Vec<Effect>) {
        if let Some(held) = self.held.get_mut(&attempt)
            && held.answers(rect)
        {
            self.ahead.hears(attempt, rect, self.now);
            self.blocks_acked += 1;
            self.unacked -= 1;
            out.push(Effect::DropBlock { attempt, rect });
            self.settle(attempt, out);
            self.press_back(out);
        }
    }

    pub(crate) fn block_refused(
        &mut self,
        attempt: AttemptId,
        rect: Rect,
        verdict: BlockVerdict,
        out: &mut Vec<Effect>,
    ) {
        self.ahead.forgets();
        let Some(held) = self.held.get_mut(&attempt) else {
            return;
        };
        match verdict {
            BlockVerdict::Later if held.unacked.contains(&rect) => {
                let due = self.now + self.config.resend_after;
                self.resends.insert((due, attempt, rect));
            }
            BlockVerdict::Later => {}
            BlockVerdict::AttemptDead => self.drop_attempt(attempt, out),
            BlockVerdict::Never { reason } => {
                self.drop_attempt(attempt, out);
                if self.link.is_up() {
                    out.push(Effect::SendFailed { attempt, reason });
                }
            }
        }
    }

    pub(crate) fn resend_due(&mut self, out: &mut Vec<Effect>) {
        while let Some(&(due, attempt, rect)) = self.resends.first()
            && due <= self.now
        {
            self.resends.pop_first();
            let held = self.held.get(&attempt);
            if held.is_some_and(|held| held.unacked.contains(&rect)) {
                out.push(Effect::SendBlock { attempt, rect });
            }
        }
    }

    /// On a new link: sends every block that is kept, and says what could not be said.
    pub(crate) fn resend_all(&mut self, out: &mut Vec<Effect>) {
        for (&attempt, held) in &self.held {
            let send = |&rect: &Rect| Effect::SendBlock { attempt, rect };
            out.extend(held.unacked.iter().map(send));
        }
        let held: Vec<AttemptId> = self.held.keys().copied().collect();
        for attempt in held {
            self.settle(attempt, out);
        }
    }

    /// Ends an attempt of which nothing is left to do but to say so.
    pub(crate) fn settle(&mut self, attempt: AttemptId, out: &mut Vec<Effect>) {
        let Some(held) = self.held.get(&attempt) else {
            return;
        };
        if !held.unacked.is_empty() {
            return;
        }
        match &held.phase {
            Phase::Waiting | Phase::Running => return,
            Phase::Rendered => self.tiles_delivered += 1,
            Phase::Failed(_) | Phase::Stopped if !self.link.is_up() => return,
            Phase::Failed(reason) => out.push(Effect::SendFailed {
                attempt,
                reason: reason.clone(),
            }),
            Phase::Stopped => out.push(Effect::GiveBack {
                attempts: vec![attempt],
            }),
        }
        self.held.remove(&attempt);
    }

    /// Forgets an attempt that is dead at the coordinator, and its blocks.
    pub(crate) fn drop_attempt(&mut self, attempt: AttemptId, out: &mut Vec<Effect>) {
        let Some(held) = self.held.remove(&attempt) else {
            return;
        };
        self.waiting.remove(&attempt);
        self.ahead.forgets();
        if held.phase == Phase::Running {
            self.running -= 1;
            out.push(Effect::CancelTile { attempt });
        }
        for rect in held.unacked {
            self.unacked -= 1;
            out.push(Effect::DropBlock { attempt, rect });
        }
        self.press_back(out);
    }

    /// Forgets what no thread has started: it is dead at the coordinator, and nothing is lost.
    pub(crate) fn forget_waiting(&mut self) {
        for attempt in core::mem::take(&mut self.waiting) {
            self.held.remove(&attempt);
        }
    }

    /// Pauses rendering before more blocks are kept than there may be, each thread
    /// having one in hand, and lets it go on when half of them are gone.
    fn press_back(&mut self, out: &mut Vec<Effect>) {
        let high = self.config.unacked_blocks_max - self.config.threads;
        if !self.paused && self.unacked >= high {
            self.paused = true;
            out.push(Effect::PauseRendering);
        } else if self.paused && self.unacked <= high / 2 {
            self.paused = false;
            out.push(Effect::ResumeRendering);
        }
    }
}
