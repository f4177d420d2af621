//! Images that a worker of wrong pixels had a part in, until they are rendered again.
//!
//! The shell is asked to have a few of them rendered again at a time, and answers each with a
//! [`crate::Command::Again`]. Where a job is over that could not go on now, because as many as there may be do, its images wait
//! until there is room. So what one conviction causes is bounded at every event, and nothing of it is lost.

use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use model::{ImageRef, JobId, WorkerId};

use crate::{CommandRefusal, Effect, ImageState, JobOutcome, Sched};

/// Images whose rendering again is asked for and not answered, at most.
const ASKED_MAX: usize = 16;

/// Images with wrong pixels, and whose those were. Not more than images that are remembered.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wrong {
    waiting: BTreeMap<JobId, BTreeMap<ImageRef, WorkerId>>,
    asked: BTreeMap<ImageRef, WorkerId>,
}

impl Wrong {
    pub(crate) fn add(&mut self, image: ImageRef, by: WorkerId) {
        if !self.asked.contains_key(&image) {
            self.waiting.entry(image.job).or_default().insert(image, by);
        }
    }

    /// Forgets a job.
    pub(crate) fn forget(&mut self, job: JobId) {
        self.waiting.remove(&job);
        self.asked.retain(|image, _| image.job != job);
    }

    fn take(&mut self, job: JobId) -> Option<(ImageRef, WorkerId)> {
        let images = self.waiting.get_mut(&job)?;
        let taken = images.pop_first();
        if images.is_empty() {
            self.waiting.remove(&job);
        }
        taken
    }

    /// How many there are, asked for or not.
    pub(crate) fn count(&self) -> usize {
        self.asked.len() + self.waiting.values().map(BTreeMap::len).sum::<usize>()
    }
}

impl Sched {
    /// Asks for some of the images with wrong pixels to be rendered again.
    pub(crate) fn ask_again(&mut self, out: &mut Vec<Effect>) {
        if self.wrong.waiting.is_empty() {
            return;
        }
        let jobs: Vec<JobId> = self.wrong.waiting.keys().copied().collect();
        for id in jobs {
            while self.wrong.asked.len() < ASKED_MAX && self.may_go_on(id) {
                let Some((image, worker)) = self.wrong.take(id) else {
                    break;
                };
                if self.has_pixels(image) {
                    self.wrong.asked.insert(image, worker);
                    out.push(Effect::RenderAgain { image, worker });
                }
            }
        }
    }

    /// Whether images of a job that is over could be rendered again now. One that is not known has none.
    fn may_go_on(&self, id: JobId) -> bool {
        let is_over = self.jobs.get(&id).is_some_and(|job| job.is_over());
        !is_over || self.has_room_for_job()
    }

    /// Whether there is anything to be rendered again of an image.
    fn has_pixels(&self, image: ImageRef) -> bool {
        let Some(job) = self.jobs.get(&image.job) else {
            return false;
        };
        let state = job.place(image.image).map(|place| job.state(place));
        let is_wanted = job.outcome != Some(JobOutcome::Cancelled);
        is_wanted
            && matches!(
                state,
                Some(ImageState::Rendering | ImageState::Encoding | ImageState::Encoded { .. })
            )
    }

    /// An image was to be rendered again, by whoever's wish.
    pub(crate) fn answers_again(&mut self, image: ImageRef, answer: Result<(), CommandRefusal>) {
        let Some(worker) = self.wrong.asked.remove(&image) else {
            return;
        };
        if let Err(CommandRefusal::TooManyJobs { .. }) = answer {
            self.wrong.add(image, worker);
        }
    }
}
