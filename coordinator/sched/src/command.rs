//! What users want of jobs that are there.

use alloc::vec::Vec;

use model::{ImageNumber, ImageRef, JobId, Rect};

use crate::view::Paused;
use crate::{CommandRefusal, Effect, ImageState, JobOutcome, RevokeReason, Sched};

/// Something that a user wants of a job. Wanting it again does no harm.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Command {
    /// Lease nothing more of it, and call back what was not started. What runs is finished.
    Pause,
    /// Go on with it.
    Resume,
    /// End it. Nothing happens where it is over already.
    Cancel,
    /// Render its failed images again.
    Retry,
    /// Render one image from its first pixel again, whatever became of it.
    Again(ImageNumber),
    /// Serve it before the jobs of lower priority, and after those of higher.
    Priority(i32),
    /// Its part of the farm among the jobs of its priority, at least 1.
    Share(u32),
    /// Render this region of each image first (thesis §7.4), or none before the others.
    Focus(Option<Rect>),
    /// Forget it, cancelling it first where it is not over. Finished frames stay.
    Remove,
}

impl Sched {
    pub(crate) fn command(&mut self, job: JobId, command: Command, out: &mut Vec<Effect>) {
        let answer = out.len();
        let followed = self.follow(job, command, out);
        if let Command::Again(image) = command {
            self.answers_again(ImageRef { job, image }, followed);
        }
        match followed {
            // Said first, whatever else is to be done.
            Ok(()) => out.insert(answer, Effect::Commanded { job }),
            Err(refusal) => out.push(Effect::CommandRefused { job, refusal }),
        }
        self.job_changed(job);
    }

    fn follow(
        &mut self,
        id: JobId,
        command: Command,
        out: &mut Vec<Effect>,
    ) -> Result<(), CommandRefusal> {
        let share_max = self.config.limits.share_max;
        let job = self.jobs.get_mut(&id).ok_or(CommandRefusal::UnknownJob)?;
        let is_over = job.is_over();
        match command {
            Command::Cancel if is_over => {}
            Command::Cancel => self.cancel(id, out),
            Command::Retry => self.retry(id)?,
            Command::Again(image) => self.again(id, image, out)?,
            Command::Remove => self.remove(id, out)?,
            _ if is_over => return Err(CommandRefusal::JobOver),
            Command::Pause => {
                job.paused = Paused::Yes;
                self.call_back_job(id, out);
            }
            Command::Resume => job.paused = Paused::No,
            Command::Priority(priority) => job.priority = priority,
            Command::Share(share) if share == 0 || share > share_max => {
                return Err(CommandRefusal::ShareOutside { max: share_max });
            }
            Command::Share(share) => job.share = share,
            Command::Focus(focus) => job.focus(focus),
        }
        Ok(())
    }

    /// Calls back every lease of a job that was not started.
    fn call_back_job(&mut self, id: JobId, out: &mut Vec<Effect>) {
        let job = &self.jobs[&id];
        let ahead: Vec<u64> = job.live().filter(|&number| self.is_ahead(number)).collect();
        for number in ahead {
            self.revoke(number, RevokeReason::Paused, out);
        }
    }

    fn retry(&mut self, id: JobId) -> Result<(), CommandRefusal> {
        let job = &self.jobs[&id];
        let is_failed = |&place: &u32| job.state(place) == ImageState::Failed;
        let failed: Vec<u32> = (0..job.spec.frames.count()).filter(is_failed).collect();
        if failed.is_empty() && job.outcome != Some(JobOutcome::Cancelled) {
            return Err(CommandRefusal::NothingFailed);
        }
        self.wait_again(id, &failed)
    }

    fn again(
        &mut self,
        id: JobId,
        image: ImageNumber,
        out: &mut Vec<Effect>,
    ) -> Result<(), CommandRefusal> {
        let job = &self.jobs[&id];
        let place = job
            .place(image)
            .ok_or(CommandRefusal::UnknownImage { image })?;
        match job.state(place) {
            ImageState::Encoded { .. } | ImageState::Failed => self.wait_again(id, &[place]),
            _ if job.is_over() => Err(CommandRefusal::JobCancelled),
            ImageState::Rendering | ImageState::Encoding => {
                let image = job.image_ref(place);
                self.drop_work(image, RevokeReason::RenderedAgain, out);
                if let Some(job) = self.jobs.get_mut(&id) {
                    job.wait_again(place);
                }
                Ok(())
            }
            ImageState::Waiting | ImageState::Dropped => Ok(()),
        }
    }

    /// Lets images of a job that are over wait again; the job goes on.
    fn wait_again(&mut self, id: JobId, places: &[u32]) -> Result<(), CommandRefusal> {
        let max = self.config.limits.jobs_max;
        let has_room = self.has_room_for_job();
        let job = self.jobs.get_mut(&id).ok_or(CommandRefusal::UnknownJob)?;
        if job.outcome == Some(JobOutcome::Cancelled) {
            return Err(CommandRefusal::JobCancelled);
        }
        if job.is_over() {
            if !has_room {
                return Err(CommandRefusal::TooManyJobs { max });
            }
            job.outcome = None;
            job.tally.ended = None;
            self.over.retain(|&over| over != id);
        }
        for &place in places {
            job.wait_again(place);
        }
        Ok(())
    }

    fn remove(&mut self, id: JobId, out: &mut Vec<Effect>) -> Result<(), CommandRefusal> {
        if let Some(&by) = self.waited_for.get(&id).and_then(|by| by.first()) {
            return Err(CommandRefusal::WaitedFor { by });
        }
        self.cancel(id, out);
        self.over.retain(|&over| over != id);
        self.forget_job(id, out);
        Ok(())
    }
}
