//! The scheduler itself: its state, its one door, and what can be asked of it.

use alloc::collections::{BTreeMap, BTreeSet, VecDeque};
use alloc::vec::Vec;

use model::{AttemptId, ImageRef, JobId, Rect, SubmissionId, Timestamp, WorkerId};

use crate::aside::Expelled;
use crate::attempt::{Attempt, is_block_of};
use crate::job::Job;
use crate::live::Live;
use crate::market::Market;
use crate::needs::Kinds;
use crate::roster::{Place, Roster};
use crate::timers::Timers;
use crate::wrong::Wrong;
use crate::{
    BlockRef, BlockRefusal, Config, Effect, Event, ImageFailure, ImageView, JobView, Verdict,
    WorkerView,
};

/// The state of the farm.
///
/// An event costs the logarithm of how many jobs, workers and attempts there
/// are; what ends a whole image, job or worker costs as much as that holds.
#[derive(Clone, Debug)]
pub struct Sched {
    pub(crate) config: Config,
    /// The latest time that was told.
    pub(crate) now: Timestamp,
    pub(crate) jobs: BTreeMap<JobId, Job>,
    pub(crate) submissions: BTreeMap<SubmissionId, JobId>,
    pub(crate) jobs_made: u64,
    /// Jobs that are over, in the order in which they ended.
    pub(crate) over: VecDeque<JobId>,
    /// Images of all jobs that are remembered.
    pub(crate) images: u32,
    /// Jobs that others wait for, and which.
    pub(crate) waited_for: BTreeMap<JobId, BTreeSet<JobId>>,
    pub(crate) kinds: Kinds,
    pub(crate) workers: Roster,
    /// Those that stand for a queue.
    pub(crate) queues: BTreeSet<Place>,
    /// What all threads of workers that take tiles get done in a microsecond, times 1,024.
    pub(crate) capacity: u64,
    /// Live attempts by number.
    pub(crate) attempts: Live,
    pub(crate) attempts_made: u64,
    /// The numbers of live attempts that were leased in earlier epochs, by the names that they keep.
    pub(crate) adopted: BTreeMap<AttemptId, u64>,
    pub(crate) timers: Timers,
    pub(crate) market: Market,
    /// When it is worth looking again for help that jobs near their end could have.
    pub(crate) help_next: Timestamp,
    /// Workers that were expelled.
    pub(crate) expelled: Expelled,
    /// Images with pixels of theirs.
    pub(crate) wrong: Wrong,
    /// Images of which a check may wait in vain.
    pub(crate) unlooked: Vec<ImageRef>,
    /// Jobs that this event changed, each once.
    pub(crate) changed: Vec<JobId>,
}

impl Sched {
    /// A farm without jobs or workers.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            now: Timestamp::default(),
            jobs: BTreeMap::new(),
            submissions: BTreeMap::new(),
            jobs_made: 0,
            over: VecDeque::new(),
            images: 0,
            waited_for: BTreeMap::new(),
            kinds: Kinds::default(),
            workers: Roster::default(),
            queues: BTreeSet::new(),
            capacity: 0,
            attempts: Live::default(),
            attempts_made: 0,
            adopted: BTreeMap::new(),
            timers: Timers::default(),
            market: Market::default(),
            help_next: Timestamp::default(),
            expelled: Expelled::default(),
            wrong: Wrong::default(),
            unlooked: Vec::new(),
            changed: Vec::new(),
        }
    }

    /// Applies one event and appends to `out` what the shell must now do.
    ///
    /// `now` may not decrease; where it does, the latest time told before holds.
    pub fn handle(&mut self, now: Timestamp, event: Event, out: &mut Vec<Effect>) {
        self.now = self.now.max(now);
        match event {
            Event::Submit(submission) => self.submit(submission, out),
            Event::BlockStored {
                worker,
                block,
                elapsed,
                pixels,
            } => self.block_stored(worker, block, (elapsed, pixels), out),
            Event::TileFailed {
                worker,
                attempt,
                reason,
            } => self.tile_failed(worker, attempt, reason, out),
            Event::ImageEncoded { image, film } => self.image_encoded(image, film, out),
            Event::JobsRecalled { last } => self.jobs_recalled(last),
            Event::ImageRecalled {
                image,
                film,
                blocks,
                render_time,
            } => self.image_recalled(image, film, (blocks, render_time), out),
            Event::BlocksRecalled { image, blocks } => self.blocks_recalled(image, &blocks, out),
            Event::ImageFailed { image, reason } => self.image_failed(image, reason, out),
            Event::Command { job, command } => self.command(job, command, out),
            Event::WorkerJoined {
                worker,
                link,
                offer,
                held,
                begun,
            } => self.worker_joined(worker, (link, offer), (&held, &begun), out),
            Event::Credit { worker, credit } => self.credit(worker, credit),
            Event::Heartbeat { worker, running } => self.heartbeat(worker, &running, out),
            Event::GivenBack { worker, attempts } => self.given_back(worker, &attempts),
            Event::LinkClosed { worker, link } => self.link_closed(worker, link),
            Event::Goodbye { worker } => self.goodbye(worker, out),
            Event::Tick => self.tick(out),
        }
        self.give_up_lonely_checks(out);
        self.ask_again(out);
        for index in 0..self.changed.len() {
            self.settle_job(self.changed[index]);
        }
        self.lease_all(out);
        self.changed.sort_unstable();
        out.extend(self.changed.drain(..).map(|job| Effect::JobChanged { job }));
    }

    /// When an [`Event::Tick`] is next worth sending; `None` while nothing is pending.
    pub fn next_deadline(&self) -> Option<Timestamp> {
        self.timers.next()
    }

    /// What to do with a block that `worker` sent; asked before it is written.
    ///
    /// A block of any live attempt counts, of a dead one never.
    pub fn accepts(&self, worker: WorkerId, block: BlockRef) -> Verdict {
        let refuse = Verdict::Refuse;
        let Some(attempt) = self.live(block.attempt) else {
            return refuse(BlockRefusal::AttemptDead);
        };
        if self.workers[attempt.worker].id != worker {
            return refuse(BlockRefusal::NotYours);
        }
        if attempt.image != block.image {
            return refuse(BlockRefusal::OtherImage);
        }
        if !is_block_of(attempt.rect, block.rect) {
            return refuse(BlockRefusal::NotABlock);
        }
        let work = self
            .jobs
            .get(&block.image.job)
            .and_then(|job| job.work.get(&job.place(block.image.image)?));
        match work {
            Some(work) if work.pixels.covers(block.rect) => Verdict::AlreadyDone,
            Some(_) => Verdict::Accept,
            None => refuse(BlockRefusal::AttemptDead),
        }
    }

    /// A job.
    pub fn job(&self, job: JobId) -> Option<JobView<'_>> {
        self.jobs.get(&job).map(Job::view)
    }

    /// The job that a submission became.
    pub fn submitted(&self, submission: SubmissionId) -> Option<JobId> {
        self.submissions.get(&submission).copied()
    }

    /// All jobs that are remembered, oldest first.
    pub fn jobs(&self) -> impl Iterator<Item = JobView<'_>> {
        self.jobs.values().map(Job::view)
    }

    /// The images of a job, in order; none for a job that is not known.
    pub fn images(&self, job: JobId) -> impl Iterator<Item = ImageView> {
        self.jobs
            .get(&job)
            .into_iter()
            .flat_map(|job| (0..job.spec.frames.count()).map(|place| job.image_view(place)))
    }

    /// One image.
    pub fn image(&self, image: ImageRef) -> Option<ImageView> {
        let job = self.jobs.get(&image.job)?;
        Some(job.image_view(job.place(image.image)?))
    }

    /// The images of a job that failed, in the order in which they did; the first
    /// [`crate::Limits::failures_kept_max`] of them.
    pub fn failures(&self, job: JobId) -> &[ImageFailure] {
        self.jobs.get(&job).map_or(&[], |job| &job.failures)
    }

    /// A worker.
    pub fn worker(&self, worker: WorkerId) -> Option<WorkerView> {
        Some(self.workers.by_id(worker)?.view())
    }

    /// All workers that are known, by id.
    pub fn workers(&self) -> impl Iterator<Item = WorkerView> {
        self.workers.iter().map(|(_, worker)| worker.view())
    }

    /// Whose a live attempt is, and its image and tile; `None` for one that is dead.
    pub fn attempt(&self, attempt: AttemptId) -> Option<(WorkerId, ImageRef, Rect)> {
        let attempt = self.live(attempt)?;
        let worker = self.workers[attempt.worker].id;
        Some((worker, attempt.image, attempt.rect))
    }

    /// A live attempt; one of another epoch is only where it was taken up again.
    pub(crate) fn live(&self, attempt: AttemptId) -> Option<&Attempt> {
        self.attempts.get(self.number(attempt)?)
    }

    /// The number of an attempt, which may have ended, in this epoch.
    fn number(&self, attempt: AttemptId) -> Option<u64> {
        match attempt.epoch == self.config.epoch {
            true => Some(attempt.number),
            false => self.adopted.get(&attempt).copied(),
        }
    }

    /// The number of a live attempt, if it is this worker's.
    pub(crate) fn owned(&self, worker: WorkerId, attempt: AttemptId) -> Option<u64> {
        let number = self.number(attempt)?;
        let live = self.attempts.get(number)?;
        (self.workers[live.worker].id == worker).then_some(number)
    }

    /// The blocks of a worker's tile that are not durable, whoever brings them; `None` where the tile is not its own.
    pub fn missing(&self, worker: WorkerId, attempt: AttemptId) -> Option<Vec<Rect>> {
        let attempt = self.attempts.get(self.owned(worker, attempt)?)?;
        let job = self.jobs.get(&attempt.image.job)?;
        let work = job.work.get(&job.place(attempt.image.image)?)?;
        let blocks = attempt.rect.blocks();
        Some(blocks.filter(|&block| !work.pixels.covers(block)).collect())
    }

    /// What its worker calls an attempt.
    pub(crate) fn attempt_id(&self, number: u64) -> AttemptId {
        let name = self.attempts.get(number).and_then(|attempt| attempt.name);
        name.unwrap_or(AttemptId {
            epoch: self.config.epoch,
            number,
        })
    }
}
