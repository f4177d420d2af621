//! The link: dialling, greeting, heartbeats, and what its loss means.

use alloc::string::String;
use alloc::vec::Vec;

use model::{AttemptId, Running, Span, Timestamp};

use crate::held::{Held, Phase};
use crate::leave::Leaving;
use crate::{Effect, ExitReason, LinkState, Retry, Session, Welcome};

/// The shortest interval between heartbeats that a coordinator may ask for.
const HEARTBEAT_LEAST: Span = Span::from_millis(10);

/// Where the link stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Link {
    /// The program is not up.
    Unstarted,
    /// There is none until `redial`.
    Down { redial: Timestamp },
    /// The shell dials; it takes too long at `limit`.
    Dialling { limit: Timestamp },
    /// Hello was said.
    Greeting { limit: Timestamp },
    /// Welcomed.
    Up { heartbeat: Timestamp },
}

/// What is known of the coordinator.
#[derive(Clone, Default, Debug)]
pub(crate) struct Coordinator {
    heartbeat_interval: Span,
    liveness_limit: Span,
    /// When it counts what is held as dead, since the link broke.
    pub(crate) dead_at: Option<Timestamp>,
    /// Since when it was not reached.
    away_since: Option<Timestamp>,
    /// Links in a row that broke before they had lasted.
    failures: u32,
    /// What was wrong last.
    trouble: String,
}

impl Link {
    pub(crate) fn deadline(self) -> Option<Timestamp> {
        match self {
            Self::Unstarted => None,
            Self::Down { redial } => Some(redial),
            Self::Dialling { limit } | Self::Greeting { limit } => Some(limit),
            Self::Up { heartbeat } => Some(heartbeat),
        }
    }

    pub(crate) fn state(self) -> LinkState {
        match self {
            Self::Unstarted | Self::Down { .. } => LinkState::Down,
            Self::Dialling { .. } | Self::Greeting { .. } => LinkState::Connecting,
            Self::Up { .. } => LinkState::Up,
        }
    }

    pub(crate) fn is_up(self) -> bool {
        matches!(self, Self::Up { .. })
    }
}

impl Session {
    pub(crate) fn started(&mut self, out: &mut Vec<Effect>) {
        if self.link == Link::Unstarted {
            self.coordinator.away_since = Some(self.now);
            self.dial(out);
        }
    }

    fn dial(&mut self, out: &mut Vec<Effect>) {
        let limit = self.now + self.config.connect_limit;
        self.link = Link::Dialling { limit };
        out.push(Effect::Connect);
    }

    pub(crate) fn dialled(&mut self, out: &mut Vec<Effect>) {
        if let Link::Dialling { limit } = self.link {
            self.link = Link::Greeting { limit };
            let held = self.held.keys().copied().collect();
            let begun = self.held.values().filter_map(Held::begun).collect();
            out.push(Effect::SendHello { held, begun });
        }
    }

    pub(crate) fn connected(&mut self, welcome: Welcome, out: &mut Vec<Effect>) {
        if !matches!(self.link, Link::Greeting { .. }) {
            return;
        }
        let interval = welcome.heartbeat_interval.max(HEARTBEAT_LEAST);
        self.link = Link::Up {
            heartbeat: self.now + interval,
        };
        self.coordinator.heartbeat_interval = interval;
        self.coordinator.liveness_limit = welcome.liveness_limit;
        self.coordinator.dead_at = None;
        self.coordinator.away_since = None;
        // Another epoch numbers its attempts anew.
        self.newest = self.newest.filter(|newest| newest.epoch == welcome.epoch);
        self.reconcile(&welcome, out);
        self.send_credit(out);
        self.resend_all(out);
    }

    /// Forgets what is dead at the coordinator, and gives back what only lives there.
    fn reconcile(&mut self, welcome: &Welcome, out: &mut Vec<Effect>) {
        let lives = |attempt: &AttemptId| welcome.live.contains(attempt);
        let held: Vec<AttemptId> = self.held.keys().copied().collect();
        for attempt in held.into_iter().filter(|attempt| !lives(attempt)) {
            self.drop_attempt(attempt, out);
        }
        let strange = |attempt: &AttemptId| !self.held.contains_key(attempt);
        let attempts: Vec<AttemptId> = welcome.live.iter().copied().filter(strange).collect();
        if !attempts.is_empty() {
            out.push(Effect::GiveBack { attempts });
        }
    }

    pub(crate) fn link_lost(&mut self, reason: String, out: &mut Vec<Effect>) {
        match self.link {
            Link::Unstarted | Link::Down { .. } => return,
            Link::Dialling { .. } | Link::Greeting { .. } => {}
            Link::Up { .. } => {
                self.coordinator.dead_at = Some(self.now + self.coordinator.liveness_limit);
            }
        }
        let coordinator = &mut self.coordinator;
        coordinator.away_since.get_or_insert(self.now);
        coordinator.trouble = reason;
        let wait = self.config.backoff.wait(coordinator.failures);
        coordinator.failures = coordinator.failures.saturating_add(1);
        self.link = Link::Down {
            redial: self.now + wait,
        };
        // All that is kept is sent again on the next link.
        self.resends.clear();
        self.ahead.forgets();
        if let Leaving::Stopping { .. } = self.leaving {
            self.exit(ExitReason::Stopped, out);
        }
    }

    pub(crate) fn refused(&mut self, reason: String, retry: Retry, out: &mut Vec<Effect>) {
        match retry {
            Retry::Later => self.link_lost(reason, out),
            Retry::Never => self.exit(ExitReason::Refused { reason }, out),
        }
    }

    /// When the session has tried to reach its coordinator for long enough.
    pub(crate) fn gives_up_at(&self) -> Option<Timestamp> {
        let since = self.coordinator.away_since?;
        Some(since + self.config.give_up)
    }

    pub(crate) fn link_due(&mut self, out: &mut Vec<Effect>) {
        if self.coordinator.dead_at.is_some_and(|due| due <= self.now) {
            self.coordinator.dead_at = None;
            self.forget_waiting();
        }
        if self.gives_up_at().is_some_and(|due| due <= self.now) {
            let reason = core::mem::take(&mut self.coordinator.trouble);
            self.exit(ExitReason::GaveUp { reason }, out);
            return;
        }
        if self.link.deadline().is_none_or(|due| due > self.now) {
            return;
        }
        match self.link {
            Link::Unstarted => {}
            Link::Down { .. } => self.dial(out),
            Link::Dialling { .. } => {
                out.push(Effect::CloseLink);
                self.link_lost("the coordinator could not be reached in time".into(), out);
            }
            Link::Greeting { .. } => {
                out.push(Effect::CloseLink);
                self.link_lost("the coordinator did not answer in time".into(), out);
            }
            Link::Up { .. } => self.heartbeat(out),
        }
    }

    fn heartbeat(&mut self, out: &mut Vec<Effect>) {
        // A link that lasted so long has ended the series of failures.
        self.coordinator.failures = 0;
        self.link = Link::Up {
            heartbeat: self.now + self.coordinator.heartbeat_interval,
        };
        let running = self
            .held
            .iter()
            .filter(|(_, held)| held.phase != Phase::Waiting)
            .map(|(&attempt, held)| Running {
                attempt,
                blocks: held.rendered,
            })
            .collect();
        out.push(Effect::SendHeartbeat { running });
        self.ahead.settles();
        if self.credit() != self.credit_told {
            self.send_credit(out);
        }
    }
}
