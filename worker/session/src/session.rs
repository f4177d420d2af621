//! The session itself.

use alloc::vec::Vec;

use model::Timestamp;

use crate::{Config, Effect, Event};

/// A worker's session with its coordinator, over as many links as it takes.
#[derive(Clone, Debug)]
pub struct Session {
    config: Config,
    deadline: Option<Timestamp>,
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
    /// Tiles rendered, of which blocks are not yet acknowledged.
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
    pub fn new(config: Config) -> Self {
        Self {
            config,
            deadline: None,
        }
    }

    /// Applies one event and appends to `out` what the shell must now do.
    pub fn handle(&mut self, now: Timestamp, event: Event, out: &mut Vec<Effect>) {
        let _ = (now, event, out, &self.config);
    }

    /// When an [`Event::Tick`] is next worth sending; `None` while nothing is pending.
    pub fn next_deadline(&self) -> Option<Timestamp> {
        self.deadline
    }

    /// What it is doing.
    pub fn summary(&self) -> Summary {
        Summary {
            link: LinkState::Down,
            running: 0,
            waiting: 0,
            delivering: 0,
            unacked_blocks: 0,
            tiles_delivered: 0,
            blocks_acked: 0,
        }
    }
}
