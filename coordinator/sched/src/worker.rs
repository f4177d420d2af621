//! A worker, as the scheduler knows it.

use alloc::collections::BTreeSet;

use model::{Revision, Span, Timestamp, WorkerId};

use crate::market::Load;
use crate::{Link, LinkId, WorkerView};

#[derive(Clone, Debug)]
pub(crate) struct Worker {
    pub(crate) revision: Revision,
    pub(crate) threads: u32,
    /// The newest link it came on.
    pub(crate) newest: LinkId,
    pub(crate) link: Link,
    pub(crate) credit: u32,
    /// Its live attempts.
    pub(crate) live: BTreeSet<u64>,
    /// How many of them wait for something else of its: those not started, those being delivered.
    pub(crate) idle: u32,
    /// The newest limit for one block of what it holds.
    pub(crate) patience: Span,
    pub(crate) joined: Timestamp,
    pub(crate) heard: Timestamp,
    pub(crate) blocks: u64,
    pub(crate) pixels: u64,
    pub(crate) render_time: Span,
    /// When it counts as lost.
    pub(crate) lost: Option<Timestamp>,
    /// When what it holds counts as forgotten; set while it holds something and renders nothing.
    pub(crate) waiting: Option<Timestamp>,
    /// Where it stands in the market; `None` while it wants no tile.
    pub(crate) load: Option<Load>,
}

impl Worker {
    pub(crate) fn new(revision: Revision, threads: u32, link: LinkId, now: Timestamp) -> Self {
        Self {
            revision,
            threads,
            newest: link,
            link: Link::Open,
            credit: 0,
            live: BTreeSet::new(),
            idle: 0,
            patience: Span(0),
            joined: now,
            heard: now,
            blocks: 0,
            pixels: 0,
            render_time: Span(0),
            lost: None,
            waiting: None,
            load: None,
        }
    }

    /// Whether it holds something and renders nothing.
    pub(crate) fn is_idle(&self) -> bool {
        self.idle > 0 && self.idle as usize == self.live.len()
    }

    /// Where it belongs in the market.
    pub(crate) fn wants(&self) -> Option<Load> {
        let wants = self.link == Link::Open && self.live.len() < self.credit as usize;
        wants.then(|| Load::new(self.live.len(), self.threads))
    }

    pub(crate) fn view(&self, worker: WorkerId) -> WorkerView {
        WorkerView {
            worker,
            revision: self.revision,
            threads: self.threads,
            link: self.link,
            credit: self.credit,
            attempts: u32::try_from(self.live.len()).unwrap_or(u32::MAX),
            running: u32::try_from(self.live.len()).unwrap_or(u32::MAX) - self.idle,
            heard: self.heard,
            joined: self.joined,
            blocks: self.blocks,
            pixels: self.pixels,
            render_time: self.render_time,
        }
    }
}
