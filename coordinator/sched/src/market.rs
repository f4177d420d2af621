//! Which workers want tiles, and which jobs have some.
//!
//! Outside [`crate::Sched::handle`] no worker wants a tile that it may have: whatever can be leased is.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec::Vec;
use core::cmp::Reverse;

use model::{JobId, Timestamp};

use crate::needs::{Kind, KindSet};
use crate::roster::Place;

/// Groups of workers beyond which those that are empty are forgotten.
const GROUPS_KEPT: usize = 32;

/// Workers that want tiles and jobs that have some, by the kind of job.
#[derive(Clone, Debug, Default)]
pub(crate) struct Market {
    /// Workers for which the same jobs are to be had, the least loaded first.
    wanting: BTreeMap<Group, BTreeSet<Seat>>,
    /// Jobs with tiles that wait for a worker, by kind, in the order in which they are served.
    open: Vec<BTreeSet<Rank>>,
    /// Jobs of which every tile is leased and not every tile is done, in the same way.
    ending: Vec<BTreeSet<Rank>>,
    /// Kinds where somebody came in since the last time nothing was left to match.
    touched: KindSet,
    /// Whether a worker came or moved since somebody last asked.
    came: bool,
}

/// Workers that are alike: where one of them finds no job, the others need not look.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct Group {
    pub(crate) kinds: KindSet,
    /// The jobs that they are set aside for, in order.
    pub(crate) aside: Vec<JobId>,
    /// Whether their time is limited.
    pub(crate) is_limited: bool,
    /// Who stands for a queue is like nobody else.
    pub(crate) queue: Option<Place>,
    /// Whether they may hold another tile, or for a queue another image: one that may not wants the rest of those it holds.
    pub(crate) has_room: bool,
}

/// Where a worker stands among those of its group that want tiles.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct Seat {
    /// Where their time is limited, whoever has most of it first: what does not fit there fits nobody.
    ends: Reverse<Timestamp>,
    /// Tiles held per thread, times 1,024.
    load: u64,
    /// Of those that are loaded alike, the fastest first.
    speed: Reverse<u32>,
    pub(crate) worker: Place,
}

/// Where a job stands among those of its kind.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct Rank {
    priority: Reverse<i32>,
    /// What it would hold of the farm with one more tile, per share, times 2²⁰.
    load: u64,
    pub(crate) job: JobId,
}

/// What a job has for workers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Stage {
    /// Tiles that wait for one.
    Open,
    /// Tiles that are leased, and could be leased a second time or called back.
    Ending,
}

/// Where a job stands: it may have both, tiles that suit nobody who is free and others that could be helped.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct Stands {
    pub(crate) open: Option<Rank>,
    pub(crate) ending: Option<Rank>,
}

impl Seat {
    pub(crate) fn new(
        ends: Option<Timestamp>,
        (held, threads): (usize, u32),
        speed: u32,
        worker: Place,
    ) -> Self {
        Self {
            ends: Reverse(ends.unwrap_or_default()),
            load: held as u64 * 1_024 / u64::from(threads.max(1)),
            speed: Reverse(speed),
            worker,
        }
    }

    /// Whether one of its threads has nothing to do.
    pub(crate) fn has_free_thread(self) -> bool {
        self.load < 1_024
    }
}

impl Rank {
    pub(crate) fn new(priority: i32, held: u32, share: u32, job: JobId) -> Self {
        Self {
            priority: Reverse(priority),
            load: (u64::from(held) + 1) * (1 << 20) / u64::from(share.max(1)),
            job,
        }
    }
}

impl Market {
    /// Puts a worker where it now belongs; `slot` is where it stood.
    pub(crate) fn place_worker(
        &mut self,
        slot: &mut Option<(Group, Seat)>,
        seat: Option<(Group, Seat)>,
    ) {
        if *slot == seat {
            return;
        }
        if let Some((group, old)) = slot
            && let Some(seats) = self.wanting.get_mut(group)
        {
            seats.remove(old);
        }
        if let Some((group, new)) = &seat {
            match self.wanting.get_mut(group) {
                Some(seats) => drop(seats.insert(*new)),
                None => self.found(group.clone(), *new),
            }
            self.touched.add(group.kinds);
            self.came = true;
        }
        *slot = seat;
    }

    /// A group gets its first worker. Groups that are empty are kept, since most are not for long, but not many.
    fn found(&mut self, group: Group, seat: Seat) {
        if self.wanting.len() >= GROUPS_KEPT {
            self.wanting.retain(|_, seats| !seats.is_empty());
        }
        self.wanting.insert(group, BTreeSet::from([seat]));
    }

    /// Puts a job where it now belongs; `slot` is where it stood.
    pub(crate) fn place_job(&mut self, kind: Kind, slot: &mut Stands, stands: Stands) {
        let moves = [
            (Stage::Open, slot.open, stands.open),
            (Stage::Ending, slot.ending, stands.ending),
        ];
        for (stage, before, after) in moves
            .into_iter()
            .filter(|(_, before, after)| before != after)
        {
            let ranks = self.ranks(stage, kind);
            if let Some(rank) = before {
                ranks.remove(&rank);
            }
            if let Some(rank) = after {
                ranks.insert(rank);
            }
        }
        *slot = stands;
    }

    /// Whether a worker came or moved since this was last asked.
    pub(crate) fn take_came(&mut self) -> bool {
        core::mem::take(&mut self.came)
    }

    /// Something of these kinds may be leased that was not before.
    pub(crate) fn touch(&mut self, kinds: KindSet) {
        self.touched.add(kinds);
    }

    /// A job of a kind has tiles that may not have been there before, or may suit somebody else now.
    pub(crate) fn touch_kind(&mut self, kind: Kind) {
        self.touched.insert(kind);
    }

    /// A kind that may have something to match.
    pub(crate) fn touched(&self) -> Option<Kind> {
        self.touched.first()
    }

    /// Nothing of a kind is left to match.
    pub(crate) fn settled(&mut self, kind: Kind) {
        self.touched.remove(kind);
    }

    /// Workers that want tiles and serve a kind, each group in order.
    pub(crate) fn wanting(&self, kind: Kind) -> impl Iterator<Item = (KindSet, &BTreeSet<Seat>)> {
        self.groups().filter(move |(kinds, _)| kinds.contains(kind))
    }

    /// All workers that want tiles, in groups.
    pub(crate) fn groups(&self) -> impl Iterator<Item = (KindSet, &BTreeSet<Seat>)> {
        self.wanting
            .iter()
            .map(|(group, seats)| (group.kinds, seats))
    }

    /// The jobs of a kind in a stage, in order.
    pub(crate) fn jobs(&self, stage: Stage, kind: Kind) -> impl Iterator<Item = Rank> {
        let ranks = match stage {
            Stage::Open => &self.open,
            Stage::Ending => &self.ending,
        };
        ranks.get(kind.index()).into_iter().flatten().copied()
    }

    /// Whether some job is in a stage.
    pub(crate) fn has(&self, stage: Stage) -> bool {
        let ranks = match stage {
            Stage::Open => &self.open,
            Stage::Ending => &self.ending,
        };
        ranks.iter().any(|ranks| !ranks.is_empty())
    }

    fn ranks(&mut self, stage: Stage, kind: Kind) -> &mut BTreeSet<Rank> {
        let ranks = match stage {
            Stage::Open => &mut self.open,
            Stage::Ending => &mut self.ending,
        };
        if ranks.len() <= kind.index() {
            ranks.resize(kind.index() + 1, BTreeSet::new());
        }
        &mut ranks[kind.index()]
    }
}
