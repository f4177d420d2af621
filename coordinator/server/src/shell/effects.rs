//! Performing effects.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use image::{FrameMetadata, ScratchIdentity, ViewTransform};
use model::{ImageNumber, JobId, SubmissionId, WorkerId};
use sched::{BlockRef, BlockRefusal, Effect, Event, JobOutcome, RevokeReason, WorkerRefusal};
use tonic::Status;
use wire::Failure;
use wire::proto::{self, ErrorKind, control_down, deliver_down};

use super::Shell;
use crate::inbox::NewJob;
use crate::job::Job;
use crate::storage::Plan;
use crate::worker::Told;

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
                    sched::SubmitRefusal::WrongRevision { .. } => ErrorKind::WrongRevision,
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
            Effect::Encode { image } => {
                if let Some(job) = self.jobs.get_mut(image.job) {
                    let counters = job.take_counters(image.image);
                    let plan = job.plan.clone();
                    self.storage.encode(plan, image, counters);
                }
                self.jobs.touch_image(image);
            }
            Effect::GiveUp { image, reason } => self.feed(Event::ImageFailed { image, reason }),
            Effect::Incident {
                block,
                worker,
                other,
            } => self.incident(block, worker, other),
            Effect::Commanded { .. } => {}
            Effect::CommandRefused { refusal, .. } => self.refused = Some(refusal),
            Effect::DropScratch { image } => {
                if let Some(job) = self.jobs.get_mut(image.job) {
                    job.take_counters(image.image);
                    self.storage.drop_scratch(&job.plan, image);
                }
                self.jobs.touch_image(image);
            }
            Effect::DropJob { job } => self.clear_job(job),
            Effect::JobDone { job, outcome } => self.job_done(job, outcome),
            Effect::ForgetJob { job } => {
                self.jobs.remove(job);
            }
            Effect::JobChanged { job } => {
                self.jobs.touch(job);
                self.tell_of_attempts(job);
            }
            Effect::Forget { worker } => {
                if let Some(known) = self.workers.remove(&worker) {
                    tracing::info!(%worker, name = known.about.name, "a worker left or is lost");
                }
            }
        }
    }

    fn submitted(&mut self, submission: SubmissionId, id: JobId) {
        let Some((_, new, reply)) = self
            .submitting
            .take_if(|(waiting, _, _)| *waiting == submission)
        else {
            return;
        };
        let answer = match self.jobs.get(id) {
            Some(known) if known.formats() == new.formats && known.submission == submission => {
                Ok(proto::Submitted {
                    job: id.0,
                    again: true,
                })
            }
            Some(_) => Err(Failure::new(
                ErrorKind::Conflict,
                sched::SubmitRefusal::SubmissionReused.to_string(),
            )),
            None => self.begin_job(id, *new),
        };
        let _ = reply.send(answer);
    }

    fn begin_job(&mut self, id: JobId, new: NewJob) -> Result<proto::Submitted, Failure> {
        let plan = self.plan(id, &new);
        if let Err(error) = plan.folders.make() {
            // The job's blocks will fail for the same reason, and say so in its log.
            tracing::error!(job = %id, "{}", crate::storage::chain(&error));
        }
        let NewJob {
            submission, upload, ..
        } = new;
        tracing::info!(job = %id, name = submission.name, frames = %submission.frames, scene = %submission.scene, "a job is submitted");
        let lines = self.config.limits.log_lines_max;
        self.jobs.insert(
            id,
            Job::new(Arc::new(plan), upload, submission.submission, lines),
        );
        self.say(id, format!("submitted: frames {}", submission.frames));
        Ok(proto::Submitted {
            job: id.0,
            again: false,
        })
    }

    /// How the images of a new job are stored.
    fn plan(&self, id: JobId, new: &NewJob) -> Plan {
        let film = &new.description.film;
        Plan {
            folders: self.state.job(id),
            stem: stem(&new.submission.name, &new.description.name),
            formats: new.formats,
            identity: ScratchIdentity {
                scene: new.submission.scene,
                revision: new.submission.revision.0,
                image: ImageNumber(0),
                resolution: film.resolution,
            },
            window: film.window,
            metadata: FrameMetadata {
                scene_digest: new.submission.scene,
                revision: new.submission.revision.0,
                settings: new.settings.clone(),
                statistics: String::new(),
                software: self.config.build.clone(),
                frames_per_second: film.fps,
                comments: String::new(),
            },
            view: ViewTransform {
                exposure_stops: film.exposure,
            },
            cancelled: AtomicBool::new(false),
        }
    }

    fn answer_submission(
        &mut self,
        submission: SubmissionId,
        answer: Result<proto::Submitted, Failure>,
    ) {
        let waiting = self
            .submitting
            .take_if(|(waiting, _, _)| *waiting == submission);
        if let Some((_, new, reply)) = waiting {
            drop(new);
            let _ = reply.send(answer);
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
        self.say(id, format!("the job is {words}"));
        self.clear_job(id);
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

    /// Removes what a job that is over leaves beside its frames.
    fn clear_job(&mut self, id: JobId) {
        let cancelled = sched::JobState::Over(JobOutcome::Cancelled);
        let is_cancelled = self.sched.job(id).is_none_or(|job| job.state == cancelled);
        let Some(job) = self.jobs.get_mut(id) else {
            return;
        };
        // Nobody can ask for a retry yet, which would need the scene again.
        if let Some(upload) = job.upload.take() {
            self.storage.remove(upload);
        }
        if is_cancelled {
            job.plan.cancelled.store(true, Ordering::Relaxed);
        }
        let folders = job.folders().clone();
        self.storage.clear(folders);
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
                "frame {}: workers {name} and {other} made different pixels at {},{}; the first to arrive are kept",
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
            job.say(now, &text);
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

    fn tell(&mut self, id: WorkerId, message: control_down::Message) {
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

fn revoke_words(reason: RevokeReason) -> &'static str {
    match reason {
        RevokeReason::TileDone => "every pixel of the tile is durable",
        RevokeReason::Cancelled => "the job was cancelled",
        RevokeReason::Paused => "the job pauses",
        RevokeReason::CalledBack => "another worker has nothing to do",
        RevokeReason::Differs => "its pixels differ from another worker's",
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
