//! How large a farm is, what goes wrong in it, and which mistake is planted; all of it can be made smaller.

use crate::random::Random;

/// How often things go wrong, in so many of 1,000 cases.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct Troubles {
    /// A message comes a second time, later.
    pub(crate) repeats: u64,
    /// In a second of the farm, a link is cut.
    pub(crate) cuts: u64,
    /// In a second of the farm, some of the workers cannot be reached for a while.
    pub(crate) partitions: u64,
    /// In a second of the farm, a worker is killed.
    pub(crate) kills: u64,
    /// In a second of the farm, a worker is frozen, longer than its limit or not.
    pub(crate) freezes: u64,
    /// In a second of the farm, a worker is drained or stopped.
    pub(crate) leaves: u64,
    /// In a second of the farm, the coordinator is frozen.
    pub(crate) pauses: u64,
    /// In a second of the farm, the coordinator's machine crashes.
    pub(crate) crashes: u64,
    /// In a second of the farm, the disk fills up for a while.
    pub(crate) fulls: u64,
    /// In a second of the farm, the coordinator's clock jumps.
    pub(crate) jumps: u64,
    /// In a second of the farm, a worker's clock jumps ahead or stands still.
    pub(crate) clocks: u64,
    /// In a second of the farm, a user wants something.
    pub(crate) wishes: u64,
    /// In a second of the farm, a polled site cannot be reached for a while, longer than its patience or not.
    pub(crate) aways: u64,
    /// At a polled site, a task ends by itself after a block, or its host is gone.
    pub(crate) deaths: u64,
    /// A tile fails.
    pub(crate) failures: u64,
    /// A worker makes wrong pixels.
    pub(crate) liars: u64,
    /// A worker is ten times as slow as others.
    pub(crate) slow: u64,
}

impl Troubles {
    pub(crate) const NONE: Self = Self {
        repeats: 0,
        cuts: 0,
        partitions: 0,
        kills: 0,
        freezes: 0,
        leaves: 0,
        pauses: 0,
        crashes: 0,
        fulls: 0,
        jumps: 0,
        clocks: 0,
        wishes: 0,
        aways: 0,
        deaths: 0,
        failures: 0,
        liars: 0,
        slow: 0,
    };

    /// Everything at once, but for wrong pixels.
    pub(crate) const ALL: Self = Self {
        repeats: 10,
        cuts: 30,
        partitions: 5,
        kills: 8,
        freezes: 8,
        leaves: 8,
        pauses: 3,
        crashes: 10,
        fulls: 10,
        jumps: 2,
        clocks: 8,
        wishes: 30,
        aways: 15,
        deaths: 60,
        failures: 5,
        liars: 0,
        slow: 200,
    };

    /// The same without each of them in turn.
    fn fewer(self) -> Vec<Self> {
        let fields: [fn(&mut Self) -> &mut u64; 17] = [
            |it| &mut it.repeats,
            |it| &mut it.cuts,
            |it| &mut it.partitions,
            |it| &mut it.kills,
            |it| &mut it.freezes,
            |it| &mut it.leaves,
            |it| &mut it.pauses,
            |it| &mut it.crashes,
            |it| &mut it.fulls,
            |it| &mut it.jumps,
            |it| &mut it.clocks,
            |it| &mut it.wishes,
            |it| &mut it.aways,
            |it| &mut it.deaths,
            |it| &mut it.failures,
            |it| &mut it.liars,
            |it| &mut it.slow,
        ];
        let without = |field: fn(&mut Self) -> &mut u64| {
            let mut fewer = self;
            (std::mem::take(field(&mut fewer)) > 0).then_some(fewer)
        };
        fields.into_iter().filter_map(without).collect()
    }
}

/// A mistake around the scheduler's events and effects, to see that it is caught.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Bug {
    /// A block is acknowledged of which the store was not told.
    LostAcknowledgement,
    /// The store is told of blocks that were not synced.
    MissingSync,
    /// What was done is reported twice.
    DoubleCommit,
    /// A block of a dead attempt is taken.
    StaleAttempt,
    /// Nobody looks at the clock.
    EndlessLease,
    /// Blocks are taken however many wait for the disk.
    UnboundedQueue,
    /// The scheduler is not told what a job waits for.
    NoPatience,
    /// A polled site is not asked what of its tiles is missing.
    FetchedAgain,
}

/// A farm.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Plan {
    pub(crate) key: u64,
    pub(crate) workers: u64,
    /// Sites that are polled.
    pub(crate) sites: u64,
    pub(crate) jobs: u64,
    /// Of the longest job.
    pub(crate) images: u64,
    /// Of a million tiles, so many are rendered once more.
    pub(crate) verify: u32,
    pub(crate) troubles: Troubles,
    pub(crate) bug: Option<Bug>,
}

impl Plan {
    /// A farm whose size is drawn from the key.
    pub(crate) fn new(key: u64, troubles: Troubles) -> Self {
        let mut random = Random::new(key ^ 0x5eed);
        Self {
            key,
            workers: 1 + random.below(5),
            jobs: 1 + random.below(3),
            images: 1 + random.below(6),
            // In every second farm nothing may be rendered twice on purpose.
            verify: if key.is_multiple_of(2) { 0 } else { 30_000 },
            troubles,
            // In every second farm nothing is polled.
            sites: random.below(2),
            bug: None,
        }
    }

    /// Farms that are a little simpler.
    pub(crate) fn simpler(self) -> Vec<Self> {
        let mut simpler: Vec<Self> = self
            .troubles
            .fewer()
            .into_iter()
            .map(|troubles| Self { troubles, ..self })
            .collect();
        if self.jobs > 1 {
            let jobs = self.jobs - 1;
            simpler.push(Self { jobs, ..self });
        }
        if self.images > 1 {
            let images = self.images - 1;
            simpler.push(Self { images, ..self });
        }
        if self.workers > 1 {
            let workers = self.workers - 1;
            simpler.push(Self { workers, ..self });
        }
        if self.sites > 0 {
            let sites = self.sites - 1;
            simpler.push(Self { sites, ..self });
        }
        simpler
    }
}
