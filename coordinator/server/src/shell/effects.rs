//! Performing effects.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use model::{FrameRange, ImageRef, JobId, SubmissionId, WorkerId};
use sched::{
    BlockRef, BlockRefusal, Command, Effect, Event, JobOutcome, RevokeReason, WorkerRefusal,
};
use store::Entry;
use tokio::sync::oneshot;
use tonic::Status;
use wire::Failure;
use wire::proto::{self, ErrorKind, control_down, deliver_down};

use super::{Shell, Submitting};
use crate::about::JobAbout;
use crate::hook::About;
use crate::inbox::NewJob;
use crate::input::{Frames, Wish};
use crate::job::{Foretold, Job};
use crate::storage::{Era, Plan};
use crate::worker::{Draining, Told, Worker};

/// One of how many parts of a job is done when its end is foretold.
const FORETOLD_AT: u64 = 10;

impl Shell {
    /// Performs one effect.
    pub(super) fn perform(&mut self, effect: Effect) {
        match effect {
            Effect::Submitted { submission, job } => self.submitted(submission, job),
            Effect::SubmitRefused {
                submission,
                refusal,
            } => {
                let kind = match refusal {
                    sched::SubmitRefusal::SubmissionReused => ErrorKind::Conflict,
                    _ if refusal.is_retryable() => ErrorKind::Limit,
                    _ => ErrorKind::BadRequest,
                };
                let failure = match refusal.is_retryable() {
                    true => Failure::later(kind, refusal.to_string()),
                    false => Failure::new(kind, refusal.to_string()),
                };
                self.answer_submission(submission, Err(failure));
            }
            Effect::Welcome { worker, live } => self.welcome(worker, live),
            Effect::Adopted {
                worker,
                attempt,
                image,
            } => {
                let name = self.worker_name(worker);
                tracing::info!(%worker, name, %attempt, job = %image.job, image = %image.image, "a worker goes on with what it had begun");
                self.say(
                    image.job,
                    format!("frame {}: worker {name} goes on with a tile that it had begun before the coordinator was started again", image.image),
                );
            }
            Effect::WorkerRefused { worker, refusal } => self.refuse_worker(worker, refusal),
            Effect::Lease { worker, lease } => {
                let image = lease.image;
                tracing::debug!(job = %image.job, image = %image.image, tile = ?lease.tile, attempt = %lease.attempt, %worker, "lease");
                let first = self
                    .jobs
                    .get_mut(image.job)
                    .is_some_and(|job| job.begin(image.image));
                if first {
                    let name = self.worker_name(worker);
                    let said = format!("frame {} is begun by worker {name}", image.image);
                    self.say(image.job, said);
                }
                self.jobs.touch_image(image);
                self.tell(worker, control_down::Message::Lease(lease.into()));
            }
            Effect::Revoke {
                worker,
                attempt,
                reason,
            } => {
                let revoke = proto::Revoke {
                    attempt: Some(attempt.into()),
                    reason: revoke_words(reason).to_owned(),
                };
                self.tell(worker, control_down::Message::Revoke(revoke));
            }
            Effect::Ack {
                worker,
                attempt,
                rect,
            } => {
                let acknowledged = proto::Acknowledged {
                    attempt: Some(attempt.into()),
                    block: Some(rect.into()),
                };
                self.reply(worker, deliver_down::Message::Acknowledged(acknowledged));
            }
            Effect::RefuseBlock {
                worker,
                block,
                refusal,
            } => self.refuse_block(worker, block, refusal),
            Effect::Encode { image } => self.encode(image, self.era(image)),
            Effect::GiveUp { image, reason } => self.feed(Event::ImageFailed { image, reason }),
            Effect::Incident {
                block,
                worker,
                other,
            } => self.incident(block, worker, other),
            Effect::Unverified { image, tiles } => {
                tracing::warn!(job = %image.job, image = %image.image, tiles, "tiles were not verified");
                self.say(
                    image.job,
                    format!("frame {}: {tiles} tiles were not verified, since no other worker could render them in time", image.image),
                );
            }
            Effect::Commanded { job } => self.commanded(job, None),
            Effect::CommandRefused { job, refusal } => self.commanded(job, Some(refusal)),
            Effect::RenderAgain { image, worker } => {
                let name = self.worker_name(worker);
                tracing::error!(%worker, name, job = %image.job, image = %image.image, "a worker's pixels were wrong: an image that it had a part in is rendered again");
                self.say(
                    image.job,
                    format!("frame {}: worker {name} had a part in it, whose pixels were wrong elsewhere", image.image),
                );
                // Nobody waits for the answer.
                let (reply, _) = oneshot::channel();
                let wish = Wish {
                    command: Command::Again(image.image),
                    frames: Frames::Stay,
                    if_over_since: None,
                };
                self.command(image.job, wish, reply);
            }
            Effect::DropScratch { image } => {
                if let Some(job) = self.jobs.get_mut(image.job) {
                    job.take_work(image.image);
                }
                self.storage.drop_scratch(image);
                self.jobs.touch_image(image);
            }
            Effect::DropJob { job } => {
                if let Some(job) = self.jobs.get(job) {
                    job.plan.cancelled.store(true, Ordering::Relaxed);
                    self.storage.forget(job.folders().clone(), Frames::Stay);
                }
            }
            Effect::JobDone { job, outcome } => self.job_done(job, outcome),
            Effect::ForgetJob { job } => self.forget_job(job),
            Effect::JobChanged { job } => {
                self.jobs.touch(job);
                self.tell_of_attempts(job);
                self.foretell(job);
            }
            Effect::Forget { worker } => {
                if let Some(known) = self.workers.remove(&worker) {
                    if known.draining == Draining::Yes {
                        self.leaving.add(worker);
                    }
                    tracing::info!(%worker, name = known.about.name, "a worker left or is lost");
                }
            }
        }
    }

    fn submitted(&mut self, submission: SubmissionId, id: JobId) {
        let Some(waiting) = self.waiting_submission(submission) else {
            return;
        };
        let again = waiting.again;
        let known = self.jobs.get(id);
        let same = known.is_some_and(|known| known.formats() == waiting.formats);
        let answer = match same || !again {
            true => Ok(proto::Submitted {
                job: id.0,
                again,
                ..proto::Submitted::default()
            }),
            false => Err(Failure::new(
                ErrorKind::Conflict,
                sched::SubmitRefusal::SubmissionReused.to_string(),
            )),
        };
        if !again && let Some(view) = self.sched.job(id) {
            let (name, frames, scene) = (view.name, view.frames, view.scene);
            tracing::info!(job = %id, name, %frames, %scene, "a job is submitted");
            self.say(id, format!("submitted: frames {frames}"));
        }
        let _ = waiting.reply.send(answer);
    }

    fn waiting_submission(&mut self, submission: SubmissionId) -> Option<Submitting> {
        let is_it = |waiting: &Submitting| waiting.submission == submission;
        let place = self.submitting.iter().position(is_it)?;
        self.submitting.remove(place)
    }

    /// Takes the submission that is being fed as a job, if that is what became of it; gives what is to be committed.
    pub(super) fn begin_job(
        &mut self,
        unix_ms: u64,
        submission: sched::Submission,
    ) -> Option<Entry> {
        let job = self.sched.submitted(submission.submission)?;
        let new = self.arriving.take_if(|_| self.jobs.get(job).is_none())?;
        let NewJob {
            description,
            upload,
            formats,
            settings,
            ..
        } = *new;
        let film = &description.film;
        let folders = self.state.job(job);
        let scene = upload.files_at(folders.scene.clone());
        let about = JobAbout {
            stem: stem(&submission.name, &description.name),
            formats: formats.iter().map(|format| format.to_string()).collect(),
            settings,
            resolution: (film.resolution.width, film.resolution.height),
            frames_per_second: film.fps,
            exposure_stops: film.exposure,
            software: self.config.build.clone(),
            assets: scene.assets.iter().map(ToString::to_string).collect(),
        };
        let plan = Plan::new(folders.clone(), &submission, &about, formats);
        let lines = self.config.limits.log_lines_max;
        let known = Job::new(Arc::new(plan), scene, lines);
        self.jobs.insert(job, known);
        self.storage.adopt(upload, folders);
        Some(Entry::Submitted {
            job,
            unix_ms,
            submission,
            about: serde_json::to_string(&about).expect("it is JSON"),
        })
    }

    /// Has a complete image encoded.
    pub(super) fn encode(&mut self, image: ImageRef, era: Era) {
        if let Some(job) = self.jobs.get(image.job) {
            let counters = job.work(image.image).counters;
            self.storage.encode(job.plan.clone(), image, counters, era);
        }
        self.jobs.touch_image(image);
    }

    /// Answers the oldest command that is not answered.
    fn commanded(&mut self, id: JobId, refusal: Option<sched::CommandRefusal>) {
        let Some(waiting) = self.commanding.pop_front() else {
            return;
        };
        let answer = match refusal {
            Some(refusal) => Err(Failure::new(ErrorKind::BadRequest, refusal.to_string())),
            None => {
                if let Some(said) = command_words(waiting.command) {
                    self.say(id, said);
                }
                if moves_the_end(waiting.command)
                    && let Some(job) = self.jobs.get_mut(id)
                {
                    job.foretold = None;
                }
                if waiting.command == Command::Remove {
                    let before = waiting.before.clone();
                    self.removing.insert(id, (waiting.frames, before));
                }
                let goes_on = self
                    .sched
                    .job(id)
                    .is_some_and(|view| view.state == sched::JobState::Running);
                if goes_on && let Some(job) = self.jobs.get_mut(id) {
                    job.admit_watchers();
                }
                Ok(self.summary(id).unwrap_or(waiting.before))
            }
        };
        let _ = waiting.reply.send(answer);
    }

    /// Nothing is kept of a job but its finished frames.
    fn forget_job(&mut self, id: JobId) {
        let Some(job) = self.jobs.remove(id) else {
            return;
        };
        self.eras.retain(|image, _| image.job != id);
        self.storage.record(Entry::Forgotten { job: id }, None);
        let removed = self.removing.remove(&id);
        let frames = removed.map_or(Frames::Stay, |(frames, _)| frames);
        self.storage.forget(job.folders().clone(), frames);
    }

    fn answer_submission(
        &mut self,
        submission: SubmissionId,
        answer: Result<proto::Submitted, Failure>,
    ) {
        if let Some(waiting) = self.waiting_submission(submission) {
            let _ = waiting.reply.send(answer);
        }
    }

    fn welcome(&mut self, worker: WorkerId, live: Vec<model::AttemptId>) {
        let milliseconds =
            |span: model::Span| u32::try_from(span.0.div_ceil(1_000)).unwrap_or(u32::MAX);
        let protocol = self.workers.get(&worker).map(|known| known.protocol);
        let welcome = proto::Welcome {
            protocol: protocol.unwrap_or(wire::version::PROTOCOL_MAX),
            epoch: self.state.epoch().0,
            heartbeat_interval_ms: milliseconds(self.config.heartbeat_interval),
            liveness_limit_ms: milliseconds(self.config.liveness_limit),
            live: live.into_iter().map(Into::into).collect(),
        };
        self.tell(worker, control_down::Message::Welcome(welcome));
        let is_leaving = |known: &Worker| known.draining == Draining::Yes;
        if self.workers.get(&worker).is_some_and(is_leaving) {
            self.tell(worker, control_down::Message::Drain(proto::Drain {}));
        }
    }

    fn refuse_worker(&mut self, id: WorkerId, refusal: WorkerRefusal) {
        tracing::warn!(worker = %id, %refusal, "a worker is refused");
        let kind = match refusal {
            WorkerRefusal::WrongRevision { .. } => ErrorKind::WrongRevision,
            WorkerRefusal::TooMany { .. } => ErrorKind::Limit,
            WorkerRefusal::NoThreads | WorkerRefusal::TooManyLabels { .. } => ErrorKind::BadRequest,
        };
        let failure = match refusal.is_retryable() {
            true => Failure::later(kind, refusal.to_string()),
            false => Failure::new(kind, refusal.to_string()),
        };
        if let Some(link) = self.workers.remove(&id).and_then(|worker| worker.control) {
            let _ = link.down.try_send(Err(Status::from(failure)));
        }
    }

    /// Tells a worker that a block of it counts for nothing.
    pub(super) fn refuse_block(
        &mut self,
        worker: WorkerId,
        block: BlockRef,
        refusal: BlockRefusal,
    ) {
        tracing::debug!(%worker, attempt = %block.attempt, rect = ?block.rect, %refusal, "a block is refused");
        let kind = match refusal {
            BlockRefusal::AttemptDead => ErrorKind::AttemptDead,
            BlockRefusal::NotYours | BlockRefusal::OtherImage | BlockRefusal::NotABlock => {
                ErrorKind::BadRequest
            }
        };
        let refused = proto::Refused {
            attempt: Some(block.attempt.into()),
            block: Some(block.rect.into()),
            error: Some(Failure::new(kind, refusal.to_string()).detail()),
        };
        self.reply(worker, deliver_down::Message::Refused(refused));
    }

    fn job_done(&mut self, id: JobId, outcome: JobOutcome) {
        let words = match outcome {
            JobOutcome::Finished => "finished",
            JobOutcome::Failed => "over, with frames that failed",
            JobOutcome::Cancelled => "cancelled",
        };
        tracing::info!(job = %id, outcome = words, "a job is over");
        let failures: Vec<_> = self.sched.failures(id).to_vec();
        for failure in failures {
            self.say(
                id,
                format!("frame {} failed: {}", failure.image, failure.reason),
            );
        }
        if outcome == JobOutcome::Finished
            && let Some(said) = self.was_foretold(id)
        {
            self.say(id, said);
        }
        self.say(id, format!("the job is {words}"));
        // Of a job that is removed before it is over the scheduler says nothing any more.
        let removed = self.removing.get(&id).map(|(_, before)| before);
        let summary = self.summary(id);
        let summary = summary.as_ref().or(removed);
        if let (Some(summary), Some(job)) = (summary, self.jobs.get(id)) {
            self.hook.job_ended(|| about_ended(summary, outcome, job));
        }
        if let Some(job) = self.jobs.get_mut(id) {
            // No event of its own told of images that were never begun.
            for image in self.sched.images(id) {
                if !matches!(image.state, sched::ImageState::Encoded { .. }) {
                    job.touch(image.image);
                }
            }
        }
        self.jobs.touch(id);
    }

    /// Two workers made different pixels of one block.
    fn incident(&mut self, block: BlockRef, worker: WorkerId, other: Option<WorkerId>) {
        let name = self.worker_name(worker);
        let other = other.map_or_else(|| "another".to_owned(), |other| self.worker_name(other));
        let (image, rect) = (block.image, block.rect);
        tracing::error!(job = %image.job, image = %image.image, ?rect, %worker, name, other, "two renderings of one block differ");
        self.say(
            image.job,
            format!(
                "frame {}: workers {name} and {other} made different pixels at {},{}; a third worker decides where there is one, else the first to arrive are kept",
                image.image, rect.x0, rect.y0
            ),
        );
    }

    /// Tells a job's log of attempts that failed or were lost since it was last told.
    fn tell_of_attempts(&mut self, id: JobId) {
        let Some(view) = self.sched.job(id) else {
            return;
        };
        let now = (view.attempts_lost, view.attempts_failed);
        let Some(job) = self.jobs.get_mut(id) else {
            return;
        };
        let before = std::mem::replace(&mut job.told, now);
        let lost = now.0.saturating_sub(before.0);
        if lost > 0 {
            tracing::warn!(job = %id, lost, "attempts were lost with their worker");
            self.say(
                id,
                format!("{lost} tiles were lost with their worker and are leased again"),
            );
        }
        let failed = now.1.saturating_sub(before.1);
        if failed > 0 {
            tracing::warn!(job = %id, failed, "attempts failed or made no progress");
            self.say(
                id,
                format!(
                    "{failed} attempts failed or made no progress; their tiles are leased again"
                ),
            );
        }
    }

    /// Notes what is expected of a job when a tenth of it is done.
    fn foretell(&mut self, id: JobId) {
        let Some(view) = self.sched.job(id) else {
            return;
        };
        let done = view.pixels_done.saturating_mul(FORETOLD_AT);
        // One that was recalled in its middle is not foretold.
        let is_due = (view.pixels..2 * view.pixels).contains(&done);
        let is_new = |job: &Job| job.foretold.is_none();
        if !is_due || !self.jobs.get(id).is_some_and(is_new) {
            return;
        }
        let (at, left) = (self.now(), self.sched.time_left(id));
        if let Some(job) = self.jobs.get_mut(id) {
            job.foretold = left.map(|left| Foretold { at, left });
        }
    }

    /// How right it was.
    fn was_foretold(&self, id: JobId) -> Option<String> {
        let Foretold { at, left } = self.jobs.get(id)?.foretold?;
        let took = (self.now() - at).0;
        let seconds = |micros: u64| micros as f64 / 1e6;
        let off = (seconds(took) / seconds(left.left.0).max(1e-6) - 1.0) * 100.0;
        Some(format!(
            "from its first tenth on it took {:.1} s, {off:+.0} % of what was expected then: {:.1} s ({:.1} to {:.1})",
            seconds(took),
            seconds(left.left.0),
            seconds(left.early.0),
            seconds(left.late.0),
        ))
    }

    /// Tells the jobs in hand that a worker's link closed.
    pub(super) fn tell_jobs_of_closed_link(&mut self, worker: WorkerId) {
        let held = self.sched.worker(worker).map_or(0, |view| view.attempts);
        if held == 0 {
            return;
        }
        let name = self.worker_name(worker);
        let running: Vec<_> = self
            .sched
            .jobs()
            .filter(|job| job.attempts_live > 0)
            .map(|job| job.job)
            .collect();
        for job in running {
            self.say(
                job,
                format!("the link of worker {name} closed; its tiles go to others, and it may come back to them"),
            );
        }
    }

    /// Adds a line to a job's log.
    pub(super) fn say(&mut self, id: JobId, text: String) {
        let now = self.unix_ms_now();
        if let Some(job) = self.jobs.get_mut(id) {
            let line = Entry::Line {
                job: id,
                unix_ms: now,
                text: job.say(now, &text),
            };
            self.storage.record(line, None);
            self.jobs.touch(id);
        }
    }

    /// What a worker calls itself.
    pub(super) fn worker_name(&self, worker: WorkerId) -> String {
        match self.workers.get(&worker) {
            Some(known) => known.about.name.clone(),
            None => worker.to_string(),
        }
    }

    pub(super) fn tell(&mut self, id: WorkerId, message: control_down::Message) {
        if let Some(worker) = self.workers.get_mut(&id)
            && worker.tell(message) == Told::Cut
        {
            // Its reader notices, and feeds that the link is closed.
            tracing::warn!(worker = %id, "a worker reads too slowly: its control stream is cut");
            worker.delivery = None;
        }
    }

    fn reply(&mut self, id: WorkerId, message: deliver_down::Message) {
        if let Some(worker) = self.workers.get_mut(&id)
            && worker.answer(message) == Told::Cut
        {
            tracing::warn!(worker = %id, "a worker reads too slowly: its delivery stream is cut");
        }
    }

    /// Tells every worker that the coordinator stops.
    pub(super) fn dismiss_workers(&mut self) {
        let stopping = || {
            Status::from(Failure::later(
                ErrorKind::Stopping,
                "the coordinator is stopping",
            ))
        };
        for (_, worker) in std::mem::take(&mut self.workers) {
            if let Some(link) = worker.control {
                let _ = link.down.try_send(Err(stopping()));
            }
            if let Some(link) = worker.delivery {
                let _ = link.down.try_send(Err(stopping()));
            }
        }
    }
}

/// What the files of a job begin with.
fn stem(name: &str, scene: &str) -> String {
    let keep = |text: &str| -> String {
        text.chars()
            .filter(|letter| letter.is_ascii_alphanumeric() || matches!(letter, '-' | '_'))
            .take(100)
            .collect()
    };
    [keep(name), keep(scene)]
        .into_iter()
        .find(|stem| !stem.is_empty())
        .unwrap_or_else(|| "frame".to_owned())
}

/// How a job ended, in one word, as `flyby job list` says it.
fn state_word(outcome: JobOutcome) -> &'static str {
    match outcome {
        JobOutcome::Finished => "done",
        JobOutcome::Failed => "failed",
        JobOutcome::Cancelled => "cancelled",
    }
}

/// What a job's log says of a command that was followed.
fn command_words(command: Command) -> Option<String> {
    Some(match command {
        Command::Pause => "paused by its user".to_owned(),
        Command::Resume => "resumed by its user".to_owned(),
        Command::Retry => "its failed frames are rendered again".to_owned(),
        Command::Again(image) => format!("frame {image} is rendered again"),
        Command::Priority(priority) => format!("its priority is {priority} now"),
        Command::Share(share) => format!("its share is {share} now"),
        Command::Focus(None) => "no part of its frames comes before others".to_owned(),
        Command::Focus(Some(region)) => format!(
            "{},{} to {},{} of each frame comes first",
            region.x0, region.y0, region.x1, region.y1
        ),
        Command::Cancel | Command::Remove => return None,
    })
}

/// What the operator's program is told of a job that is over.
fn about_ended(summary: &proto::JobSummary, outcome: JobOutcome, job: &Job) -> About {
    let frames = summary.frames.map(FrameRange::try_from);
    let frames = frames.and_then(Result::ok).map(|frames| frames.to_string());
    vec![
        ("FLYBY_JOB", summary.job.to_string()),
        ("FLYBY_JOB_NAME", summary.name.clone()),
        ("FLYBY_JOB_STATE", state_word(outcome).to_owned()),
        ("FLYBY_JOB_FRAMES", frames.unwrap_or_default()),
        ("FLYBY_JOB_FRAMES_DONE", summary.images_done.to_string()),
        ("FLYBY_JOB_FRAMES_FAILED", summary.images_failed.to_string()),
        (
            "FLYBY_JOB_FOLDER",
            job.folders().frames.display().to_string(),
        ),
    ]
}

/// Whether what was expected of a job before says nothing of how right it was.
fn moves_the_end(command: Command) -> bool {
    match command {
        Command::Pause | Command::Resume | Command::Retry | Command::Again(_) => true,
        Command::Priority(_) | Command::Share(_) => true,
        Command::Focus(_) | Command::Cancel | Command::Remove => false,
    }
}

fn revoke_words(reason: RevokeReason) -> &'static str {
    match reason {
        RevokeReason::TileDone => "every pixel of the tile is durable",
        RevokeReason::Cancelled => "the job was cancelled",
        RevokeReason::Paused => "the job pauses",
        RevokeReason::CalledBack => "another worker has nothing to do",
        RevokeReason::Differs => "its pixels differ from another worker's",
        RevokeReason::RenderedAgain => "the frame is rendered again from its first pixel",
        RevokeReason::ImageFailed => "the image failed",
        RevokeReason::NoProgress => "no block came for too long",
        RevokeReason::NotLive => "the attempt had ended before",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_stay_in_their_folder() {
        assert_eq!(stem("../etc/passwd", "x"), "etcpasswd");
        assert_eq!(stem("..", "fly by"), "flyby");
        assert_eq!(stem("/", "…"), "frame");
    }
}
