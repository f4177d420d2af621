//! The coordinator's shell: what is durable before what is said, and how it begins again after a crash.
//!
//! A block is accepted, written to its scratch file, synced, committed, then told to the scheduler,
//! then acknowledged. Any other durable event is told first, and its effects and all later ones wait
//! until it is committed.

use std::collections::{BTreeMap, VecDeque};

use model::{Epoch, ImageRef, JobId, Revision, Span, Timestamp, WorkerId};
use sched::{
    BlockRef, Command, Config, Effect, Event, ImageState, JobOutcome, JobState, LinkId, Offer,
    Sched, Verdict,
};
use session::{BlockVerdict, Retry, Welcome};
use store::{Entry, Memory, Store as _};

use crate::disk::{Disk, Pixels, flaws};
use crate::message::{Down, Up};
use crate::plan::{Bug, Plan};
use crate::random::Random;
use crate::witness::Witness;

pub(crate) const REVISION: Revision = Revision(1);

/// Blocks that wait for the disk; who sends more is asked to come again.
const BLOCKS_MAX: usize = 16;

/// Entries of users and of images that wait for the disk; more than there are users and images.
const RECORDS_MAX: usize = 200;

/// Effects that wait for a commit.
const HELD_MAX: usize = 4_000;

/// Orders that are performed together.
const GROUP_MAX: usize = 8;

/// The whole state is looked at after so many events; sched's own histories look after each.
const CHECK_EVERY: u64 = 64;

/// What the coordinator's machine reports later.
#[derive(Clone, Debug)]
pub(crate) enum Later {
    /// The writer looks at its orders.
    Write,
    Synced,
    Committed,
    /// An image, of an era.
    Encoded(ImageRef, u32),
}

/// What the shell wants of the world.
#[derive(Debug)]
pub(crate) enum Wish {
    Send(WorkerId, Down),
    Disk(Later, Span),
    Close(WorkerId),
    /// A user hears that a submission is a job.
    Tell(u128, JobId),
}

/// What the writer does next.
#[derive(Debug)]
enum Order {
    Block {
        worker: WorkerId,
        block: BlockRef,
        elapsed: Span,
        pixels: Pixels,
        era: u32,
    },
    /// An entry, and the effects that wait for it.
    Record(Box<Entry>, Option<u64>),
    Remove(ImageRef),
}

/// Orders that the writer has in hand.
#[derive(Debug)]
struct Group {
    orders: Vec<Order>,
    is_synced: bool,
}

#[derive(Debug)]
enum Held {
    /// An effect; where it is about pixels of an image, also that and its era.
    Effect(Effect, Option<(ImageRef, u32)>),
    /// What follows waits for this record, which may be that of an image that is encoded.
    Until(u64, Option<ImageRef>),
}

pub(crate) struct Coordinator {
    pub(crate) sched: Sched,
    pub(crate) disk: Disk,
    store: Memory,
    pub(crate) witness: Witness,
    plan: Plan,
    epoch: u64,
    pub(crate) is_up: bool,
    /// How far its clock is ahead of the world's.
    pub(crate) skew: u64,
    orders: VecDeque<Order>,
    group: Option<Group>,
    is_writing_planned: bool,
    held: VecDeque<Held>,
    records: u64,
    committed: std::collections::BTreeSet<u64>,
    is_performing: bool,
    /// How often what there was of an image became void: dropped, encoded, or begun again.
    eras: BTreeMap<ImageRef, u32>,
    pub(crate) events: u64,
    wishes: Vec<Wish>,
}

impl Coordinator {
    pub(crate) fn new(plan: Plan) -> Self {
        Self {
            sched: Sched::new(config(1)),
            disk: Disk::default(),
            store: Memory::new(),
            witness: Witness::default(),
            plan,
            epoch: 1,
            is_up: true,
            skew: 0,
            orders: VecDeque::new(),
            group: None,
            is_writing_planned: false,
            held: VecDeque::new(),
            records: 0,
            committed: std::collections::BTreeSet::new(),
            is_performing: false,
            eras: BTreeMap::new(),
            events: 0,
            wishes: Vec::new(),
        }
    }

    /// What it wished for since the last time.
    pub(crate) fn wishes(&mut self) -> Vec<Wish> {
        std::mem::take(&mut self.wishes)
    }

    /// How often it was started after a crash.
    pub(crate) fn restarts(&self) -> u64 {
        self.epoch - 1
    }

    /// Whether nothing waits for the disk.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.orders.is_empty() && self.group.is_none() && self.held.is_empty()
    }

    /// When, by the world's clock, it wants to look at its own.
    pub(crate) fn next_deadline(&self) -> Option<Timestamp> {
        let looks = self.is_up && self.plan.bug != Some(Bug::EndlessLease);
        let due = self.sched.next_deadline().filter(|_| looks)?;
        Some(Timestamp(due.0.saturating_sub(self.skew)))
    }

    pub(crate) fn hears(&mut self, now: Timestamp, worker: WorkerId, link: u64, message: Up) {
        self.witness.hears_of(worker, now);
        let event = match message {
            Up::Hello(held, begun) => Event::WorkerJoined {
                worker,
                link: LinkId(link),
                offer: Offer {
                    revision: REVISION,
                    threads: 1,
                    memory_bytes: 0,
                    labels: std::collections::BTreeSet::new(),
                    time_left: None,
                },
                held,
                begun,
            },
            Up::Credit(credit) => Event::Credit { worker, credit },
            Up::Heartbeat(running) => Event::Heartbeat { worker, running },
            Up::Failed(attempt, reason) => Event::TileFailed {
                worker,
                attempt,
                reason,
            },
            Up::GiveBack(attempts) => Event::GivenBack { worker, attempts },
            Up::Goodbye => Event::Goodbye { worker },
            Up::Block(block, elapsed, pixels) => {
                return self.takes(now, worker, block, (elapsed, pixels));
            }
        };
        self.tell(now, event);
    }

    fn takes(
        &mut self,
        now: Timestamp,
        worker: WorkerId,
        block: BlockRef,
        (elapsed, pixels): (Span, Pixels),
    ) {
        let mut verdict = self.sched.accepts(worker, block);
        if self.plan.bug == Some(Bug::StaleAttempt) && matches!(verdict, Verdict::Refuse(_)) {
            verdict = Verdict::Accept;
        }
        match verdict {
            Verdict::Accept => {
                let waiting = self.blocks_waiting();
                if waiting >= BLOCKS_MAX && self.plan.bug != Some(Bug::UnboundedQueue) {
                    return self.refuse(worker, block, BlockVerdict::Later);
                }
                let attempt = self.sched.attempt(block.attempt);
                let is_live = attempt.is_some_and(|(of, image, tile)| {
                    (of, image) == (worker, block.image) && tile.contains(block.rect)
                });
                assert!(is_live, "a block of a dead attempt never counts");
                let era = self.era(block.image);
                self.order(Order::Block {
                    worker,
                    block,
                    elapsed,
                    pixels,
                    era,
                });
            }
            Verdict::AlreadyDone => self.tell(
                now,
                Event::BlockStored {
                    worker,
                    block,
                    elapsed,
                    pixels: pixels.digest(),
                },
            ),
            Verdict::Refuse(_) => self.refuse(worker, block, BlockVerdict::AttemptDead),
        }
    }

    fn refuse(&mut self, worker: WorkerId, block: BlockRef, verdict: BlockVerdict) {
        let down = Down::BlockRefused(block.attempt, block.rect, verdict);
        self.wishes.push(Wish::Send(worker, down));
    }

    fn era(&self, image: ImageRef) -> u32 {
        self.eras.get(&image).copied().unwrap_or(0)
    }

    /// What there was of an image counts no more.
    fn end_era(&mut self, image: ImageRef) {
        *self.eras.entry(image).or_default() += 1;
        self.witness.forget_pixels(image);
    }

    fn blocks_waiting(&self) -> usize {
        let in_hand = self.group.iter().flat_map(|group| &group.orders);
        let all = self.orders.iter().chain(in_hand);
        all.filter(|order| matches!(order, Order::Block { .. }))
            .count()
    }

    fn order(&mut self, order: Order) {
        self.orders.push_back(order);
        let blocks = self.blocks_waiting();
        assert!(blocks <= BLOCKS_MAX, "blocks that wait are bounded");
        assert!(self.orders.len() - blocks.min(self.orders.len()) <= RECORDS_MAX);
        self.plan_writing(Span(100));
    }

    fn plan_writing(&mut self, after: Span) {
        if !self.is_writing_planned && self.group.is_none() {
            self.is_writing_planned = true;
            self.wishes.push(Wish::Disk(Later::Write, after));
        }
    }

    pub(crate) fn finishes(&mut self, now: Timestamp, later: Later) {
        match later {
            Later::Write => self.write(),
            Later::Synced => self.synced(),
            Later::Committed => self.commit(now),
            Later::Encoded(image, era) => self.encoded(now, image, era),
        }
    }

    /// The next orders: blocks go to their places.
    fn write(&mut self) {
        self.is_writing_planned = false;
        while let Some(&Order::Remove(image)) = self.orders.front() {
            self.orders.pop_front();
            self.disk.remove(image);
        }
        if self.orders.is_empty() {
            return;
        }
        if self.disk.is_full {
            // Held, and tried again: nothing fails.
            return self.plan_writing(Span::from_millis(200));
        }
        let mut orders = Vec::new();
        while orders.len() < GROUP_MAX {
            match self.orders.pop_front() {
                None => break,
                Some(remove @ Order::Remove(_)) => {
                    self.orders.push_front(remove);
                    break;
                }
                Some(order) => orders.push(order),
            }
        }
        for order in &orders {
            if let Order::Block { block, pixels, .. } = order {
                self.disk.write(block.image, block.rect, *pixels);
            }
        }
        self.group = Some(Group {
            orders,
            is_synced: false,
        });
        self.wishes
            .push(Wish::Disk(Later::Synced, Span::from_millis(3)));
    }

    fn synced(&mut self) {
        let Some(group) = &mut self.group else {
            return;
        };
        for order in &group.orders {
            if let Order::Block { block, .. } = order
                && self.plan.bug != Some(Bug::MissingSync)
            {
                self.disk.sync(block.image);
            }
        }
        group.is_synced = true;
        self.wishes
            .push(Wish::Disk(Later::Committed, Span::from_millis(2)));
    }

    fn entries(&self) -> Vec<Entry> {
        let orders = self.group.iter().flat_map(|group| &group.orders);
        orders.filter_map(|order| self.entry(order)).collect()
    }

    fn entry(&self, order: &Order) -> Option<Entry> {
        match order {
            Order::Block {
                block,
                elapsed,
                pixels,
                ..
            } => {
                let loses = self.plan.bug == Some(Bug::LostAcknowledgement);
                (!loses || block.rect.x0 >= 64).then(|| Entry::Block {
                    image: block.image,
                    rect: block.rect,
                    elapsed: *elapsed,
                    pixels: pixels.digest(),
                    about: Vec::new(),
                })
            }
            Order::Record(entry, _) => Some(Entry::clone(entry)),
            Order::Remove(_) => None,
        }
    }

    fn commit(&mut self, now: Timestamp) {
        if self.disk.is_full {
            self.store.refuse(1);
        }
        if let Err(error) = self.store.commit(&self.entries()) {
            assert!(error.is_transient(), "{error}");
            let later = Span::from_millis(200);
            return self.wishes.push(Wish::Disk(Later::Committed, later));
        }
        let group = self.group.take();
        for order in group.into_iter().flat_map(|group| group.orders) {
            match order {
                Order::Block {
                    worker,
                    block,
                    elapsed,
                    pixels,
                    era,
                } if era == self.era(block.image) => {
                    self.witness.hears_of(worker, now);
                    let pixels = pixels.digest();
                    self.tell(
                        now,
                        Event::BlockStored {
                            worker,
                            block,
                            elapsed,
                            pixels,
                        },
                    );
                }
                Order::Block { worker, block, .. } => {
                    self.refuse(worker, block, BlockVerdict::AttemptDead);
                }
                Order::Record(_, Some(number)) => {
                    self.committed.insert(number);
                    self.flush(now);
                }
                Order::Record(_, None) | Order::Remove(_) => {}
            }
        }
        if !self.orders.is_empty() {
            self.plan_writing(Span(100));
        }
    }

    fn encoded(&mut self, now: Timestamp, image: ImageRef, era: u32) {
        self.witness.places(self.epoch, image, era);
        if era != self.era(image) {
            return;
        }
        if self.disk.is_full {
            let later = Later::Encoded(image, era);
            self.witness.places_not(self.epoch, image, era);
            return self.wishes.push(Wish::Disk(later, Span::from_millis(500)));
        }
        let frame = self.disk.read(image);
        let (missing, wrong) = flaws(image, &frame);
        assert_eq!(missing, 0, "all pixels of {image:?} are there");
        assert!(wrong == 0 || self.plan.troubles.liars > 0, "they are right");
        self.disk.frames.insert(image, frame);
        let film = Pixels::Right.digest();
        self.tell(now, Event::ImageEncoded { image, film });
    }

    /// Tells the scheduler; where the event is durable, what it wants waits for the commit.
    pub(crate) fn tell(&mut self, now: Timestamp, event: Event) {
        self.events += 1;
        let told = event.clone();
        let mut effects = Vec::new();
        let is_known = |sched: &Sched, event: &Event| match event {
            Event::Submit(spec) => sched.submitted(spec.submission).is_some(),
            _ => false,
        };
        let was_known = is_known(&self.sched, &told);
        self.sched
            .handle(Timestamp(now.0 + self.skew), event, &mut effects);
        if self.events.is_multiple_of(CHECK_EVERY) {
            self.sched.check_invariants();
        }
        for effect in &effects {
            match effect {
                Effect::DropScratch { image } => self.end_era(*image),
                Effect::ForgetJob { job } => self.witness.forget_job(*job),
                _ => {}
            }
        }
        if !was_known && let Some(entry) = self.record(now, told, &effects) {
            self.records += 1;
            let image = match &entry {
                Entry::ImageEncoded { image, .. } => Some(*image),
                _ => None,
            };
            self.held.push_back(Held::Until(self.records, image));
            self.order(Order::Record(Box::new(entry), Some(self.records)));
        }
        for effect in effects {
            if let Effect::ForgetJob { job } = effect {
                self.order(Order::Record(Box::new(Entry::Forgotten { job }), None));
            }
            let about = self.about(&effect);
            self.held.push_back(Held::Effect(effect, about));
        }
        assert!(self.held.len() <= HELD_MAX, "effects that wait are bounded");
        self.flush(now);
    }

    fn about(&self, effect: &Effect) -> Option<(ImageRef, u32)> {
        let image = match effect {
            Effect::Ack { attempt, .. } => self.witness.image_of(*attempt)?,
            Effect::Encode { image } => *image,
            _ => return None,
        };
        Some((image, self.era(image)))
    }

    /// What is to be committed of an event, if it changed anything.
    fn record(&mut self, now: Timestamp, event: Event, effects: &[Effect]) -> Option<Entry> {
        // The calendar may say anything.
        let unix_ms = now.0.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 20;
        match event {
            Event::Submit(submission) => {
                let job = self.sched.submitted(submission.submission)?;
                Some(Entry::Submitted {
                    job,
                    unix_ms,
                    submission,
                    about: String::new(),
                })
            }
            Event::Command { job, command } => {
                let is_refused = |effect: &Effect| matches!(effect, Effect::CommandRefused { .. });
                if effects.iter().any(is_refused) {
                    return None;
                }
                match command {
                    Command::Again(image) => self.end_era(ImageRef { job, image }),
                    Command::Remove => self.witness.forget_job(job),
                    _ => {}
                }
                if let Command::Again(image) = command {
                    self.witness.encoded.remove(&ImageRef { job, image });
                }
                Some(Entry::Command {
                    job,
                    unix_ms,
                    command,
                })
            }
            Event::ImageEncoded { image, film } => {
                let view = self.sched.image(image)?;
                if view.state != (ImageState::Encoded { film }) {
                    return None;
                }
                self.end_era(image);
                Some(Entry::ImageEncoded {
                    image,
                    unix_ms,
                    film,
                    blocks: 1,
                    render_time: Span(1),
                    about: String::new(),
                })
            }
            Event::ImageFailed { image, reason } => {
                let view = self.sched.image(image)?;
                (view.state == ImageState::Failed).then_some(Entry::ImageFailed {
                    image,
                    unix_ms,
                    reason,
                })
            }
            _ => None,
        }
    }

    /// Performs what waits for nothing, in order.
    fn flush(&mut self, now: Timestamp) {
        if std::mem::replace(&mut self.is_performing, true) {
            return;
        }
        while let Some(held) = self.held.pop_front() {
            match held {
                Held::Until(record, image) if !self.committed.remove(&record) => {
                    self.held.push_front(Held::Until(record, image));
                    break;
                }
                Held::Until(_, image) => {
                    image.into_iter().for_each(|image| self.is_in_place(image))
                }
                Held::Effect(effect, about) => self.perform(now, effect, about),
            }
        }
        self.is_performing = false;
    }

    fn perform(&mut self, now: Timestamp, effect: Effect, about: Option<(ImageRef, u32)>) {
        let (worker, down) = match effect {
            Effect::Welcome { worker, live } => {
                let welcome = Welcome {
                    epoch: Epoch(self.epoch),
                    heartbeat_interval: Span::from_secs(1),
                    liveness_limit: Span::from_secs(4),
                    live,
                };
                (worker, Down::Welcome(welcome))
            }
            Effect::WorkerRefused { worker, refusal } => {
                (worker, Down::Refused(refusal.to_string(), Retry::Later))
            }
            Effect::Lease { worker, lease } => {
                self.witness.leases(worker, &lease);
                (worker, Down::Lease(lease))
            }
            Effect::Adopted {
                worker,
                attempt,
                image,
            } => return self.witness.adopts(worker, attempt, image),
            Effect::Revoke {
                worker, attempt, ..
            } => (worker, Down::Revoke(attempt)),
            Effect::Ack {
                worker,
                attempt,
                rect,
            } => {
                if let Some((image, _)) = about.filter(|&(image, era)| era == self.era(image)) {
                    self.witness.acknowledges(image, rect);
                }
                (worker, Down::Ack(attempt, rect))
            }
            Effect::RefuseBlock { worker, block, .. } => {
                return self.refuse(worker, block, BlockVerdict::AttemptDead);
            }
            Effect::Encode { image } => {
                // Where it was dropped while this waited, nobody wants it any more.
                let era = about.map_or(0, |(_, era)| era);
                if era != self.era(image) {
                    return;
                }
                let later = Later::Encoded(image, era);
                let took = Span::from_millis(40);
                if self.plan.bug == Some(Bug::DoubleCommit) {
                    self.wishes.push(Wish::Disk(later.clone(), took));
                }
                return self.wishes.push(Wish::Disk(later, took));
            }
            Effect::Forget { worker } => return self.wishes.push(Wish::Close(worker)),
            Effect::GiveUp { image, reason } => {
                return self.tell(now, Event::ImageFailed { image, reason });
            }
            Effect::DropScratch { image } => return self.order(Order::Remove(image)),
            Effect::Submitted { submission, job } => {
                self.witness.jobs.insert(job);
                return self.wishes.push(Wish::Tell(submission.0, job));
            }
            Effect::Commanded { job } => {
                let state = self.sched.job(job).map(|job| job.state);
                if state == Some(JobState::Over(JobOutcome::Cancelled)) {
                    self.witness.cancelled.insert(job);
                }
                return;
            }
            Effect::Incident { .. } => return self.witness.incidents += 1,
            Effect::JobChanged { .. }
            | Effect::JobDone { .. }
            | Effect::DropJob { .. }
            | Effect::ForgetJob { .. }
            | Effect::CommandRefused { .. }
            | Effect::SubmitRefused { .. } => return,
        };
        self.wishes.push(Wish::Send(worker, down));
    }

    /// An image is certainly encoded: its scratch file is needed no more.
    fn is_in_place(&mut self, image: ImageRef) {
        self.order(Order::Remove(image));
        let state = self.sched.image(image).map(|view| view.state);
        if matches!(state, Some(ImageState::Encoded { .. })) {
            self.witness.encoded.insert(image);
        }
    }

    /// The machine's power fails.
    pub(crate) fn crash(&mut self, random: &mut Random) {
        let is_committing = self.group.as_ref().is_some_and(|group| group.is_synced);
        if is_committing && !self.disk.is_full && random.below(2) == 0 {
            let committed = self.store.commit(&self.entries());
            committed.expect("there is room");
        }
        // Where everything was committed, nothing may be missing.
        self.witness.before = self.is_at_rest().then(|| self.sched.clone());
        self.store = std::mem::take(&mut self.store).crash();
        self.disk.crash(random);
        self.is_up = false;
        self.orders.clear();
        self.group = None;
        self.is_writing_planned = false;
        self.held.clear();
        self.committed.clear();
        self.wishes.clear();
        self.witness.crash();
        self.sched = Sched::new(config(self.epoch));
    }

    /// A coordinator starts over what is there.
    pub(crate) fn restart(&mut self, now: Timestamp) {
        self.epoch += 1;
        self.is_up = true;
        self.sched = Sched::new(config(self.epoch));
        let recalled = self.store.recall().expect("it is in memory");
        let mut effects = Vec::new();
        for (_, event) in recalled.events() {
            self.events += 1;
            self.sched
                .handle(Timestamp(now.0 + self.skew), event, &mut effects);
        }
        self.sched.check_invariants();
        let is_honest = self.plan.troubles.liars == 0;
        let mut begun = std::collections::BTreeSet::new();
        for job in &recalled.jobs {
            for block in &job.blocks {
                let image = ImageRef {
                    job: job.job,
                    image: block.image,
                };
                begun.insert(image);
                let holds = self.disk.holds(image, block.rect, block.pixels);
                assert!(
                    holds || !is_honest,
                    "{image:?}: what is committed was synced"
                );
            }
        }
        self.witness.compare(&self.sched, &recalled);
        for image in self.disk.images() {
            if !begun.contains(&image) {
                self.disk.remove(image);
            }
        }
        for effect in effects {
            match effect {
                // For nobody that is here.
                Effect::Ack { .. } | Effect::Submitted { .. } => {}
                effect => {
                    let about = self.about(&effect);
                    self.held.push_back(Held::Effect(effect, about));
                }
            }
        }
        self.flush(now);
    }
}

fn config(epoch: u64) -> Config {
    Config {
        images_in_flight_max: 3,
        tile_failures_max: 2,
        ..Config::new(Epoch(epoch))
    }
}
