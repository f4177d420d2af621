//! What users are shown, from the scheduler's views and the loop's own tables.

use std::collections::{BTreeMap, BTreeSet};

use model::{ImageNumber, ImageRef, JobId, Timestamp};
use sched::{ImageFailure, ImageView, JobOutcome, JobView, Sched, WorkerView};
use wire::Failure;
use wire::proto::{self, ErrorKind};

use crate::clock::unix_ms;
use crate::job::Job;
use crate::worker::{Draining, Worker};

/// The answer to a question about a job that is not there.
pub(super) fn no_job(job: JobId) -> Failure {
    Failure::new(
        ErrorKind::NotFound,
        format!("there is no job {job}; `flyby job list` shows those there are"),
    )
}

/// The answer to a question about a worker that is not there.
pub(super) fn no_worker(name: &str) -> Failure {
    Failure::new(
        ErrorKind::NotFound,
        format!("there is no worker `{name}`; `flyby worker list` shows those there are"),
    )
}

/// A job in one line. `ended`: how and when, if that may be told.
pub(super) fn summary(
    view: &JobView<'_>,
    ended: Option<(JobOutcome, Option<Timestamp>)>,
    job: &Job,
) -> proto::JobSummary {
    let resolution = job.plan.identity.resolution;
    let state = match ended {
        None => proto::JobState::Running,
        Some((JobOutcome::Finished, _)) => proto::JobState::Done,
        Some((JobOutcome::Failed, _)) => proto::JobState::Failed,
        Some((JobOutcome::Cancelled, _)) => proto::JobState::Cancelled,
    };
    proto::JobSummary {
        job: view.job.0,
        name: view.name.to_owned(),
        state: state.into(),
        frames: Some(view.frames.into()),
        images: view.frames.count(),
        images_done: view.images.encoded,
        images_failed: view.images.failed,
        pixels: view.pixels,
        pixels_done: view.pixels_done,
        blocks_done: view.blocks_done,
        blocks_again: view.blocks_again,
        pixels_again: view.pixels_again,
        submitted_unix_ms: unix_ms(view.submitted),
        started_unix_ms: view.started.map_or(0, unix_ms),
        finished_unix_ms: ended.and_then(|(_, at)| at).map_or(0, unix_ms),
        description_digest: view.scene.0.to_vec(),
        width: resolution.width,
        height: resolution.height,
        window: Some(view.window.into()),
        formats: job
            .formats()
            .iter()
            .map(|format| crate::grpc::format_message(format).into())
            .collect(),
        counters: job
            .counters
            .iter()
            .map(|(name, value)| proto::Counter {
                name: name.clone(),
                value: *value,
            })
            .collect(),
        render_us: view.render_time.0,
        tiles_per_image: view.tiles.map_or(0, |(_, count)| count),
        tile: view
            .tiles
            .map(|((width, height), _)| proto::TileShape { width, height }),
        attempts_live: view.attempts_live,
        attempts_failed: view.attempts_failed,
        attempts_lost: view.attempts_lost,
        revision: view.revision.0,
        paused: view.paused == sched::Paused::Yes,
        priority: view.priority,
        share: view.share,
        needs: needs(view.needs),
        after: view.after.iter().map(|job| job.0).collect(),
        focus: view.focus.map(Into::into),
        blocks_twice: view.blocks_twice,
        incidents: view.incidents,
        unverified: view.unverified,
        undecided: view.undecided,
        left: None,
    }
}

/// How long a job will still take.
pub(super) fn estimate(left: sched::Estimate) -> proto::Estimate {
    proto::Estimate {
        expected_ms: left.left.0 / 1_000,
        early_ms: left.early.0 / 1_000,
        late_ms: left.late.0 / 1_000,
    }
}

/// What a job asks of workers, if it asks for anything.
fn needs(needs: &sched::Needs) -> Option<proto::Needs> {
    let asks = *needs != sched::Needs::default();
    asks.then(|| proto::Needs {
        labels: needs.labels.iter().cloned().collect(),
        threads: needs.threads,
        memory_bytes: needs.memory_bytes,
    })
}

/// Whether nothing of a job will change any more.
pub(super) fn is_over(summary: &proto::JobSummary) -> bool {
    use proto::JobState::{Cancelled, Done, Failed};
    matches!(summary.state(), Done | Failed | Cancelled)
}

/// Why images failed, by number.
pub(super) struct Reasons<'a>(BTreeMap<ImageNumber, &'a str>);

impl<'a> Reasons<'a> {
    pub(super) fn of(failures: &'a [ImageFailure]) -> Self {
        let reason = |failure: &'a ImageFailure| (failure.image, failure.reason.as_str());
        Self(failures.iter().map(reason).collect())
    }

    fn why(&self, image: ImageNumber) -> String {
        let reason = self.0.get(&image).copied();
        reason
            .unwrap_or("it failed; the job's log may say why")
            .to_owned()
    }
}

/// An image as it is now, on its own. `over`: its job is.
pub(super) fn image_status(
    sched: &Sched,
    id: JobId,
    job: &Job,
    image: ImageNumber,
    over: bool,
) -> Option<proto::ImageStatus> {
    let view = sched.image(ImageRef { job: id, image })?;
    let reasons = match view.state {
        sched::ImageState::Failed => Reasons::of(sched.failures(id)),
        _ => Reasons(BTreeMap::new()),
    };
    Some(status(&view, job, over, &reasons))
}

/// An image as it is now. `over`: its job is.
pub(super) fn status(
    view: &ImageView,
    job: &Job,
    over: bool,
    reasons: &Reasons<'_>,
) -> proto::ImageStatus {
    use proto::ImageState::{Cancelled, Done, Encoding, Failed, Rendering, Waiting};
    let (state, film_digest, error) = match view.state {
        sched::ImageState::Encoded { film } => (Done, film.0.to_vec(), String::new()),
        sched::ImageState::Failed => (Failed, Vec::new(), reasons.why(view.image)),
        sched::ImageState::Dropped => (Cancelled, Vec::new(), String::new()),
        _ if over => (Cancelled, Vec::new(), String::new()),
        sched::ImageState::Waiting => (Waiting, Vec::new(), String::new()),
        sched::ImageState::Rendering => (Rendering, Vec::new(), String::new()),
        sched::ImageState::Encoding => (Encoding, Vec::new(), String::new()),
    };
    proto::ImageStatus {
        image: view.image.0,
        state: state.into(),
        pixels_done: view.pixels_done,
        film_digest,
        error,
        files: job.files.get(&view.image).cloned().unwrap_or_default(),
    }
}

/// A finished file.
pub(super) fn file(file: &image::FinishedFile) -> proto::FrameFile {
    let name = file.path.file_name().unwrap_or_default();
    proto::FrameFile {
        format: crate::grpc::format_message(file.format).into(),
        name: name.to_string_lossy().into_owned(),
        bytes: file.bytes,
        digest: file.digest.0.to_vec(),
    }
}

/// A worker as it stands.
pub(super) fn worker_status(view: &WorkerView, known: Option<&Worker>) -> proto::WorkerStatus {
    let state = match view.link {
        sched::Link::Open => proto::WorkerState::Connected,
        sched::Link::Closed => proto::WorkerState::Away,
    };
    let about = known.map(|worker| worker.about.clone());
    let about = about.unwrap_or_else(|| crate::input::AboutWorker {
        name: view.worker.to_string(),
        build: String::new(),
        simd_level: String::new(),
        memory_bytes: 0,
        labels: BTreeSet::new(),
        time_left: None,
    });
    proto::WorkerStatus {
        worker: Some(view.worker.into()),
        name: about.name,
        state: state.into(),
        threads: view.threads,
        simd_level: about.simd_level,
        memory_bytes: about.memory_bytes,
        build: about.build,
        attempts: view.attempts,
        blocks: view.blocks,
        heard_unix_ms: unix_ms(view.heard),
        credit: view.credit,
        render_us: view.render_time.0,
        revision: view.revision.0,
        labels: about.labels.into_iter().collect(),
        runs_until_unix_ms: known
            .and_then(|worker| worker.runs_until)
            .map_or(0, unix_ms),
        aside_until_unix_ms: view.aside.map_or(0, unix_ms),
        draining: known.is_some_and(|worker| worker.draining == Draining::Yes),
        expelled: view.trust == sched::Trust::Expelled,
    }
}
