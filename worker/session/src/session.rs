//! The session itself: its state, its one door, and what can be asked of it.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec::Vec;

use model::{AttemptId, Rect, Timestamp};

use crate::ahead::Ahead;
use crate::held::{Held, Phase};
use crate::leave::Leaving;
use crate::link::{Coordinator, Link};
use crate::{Config, Effect, Event};

/// A worker's session with its coordinator, over as many links as it takes.
#[derive(Clone, Debug)]
pub struct Session {
    pub(crate) config: Config,
    /// The latest time that was told.
    pub(crate) now: Timestamp,
    pub(crate) link: Link,
    pub(crate) coordinator: Coordinator,
    /// What is held. Attempts are numbered in the order in which they are leased.
    pub(crate) held: BTreeMap<AttemptId, Held>,
    /// Those of it that wait for a thread.
    pub(crate) waiting: BTreeSet<AttemptId>,
    /// The newest attempt that was ever taken.
    pub(crate) newest: Option<AttemptId>,
    /// Tiles that threads render.
    pub(crate) running: u32,
    /// Blocks kept.
    pub(crate) unacked: u32,
    /// Blocks to send again, and when.
    pub(crate) resends: BTreeSet<(Timestamp, AttemptId, Rect)>,
    pub(crate) paused: bool,
    pub(crate) ahead: Ahead,
    /// The credit that the coordinator was told last.
    pub(crate) credit_told: u32,
    /// Whether a lease was given back since: the coordinator waits to hear that there is room.
    pub(crate) turned_away: bool,
    pub(crate) leaving: Leaving,
    /// Since when there is nothing to do.
    pub(crate) idle_since: Option<Timestamp>,
    pub(crate) tiles_delivered: u64,
    pub(crate) blocks_acked: u64,
}

/// What a session is doing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Summary {
    /// How it stands with the coordinator.
    pub link: LinkState,
    /// Tiles that threads render.
    pub running: u32,
    /// Tiles held ahead.
    pub waiting: u32,
    /// Tiles of which only blocks are left to be acknowledged.
    pub delivering: u32,
    /// Blocks rendered and not yet acknowledged.
    pub unacked_blocks: u32,
    /// Tiles delivered so far.
    pub tiles_delivered: u64,
    /// Blocks acknowledged so far.
    pub blocks_acked: u64,
}

/// How a session stands with its coordinator.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LinkState {
    /// Waiting to dial.
    Down,
    /// Dialling, or waiting for the welcome.
    Connecting,
    /// Welcomed.
    Up,
}

impl Session {
    /// A session that waits for [`Event::Started`].
    pub fn new(mut config: Config) -> Self {
        config.threads = config.threads.max(1);
        config.unacked_blocks_max = config
            .unacked_blocks_max
            .max(config.threads.saturating_add(1));
        Self {
            config,
            now: Timestamp::default(),
            link: Link::Unstarted,
            coordinator: Coordinator::default(),
            held: BTreeMap::new(),
            waiting: BTreeSet::new(),
            newest: None,
            running: 0,
            unacked: 0,
            resends: BTreeSet::new(),
            paused: false,
            ahead: Ahead::default(),
            credit_told: 0,
            turned_away: false,
            leaving: Leaving::No,
            idle_since: None,
            tiles_delivered: 0,
            blocks_acked: 0,
        }
    }

    /// Applies one event and appends to `out` what the shell must now do.
    ///
    /// `now` may not decrease; where it does, the latest time told before holds.
    /// After [`Effect::Exit`] nothing has an effect any more.
    pub fn handle(&mut self, now: Timestamp, event: Event, out: &mut Vec<Effect>) {
        self.now = self.now.max(now);
        if self.leaving == Leaving::Gone {
            return;
        }
        match event {
            Event::Started => self.started(out),
            Event::Dialled => self.dialled(out),
            Event::Connected(welcome) => self.connected(welcome, out),
            Event::LinkLost { reason } => self.link_lost(reason, out),
            Event::Refused { reason, retry } => self.refused(reason, retry, out),
            Event::Leased(lease) => self.leased(lease, out),
            Event::Revoked { attempt } => self.drop_attempt(attempt, out),
            Event::BlockRendered { attempt, rect } => self.block_rendered(attempt, rect, out),
            Event::TileRendered { attempt } => self.tile_ends(attempt, Phase::Rendered, out),
            Event::RenderFailed { attempt, reason } => {
                self.tile_ends(attempt, Phase::Failed(reason), out);
            }
            Event::Acked { attempt, rect } => self.acked(attempt, rect, out),
            Event::BlockRefused {
                attempt,
                rect,
                verdict,
            } => self.block_refused(attempt, rect, verdict, out),
            Event::DrainAsked => self.drain(out),
            Event::StopAsked => self.stop(out),
            Event::Tick => self.tick(out),
        }
        if self.leaving != Leaving::Gone {
            self.start_tiles(out);
            self.ask_for_more(out);
            self.leave_if_done(out);
        }
        self.note_idleness();
    }

    /// When an [`Event::Tick`] is next worth sending; `None` while nothing is pending.
    pub fn next_deadline(&self) -> Option<Timestamp> {
        if self.leaving == Leaving::Gone {
            return None;
        }
        [
            self.link.deadline(),
            self.coordinator.dead_at,
            self.gives_up_at(),
            self.resends.first().map(|&(due, ..)| due),
            self.leaving.deadline(),
            self.idle_until(),
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// What it is doing.
    pub fn summary(&self) -> Summary {
        let held = u32::try_from(self.held.len()).unwrap_or(u32::MAX);
        let waiting = u32::try_from(self.waiting.len()).unwrap_or(u32::MAX);
        Summary {
            link: self.link.state(),
            running: self.running,
            waiting,
            delivering: held - waiting - self.running,
            unacked_blocks: self.unacked,
            tiles_delivered: self.tiles_delivered,
            blocks_acked: self.blocks_acked,
        }
    }

    fn tick(&mut self, out: &mut Vec<Effect>) {
        self.link_due(out);
        if self.leaving != Leaving::Gone {
            self.resend_due(out);
            self.leaving_due(out);
        }
        if self.leaving == Leaving::No {
            self.idle_due(out);
        }
    }
}
