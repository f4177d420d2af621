//! What jobs ask of workers, what workers offer, and which jobs that leaves to whom.
//!
//! Jobs that ask for the same are of one *kind*. There are few kinds, so a worker
//! is matched against kinds, once, and not against jobs.

use alloc::collections::BTreeSet;
use alloc::string::String;
use alloc::vec::Vec;

use model::{Revision, Span};

/// What a job asks of the workers that render it, beside the renderer's revision.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Needs {
    /// Labels that a worker must have, all of them.
    pub labels: BTreeSet<String>,
    /// Fewest render threads.
    pub threads: u32,
    /// Least memory of its machine in bytes.
    pub memory_bytes: u64,
}

/// What a worker offers.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Offer {
    /// Its renderer's revision.
    pub revision: Revision,
    /// Its render threads, at least 1.
    pub threads: u32,
    /// The memory of its machine in bytes; 0 is not known, and meets no need of memory.
    pub memory_bytes: u64,
    /// Its labels.
    pub labels: BTreeSet<String>,
    /// How long it may still run, by its queue's or its user's word; absent where nobody set a limit.
    pub time_left: Option<Span>,
    /// How it takes tiles where it stands for a cluster's queue.
    pub queue: Option<Queue>,
}

/// How a worker takes tiles that stands for a cluster's queue: whole images, each an array of tiles by the rule
/// of thesis §C.3.2. Its credit counts images: one in hand and those ahead (§C.3.5).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Queue {
    /// Fewest pixels of a tile, the thesis's Min_tsize.
    pub min_tile_pixels: u64,
    /// Most tiles of an image.
    pub max_array_size: u64,
    /// By how much what is heard of its tiles may be late: it is polled (§C.3.4).
    pub lag: Span,
    /// How long what it has begun stays its own while its link is closed: there it goes on meanwhile.
    pub patience: Span,
}

impl Needs {
    /// Whether a worker offers all of it.
    pub fn are_met_by(&self, offer: &Offer) -> bool {
        offer.threads >= self.threads
            && offer.memory_bytes >= self.memory_bytes
            && self.labels.is_subset(&offer.labels)
    }
}

/// One kind of job.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct Kind(u8);

/// Some of the kinds.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
pub(crate) struct KindSet(u64);

/// Most kinds at a time: one bit each.
pub(crate) const KINDS_MAX: usize = 64;

impl Kind {
    pub(crate) fn index(self) -> usize {
        usize::from(self.0)
    }
}

impl KindSet {
    pub(crate) fn contains(self, kind: Kind) -> bool {
        self.0 >> kind.0 & 1 == 1
    }

    pub(crate) fn insert(&mut self, kind: Kind) {
        self.0 |= 1 << kind.0;
    }

    pub(crate) fn remove(&mut self, kind: Kind) {
        self.0 &= !(1 << kind.0);
    }

    pub(crate) fn add(&mut self, other: Self) {
        self.0 |= other.0;
    }

    pub(crate) fn first(self) -> Option<Kind> {
        let bit = self.0.trailing_zeros();
        u8::try_from(bit).ok().filter(|&bit| bit < 64).map(Kind)
    }

    pub(crate) fn iter(self) -> impl Iterator<Item = Kind> {
        let mut left = self;
        core::iter::from_fn(move || {
            let kind = left.first()?;
            left.remove(kind);
            Some(kind)
        })
    }
}

/// Whether a kind is forgotten.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Forgotten {
    Yes,
    No,
}

/// The kinds of all jobs that are remembered.
#[derive(Clone, Debug, Default)]
pub(crate) struct Kinds(Vec<Option<Row>>);

#[derive(Clone, Debug)]
struct Row {
    revision: Revision,
    needs: Needs,
    /// Jobs of this kind.
    jobs: u32,
    /// Workers that serve it: who can be reached, wants tiles and is not set aside.
    able: u32,
}

/// A kind, and whether it is there for the first time.
pub(crate) enum Interned {
    Known(Kind),
    New(Kind),
}

impl Kinds {
    /// The kind of one more job; `None` where there are too many.
    pub(crate) fn add(&mut self, revision: Revision, needs: &Needs) -> Option<Interned> {
        let is_same = |row: &Row| row.revision == revision && row.needs == *needs;
        let known = self
            .0
            .iter()
            .position(|row| row.as_ref().is_some_and(is_same));
        if let Some(row) = known.and_then(|index| self.0[index].as_mut()) {
            row.jobs += 1;
            return known.and_then(kind).map(Interned::Known);
        }
        let index = match self.0.iter().position(Option::is_none) {
            Some(index) => index,
            None if self.0.len() < KINDS_MAX => {
                self.0.push(None);
                self.0.len() - 1
            }
            None => return None,
        };
        self.0[index] = Some(Row {
            revision,
            needs: needs.clone(),
            jobs: 1,
            able: 0,
        });
        kind(index).map(Interned::New)
    }

    /// A job of a kind is forgotten; says whether the kind is, too.
    pub(crate) fn remove(&mut self, kind: Kind) -> Forgotten {
        let row = &mut self.0[kind.index()];
        if let Some(known) = row {
            known.jobs -= 1;
            if known.jobs > 0 {
                return Forgotten::No;
            }
        }
        *row = None;
        Forgotten::Yes
    }

    /// The kinds that a worker serves.
    pub(crate) fn served_by(&self, offer: &Offer) -> KindSet {
        let mut kinds = KindSet::default();
        for (index, row) in self.0.iter().enumerate() {
            let serves = row
                .as_ref()
                .is_some_and(|row| row.revision == offer.revision && row.needs.are_met_by(offer));
            if let Some(kind) = kind(index).filter(|_| serves) {
                kinds.insert(kind);
            }
        }
        kinds
    }

    /// How many workers serve a kind at this moment.
    pub(crate) fn able(&self, kind: Kind) -> u32 {
        self.0[kind.index()].as_ref().map_or(0, |row| row.able)
    }

    /// A worker that serves these kinds begins to want tiles, or ends to.
    pub(crate) fn count_able(&mut self, kinds: KindSet, comes: Comes) {
        for kind in kinds.iter() {
            if let Some(row) = &mut self.0[kind.index()] {
                match comes {
                    Comes::In => row.able += 1,
                    Comes::Out => row.able -= 1,
                }
            }
        }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.0.iter().flatten().count()
    }
}

/// A direction.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Comes {
    In,
    Out,
}

fn kind(index: usize) -> Option<Kind> {
    u8::try_from(index).ok().map(Kind)
}
