//! A worker, as the scheduler knows it.

use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use model::{ImageRef, JobId, Span, Timestamp, WorkerId};

use crate::aside::Aside;
use crate::market::{Group, Seat};
use crate::needs::KindSet;
use crate::pace::{Pace, cost_of, time_of};
use crate::roster::Place;
use crate::timers::Alarm;
use crate::{Link, LinkId, Offer, Trust, WorkerView};

#[derive(Clone, Debug)]
pub(crate) struct Worker {
    pub(crate) id: WorkerId,
    pub(crate) offer: Offer,
    /// The kinds of job that it serves.
    pub(crate) kinds: KindSet,
    /// The newest link it came on.
    pub(crate) newest: LinkId,
    pub(crate) link: Link,
    pub(crate) credit: u32,
    /// Whether it gave something back, and has not said since that it wants more: it may hold what counts as delivered here.
    pub(crate) is_full: bool,
    /// Its live attempts, in the order in which they were leased.
    pub(crate) live: Vec<u64>,
    /// Where it stands for a queue: the images of which it holds tiles, and how many of each.
    pub(crate) images: BTreeMap<ImageRef, u32>,
    /// How many of them wait for something else of its: those not started, those being delivered.
    pub(crate) idle: u32,
    /// What its live attempts cost together.
    pub(crate) backlog: u64,
    /// When it last began or ended something.
    pub(crate) moved: Timestamp,
    pub(crate) pace: Pace,
    /// When it must be gone.
    pub(crate) ends: Option<Timestamp>,
    /// What it is set aside for.
    pub(crate) aside: Aside,
    /// The newest limit for one block of what it holds.
    pub(crate) patience: Span,
    pub(crate) joined: Timestamp,
    pub(crate) heard: Timestamp,
    pub(crate) blocks: u64,
    pub(crate) pixels: u64,
    pub(crate) render_time: Span,
    /// When it counts as lost.
    pub(crate) lost: Alarm,
    /// When what it holds counts as forgotten; due while it holds something and renders nothing.
    pub(crate) waiting: Alarm,
    /// Where it stands in the market; `None` while it wants no tile.
    pub(crate) seat: Option<(Group, Seat)>,
    /// What it counts for.
    pub(crate) counted: Option<Counts>,
}

/// What a worker that takes tiles counts for.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Counts {
    /// The kinds under which it counts as able…
    pub(crate) kinds: KindSet,
    /// …but for these jobs, in order, which it is set aside for.
    pub(crate) aside: Vec<JobId>,
    /// What it adds to the farm's capacity.
    pub(crate) capacity: u64,
}

impl Worker {
    pub(crate) fn new(id: WorkerId, offer: Offer, link: LinkId, now: Timestamp) -> Self {
        Self {
            id,
            offer,
            kinds: KindSet::default(),
            newest: link,
            link: Link::Open,
            credit: 0,
            is_full: false,
            live: Vec::new(),
            images: BTreeMap::new(),
            idle: 0,
            backlog: 0,
            moved: now,
            pace: Pace::default(),
            ends: None,
            aside: Aside::default(),
            patience: Span(0),
            joined: now,
            heard: now,
            blocks: 0,
            pixels: 0,
            render_time: Span(0),
            lost: Alarm::default(),
            waiting: Alarm::default(),
            seat: None,
            counted: None,
        }
    }

    /// Whether it holds something and renders nothing.
    pub(crate) fn is_idle(&self) -> bool {
        self.idle > 0 && self.idle as usize == self.live.len()
    }

    /// Whether it takes tiles at all.
    pub(crate) fn is_able(&self) -> bool {
        self.link == Link::Open && self.credit > 0 && self.aside.farm().is_none()
    }

    /// What it counts for.
    pub(crate) fn counts(&self) -> Option<Counts> {
        self.is_able().then(|| Counts {
            kinds: self.kinds,
            aside: self.aside.jobs(),
            capacity: u64::from(self.offer.threads) * u64::from(self.pace.speed()),
        })
    }

    /// Whether it may hold another tile, or where it stands for a queue another image.
    pub(crate) fn has_room(&self) -> bool {
        let held = match self.offer.queue {
            None => self.live.len(),
            Some(_) => self.images.len(),
        };
        !self.is_full && held < self.credit as usize
    }

    /// Notes that it got a tile of an image.
    pub(crate) fn takes(&mut self, image: ImageRef) {
        if self.offer.queue.is_some() {
            *self.images.entry(image).or_default() += 1;
        }
    }

    /// Notes that it holds a tile of an image no more.
    pub(crate) fn lets_go(&mut self, image: ImageRef) {
        if let Some(tiles) = self.images.get_mut(&image) {
            *tiles -= 1;
            if *tiles == 0 {
                self.images.remove(&image);
            }
        }
    }

    /// Where it belongs in the market.
    pub(crate) fn wants(&self, place: Place) -> Option<(Group, Seat)> {
        let wants = self.is_able() && (self.has_room() || !self.images.is_empty());
        wants.then(|| {
            let seat = Seat::new(
                self.ends,
                (self.live.len(), self.offer.threads),
                self.pace.speed(),
                place,
            );
            let group = Group {
                kinds: self.kinds,
                aside: self.aside.jobs(),
                is_limited: self.ends.is_some(),
                queue: self.offer.queue.map(|_| place),
                has_room: self.has_room(),
            };
            (group, seat)
        })
    }

    /// When a tile that is leased to it now is expected to be begun.
    pub(crate) fn begins_next(&self, now: Timestamp) -> Timestamp {
        let threads = self.offer.threads as usize;
        if self.live.len() < threads {
            return now;
        }
        let busy = threads.min(self.live.len()) as u64;
        let speed = self.pace.speed();
        let done = cost_of(now - self.moved, speed).saturating_mul(busy);
        let left = self.backlog.saturating_sub(done);
        now + time_of(left / u64::from(self.offer.threads.max(1)), speed)
    }

    /// How long it has left for a tile that is leased to it now; absent where nobody set a limit.
    pub(crate) fn time_left(&self, now: Timestamp) -> Option<Span> {
        Some(self.ends? - self.begins_next(now))
    }

    /// Whether one of its live attempts cannot have been started yet: a thread starts
    /// what was leased first.
    pub(crate) fn holds_ahead(&self, number: u64, is_rendered: impl Fn(u64) -> bool) -> bool {
        let before = self.live.iter().take_while(|&&live| live != number);
        before.filter(|&&live| !is_rendered(live)).count() >= self.offer.threads as usize
    }

    pub(crate) fn view(&self) -> WorkerView {
        let attempts = u32::try_from(self.live.len()).unwrap_or(u32::MAX);
        WorkerView {
            worker: self.id,
            revision: self.offer.revision,
            threads: self.offer.threads,
            link: self.link,
            credit: self.credit,
            attempts,
            running: attempts - self.idle,
            speed: self.pace.speed(),
            aside: self.aside.farm(),
            trust: match self.aside.expelled() {
                Some(_) => Trust::Expelled,
                None => Trust::Usual,
            },
            heard: self.heard,
            joined: self.joined,
            blocks: self.blocks,
            pixels: self.pixels,
            render_time: self.render_time,
        }
    }
}
