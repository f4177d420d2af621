//! A bystander who notes what was promised, and says when a promise is broken.

use std::collections::{BTreeMap, BTreeSet};

use model::{AttemptId, ImageRef, JobId, Lease, Rect, Span, Timestamp, WorkerId};
use sched::{BlockRef, ImageState, JobOutcome, JobState, Sched};
use store::Recalled;

use crate::disk::{HEIGHT, WIDTH};

/// A worker of which nothing was heard for so long holds no lease: four heartbeats, and
/// room for a coordinator that was frozen and whose clock went back.
const SILENCE_MAX: Span = Span::from_secs(20);

#[derive(Debug, Default)]
pub(crate) struct Witness {
    /// Whether tiles are rendered once more to be compared.
    verifies: bool,
    /// Jobs whose user heard their number.
    pub(crate) jobs: BTreeSet<JobId>,
    /// Of those, the cancelled ones.
    pub(crate) cancelled: BTreeSet<JobId>,
    /// Images whose encoding is committed.
    pub(crate) encoded: BTreeSet<ImageRef>,
    /// Blocks of which two renderings differed.
    pub(crate) incidents: u64,
    /// Images of a worker's that are rendered again since it made wrong pixels.
    pub(crate) convicted: u64,
    /// Tiles that workers went on with after a crash.
    pub(crate) adopted: u64,
    /// Blocks that were fetched from polled sites.
    pub(crate) fetched: u64,
    /// Times that a polled site was out of reach for longer than its patience.
    pub(crate) lost: u64,
    /// Pixels that were acknowledged and still count.
    pixels: BTreeMap<ImageRef, Vec<bool>>,
    /// Every lease of this epoch.
    leased: BTreeMap<AttemptId, (WorkerId, ImageRef)>,
    heard: BTreeMap<WorkerId, Timestamp>,
    /// How long polled sites keep their tiles beyond that.
    patience: BTreeMap<WorkerId, Span>,
    /// Pixels that were acknowledged when a polled site was reached.
    known: BTreeMap<WorkerId, BTreeMap<ImageRef, Vec<bool>>>,
    /// Blocks of polled sites that were acknowledged.
    brought: BTreeSet<(AttemptId, Rect)>,
    /// The scheduler before the last crash, where it had nothing to commit.
    pub(crate) before: Option<Sched>,
    placed: BTreeMap<(u64, ImageRef, u32), u32>,
    /// What each job was submitted to wait for.
    after: BTreeMap<JobId, Vec<JobId>>,
    /// Jobs that were finished, at least once in this epoch.
    finished: BTreeSet<JobId>,
}

impl Witness {
    pub(crate) fn new(verifies: bool) -> Self {
        Self {
            verifies,
            ..Self::default()
        }
    }

    pub(crate) fn hears_of(&mut self, worker: WorkerId, now: Timestamp) {
        self.heard.insert(worker, now);
    }

    /// A worker stands for a site that is polled.
    pub(crate) fn is_patient(&mut self, worker: WorkerId, patience: Span) {
        self.patience.insert(worker, patience);
    }

    /// A polled site is reached, and asks what is missing.
    pub(crate) fn connects(&mut self, site: WorkerId) {
        self.known.insert(site, self.pixels.clone());
    }

    /// A block is fetched from a polled site: it was missing when that was reached, and was not brought since.
    pub(crate) fn fetches(&mut self, site: WorkerId, block: BlockRef) {
        self.fetched += 1;
        let known = self.known.get(&site);
        let known = known.and_then(|known| known.get(&block.image));
        let was_known = known.is_some_and(|pixels| places(block.rect).all(|place| pixels[place]));
        let was_brought = self.brought.contains(&(block.attempt, block.rect));
        assert!(
            !was_known && !was_brought,
            "{block:?}: what is durable is not fetched again"
        );
    }

    pub(crate) fn leases(&mut self, worker: WorkerId, lease: &Lease) {
        let before = self.leased.insert(lease.attempt, (worker, lease.image));
        assert_eq!(before, None, "an attempt is leased once");
        if let Some(pixels) = self.pixels.get(&lease.image) {
            let is_new = |block: Rect| places(block).any(|place| !pixels[place]);
            // All of it was: it is verified.
            let is_check = self.verifies && lease.blocks().all(|block| !is_new(block));
            assert!(
                is_check || lease.blocks().all(is_new),
                "what is acknowledged is never rendered again"
            );
        }
    }

    /// A worker goes on with what another epoch had leased it.
    pub(crate) fn adopts(&mut self, worker: WorkerId, attempt: AttemptId, image: ImageRef) {
        self.leased.insert(attempt, (worker, image));
        self.adopted += 1;
    }

    pub(crate) fn waits(&mut self, job: JobId, after: &[JobId]) {
        self.after.insert(job, after.to_vec());
    }

    pub(crate) fn finishes(&mut self, job: JobId) {
        self.finished.insert(job);
    }

    /// Nothing is leased of a job before those that it waits for were finished.
    pub(crate) fn check_begun(&self, job: JobId) {
        let mut before = self.after.get(&job).into_iter().flatten();
        let is_finished = before.all(|before| self.finished.contains(before));
        assert!(is_finished, "{job:?}: jobs that wait are not begun");
    }

    pub(crate) fn image_of(&self, attempt: AttemptId) -> Option<ImageRef> {
        self.leased.get(&attempt).map(|&(_, image)| image)
    }

    pub(crate) fn acknowledges(&mut self, worker: WorkerId, block: BlockRef) {
        let none = || vec![false; (WIDTH * HEIGHT) as usize];
        let pixels = self.pixels.entry(block.image).or_insert_with(none);
        places(block.rect).for_each(|place| pixels[place] = true);
        if self.known.contains_key(&worker) {
            self.brought.insert((block.attempt, block.rect));
        }
    }

    pub(crate) fn forget_pixels(&mut self, image: ImageRef) {
        self.pixels.remove(&image);
        for known in self.known.values_mut() {
            known.remove(&image);
        }
    }

    pub(crate) fn forget_job(&mut self, job: JobId) {
        self.jobs.remove(&job);
        self.cancelled.remove(&job);
        self.encoded.retain(|image| image.job != job);
        for after in self.after.values_mut() {
            after.retain(|&before| before != job);
        }
        self.pixels.retain(|image, _| image.job != job);
    }

    /// A frame is put in its place.
    pub(crate) fn places(&mut self, epoch: u64, image: ImageRef, era: u32) {
        let placed = self.placed.entry((epoch, image, era)).or_default();
        *placed += 1;
        assert_eq!(*placed, 1, "an image is put in its place once");
    }

    pub(crate) fn places_not(&mut self, epoch: u64, image: ImageRef, era: u32) {
        self.placed.remove(&(epoch, image, era));
    }

    /// No lease outlives its worker.
    pub(crate) fn check_leases(&self, now: Timestamp, sched: &Sched) {
        for (&attempt, (worker, _)) in &self.leased {
            let heard = self.heard.get(worker).copied().unwrap_or_default();
            let is_over = sched.attempt(attempt).is_none();
            let patience = self.patience.get(worker).copied().unwrap_or_default();
            assert!(
                is_over || now - heard <= SILENCE_MAX + patience,
                "every lease ends: {attempt}"
            );
        }
    }

    /// Attempts of another epoch are dead until they are taken up, and what they were leased is of no interest.
    pub(crate) fn crash(&mut self) {
        self.leased.clear();
        self.finished.clear();
        self.known.clear();
        self.brought.clear();
        self.patience.clear();
    }

    /// Holds a scheduler that was told what the store recalls against what was promised.
    pub(crate) fn compare(&mut self, sched: &Sched, recalled: &Recalled) {
        self.after.clear();
        for job in &recalled.jobs {
            let mut after = job.submission.after.clone();
            after.retain(|&before| sched.job(before).is_some());
            self.after.insert(job.job, after);
        }
        for job in sched.jobs() {
            if job.state == JobState::Over(JobOutcome::Finished) {
                self.finished.insert(job.job);
            }
        }
        for &job in &self.jobs {
            let state = sched.job(job).map(|job| job.state);
            assert!(state.is_some(), "{job:?}: a job that was taken is there");
            let is_cancelled = state == Some(JobState::Over(JobOutcome::Cancelled));
            assert!(
                is_cancelled || !self.cancelled.contains(&job),
                "{job:?} was cancelled"
            );
        }
        for &image in &self.encoded {
            let state = sched.image(image).map(|view| view.state);
            let is_encoded = matches!(state, Some(ImageState::Encoded { .. }));
            assert!(is_encoded, "{image:?} was in its place, and is {state:?}");
        }
        let mut there: BTreeMap<ImageRef, Vec<bool>> = BTreeMap::new();
        for job in &recalled.jobs {
            for block in &job.blocks {
                let image = ImageRef {
                    job: job.job,
                    image: block.image,
                };
                let none = || vec![false; (WIDTH * HEIGHT) as usize];
                let pixels = there.entry(image).or_insert_with(none);
                places(block.rect).for_each(|place| pixels[place] = true);
            }
        }
        self.pixels.retain(|&image, promised| {
            let begins = |state| {
                matches!(
                    state,
                    ImageState::Waiting | ImageState::Rendering | ImageState::Encoding
                )
            };
            let begins = sched.image(image).is_some_and(|view| begins(view.state));
            let kept = |place: usize| there.get(&image).is_some_and(|pixels| pixels[place]);
            let lost = (0..promised.len()).any(|place| promised[place] && !kept(place));
            assert!(
                !begins || !lost,
                "{image:?}: what was acknowledged is there"
            );
            begins
        });
        // Last, since what is missing here is better said by one of those above.
        if let Some(before) = self.before.take() {
            are_alike(&before, sched);
        }
    }
}

/// Whether a scheduler knows all that the one before it knew durably.
fn are_alike(before: &Sched, after: &Sched) {
    assert_eq!(before.jobs().count(), after.jobs().count());
    for (before_job, after_job) in before.jobs().zip(after.jobs()) {
        let durable = |job: &sched::JobView<'_>| {
            let rank = (job.priority, job.share, job.paused, job.focus);
            (job.job, job.state, rank, job.pixels_done, job.after.clone())
        };
        assert_eq!(durable(&before_job), durable(&after_job));
        let job = before_job.job;
        for (before, after) in before.images(job).zip(after.images(job)) {
            let begun = |view: sched::ImageView| match view.state {
                // What was still to be verified is forgotten.
                ImageState::Rendering if view.pixels_done == view.pixels => ImageState::Encoding,
                ImageState::Rendering => ImageState::Waiting,
                state => state,
            };
            let alike = begun(before) == begun(after) && (before.pixels_done == after.pixels_done);
            // What was in flight of a cancelled job is forgotten.
            let is_dropped = before_job.state == JobState::Over(JobOutcome::Cancelled);
            assert!(alike || is_dropped, "{job:?}: {before:?}, then {after:?}");
        }
    }
}

fn places(rect: Rect) -> impl Iterator<Item = usize> {
    (rect.y0..rect.y1).flat_map(move |y| (rect.x0..rect.x1).map(move |x| (y * WIDTH + x) as usize))
}
