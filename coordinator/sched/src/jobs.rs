//! How jobs come, and how they end.

use alloc::vec::Vec;

use model::rect::SIDE_MAX;
use model::{ImageRef, JobId};

use crate::job::{Job, Shape};
use crate::market::Stands;
use crate::needs::{Forgotten, Interned, KINDS_MAX, Kind};
use crate::tiling::{TileGrid, TileRule};
use crate::timers::Timer;
use crate::{Effect, JobOutcome, RevokeReason, Sched, Submission, SubmitRefusal, TileShape};

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
            let same = self.is_same(id, spec);
            return same.then_some(id).ok_or(SubmitRefusal::SubmissionReused);
        }
        self.check(&spec)?;
        let shape = self.shape(&spec)?;
        self.make_room(spec.frames.count(), out)?;
        let kind = self.kind_of(&spec)?;

        self.jobs_made += 1;
        let id = JobId(self.jobs_made);
        self.images += spec.frames.count();
        self.submissions.insert(spec.submission, id);
        let mut job = Job::new(id, spec, (kind, shape), self.now);
        for &after in &job.spec.after {
            let before = self.jobs.get(&after).and_then(|before| before.outcome);
            if before != Some(JobOutcome::Finished) {
                job.after.insert(after);
                self.waited_for.entry(after).or_default().insert(id);
            }
        }
        self.jobs.insert(id, job);
        self.job_changed(id);
        Ok(id)
    }

    /// Whether a job came from this submission. A store does not keep that it waited for jobs that were then finished.
    fn is_same(&self, id: JobId, mut spec: Submission) -> bool {
        let Some(job) = self.jobs.get(&id) else {
            return false;
        };
        let is_past = |before: &JobId| {
            let known = self.jobs.get(before);
            before.0 <= self.jobs_made
                && known.is_none_or(|before| before.outcome == Some(JobOutcome::Finished))
        };
        let is_kept = |before: &JobId| job.spec.after.contains(before) || !is_past(before);
        spec.after.retain(is_kept);
        spec == job.spec
    }

    /// The kind of one more job. A kind that is new costs a look at every worker.
    fn kind_of(&mut self, spec: &Submission) -> Result<Kind, SubmitRefusal> {
        let kind = self.kinds.add(spec.revision, &spec.needs);
        let max = u32::try_from(KINDS_MAX).unwrap_or(u32::MAX);
        let kind = match kind.ok_or(SubmitRefusal::TooManyKinds { max })? {
            Interned::Known(kind) => return Ok(kind),
            Interned::New(kind) => kind,
        };
        self.offer_anew();
        Ok(kind)
    }

    /// Matches every worker with the kinds that there are.
    fn offer_anew(&mut self) {
        for place in self.workers.places().collect::<Vec<_>>() {
            let worker = &mut self.workers[place];
            worker.kinds = self.kinds.served_by(&worker.offer);
            self.worker_changed(place);
        }
    }

    fn check(&self, spec: &Submission) -> Result<(), SubmitRefusal> {
        let limits = &self.config.limits;
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
        if spec.share == 0 || spec.share > limits.share_max {
            let max = limits.share_max;
            return Err(SubmitRefusal::ShareOutside { max });
        }
        let (labels_max, bytes_max) = (limits.labels_max, limits.label_bytes_max);
        if !limits.allow_labels(&spec.needs.labels) {
            return Err(SubmitRefusal::TooManyLabels {
                labels_max,
                bytes_max,
            });
        }
        if spec.after.len() > limits.after_max as usize {
            let max = limits.after_max;
            return Err(SubmitRefusal::TooManyAfter { max });
        }
        match spec
            .after
            .iter()
            .find(|after| !self.jobs.contains_key(after))
        {
            Some(&job) => Err(SubmitRefusal::UnknownJob { job }),
            None => Ok(()),
        }
    }

    fn shape(&self, spec: &Submission) -> Result<Shape, SubmitRefusal> {
        let limits = &self.config.limits;
        let window = spec.window;
        let size = match spec.tiles {
            TileShape::Time { aim } => {
                return Ok(Shape {
                    grid: TileGrid::squares(window),
                    aim: Some(aim.unwrap_or(self.config.tile_time)),
                });
            }
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
        Ok(Shape { grid, aim: None })
    }

    /// Sees that another job of so many images can be remembered; jobs that are over make room.
    fn make_room(&mut self, asked: u32, out: &mut Vec<Effect>) -> Result<(), SubmitRefusal> {
        let limits = &self.config.limits;
        if !self.has_room_for_job() {
            let max = limits.jobs_max;
            return Err(SubmitRefusal::TooManyJobs { max });
        }
        let images_max = limits.images_max;
        let is_free = |id: &&JobId| !self.waited_for.contains_key(id);
        let of_over = |id| self.jobs[id].spec.frames.count();
        let over: u32 = self.over.iter().filter(is_free).map(of_over).sum();
        let left = images_max - self.images + over;
        while asked <= left && asked > images_max - self.images && self.forget_oldest(out) {}
        if asked > left {
            return Err(SubmitRefusal::TooManyImages { asked, left });
        }
        Ok(())
    }

    /// Whether one more job may go on.
    pub(crate) fn has_room_for_job(&self) -> bool {
        self.jobs.len() - self.over.len() < self.config.limits.jobs_max as usize
    }

    /// Ends a job that is not over.
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

    pub(crate) fn end_job_if_done(&mut self, id: JobId, out: &mut Vec<Effect>) {
        let job = self.jobs.get(&id).filter(|job| !job.is_over());
        if let Some(outcome) = job.and_then(Job::ends) {
            self.end_job(id, outcome, out);
        }
    }

    fn end_job(&mut self, id: JobId, outcome: JobOutcome, out: &mut Vec<Effect>) {
        let Some(job) = self.jobs.get_mut(&id) else {
            return;
        };
        job.outcome = Some(outcome);
        job.tally.ended = Some(self.now);
        for before in core::mem::take(&mut job.after) {
            self.waits_no_more(id, before);
        }
        if outcome == JobOutcome::Finished {
            for next in self.waited_for.remove(&id).unwrap_or_default() {
                if let Some(job) = self.jobs.get_mut(&next) {
                    job.after.remove(&id);
                }
                self.job_changed(next);
            }
        }
        self.over.push_back(id);
        self.job_changed(id);
        out.push(Effect::JobDone { job: id, outcome });
        while self.over.len() > self.config.limits.jobs_kept_max as usize && self.forget_oldest(out)
        {
        }
    }

    /// A job no longer waits for another one.
    fn waits_no_more(&mut self, job: JobId, before: JobId) {
        if let Some(by) = self.waited_for.get_mut(&before) {
            by.remove(&job);
            if by.is_empty() {
                self.waited_for.remove(&before);
            }
        }
    }

    /// Forgets the job that has been over for longest, of those that no other waits for; says whether there was one.
    fn forget_oldest(&mut self, out: &mut Vec<Effect>) -> bool {
        let is_free = |id: &JobId| !self.waited_for.contains_key(id);
        let oldest = self.over.iter().position(is_free);
        let Some(id) = oldest.and_then(|index| self.over.remove(index)) else {
            return false;
        };
        self.forget_job(id, out);
        true
    }

    /// Forgets a job that is over.
    pub(crate) fn forget_job(&mut self, id: JobId, out: &mut Vec<Effect>) {
        if let Some(mut job) = self.jobs.remove(&id) {
            self.images -= job.spec.frames.count();
            self.submissions.remove(&job.spec.submission);
            self.timers
                .remove(Timer::Unverified(id), &mut job.unverified);
            self.wrong.forget(id);
            self.market
                .place_job(job.kind, &mut job.stands, Stands::default());
            if self.kinds.remove(job.kind) == Forgotten::Yes {
                self.offer_anew();
            }
        }
        self.changed.retain(|&changed| changed != id);
        out.push(Effect::ForgetJob { job: id });
    }

    /// Watchers are to hear of a job, and it may belong elsewhere in the market.
    pub(crate) fn job_changed(&mut self, id: JobId) {
        if !self.changed.contains(&id) && self.jobs.contains_key(&id) {
            self.changed.push(id);
        }
    }

    /// Sees that a job stands where it belongs in the market.
    pub(crate) fn settle_job(&mut self, id: JobId) {
        if let Some(job) = self.jobs.get_mut(&id) {
            let stands = job.belongs(&self.config);
            self.market.place_job(job.kind, &mut job.stands, stands);
            if stands.open.is_some() {
                self.market.touch_kind(job.kind);
            }
            if job.unverified.due().is_some() && !job.has_checks() {
                self.timers
                    .remove(Timer::Unverified(id), &mut job.unverified);
            }
        }
    }

    pub(crate) fn job_and_place(&mut self, image: ImageRef) -> Option<(&mut Job, u32)> {
        let job = self.jobs.get_mut(&image.job)?;
        let place = job.place(image.image)?;
        Some((job, place))
    }
}
