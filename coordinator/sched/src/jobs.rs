//! What users do, and how images and jobs end.

use alloc::string::String;
use alloc::vec::Vec;

use model::rect::SIDE_MAX;
use model::{Digest, ImageRef, JobId};

use crate::job::Job;
use crate::tiling::{TileGrid, TileRule};
use crate::{
    Effect, ImageState, JobOutcome, RevokeReason, Sched, Submission, SubmitRefusal, TileShape,
};

impl Sched {
    pub(crate) fn submit(&mut self, spec: Submission, out: &mut Vec<Effect>) {
        let submission = spec.submission;
        match self.admit(spec, out) {
            Ok(job) => out.push(Effect::Submitted { submission, job }),
            Err(refusal) => out.push(Effect::SubmitRefused {
                submission,
                refusal,
            }),
        }
    }

    fn admit(&mut self, spec: Submission, out: &mut Vec<Effect>) -> Result<JobId, SubmitRefusal> {
        if let Some(&id) = self.submissions.get(&spec.submission) {
            let same = self.jobs.get(&id).is_some_and(|job| job.spec == spec);
            return same.then_some(id).ok_or(SubmitRefusal::SubmissionReused);
        }
        let grid = self.check(&spec)?;
        self.make_room(spec.frames.count(), out)?;

        self.jobs_made += 1;
        let id = JobId(self.jobs_made);
        self.images += spec.frames.count();
        self.submissions.insert(spec.submission, id);
        self.jobs.insert(id, Job::new(id, spec, grid, self.now));
        self.job_changed(id);
        Ok(id)
    }

    fn check(&self, spec: &Submission) -> Result<TileGrid, SubmitRefusal> {
        let limits = &self.config.limits;
        if let Some(ours) = self.config.revision.filter(|&ours| ours != spec.revision) {
            let asked = spec.revision;
            return Err(SubmitRefusal::WrongRevision { asked, ours });
        }
        if spec.name.len() > limits.name_bytes_max {
            let bytes_max = limits.name_bytes_max;
            return Err(SubmitRefusal::NameTooLong { bytes_max });
        }
        let window = spec.window;
        if window.is_empty() {
            return Err(SubmitRefusal::EmptyWindow);
        }
        if window.x1 > SIDE_MAX || window.y1 > SIDE_MAX {
            let side_max = SIDE_MAX;
            return Err(SubmitRefusal::WindowOutside { side_max });
        }
        let (pixels, max) = (window.area(), limits.image_pixels_max);
        if pixels > max {
            return Err(SubmitRefusal::WindowTooLarge { pixels, max });
        }
        let size = match spec.tiles {
            TileShape::Rule { min_tile_pixels } => TileRule {
                min_tile_pixels: min_tile_pixels.unwrap_or(self.config.min_tile_pixels),
                max_array_size: self.config.max_array_size,
            }
            .tile_size(window),
            TileShape::Size { width, height } if width == 0 || height == 0 => {
                return Err(SubmitRefusal::EmptyTile);
            }
            TileShape::Size { width, height } => (width, height),
        };
        let grid = TileGrid::new(window, size);
        let (pixels, max) = (grid.tile(0).area(), limits.tile_pixels_max);
        if pixels > max {
            return Err(SubmitRefusal::TileTooLarge { pixels, max });
        }
        let (tiles, max) = (grid.count(), self.config.max_array_size);
        if tiles > max {
            return Err(SubmitRefusal::TooManyTiles { tiles, max });
        }
        Ok(grid)
    }

    /// Sees that another job of so many images can be remembered; jobs that are over make room.
    fn make_room(&mut self, asked: u32, out: &mut Vec<Effect>) -> Result<(), SubmitRefusal> {
        let limits = &self.config.limits;
        if self.jobs.len() - self.over.len() >= limits.jobs_max as usize {
            let max = limits.jobs_max;
            return Err(SubmitRefusal::TooManyJobs { max });
        }
        let images_max = limits.images_max;
        let of_over = |id| self.jobs[id].spec.frames.count();
        let left = images_max - self.images + self.over.iter().map(of_over).sum::<u32>();
        while asked <= left && asked > images_max - self.images {
            self.forget_oldest(out);
        }
        if asked > left {
            return Err(SubmitRefusal::TooManyImages { asked, left });
        }
        Ok(())
    }

    pub(crate) fn image_encoded(&mut self, image: ImageRef, film: Digest, out: &mut Vec<Effect>) {
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        if job.state(place) != ImageState::Encoding {
            return;
        }
        job.set_state(place, ImageState::Encoded { film });
        self.job_changed(image.job);
        self.end_job_if_done(image.job, out);
    }

    pub(crate) fn image_failed(&mut self, image: ImageRef, reason: String, out: &mut Vec<Effect>) {
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        let in_flight = matches!(
            job.state(place),
            ImageState::Rendering | ImageState::Encoding
        );
        if in_flight && !job.is_over() {
            self.fail_image(image, reason, out);
        }
    }

    /// Gives up an image in flight; the job goes on with the others.
    pub(crate) fn fail_image(&mut self, image: ImageRef, reason: String, out: &mut Vec<Effect>) {
        self.drop_work(image, RevokeReason::ImageFailed, out);
        if let Some(job) = self.jobs.get_mut(&image.job)
            && let Some(place) = job.place(image.image)
        {
            job.set_state(place, ImageState::Failed);
            job.blame(place, reason, &self.config);
        }
        self.job_changed(image.job);
        self.end_job_if_done(image.job, out);
    }

    pub(crate) fn cancel(&mut self, id: JobId, out: &mut Vec<Effect>) {
        let Some(job) = self.jobs.get(&id).filter(|job| !job.is_over()) else {
            return;
        };
        let in_flight: Vec<ImageRef> = job
            .in_flight()
            .into_iter()
            .map(|place| job.image_ref(place))
            .collect();
        for image in in_flight {
            self.drop_work(image, RevokeReason::Cancelled, out);
        }
        out.push(Effect::DropJob { job: id });
        self.end_job(id, JobOutcome::Cancelled, out);
    }

    /// Ends all attempts at an image in flight, and lets the shell forget its pixels.
    fn drop_work(&mut self, image: ImageRef, reason: RevokeReason, out: &mut Vec<Effect>) {
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        let live: Vec<u64> = job
            .work
            .get(&place)
            .into_iter()
            .flat_map(|work| work.live.iter().copied())
            .collect();
        for number in live {
            self.revoke(number, reason, out);
        }
        if let Some(job) = self.jobs.get_mut(&image.job) {
            job.work.remove(&place);
        }
        out.push(Effect::DropScratch { image });
    }

    fn end_job_if_done(&mut self, id: JobId, out: &mut Vec<Effect>) {
        let job = self.jobs.get(&id).filter(|job| !job.is_over());
        if let Some(outcome) = job.and_then(Job::ends) {
            self.end_job(id, outcome, out);
        }
    }

    fn end_job(&mut self, id: JobId, outcome: JobOutcome, out: &mut Vec<Effect>) {
        if let Some(job) = self.jobs.get_mut(&id) {
            job.outcome = Some(outcome);
            job.tally.ended = Some(self.now);
        }
        self.over.push_back(id);
        self.job_changed(id);
        out.push(Effect::JobDone { job: id, outcome });
        while self.over.len() > self.config.limits.jobs_kept_max as usize {
            self.forget_oldest(out);
        }
    }

    fn forget_oldest(&mut self, out: &mut Vec<Effect>) {
        let Some(id) = self.over.pop_front() else {
            return;
        };
        if let Some(job) = self.jobs.remove(&id) {
            self.images -= job.spec.frames.count();
            self.submissions.remove(&job.spec.submission);
        }
        self.changed.remove(&id);
        out.push(Effect::ForgetJob { job: id });
    }

    /// Sees that the job stands where it belongs in the market, and that watchers hear of it.
    pub(crate) fn job_changed(&mut self, id: JobId) {
        if let Some(job) = self.jobs.get(&id) {
            self.market
                .place_job(job.spec.revision, id, job.has_tiles(&self.config));
            self.changed.insert(id);
        }
    }

    pub(crate) fn job_and_place(&mut self, image: ImageRef) -> Option<(&mut Job, u32)> {
        let job = self.jobs.get_mut(&image.job)?;
        let place = job.place(image.image)?;
        Some((job, place))
    }
}
