//! What befalls the farm, drawn from a key.

use std::time::Duration;

use super::{LINKS, WORKERS};
use crate::harness::Moment;

/// What happens in one round.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    /// How many blocks are let pass before.
    pub(super) after_blocks: u64,
    pub(super) trouble: Trouble,
}

/// One trouble.
#[derive(Clone, Copy, Debug)]
pub(super) enum Trouble {
    /// `kill -9`, and another is started over its state.
    KillCoordinator,
    /// The same, but the first that is started is killed too, at some moment of its start.
    KillCoordinatorAsItStarts(Moment),
    /// Frozen until the workers have rendered for so long, all together, or have nothing left to render.
    FreezeCoordinator(Duration),
    /// `kill -9`, and another worker is started.
    KillWorker(usize),
    /// Frozen, and thawed; the coordinator may be killed in between.
    FreezeWorker(usize, Until, Meanwhile),
    /// The connections of these links end; new ones are let through.
    CutLinks(Links),
    /// Nothing passes these links, though they stay open.
    FreezeLinks(Links, Until, Meanwhile),
    /// No room is left on the disk of the state folder until the coordinator says that it waits for it; it
    /// may be killed as it waits, and is started when there is room.
    FillDisk(Meanwhile),
}

/// How many kinds of trouble there are, of which the last needs a disk that can be filled.
const KINDS: u64 = 8;

/// Some of the links that lead through a proxy.
pub(super) type Links = [bool; LINKS];

/// When what is frozen is thawed.
#[derive(Clone, Copy, Debug)]
pub(super) enum Until {
    /// When the coordinator counts fewer workers.
    Missed,
    /// When the others have delivered so many blocks.
    OthersDeliver(u64),
}

/// What else happens while something is frozen or full.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Meanwhile {
    Nothing,
    KillCoordinator,
}

impl Trouble {
    /// Its name in the report.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::KillCoordinator => "coordinator killed",
            Self::KillCoordinatorAsItStarts(_) => "coordinator killed, and as it starts",
            Self::FreezeCoordinator(_) => "coordinator frozen",
            Self::KillWorker(_) => "worker killed",
            Self::FreezeWorker(_, _, Meanwhile::Nothing) => "worker frozen",
            Self::FreezeWorker(..) => "worker frozen, coordinator killed",
            Self::CutLinks(_) => "links cut",
            Self::FreezeLinks(_, _, Meanwhile::Nothing) => "links frozen",
            Self::FreezeLinks(..) => "links frozen, coordinator killed",
            Self::FillDisk(Meanwhile::Nothing) => "disk full",
            Self::FillDisk(_) => "disk full, coordinator killed",
        }
    }

    /// Whether a worker is away meanwhile, so that others may be leased what it renders.
    pub(super) fn parts_a_worker(self) -> bool {
        !matches!(
            self,
            Self::KillCoordinator
                | Self::KillCoordinatorAsItStarts(_)
                | Self::FreezeCoordinator(_)
                | Self::FillDisk(_)
        )
    }
}

/// Draws rounds: the same key draws the same ones.
#[derive(Debug)]
pub(super) struct Rounds {
    state: u64,
    /// Whether the disk can be filled.
    pub(super) with_disk: bool,
}

impl Rounds {
    pub(super) fn new(key: u64, with_disk: bool) -> Self {
        Self {
            state: key.wrapping_mul(0x2545_f491_4f6c_dd1d),
            with_disk,
        }
    }

    /// The next round. Every round takes the same count of numbers, whatever becomes of it.
    pub(super) fn draw(&mut self) -> Round {
        let after_blocks = self.below(9);
        let kind = self.below(if self.with_disk { KINDS } else { KINDS - 1 });
        let worker = usize::try_from(self.below(WORKERS as u64)).unwrap();
        let links = [[true, false], [false, true], [true, true]];
        let links = links[usize::try_from(self.below(3)).unwrap()];
        let until = match self.below(16) {
            blocks @ 1..=8 => Until::OthersDeliver(blocks),
            _ => Until::Missed,
        };
        let meanwhile = match self.below(3) {
            0 => Meanwhile::KillCoordinator,
            _ => Meanwhile::Nothing,
        };
        let a_while = Duration::from_millis(100 + self.below(2_900));
        let trouble = match kind {
            0 => Trouble::KillCoordinator,
            1 => Trouble::KillCoordinatorAsItStarts(match a_while.as_millis() % 3 {
                0 => Moment::AtOnce,
                1 => Moment::Counted,
                _ => Moment::Listening,
            }),
            2 => Trouble::FreezeCoordinator(a_while),
            3 => Trouble::KillWorker(worker),
            4 => Trouble::FreezeWorker(worker, until, meanwhile),
            5 => Trouble::CutLinks(links),
            6 => Trouble::FreezeLinks(links, until, meanwhile),
            _ => Trouble::FillDisk(meanwhile),
        };
        Round {
            after_blocks,
            trouble,
        }
    }

    /// A number below `end`, by SplitMix64.
    fn below(&mut self, end: u64) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.state ^ (self.state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ (mixed >> 31)) % end
    }
}
