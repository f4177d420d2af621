//! The thread of the coordinator that polls a site: one round after the other, as `server::sites::poll` makes them.

use std::collections::BTreeMap;

use cluster::orders::Seen;
use cluster::poll::{Action, Poll, Settings as PollSettings};
use model::{AttemptId, Rect, Running, Span, Timestamp, WorkerId};
use sched::{Event, LinkId, Queue as QueueOffer};
use session::BlockVerdict;

use super::Settings;
use super::queue::{Block, Fetched, Queue};
use crate::coordinator::{Coordinator, REVISION, offer};
use crate::disk::Pixels;
use crate::message::{Down, Up};
use crate::plan::Bug;

/// After so many looks in a row that failed, others may have the site's tiles.
const MISSED_MAX: u32 = 4;

/// The least time between two looks.
const LOOK_LEAST: Span = Span::from_secs(1);

/// Room in what is heard late, beside the looks that may be missed.
const SLACK: Span = Span::from_secs(20);

/// After how long a block comes again for which there was no room.
const COMES_AGAIN: Span = Span::from_millis(50);

/// Where the thread stands in its round.
enum Doing {
    /// It waits until its next look.
    Rests,
    /// It has said hello.
    Connects,
    /// It has handed blocks over, and waits for what becomes of them.
    Delivers(Box<Delivery>),
    /// The loop may lease it more now, which it submits then.
    Submits,
    /// It was told to leave, and has.
    Gone,
}

/// What a call brought.
struct Delivery {
    seen: Seen,
    fetched: Vec<Fetched>,
    is_whole: bool,
    /// Of which it is not known what became of them.
    open: BTreeMap<(AttemptId, Rect), Block>,
    /// Of those, the ones for which there was no room.
    again: Vec<Block>,
    durable: Vec<Block>,
}

pub(super) struct Poller {
    worker: WorkerId,
    settings: Settings,
    poll: Poll,
    /// Its line to the loop.
    line: Option<LinkId>,
    credit: u32,
    running: Vec<Running>,
    beats_next: Timestamp,
    missed: u32,
    /// Hellos that were not answered; what the loop says before the last answer was said on a line that is gone.
    hellos: u32,
    doing: Doing,
    begun: Timestamp,
    due: Timestamp,
}

impl Poller {
    pub(super) fn new(now: Timestamp, worker: WorkerId, settings: Settings) -> Self {
        Self {
            poll: Poll::new(PollSettings {
                // As in the product a name never comes twice.
                names: format!("flyby-{}.{}-", worker.id, worker.incarnation),
                revision: REVISION,
                threads: 1,
                running_max: None,
                array_max: settings.array_max,
                ahead: settings.ahead,
                time_limit: None,
                time_max: None,
            }),
            worker,
            settings,
            line: None,
            credit: 0,
            running: Vec::new(),
            beats_next: now,
            missed: 0,
            hellos: 0,
            doing: Doing::Rests,
            begun: now,
            due: now,
        }
    }

    pub(super) fn worker(&self) -> WorkerId {
        self.worker
    }

    pub(super) fn has_left(&self) -> bool {
        matches!(self.doing, Doing::Gone)
    }

    /// When it goes on by itself.
    pub(super) fn due(&self) -> Option<Timestamp> {
        let goes_on = match &self.doing {
            Doing::Rests | Doing::Submits => true,
            Doing::Delivers(delivery) => !delivery.again.is_empty() || delivery.open.is_empty(),
            Doing::Connects | Doing::Gone => false,
        };
        let next = goes_on.then_some(self.due);
        let beats = self.line.map(|_| self.beats_next);
        next.into_iter().chain(beats).min()
    }

    pub(super) fn hears(&mut self, now: Timestamp, message: Down, coordinator: &Coordinator) {
        if let Down::Welcome(_) | Down::Refused(..) = message {
            self.hellos -= 1;
        }
        if self.line.is_none() || self.hellos > 0 {
            return;
        }
        match message {
            Down::Welcome(welcome) => {
                self.poll.keeps(&welcome.live);
                for attempt in self.poll.held() {
                    let missing = coordinator.sched.missing(self.worker, attempt);
                    if coordinator.plan.bug != Some(Bug::FetchedAgain) {
                        self.poll.lacks(attempt, &missing.unwrap_or_default());
                    }
                }
                self.credit = 0;
                // The round goes on.
                self.doing = Doing::Rests;
                self.due = now;
            }
            Down::Refused(..) => self.is_cut(now),
            Down::Lease(lease) => {
                self.poll.leased(lease);
                self.is_awake();
            }
            Down::Revoke(attempt) => {
                self.poll.revoked(attempt);
                self.is_awake();
            }
            Down::Ack(attempt, rect) => self.answered(now, (attempt, rect), None),
            Down::BlockRefused(attempt, rect, verdict) => {
                self.answered(now, (attempt, rect), Some(verdict));
            }
        }
    }

    /// There may be something to do before the next look is due.
    fn is_awake(&mut self) {
        if matches!(self.doing, Doing::Rests) && self.missed == 0 {
            self.due = self.due.min(self.begun + LOOK_LEAST);
        }
    }

    fn answered(&mut self, now: Timestamp, key: (AttemptId, Rect), refused: Option<BlockVerdict>) {
        let Doing::Delivers(delivery) = &mut self.doing else {
            return;
        };
        let Some(&block) = delivery.open.get(&key) else {
            return;
        };
        if refused == Some(BlockVerdict::Later) {
            delivery.again.push(block);
            self.due = now + COMES_AGAIN;
            return;
        }
        delivery.open.remove(&key);
        if refused.is_none() {
            delivery.durable.push(block);
        }
        if delivery.open.is_empty() {
            self.due = now;
        }
    }

    /// The line is gone; whatever was on it is said anew on the next.
    pub(super) fn is_cut(&mut self, now: Timestamp) {
        self.line = None;
        if !self.has_left() {
            self.doing = Doing::Rests;
            self.due = now + self.settings.poll;
        }
    }

    /// Says that the site lives, and what ran there when it was last seen.
    fn beats(&mut self, now: Timestamp, coordinator: &mut Coordinator) {
        self.beats_next = now + Span::from_secs(1);
        let (worker, running) = (self.worker, self.running.clone());
        self.says(now, Event::Heartbeat { worker, running }, coordinator);
    }

    fn says(&self, now: Timestamp, event: Event, coordinator: &mut Coordinator) {
        coordinator.witness.hears_of(self.worker, now);
        coordinator.tell(now, event);
    }

    /// Does what is due; `there` is the cluster, where it can be reached.
    pub(super) fn goes_on(
        &mut self,
        now: Timestamp,
        (there, is_leaving): (Option<&mut Queue>, bool),
        links: &mut u64,
        coordinator: &mut Coordinator,
    ) {
        if self.line.is_some() && self.beats_next <= now {
            self.beats(now, coordinator);
        }
        if self.due > now {
            return;
        }
        match std::mem::replace(&mut self.doing, Doing::Rests) {
            Doing::Delivers(mut delivery) if !delivery.open.is_empty() => {
                let again = std::mem::take(&mut delivery.again);
                self.doing = Doing::Delivers(delivery);
                self.hands_over(now, again, coordinator);
            }
            Doing::Delivers(delivery) => {
                self.delivered(now, *delivery, (there, is_leaving), coordinator);
            }
            Doing::Submits => self.submits(now, (there, is_leaving), coordinator),
            Doing::Rests => {
                self.begun = now;
                match there {
                    None => self.misses(now, coordinator),
                    Some(there) if self.line.is_none() => {
                        *links += 1;
                        self.connects(now, LinkId(*links), there, coordinator);
                    }
                    Some(there) => self.looks(now, there, coordinator),
                }
            }
            doing @ (Doing::Connects | Doing::Gone) => self.doing = doing,
        }
    }

    /// Nobody there answers.
    fn misses(&mut self, now: Timestamp, coordinator: &mut Coordinator) {
        self.missed += 1;
        if self.missed == MISSED_MAX
            && let Some(link) = self.line.take()
        {
            let worker = self.worker;
            self.says(now, Event::LinkClosed { worker, link }, coordinator);
        }
        self.due = now + self.settings.poll;
    }

    /// Joins the farm, with what the site still has of before.
    fn connects(
        &mut self,
        now: Timestamp,
        link: LinkId,
        there: &mut Queue,
        coordinator: &mut Coordinator,
    ) {
        let known = self.poll.known().into_iter().collect();
        let (seen, ..) = there.look(now, &known, &[]);
        let begun = self.poll.takes_up(&seen);
        let polls = u64::from(MISSED_MAX) + 1;
        let queue = QueueOffer {
            min_tile_pixels: self.settings.min_tile_pixels,
            max_array_size: self.settings.array_max.into(),
            lag: self.settings.poll.times(polls) + SLACK,
            patience: self.settings.patience,
        };
        self.line = Some(link);
        self.beats_next = now;
        self.hellos += 1;
        self.doing = Doing::Connects;
        coordinator.witness.connects(self.worker);
        let joined = Event::WorkerJoined {
            worker: self.worker,
            link,
            offer: offer(Some(queue)),
            held: self.poll.held(),
            begun,
        };
        self.says(now, joined, coordinator);
    }

    /// Looks, and hands over the blocks that are there.
    fn looks(&mut self, now: Timestamp, there: &mut Queue, coordinator: &mut Coordinator) {
        self.missed = 0;
        let known = self.poll.known().into_iter().collect();
        let wants = self.poll.wants();
        let (seen, fetched, is_whole) = there.look(now, &known, &wants);
        let blocks: Vec<Block> = fetched.iter().filter_map(|one| one.block).collect();
        for block in &blocks {
            coordinator.witness.fetches(self.worker, block.reference());
        }
        let open = blocks
            .iter()
            .map(|block| ((block.attempt, block.rect), *block));
        let open = open.collect();
        self.due = now;
        self.doing = Doing::Delivers(Box::new(Delivery {
            seen,
            fetched,
            is_whole,
            open,
            again: Vec::new(),
            durable: Vec::new(),
        }));
        self.hands_over(now, blocks, coordinator);
    }

    fn hands_over(&mut self, now: Timestamp, blocks: Vec<Block>, coordinator: &mut Coordinator) {
        for block in blocks {
            let up = Up::Block(block.reference(), block.took, Pixels::Right);
            coordinator.hears(now, self.worker, 0, up);
        }
    }

    /// All that a call brought is durable or of no use.
    fn delivered(
        &mut self,
        now: Timestamp,
        delivery: Delivery,
        (there, is_leaving): (Option<&mut Queue>, bool),
        coordinator: &mut Coordinator,
    ) {
        for block in delivery.durable {
            self.poll.delivered(block.attempt, block.rect, block.took);
        }
        for one in &delivery.fetched {
            self.poll.is_done_to(&one.array, one.task, one.end);
        }
        let Some(there) = there else {
            return self.misses(now, coordinator);
        };
        if !delivery.is_whole {
            return self.looks(now, there, coordinator);
        }
        for action in self.poll.observe(&delivery.seen) {
            self.performs(now, action, there, coordinator);
        }
        self.running = self.poll.running();
        let credit = match is_leaving {
            true => 0,
            false => self.poll.credit(),
        };
        let worker = self.worker;
        if std::mem::replace(&mut self.credit, credit) != credit {
            self.says(now, Event::Credit { worker, credit }, coordinator);
        }
        self.doing = Doing::Submits;
    }

    /// Submits what is leased and in no array, and ends the round.
    fn submits(
        &mut self,
        now: Timestamp,
        (there, is_leaving): (Option<&mut Queue>, bool),
        coordinator: &mut Coordinator,
    ) {
        let Some(there) = there else {
            return self.misses(now, coordinator);
        };
        self.due = now + self.settings.poll;
        for order in self.poll.orders(now) {
            there.submit(now, order);
            self.poll.submitted();
        }
        if is_leaving && self.poll.is_empty() {
            let worker = self.worker;
            self.says(now, Event::Goodbye { worker }, coordinator);
            self.line = None;
            self.doing = Doing::Gone;
        }
    }

    fn performs(
        &mut self,
        now: Timestamp,
        action: Action,
        there: &mut Queue,
        coordinator: &mut Coordinator,
    ) {
        let worker = self.worker;
        match action {
            Action::Delete(tasks) => there.delete(&tasks),
            Action::Remove(arrays) => there.remove(&arrays),
            Action::GiveBack(attempts) => {
                self.says(now, Event::GivenBack { worker, attempts }, coordinator);
            }
            Action::Fail { attempt, .. } => {
                let reason = "its task ended several times without a block".into();
                let failed = Event::TileFailed {
                    worker,
                    attempt,
                    reason,
                };
                self.says(now, failed, coordinator);
            }
        }
    }
}
