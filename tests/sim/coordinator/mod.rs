//! The coordinator's shell: what is durable before what is said, and how it begins again after a crash.
//!
//! A block is accepted, written to its scratch file, synced, committed, then told to the scheduler,
//! then acknowledged. Any other durable event is told first, and its effects and all later ones wait
//! until it is committed.

mod crash;
mod effects;
mod events;
mod inputs;
mod writer;

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use model::{Epoch, ImageRef, JobId, Revision, Span, Timestamp, WorkerId};
use sched::{Config, ImageState, Sched};
use store::Memory;

use crate::disk::{Disk, flaws};
use crate::message::Down;
use crate::plan::{Bug, Plan};
use crate::witness::Witness;
use effects::Held;
pub(crate) use inputs::offer;
use writer::{Group, Order};

pub(crate) const REVISION: Revision = Revision(1);

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

pub(crate) struct Coordinator {
    pub(crate) sched: Sched,
    pub(crate) disk: Disk,
    store: Memory,
    pub(crate) witness: Witness,
    pub(crate) plan: Plan,
    epoch: u64,
    pub(crate) is_up: bool,
    /// How far its clock is ahead of the world's.
    pub(crate) skew: u64,
    orders: VecDeque<Order>,
    group: Option<Group>,
    is_writing_planned: bool,
    held: VecDeque<Held>,
    records: u64,
    committed: BTreeSet<u64>,
    is_performing: bool,
    /// How often what there was of an image became void: dropped, encoded, or begun again.
    eras: BTreeMap<ImageRef, u32>,
    pub(crate) events: u64,
    wishes: Vec<Wish>,
}

impl Coordinator {
    pub(crate) fn new(plan: Plan) -> Self {
        Self {
            sched: Sched::new(config(1, &plan)),
            disk: Disk::default(),
            store: Memory::new(),
            witness: Witness::new(plan.verify > 0),
            plan,
            epoch: 1,
            is_up: true,
            skew: 0,
            orders: VecDeque::new(),
            group: None,
            is_writing_planned: false,
            held: VecDeque::new(),
            records: 0,
            committed: BTreeSet::new(),
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

    /// Something that it asked of its machine is done.
    pub(crate) fn finishes(&mut self, now: Timestamp, later: Later) {
        match later {
            Later::Write => self.write(),
            Later::Synced => self.synced(),
            Later::Committed => self.commit(now),
            Later::Encoded(image, era) => self.encoded(now, image, era),
        }
    }

    /// Frames in their place that have a wrong pixel.
    pub(crate) fn wrong_frames(&self) -> usize {
        let is_wrong = |(image, frame): &(&ImageRef, &Vec<u8>)| {
            let state = self.sched.image(**image).map(|view| view.state);
            matches!(state, Some(ImageState::Encoded { .. })) && flaws(**image, frame).1 > 0
        };
        self.disk.frames.iter().filter(is_wrong).count()
    }

    fn era(&self, image: ImageRef) -> u32 {
        self.eras.get(&image).copied().unwrap_or(0)
    }

    /// What there was of an image counts no more.
    fn end_era(&mut self, image: ImageRef) {
        *self.eras.entry(image).or_default() += 1;
        self.witness.forget_pixels(image);
    }
}

fn config(epoch: u64, plan: &Plan) -> Config {
    Config {
        images_in_flight_max: 3,
        tile_failures_max: 2,
        verify: plan.verify,
        ..Config::new(Epoch(epoch))
    }
}
