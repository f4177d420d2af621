//! Follows a job until it is over, across lost connections.

use std::collections::BTreeMap;
use std::time::Duration;

use model::JobId;
use tokio::sync::mpsc::UnboundedSender;
use wire::failure::Retry;
use wire::proto::job_update::Update;
use wire::proto::{
    ErrorKind, ImageState, ImageStatus, JobRequest, JobState, JobSummary, JobUpdate,
};
use wire::{BadMessage, Failure};

use super::link::refused;
use super::view::{Image, Job, Whole};
use crate::error::{Ending, Error};
use crate::options::{Context, FarmOptions};
use crate::output::say;
use crate::progress::{Progress, amount};
use crate::stop::Stop;

/// How long to wait before each try to reach a coordinator that went away.
const RETRY_AFTER: [Duration; 7] = [
    Duration::from_millis(100),
    Duration::from_millis(400),
    Duration::from_secs(1),
    Duration::from_secs(2),
    Duration::from_secs(4),
    Duration::from_secs(8),
    Duration::from_secs(15),
];

/// A job that is watched.
pub(crate) struct Follower<'a> {
    /// How the coordinator is found.
    pub(crate) context: &'a Context,
    /// Where it is.
    pub(crate) farm: &'a FarmOptions,
    /// The job.
    pub(crate) job: JobId,
    /// Once set, the job is left alone to go on.
    pub(crate) stop: &'a Stop,
    /// Hears of each image that is finished, once; its queue is no longer than the job.
    pub(crate) finished: Option<UnboundedSender<ImageStatus>>,
}

/// What is known of the job.
#[derive(Default)]
struct Known {
    summary: Option<JobSummary>,
    images: BTreeMap<u32, ImageStatus>,
    /// Whether the coordinator has answered at all, ever.
    reached: bool,
    progress: Option<Progress>,
    rays_before: u64,
    images_before: u32,
}

impl Follower<'_> {
    /// Follows the job to its end, with a progress bar; answers what it then is.
    ///
    /// Fails as interrupted once `stop` is set; the job goes on.
    pub(crate) async fn follow(self) -> Result<Whole, Error> {
        let mut known = Known::default();
        let mut tries = 0;
        loop {
            let watched = tokio::select! {
                () = self.stop.wait() => return Err(self.detached(&known)),
                watched = self.watch(&mut known, &mut tries) => watched,
            };
            let Err(error) = watched else {
                let whole = known.into_whole();
                if let Some(why) = why_frames_failed(&whole.images) {
                    say(why);
                }
                return Ok(whole);
            };
            let Some(delay) = RETRY_AFTER.get(tries).filter(|_| known.reached) else {
                known.clear_bar();
                return Err(error);
            };
            if error.ending() != Ending::Unreachable {
                known.clear_bar();
                return Err(self.forgotten(error));
            }
            tries += 1;
            tokio::select! {
                () = self.stop.wait() => return Err(self.detached(&known)),
                () = tokio::time::sleep(*delay) => {}
            }
        }
    }

    /// Watches over one connection; ends well only where the job is over.
    async fn watch(&self, known: &mut Known, tries: &mut usize) -> Result<(), Error> {
        let attempt = || format!("cannot watch job {}", self.job);
        let lost = |failure: Failure| refused(attempt(), failure);
        let mut farm = self.context.connect(self.farm).await?;
        let request = JobRequest { job: self.job.0 };
        let stream = farm.watch_job(request).await;
        let mut updates = stream.map_err(|status| lost(status.into()))?.into_inner();
        known.reached = true;
        let mut whole = false;
        while let Some(update) = updates
            .message()
            .await
            .map_err(|status| lost(status.into()))?
        {
            *tries = 0;
            whole |= self.take(known, update).map_err(|bad| lost(bad.into()))?;
            if whole && known.is_over() {
                known.clear_bar();
                return Ok(());
            }
        }
        Err(lost(Failure {
            kind: ErrorKind::Unspecified,
            retry: Retry::Later,
            sentence: "the coordinator ended the stream before the job was over".to_owned(),
        }))
    }

    /// Takes in an update; whether it completes a snapshot.
    fn take(&self, known: &mut Known, update: JobUpdate) -> Result<bool, BadMessage> {
        let (summary, images, complete) = match update.update {
            Some(Update::Snapshot(part)) => {
                if part.first {
                    known.images.clear();
                }
                (part.summary, part.images, part.last)
            }
            Some(Update::Delta(delta)) => (delta.summary, delta.images, false),
            // From a newer coordinator: skipped, as its definition says.
            None => return Ok(false),
        };
        let summary = wire::convert::require(summary, "summary")?;
        for image in images {
            let before = known.images.insert(image.image, image.clone());
            let was_done = before.is_some_and(|before| before.state() == ImageState::Done);
            if image.state() == ImageState::Done
                && !was_done
                && let Some(finished) = &self.finished
            {
                // Whoever fetches ends before this only with an error of its own.
                let _ = finished.send(image);
            }
        }
        known.show(self.context, summary);
        Ok(complete)
    }

    /// What to say when the user leaves.
    fn detached(&self, known: &Known) -> Error {
        known.clear_bar();
        let job = self.job;
        Error::interrupted(format!("job {job} goes on without being watched")).next(format!(
            "`flyby job watch {job}` comes back to it, `flyby job cancel {job}` ends it"
        ))
    }

    /// A job that was there and is not any more.
    fn forgotten(&self, error: Error) -> Error {
        if error.ending() == Ending::Usage {
            let job = self.job;
            return Error::new(
                Ending::JobLost,
                format!("job {job} is not there any more: it was removed, or its coordinator has another state folder now"),
            )
            .next("frames that it finished are in the state folder; `flyby job list` shows the jobs there are");
        }
        error
    }
}

impl Known {
    fn is_over(&self) -> bool {
        let state = self.summary.as_ref().map(JobSummary::state);
        matches!(
            state,
            Some(JobState::Done | JobState::Failed | JobState::Cancelled)
        )
    }

    fn show(&mut self, context: &Context, summary: JobSummary) {
        let rays = rays(&summary);
        if self.progress.is_none() {
            self.rays_before = rays;
            self.images_before = summary.images_done;
        }
        let progress = self.progress.get_or_insert_with(|| {
            Progress::new(context.output, summary.pixels, summary.pixels_done)
        });
        let frames = summary.images_done.saturating_sub(self.images_before);
        let about = format!(
            "frame {} of {}, {:.2} frames/s, {}rays/s",
            summary.images_done,
            summary.images,
            progress.rate(f64::from(frames)),
            amount(progress.rate(rays.saturating_sub(self.rays_before) as f64)),
        );
        let left = summary.left.as_ref();
        let left = left.map(|left| Duration::from_millis(left.expected_ms));
        progress.update_with(summary.pixels_done, about, left);
        self.summary = Some(summary);
    }

    fn clear_bar(&self) {
        if let Some(progress) = &self.progress {
            progress.finish();
        }
    }

    fn into_whole(self) -> Whole {
        Whole {
            job: Job::from(self.summary.unwrap_or_default()),
            images: self.images.into_values().map(Image::from).collect(),
        }
    }
}

/// Why the first frame that failed did, and how many others there are; `None` where none failed.
fn why_frames_failed(images: &[Image]) -> Option<String> {
    let mut failed = images.iter().filter_map(|image| {
        let why = image.error.as_deref()?;
        Some((image.image, why))
    });
    let (frame, why) = failed.next()?;
    Some(match failed.count() {
        0 => format!("frame {frame} failed: {why}"),
        others => format!("frame {frame} failed, and {others} others: {why}"),
    })
}

/// Camera rays of a job so far.
fn rays(summary: &JobSummary) -> u64 {
    let mut counters = summary.counters.iter();
    counters
        .find(|counter| counter.name == "rays")
        .map_or(0, |counter| counter.value)
}

/// How a command ends whose job ended so.
pub(crate) fn ending(job: &Job) -> Ending {
    if job.state == "done" {
        Ending::Done
    } else {
        Ending::JobLost
    }
}
