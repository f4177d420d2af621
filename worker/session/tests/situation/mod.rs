//! A worker in a situation, told in few words.

#![allow(
    dead_code,
    reason = "each test program uses its own part of the language"
)]

use model::{
    AttemptId, Begun, Digest, Epoch, ImageNumber, ImageRef, JobId, Lease, Rect, Span, Timestamp,
};
use session::{Backoff, Config, Effect, Event, Session, Welcome};

pub(crate) const EPOCH: Epoch = Epoch(3);
pub(crate) const INTERVAL: Span = Span::from_secs(1);
pub(crate) const LIVENESS: Span = Span::from_secs(4);

/// A session, the time, and what it wanted done since somebody last looked.
pub(crate) struct Situation {
    pub(crate) session: Session,
    pub(crate) now: Timestamp,
    effects: Vec<Effect>,
}

pub(crate) fn config() -> Config {
    Config {
        ahead: 1,
        backoff: Backoff {
            first: Span::from_millis(100),
            longest: Span::from_secs(1),
            key: 1,
        },
        ..Config::new(1)
    }
}

impl Situation {
    /// A worker that has not started.
    pub(crate) fn new(config: Config) -> Self {
        Self {
            session: Session::new(config),
            now: Timestamp(1_000_000),
            effects: Vec::new(),
        }
    }

    /// A worker that was welcomed and holds nothing.
    pub(crate) fn connected(config: Config) -> Self {
        let mut situation = Self::new(config);
        situation
            .is_told(Event::Started)
            .is_told(Event::Dialled)
            .is_told(welcome(&[]));
        situation.effects.clear();
        situation
    }

    /// Something happens now.
    pub(crate) fn is_told(&mut self, event: Event) -> &mut Self {
        self.session.handle(self.now, event, &mut self.effects);
        self.session.check_invariants();
        self
    }

    /// It is leased attempts, each of a tile of two blocks.
    pub(crate) fn leased(&mut self, numbers: impl IntoIterator<Item = u64>) -> &mut Self {
        for number in numbers {
            self.is_told(Event::Leased(lease(number)));
        }
        self
    }

    /// Time passes, with a tick whenever one is due.
    pub(crate) fn waits(&mut self, span: Span) -> &mut Self {
        let end = self.now + span;
        while let Some(due) = self.session.next_deadline().filter(|&due| due <= end) {
            assert!(due >= self.now, "a deadline is not left behind");
            self.now = due;
            self.is_told(Event::Tick);
        }
        self.now = end;
        self
    }

    /// It wanted exactly this, and nothing else.
    #[track_caller]
    pub(crate) fn wants(&mut self, effects: &[Effect]) -> &mut Self {
        assert_eq!(self.effects, effects);
        self.effects.clear();
        self
    }

    /// Whatever it wanted so far is of no interest.
    pub(crate) fn never_mind(&mut self) -> Vec<Effect> {
        std::mem::take(&mut self.effects)
    }
}

pub(crate) fn attempt(number: u64) -> AttemptId {
    AttemptId {
        epoch: EPOCH,
        number,
    }
}

/// The first or second block of every tile here.
pub(crate) fn block(index: u32) -> Rect {
    Rect {
        x0: 32 * index,
        y0: 0,
        x1: 32 * (index + 1),
        y1: 32,
    }
}

pub(crate) fn lease(number: u64) -> Lease {
    Lease {
        attempt: attempt(number),
        image: ImageRef {
            job: JobId(1),
            image: ImageNumber(0),
        },
        scene: Digest::default(),
        tile: Rect {
            x0: 0,
            y0: 0,
            x1: 64,
            y1: 32,
        },
        wanted: Vec::new(),
        expected: Span(0),
    }
}

pub(crate) fn welcome(live: &[u64]) -> Event {
    welcome_in(EPOCH, live)
}

pub(crate) fn welcome_in(epoch: Epoch, live: &[u64]) -> Event {
    Event::Connected(Welcome {
        epoch,
        heartbeat_interval: INTERVAL,
        liveness_limit: LIVENESS,
        live: live.iter().copied().map(attempt).collect(),
    })
}

/// What it says of a tile that a thread has begun.
pub(crate) fn begun(number: u64) -> Begun {
    let Lease {
        attempt,
        image,
        tile,
        ..
    } = lease(number);
    Begun {
        attempt,
        image,
        tile,
    }
}

pub(crate) fn lost() -> Event {
    Event::LinkLost {
        reason: "cut".into(),
    }
}

pub(crate) fn rendered(number: u64, index: u32) -> Event {
    Event::BlockRendered {
        attempt: attempt(number),
        rect: block(index),
    }
}

pub(crate) fn tile_rendered(number: u64) -> Event {
    Event::TileRendered {
        attempt: attempt(number),
    }
}

pub(crate) fn acked(number: u64, index: u32) -> Event {
    Event::Acked {
        attempt: attempt(number),
        rect: block(index),
    }
}

pub(crate) fn revoked(number: u64) -> Event {
    Event::Revoked {
        attempt: attempt(number),
    }
}

pub(crate) fn start(number: u64) -> Effect {
    Effect::StartTile {
        lease: lease(number),
    }
}

pub(crate) fn cancel(number: u64) -> Effect {
    Effect::CancelTile {
        attempt: attempt(number),
    }
}

pub(crate) fn send(number: u64, index: u32) -> Effect {
    Effect::SendBlock {
        attempt: attempt(number),
        rect: block(index),
    }
}

pub(crate) fn drop_block(number: u64, index: u32) -> Effect {
    Effect::DropBlock {
        attempt: attempt(number),
        rect: block(index),
    }
}

pub(crate) fn give_back(numbers: &[u64]) -> Effect {
    Effect::GiveBack {
        attempts: numbers.iter().copied().map(attempt).collect(),
    }
}
