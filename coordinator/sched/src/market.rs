//! Which workers want tiles, and which jobs have some.
//!
//! Outside [`crate::Sched::handle`] no revision has both: whatever can be leased is.

use alloc::collections::BTreeSet;

use model::{JobId, Revision, WorkerId};

/// Workers that want tiles and jobs that have some, per renderer revision.
#[derive(Clone, Debug, Default)]
pub(crate) struct Market {
    /// The least loaded first.
    workers: BTreeSet<(Revision, Load, WorkerId)>,
    /// The oldest first.
    jobs: BTreeSet<(Revision, JobId)>,
    /// Revisions where somebody came in since the last time nothing was left to match.
    touched: BTreeSet<Revision>,
}

/// Tiles held per thread, times 1,024.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct Load(u64);

impl Load {
    pub(crate) fn new(held: usize, threads: u32) -> Self {
        Self(held as u64 * 1_024 / u64::from(threads.max(1)))
    }
}

impl Market {
    /// Puts a worker where it now belongs; `slot` is where it stood.
    pub(crate) fn place_worker(
        &mut self,
        (revision, worker): (Revision, WorkerId),
        slot: &mut Option<Load>,
        load: Option<Load>,
    ) {
        if *slot == load {
            return;
        }
        if let Some(old) = *slot {
            self.workers.remove(&(revision, old, worker));
        }
        if let Some(new) = load {
            self.workers.insert((revision, new, worker));
            self.touched.insert(revision);
        }
        *slot = load;
    }

    /// Puts a job in, or takes it out.
    pub(crate) fn place_job(&mut self, revision: Revision, job: JobId, has_tiles: bool) {
        if !has_tiles {
            self.jobs.remove(&(revision, job));
        } else if self.jobs.insert((revision, job)) {
            self.touched.insert(revision);
        }
    }

    /// A worker and the job that its next tile comes from.
    pub(crate) fn next_match(&mut self) -> Option<(WorkerId, JobId)> {
        while let Some(&revision) = self.touched.first() {
            if let Some(pair) = self.worker(revision).zip(self.job(revision)) {
                return Some(pair);
            }
            self.touched.remove(&revision);
        }
        None
    }

    /// Whether a worker of this revision wants a tile and a job has one.
    pub(crate) fn is_open(&self, revision: Revision) -> bool {
        self.worker(revision).is_some() && self.job(revision).is_some()
    }

    /// Whether a job is in.
    pub(crate) fn has_job(&self, revision: Revision, job: JobId) -> bool {
        self.jobs.contains(&(revision, job))
    }

    fn worker(&self, revision: Revision) -> Option<WorkerId> {
        let least = WorkerId {
            id: 0,
            incarnation: 0,
        };
        self.workers
            .range((revision, Load(0), least)..)
            .next()
            .filter(|(of, ..)| *of == revision)
            .map(|&(_, _, worker)| worker)
    }

    fn job(&self, revision: Revision) -> Option<JobId> {
        self.jobs
            .range((revision, JobId(0))..)
            .next()
            .filter(|(of, _)| *of == revision)
            .map(|&(_, job)| job)
    }
}
