//! The scheduler itself.

use alloc::vec::Vec;

use model::{AttemptId, ImageRef, JobId, Timestamp, WorkerId};

use crate::{
    BlockRef, Config, Effect, Event, ImageFailure, ImageView, JobView, Verdict, WorkerView,
};

/// The state of the farm.
#[derive(Clone, Debug)]
pub struct Sched {
    config: Config,
}

impl Sched {
    /// A farm without jobs or workers.
    pub fn new(config: Config) -> Self {
        Self { config }
    }

    /// Applies one event and appends to `out` what the shell must now do.
    pub fn handle(&mut self, now: Timestamp, event: Event, out: &mut Vec<Effect>) {
        let _ = (now, event, out, &self.config);
    }

    /// When an [`Event::Tick`] is next worth sending; `None` while nothing is pending.
    pub fn next_deadline(&self) -> Option<Timestamp> {
        None
    }

    /// What to do with a block that `worker` sent; asked before it is written.
    pub fn accepts(&self, worker: WorkerId, block: BlockRef) -> Verdict {
        let _ = (worker, block);
        Verdict::Refuse(crate::BlockRefusal::AttemptDead)
    }

    /// A job.
    pub fn job(&self, job: JobId) -> Option<JobView<'_>> {
        let _ = job;
        None
    }

    /// All jobs that are remembered, oldest first.
    pub fn jobs(&self) -> impl Iterator<Item = JobView<'_>> {
        core::iter::empty()
    }

    /// The images of a job, in order; none for a job that is not known.
    pub fn images(&self, job: JobId) -> impl Iterator<Item = ImageView> {
        let _ = job;
        core::iter::empty()
    }

    /// One image.
    pub fn image(&self, image: ImageRef) -> Option<ImageView> {
        let _ = image;
        None
    }

    /// The images of a job that failed, in the order in which they did; the first
    /// [`crate::Limits::failures_kept_max`] of them.
    pub fn failures(&self, job: JobId) -> &[ImageFailure] {
        let _ = job;
        &[]
    }

    /// A worker.
    pub fn worker(&self, worker: WorkerId) -> Option<WorkerView> {
        let _ = worker;
        None
    }

    /// All workers that are known, by id.
    pub fn workers(&self) -> impl Iterator<Item = WorkerView> {
        core::iter::empty()
    }

    /// Whose a live attempt is, and its image and tile; `None` for one that is dead.
    pub fn attempt(&self, attempt: AttemptId) -> Option<(WorkerId, ImageRef, model::Rect)> {
        let _ = attempt;
        None
    }
}
