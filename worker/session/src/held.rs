//! An attempt that the worker holds, and its blocks that are not acknowledged.

use alloc::collections::VecDeque;
use alloc::string::String;

use model::{Begun, Lease, Rect, Timestamp};

#[derive(Clone, Debug)]
pub(crate) struct Held {
    pub(crate) lease: Lease,
    pub(crate) phase: Phase,
    /// When a thread began it.
    pub(crate) started: Timestamp,
    /// Blocks rendered so far.
    pub(crate) rendered: u32,
    /// Blocks rendered and not acknowledged, in the order in which they were rendered.
    pub(crate) unacked: VecDeque<Rect>,
}

/// What becomes of an attempt.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Phase {
    /// It waits for a thread.
    Waiting,
    /// A thread renders it.
    Running,
    /// All its blocks are rendered; it ends when they are acknowledged.
    Rendered,
    /// It cannot be rendered; said when the blocks that could be are acknowledged.
    Failed(String),
    /// The worker leaves; given back when the blocks that are rendered are acknowledged.
    Stopped,
}

impl Held {
    pub(crate) fn new(lease: Lease) -> Self {
        Self {
            lease,
            phase: Phase::Waiting,
            started: Timestamp::default(),
            rendered: 0,
            unacked: VecDeque::new(),
        }
    }

    /// The tile, if a thread has begun it and has not failed at it.
    pub(crate) fn begun(&self) -> Option<Begun> {
        let has_begun = matches!(
            self.phase,
            Phase::Running | Phase::Rendered | Phase::Stopped
        );
        has_begun.then_some(Begun {
            attempt: self.lease.attempt,
            image: self.lease.image,
            tile: self.lease.tile,
        })
    }

    /// Notes a rendered block; says whether it is new and still wanted.
    pub(crate) fn renders(&mut self, rect: Rect) -> bool {
        let takes = matches!(self.phase, Phase::Running | Phase::Stopped);
        let new = takes && !self.unacked.contains(&rect);
        if new {
            self.rendered += 1;
            self.unacked.push_back(rect);
        }
        new
    }

    /// Notes that a block needs no more sending; says whether it was kept.
    pub(crate) fn answers(&mut self, rect: Rect) -> bool {
        let place = self.unacked.iter().position(|&kept| kept == rect);
        place.and_then(|place| self.unacked.remove(place)).is_some()
    }
}
