//! What a tile's blocks are held against when somebody renders them once more.

use alloc::boxed::Box;
use alloc::collections::VecDeque;
use alloc::vec::Vec;

use model::{Digest, Rect, Timestamp, WorkerId};

use crate::region::Region;

/// A block as somebody made it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Made {
    pub(crate) rect: Rect,
    pub(crate) pixels: Digest,
    pub(crate) by: WorkerId,
}

/// What was made of some blocks; it stays with their pixels however those are cut.
///
/// Of most tiles nothing is kept, so that this is small where it is empty.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Evidence(Option<Box<Blocks>>);

#[derive(Clone, PartialEq, Eq, Debug, Default)]
struct Blocks {
    /// As they are durable, where that may be compared with another rendering of them.
    first: Vec<Made>,
    /// What others made of some of those that differed.
    dissent: Vec<Made>,
}

impl Evidence {
    /// Blocks as they are durable, where that is known.
    pub(crate) fn firsts(&self) -> &[Made] {
        self.0.as_ref().map_or(&[], |known| &known.first)
    }

    /// What others made otherwise.
    pub(crate) fn dissents(&self) -> &[Made] {
        self.0.as_ref().map_or(&[], |known| &known.dissent)
    }

    /// A block as it is durable.
    pub(crate) fn first(&self, rect: Rect) -> Option<Made> {
        let first = self.firsts().iter().find(|made| made.rect == rect);
        first.copied()
    }

    pub(crate) fn add_first(&mut self, made: Made) {
        self.0.get_or_insert_default().first.push(made);
    }

    pub(crate) fn add_dissent(&mut self, made: Made) {
        self.0.get_or_insert_default().dissent.push(made);
    }

    pub(crate) fn add(&mut self, other: Self) {
        if let Some(other) = other.0 {
            let known = self.0.get_or_insert_default();
            known.first.extend(other.first);
            known.dissent.extend(other.dissent);
        }
    }

    /// Takes out what is known of the blocks inside of some pixels.
    pub(crate) fn take(&mut self, rect: Rect) -> Self {
        let take = |made: &mut Vec<Made>| {
            let (inside, outside) = made.iter().partition(|made| rect.contains(made.rect));
            *made = outside;
            inside
        };
        let taken = self.0.as_mut().map(|known| {
            Box::new(Blocks {
                first: take(&mut known.first),
                dissent: take(&mut known.dissent),
            })
        });
        Self(taken)
    }

    /// Nothing more is to be known of a block.
    fn settle(&mut self, rect: Rect) {
        if let Some(known) = &mut self.0 {
            known.first.retain(|made| made.rect != rect);
            known.dissent.retain(|made| made.rect != rect);
        }
    }
}

/// A tile that is rendered once more, and what it is held against.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Check {
    /// Of the blocks that were not found to be right yet.
    pub(crate) evidence: Evidence,
    /// Who could not render it.
    unable: Vec<WorkerId>,
    /// Attempts at it that came to nothing.
    tries: u32,
}

/// What is known of the pixels of a block.
pub(crate) enum Known<'a> {
    /// Some of what is leased or waits with it is missing.
    Evidence {
        evidence: &'a mut Evidence,
        region: Region,
        /// How many render it.
        live: usize,
    },
    /// All of it is durable, and it is rendered once more.
    Check(&'a mut Check),
}

/// What a block says about who is right.
pub(crate) enum Finding {
    /// It is as it is durable, and so nothing is known against anybody.
    Nothing,
    /// It is as it is durable, and this worker had made something else of it.
    DissenterWrong {
        dissenter: WorkerId,
        first: WorkerId,
    },
    /// It is as this dissenter made it: what is durable is wrong.
    FirstWrong {
        dissenter: WorkerId,
        first: WorkerId,
    },
    /// It is the first that differs.
    Doubt { first: WorkerId },
    /// Three differ.
    Everybody,
}

impl Check {
    pub(crate) fn of(evidence: Evidence) -> Self {
        Self {
            evidence,
            unable: Vec::new(),
            tries: 0,
        }
    }

    /// Whether a worker could be given some of it. Of workers that are alike it suits all but a few: those that
    /// rendered all of it, of whom each block has one or two, and those that could not.
    pub(crate) fn suits(&self, worker: WorkerId) -> bool {
        !self.unable.contains(&worker) && self.blocks_for(worker).next().is_some()
    }

    /// Whether a worker could be given all that is left of it.
    pub(crate) fn suits_whole(&self, worker: WorkerId) -> bool {
        let all = self.evidence.firsts().len();
        !self.unable.contains(&worker) && self.blocks_for(worker).count() == all
    }

    /// The blocks that a worker rendered none of.
    fn blocks_for(&self, worker: WorkerId) -> impl Iterator<Item = Rect> {
        let (first, dissent) = (self.evidence.firsts(), self.evidence.dissents());
        // A process that was started again is the same machine.
        let is_own = move |made: &Made| made.by.id == worker.id;
        let of_others = first.iter().filter(move |made| !is_own(made));
        let blocks = of_others.map(|made| made.rect);
        blocks.filter(move |&rect| !dissent.iter().any(|made| made.rect == rect && is_own(made)))
    }

    /// All that rendered some of it.
    pub(crate) fn makers(&self) -> Vec<WorkerId> {
        let made = self
            .evidence
            .firsts()
            .iter()
            .chain(self.evidence.dissents());
        let mut makers: Vec<WorkerId> = made.map(|made| made.by).collect();
        makers.sort_unstable();
        makers.dedup();
        makers
    }

    /// Those who made something that another made otherwise.
    pub(crate) fn doubted(&self) -> Vec<WorkerId> {
        let dissent = self.evidence.dissents();
        let first = dissent
            .iter()
            .filter_map(|made| self.evidence.first(made.rect));
        first
            .chain(dissent.iter().copied())
            .map(|made| made.by)
            .collect()
    }

    /// Whether all of it was found to be right.
    pub(crate) fn is_done(&self) -> bool {
        self.evidence.firsts().is_empty()
    }

    /// The blocks that are to be rendered, by whoever that may be.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = Rect> {
        self.evidence.firsts().iter().map(|made| made.rect)
    }

    /// The blocks that a worker is to render, in order.
    pub(crate) fn wanted(&self, worker: WorkerId) -> Vec<Rect> {
        let mut wanted: Vec<Rect> = self.blocks_for(worker).collect();
        wanted.sort_unstable_by_key(|rect| (rect.y0, rect.x0));
        wanted
    }

    /// How many of those lie inside of some pixels.
    pub(crate) fn wanted_in(&self, rect: Rect, worker: WorkerId) -> u64 {
        let wanted = self.blocks_for(worker);
        wanted.filter(|block| rect.contains(*block)).count() as u64
    }

    /// Takes out what lies inside of some pixels.
    pub(crate) fn take(&mut self, rect: Rect) -> Self {
        Self {
            evidence: self.evidence.take(rect),
            unable: self.unable.clone(),
            tries: self.tries,
        }
    }

    /// A worker could not render it; how often that happened.
    pub(crate) fn fails(&mut self, worker: WorkerId) -> u32 {
        if !self.unable.contains(&worker) {
            self.unable.push(worker);
        }
        self.tries += 1;
        self.tries
    }

    /// Somebody rendered a block of it once more. What nobody asked it for says nothing.
    pub(crate) fn finds(&mut self, made: Made) -> Finding {
        let is_asked_for = self.blocks_for(made.by).any(|block| block == made.rect);
        let Some(first) = self.evidence.first(made.rect).filter(|_| is_asked_for) else {
            return Finding::Nothing;
        };
        let dissent = self.evidence.dissents();
        let dissent = dissent.iter().find(|dissent| dissent.rect == made.rect);
        let finding = match (made.pixels == first.pixels, dissent) {
            (true, None) => Finding::Nothing,
            (true, Some(dissent)) => Finding::DissenterWrong {
                dissenter: dissent.by,
                first: first.by,
            },
            (false, None) => Finding::Doubt { first: first.by },
            (false, Some(dissent)) if dissent.pixels == made.pixels => Finding::FirstWrong {
                dissenter: dissent.by,
                first: first.by,
            },
            (false, Some(_)) => Finding::Everybody,
        };
        match finding {
            Finding::Nothing | Finding::DissenterWrong { .. } => self.evidence.settle(made.rect),
            Finding::Doubt { .. } => self.evidence.add_dissent(made),
            Finding::FirstWrong { .. } | Finding::Everybody => {}
        }
        finding
    }
}

/// A check that waits for a worker.
#[derive(Clone, Debug)]
pub(crate) struct Waiting {
    pub(crate) region: Region,
    pub(crate) check: Check,
    /// Since when, or since it was last seen that it does not wait in vain.
    pub(crate) since: Timestamp,
}

/// The checks of one image that wait, in the order in which they began to.
pub(crate) type Checks = VecDeque<Waiting>;
