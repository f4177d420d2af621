//! A polled site: a cluster from which nothing dials, and the thread of the coordinator that asks after it again and again.
//!
//! What is decided is `cluster::poll`'s, as it runs in the product; here are the queue there, and the rounds of
//! `server::sites::poll` around it. The thread dies with its coordinator, and the next one finds what runs there.

mod poller;
mod queue;

use model::{Span, Timestamp, WorkerId};

use crate::coordinator::Coordinator;
use crate::message::Down;
use crate::random::Random;
use poller::Poller;
use queue::Queue;

/// Ids of workers are smaller.
const FIRST_ID: u64 = 1_000;

/// What does not change of a site.
#[derive(Clone, Copy, Debug)]
struct Settings {
    /// From one look to the next.
    poll: Span,
    /// How long it keeps its tiles while nobody reaches it.
    patience: Span,
    min_tile_pixels: u64,
    array_max: u32,
    ahead: u32,
    /// Tasks that may run at a time.
    slots: u64,
    /// How long a block takes, in the mean.
    pace: Span,
}

pub(crate) struct Site {
    number: u64,
    settings: Settings,
    queue: Queue,
    /// The coordinator's thread, while that is there.
    poller: Option<Poller>,
    away_until: Timestamp,
    is_leaving: bool,
}

impl Site {
    pub(crate) fn new(number: u64, random: &mut Random) -> Self {
        let small = |number: u64| u32::try_from(number).expect("it is small");
        let settings = Settings {
            poll: Span::from_secs(2 + random.below(10)),
            patience: Span::from_secs(10 + random.below(80)),
            min_tile_pixels: 1_000 + random.below(8_000),
            array_max: small(4 + random.below(12)),
            ahead: small(random.below(3)),
            slots: 1 + random.below(4),
            pace: Span::from_millis(20 + random.below(2_000)),
        };
        Self {
            number,
            settings,
            queue: Queue::new(settings.slots, settings.pace, Random::new(random.next())),
            poller: None,
            away_until: Timestamp(0),
            is_leaving: false,
        }
    }

    /// What it is to the scheduler of an epoch: its thread is another worker in each.
    fn worker(&self, coordinator: &Coordinator) -> WorkerId {
        WorkerId {
            id: FIRST_ID + self.number,
            incarnation: coordinator.restarts() + 1,
        }
    }

    pub(crate) fn is(&self, worker: WorkerId) -> bool {
        let poller = self.poller.as_ref();
        poller.is_some_and(|poller| poller.worker() == worker)
    }

    /// A coordinator has started.
    pub(crate) fn begins(&mut self, now: Timestamp, coordinator: &mut Coordinator) {
        let worker = self.worker(coordinator);
        coordinator
            .witness
            .is_patient(worker, self.settings.patience);
        self.poller = Some(Poller::new(now, worker, self.settings));
    }

    /// The coordinator is gone; what runs there runs on.
    pub(crate) fn ends(&mut self) {
        self.poller = None;
    }

    /// Nobody reaches it before.
    pub(crate) fn is_away(&mut self, until: Timestamp) {
        self.away_until = until;
    }

    /// So many of 1,000 blocks end their task by themselves from now on.
    pub(crate) fn dies(&mut self, per_mille: u64) {
        self.queue.deaths = per_mille;
    }

    /// Nothing goes wrong any more, and it is to leave.
    pub(crate) fn leaves(&mut self) {
        self.is_leaving = true;
        self.away_until = Timestamp(0);
        self.dies(0);
    }

    /// Whether it has left and nothing of the farm is there.
    pub(crate) fn has_left(&self) -> bool {
        self.queue.is_empty() && self.poller.as_ref().is_some_and(Poller::has_left)
    }

    /// The loop says something.
    pub(crate) fn hears(&mut self, now: Timestamp, message: Down, coordinator: &Coordinator) {
        if let Some(poller) = &mut self.poller {
            poller.hears(now, message, coordinator);
        }
    }

    /// The loop has ended the line.
    pub(crate) fn is_cut(&mut self, now: Timestamp) {
        if let Some(poller) = &mut self.poller {
            poller.is_cut(now);
        }
    }

    /// When it has something to do next, if that is known.
    pub(crate) fn due(&self) -> Option<Timestamp> {
        self.poller.as_ref().and_then(Poller::due)
    }

    /// Does what is due.
    pub(crate) fn goes_on(
        &mut self,
        now: Timestamp,
        links: &mut u64,
        coordinator: &mut Coordinator,
    ) {
        let Some(poller) = &mut self.poller else {
            return;
        };
        if poller.due().is_none_or(|due| due > now) {
            return;
        }
        let there = (now >= self.away_until).then_some(&mut self.queue);
        poller.goes_on(now, (there, self.is_leaving), links, coordinator);
    }
}
