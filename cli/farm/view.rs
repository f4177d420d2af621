//! Jobs, images and workers as commands print them. Their JSON is these structs' fields.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use image::Format;
use indicatif::HumanBytes;
use model::{Digest, FrameRange};
use serde::Serialize;
use wire::proto::{self, FrameFormat, ImageState, JobState, WorkerState};

use crate::output::{Report, columns};
use crate::progress::{amount, duration};

/// A job in one line.
#[derive(Serialize, Clone, Debug)]
pub(crate) struct Job {
    /// Its number.
    pub(crate) job: u64,
    /// What its user calls it.
    pub(crate) name: String,
    /// `running`, `paused`, `done`, `failed` or `cancelled`.
    pub(crate) state: &'static str,
    /// Jobs of higher priority are served first.
    pub(crate) priority: i32,
    /// Its part of the farm against the other jobs of its priority.
    pub(crate) share: u32,
    /// Jobs that it waits for.
    pub(crate) after: Vec<u64>,
    /// Labels that its workers must have.
    pub(crate) need_labels: Vec<String>,
    /// Fewest render threads of its workers.
    pub(crate) need_threads: u32,
    /// Least memory of their machines.
    pub(crate) need_memory_bytes: u64,
    /// The part of each frame that is rendered first, such as `0,0,64,64`.
    pub(crate) focus: Option<String>,
    /// The frames asked for, such as `0..24`.
    pub(crate) frames: String,
    /// How many frames that is.
    pub(crate) images_total: u32,
    /// Frames finished.
    pub(crate) images_done: u32,
    /// Frames given up.
    pub(crate) images_failed: u32,
    /// Pixels of the whole job.
    pub(crate) pixels: u64,
    /// Pixels on the coordinator's disk.
    pub(crate) pixels_done: u64,
    /// Blocks on the coordinator's disk.
    pub(crate) blocks_done: u64,
    /// Blocks that came although their pixels were there: work done twice.
    pub(crate) blocks_again: u64,
    /// Pixels in them.
    pub(crate) pixels_again: u64,
    /// Blocks that were rendered twice on purpose, to be verified or near the end; not among those.
    pub(crate) blocks_twice: u64,
    /// Blocks of which two renderings differed.
    pub(crate) incidents: u64,
    /// Of those, the ones of which no third worker has decided who is right.
    pub(crate) undecided: u64,
    /// Tiles that were to be rendered once more and compared, and were not.
    pub(crate) unverified: u64,
    /// Tiles of each frame; 0 where they are cut by time.
    pub(crate) tiles_per_image: u32,
    /// Their size, such as `64x64`.
    pub(crate) tile: Option<String>,
    /// Tiles that workers hold now.
    pub(crate) attempts_live: u32,
    /// Attempts that failed or made no progress.
    pub(crate) attempts_failed: u64,
    /// Attempts whose worker was lost.
    pub(crate) attempts_lost: u64,
    /// Width of a whole frame.
    pub(crate) width: u32,
    /// Height of a whole frame.
    pub(crate) height: u32,
    /// Files of each frame: `exr`, `png`, `png16`, `ppm`.
    pub(crate) formats: Vec<&'static str>,
    /// Digest of the scene.
    pub(crate) scene_digest: String,
    /// Revision of the renderer.
    pub(crate) revision: u32,
    /// Milliseconds since 1970 (UTC).
    pub(crate) submitted_unix_ms: u64,
    /// When its first tile was leased; null until then.
    pub(crate) started_unix_ms: Option<u64>,
    /// When it was over; null until then.
    pub(crate) finished_unix_ms: Option<u64>,
    /// How long it will still take, as expected; null where nobody can say.
    pub(crate) left_seconds: Option<f64>,
    /// It may be as little as this.
    pub(crate) left_seconds_early: Option<f64>,
    /// It may be as much as this.
    pub(crate) left_seconds_late: Option<f64>,
    /// Time spent rendering its blocks, over all threads.
    pub(crate) render_seconds: f64,
    /// Sums over its blocks, by name.
    pub(crate) counters: BTreeMap<String, u64>,
}

/// One frame of a job.
#[derive(Serialize, Clone, Debug)]
pub(crate) struct Image {
    /// Its number in the animation.
    pub(crate) image: u32,
    /// `waiting`, `rendering`, `encoding`, `done`, `failed` or `cancelled`.
    pub(crate) state: &'static str,
    /// Its pixels on the coordinator's disk.
    pub(crate) pixels_done: u64,
    /// Digest of all its values, once it is done.
    pub(crate) film_digest: Option<String>,
    /// Why it failed.
    pub(crate) error: Option<String>,
    /// Its finished files.
    pub(crate) files: Vec<File>,
}

/// A finished file.
#[derive(Serialize, Clone, Debug)]
pub(crate) struct File {
    /// Its format.
    pub(crate) format: &'static str,
    /// Its name on the coordinator.
    pub(crate) name: String,
    /// Its length.
    pub(crate) bytes: u64,
}

/// A worker.
#[derive(Serialize, Clone, Debug)]
pub(crate) struct Worker {
    /// 16 hexadecimal digits.
    pub(crate) worker: String,
    /// What it calls itself.
    pub(crate) name: String,
    /// `connected`, `draining`, `aside` (it gets no tiles for a while) or `away`.
    pub(crate) state: &'static str,
    /// Its render threads.
    pub(crate) threads: u32,
    /// Its SIMD level.
    pub(crate) simd_level: String,
    /// The memory of its machine; null where not known.
    pub(crate) memory_bytes: Option<u64>,
    /// Its program's version.
    pub(crate) build: String,
    /// Revision of its renderer.
    pub(crate) revision: u32,
    /// Tiles that it holds.
    pub(crate) attempts: u32,
    /// How many tiles it wants to hold.
    pub(crate) credit: u32,
    /// Blocks of it on the coordinator's disk.
    pub(crate) blocks: u64,
    /// Time its threads took over them.
    pub(crate) render_seconds: f64,
    /// When it was last heard of, milliseconds since 1970 (UTC).
    pub(crate) heard_unix_ms: u64,
    /// Its labels.
    pub(crate) labels: Vec<String>,
    /// Until when it may run; null where nobody set a limit.
    pub(crate) runs_until_unix_ms: Option<u64>,
    /// Until when it gets no tiles, since it failed too many; null where it is trusted.
    pub(crate) aside_until_unix_ms: Option<u64>,
    /// Whether that is since its pixels were wrong.
    pub(crate) expelled: bool,
}

/// `job list`.
#[derive(Serialize)]
pub(crate) struct Jobs {
    /// Oldest first.
    pub(crate) jobs: Vec<Job>,
}

/// `job show`: a job with its frames.
#[derive(Serialize, Clone, Debug)]
pub(crate) struct Whole {
    /// The job.
    #[serde(flatten)]
    pub(crate) job: Job,
    /// Its frames, in order.
    pub(crate) images: Vec<Image>,
}

/// `job why` and `worker why`.
#[derive(Serialize)]
pub(crate) struct Reason<T> {
    /// What was asked about.
    #[serde(flatten)]
    pub(crate) asked: T,
    /// Why it is not finished or has not more to do, a sentence.
    pub(crate) why: String,
}

impl<T: Serialize> Report for Reason<T> {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.why)
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        self.table(out)
    }
}

/// `worker list`.
#[derive(Serialize)]
pub(crate) struct Workers {
    /// By number.
    pub(crate) workers: Vec<Worker>,
}

/// The name of a format.
pub(crate) fn format_name(format: FrameFormat) -> &'static str {
    format_of(format).name()
}

/// A message's format as the frames' crate knows it; not said is EXR.
pub(crate) fn format_of(format: FrameFormat) -> Format {
    match format {
        FrameFormat::Unspecified | FrameFormat::Exr => Format::Exr,
        FrameFormat::Png8 => Format::Png8,
        FrameFormat::Png16 => Format::Png16,
        FrameFormat::Ppm => Format::Ppm,
    }
}

/// A format as messages hold it.
pub(crate) fn wire_format(format: Format) -> FrameFormat {
    match format {
        Format::Exr => FrameFormat::Exr,
        Format::Png8 => FrameFormat::Png8,
        Format::Png16 => FrameFormat::Png16,
        Format::Ppm => FrameFormat::Ppm,
    }
}

fn time(unix_ms: u64) -> Option<u64> {
    (unix_ms > 0).then_some(unix_ms)
}

fn seconds(microseconds: u64) -> f64 {
    microseconds as f64 / 1e6
}

fn hex(bytes: &[u8]) -> Option<String> {
    bytes.try_into().ok().map(|bytes| Digest(bytes).to_string())
}

impl From<proto::JobSummary> for Job {
    fn from(job: proto::JobSummary) -> Self {
        let frames = job.frames.map(FrameRange::try_from);
        let needs = job.needs.clone().unwrap_or_default();
        let estimate = job.left;
        let left =
            |of: fn(&proto::Estimate) -> u64| estimate.as_ref().map(|left| of(left) as f64 / 1e3);
        Self {
            state: match job.state() {
                JobState::Unspecified | JobState::Running if job.paused => "paused",
                JobState::Unspecified | JobState::Running => "running",
                JobState::Done => "done",
                JobState::Failed => "failed",
                JobState::Cancelled => "cancelled",
            },
            formats: job.formats().map(format_name).collect(),
            frames: match frames {
                Some(Ok(frames)) => frames.to_string(),
                _ => String::new(),
            },
            tile: job
                .tile
                .map(|tile| format!("{}x{}", tile.width, tile.height)),
            scene_digest: hex(&job.description_digest).unwrap_or_default(),
            counters: job
                .counters
                .into_iter()
                .map(|counter| (counter.name, counter.value))
                .collect(),
            job: job.job,
            name: job.name,
            priority: job.priority,
            share: job.share,
            after: job.after,
            need_labels: needs.labels,
            need_threads: needs.threads,
            need_memory_bytes: needs.memory_bytes,
            focus: job
                .focus
                .map(|part| format!("{},{},{},{}", part.x0, part.y0, part.x1, part.y1)),
            blocks_twice: job.blocks_twice,
            incidents: job.incidents,
            undecided: job.undecided,
            unverified: job.unverified,
            images_total: job.images,
            images_done: job.images_done,
            images_failed: job.images_failed,
            pixels: job.pixels,
            pixels_done: job.pixels_done,
            blocks_done: job.blocks_done,
            blocks_again: job.blocks_again,
            pixels_again: job.pixels_again,
            tiles_per_image: job.tiles_per_image,
            attempts_live: job.attempts_live,
            attempts_failed: job.attempts_failed,
            attempts_lost: job.attempts_lost,
            width: job.width,
            height: job.height,
            revision: job.revision,
            submitted_unix_ms: job.submitted_unix_ms,
            started_unix_ms: time(job.started_unix_ms),
            finished_unix_ms: time(job.finished_unix_ms),
            left_seconds: left(|left| left.expected_ms),
            left_seconds_early: left(|left| left.early_ms),
            left_seconds_late: left(|left| left.late_ms),
            render_seconds: seconds(job.render_us),
        }
    }
}

impl From<proto::ImageStatus> for Image {
    fn from(image: proto::ImageStatus) -> Self {
        Self {
            state: match image.state() {
                ImageState::Unspecified | ImageState::Waiting => "waiting",
                ImageState::Rendering => "rendering",
                ImageState::Encoding => "encoding",
                ImageState::Done => "done",
                ImageState::Failed => "failed",
                ImageState::Cancelled => "cancelled",
            },
            film_digest: hex(&image.film_digest),
            error: Some(image.error).filter(|error| !error.is_empty()),
            image: image.image,
            pixels_done: image.pixels_done,
            files: image
                .files
                .into_iter()
                .map(|file| File {
                    format: format_name(file.format()),
                    name: file.name,
                    bytes: file.bytes,
                })
                .collect(),
        }
    }
}

impl From<proto::WorkerStatus> for Worker {
    fn from(worker: proto::WorkerStatus) -> Self {
        Self {
            worker: format!("{:016x}", worker.worker.map_or(0, |worker| worker.id)),
            state: match worker.state() {
                WorkerState::Connected if worker.draining => "draining",
                WorkerState::Connected if worker.aside_until_unix_ms > 0 => "aside",
                WorkerState::Connected => "connected",
                WorkerState::Unspecified | WorkerState::Away => "away",
            },
            memory_bytes: time(worker.memory_bytes),
            name: worker.name,
            threads: worker.threads,
            simd_level: worker.simd_level,
            build: worker.build,
            revision: worker.revision,
            attempts: worker.attempts,
            credit: worker.credit,
            blocks: worker.blocks,
            render_seconds: seconds(worker.render_us),
            heard_unix_ms: worker.heard_unix_ms,
            labels: worker.labels,
            runs_until_unix_ms: time(worker.runs_until_unix_ms),
            aside_until_unix_ms: time(worker.aside_until_unix_ms),
            expelled: worker.expelled,
        }
    }
}

/// How long ago something was, for people.
pub(crate) fn ago(unix_ms: u64) -> String {
    let then = UNIX_EPOCH + Duration::from_millis(unix_ms);
    match SystemTime::now().duration_since(then) {
        Ok(since) => format!("{} ago", duration(since)),
        Err(_) => "now".to_owned(),
    }
}

/// The time of day of an instant, UTC.
pub(crate) fn clock(unix_ms: u64) -> String {
    let second = unix_ms / 1000 % 86_400;
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    format!("{hour:02}:{minute:02}:{second:02}")
}

impl Job {
    /// How much of it is done, in per cent.
    fn percent(&self) -> u64 {
        self.pixels_done.saturating_mul(100) / self.pixels.max(1)
    }

    /// Its place among others, where it is not the usual one.
    fn rank(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut said = Vec::new();
        if self.priority != 0 {
            said.push(format!("priority {}", self.priority));
        }
        if self.share > 1 {
            said.push(format!("share {}", self.share));
        }
        if !self.after.is_empty() {
            let after: Vec<_> = self.after.iter().map(u64::to_string).collect();
            said.push(format!("after job {}", after.join(", ")));
        }
        if !self.need_labels.is_empty() {
            said.push(format!("workers labelled {}", self.need_labels.join(", ")));
        }
        if self.need_threads > 0 {
            said.push(format!("{} threads or more", self.need_threads));
        }
        if self.need_memory_bytes > 0 {
            said.push(format!("{} of memory", HumanBytes(self.need_memory_bytes)));
        }
        if let Some(focus) = &self.focus {
            said.push(format!("{focus} of each frame first"));
        }
        match said.is_empty() {
            true => Ok(()),
            false => writeln!(out, "  rank    {}", said.join("; ")),
        }
    }

    /// From its first lease to its end.
    pub(crate) fn wall(&self) -> Option<Duration> {
        let span = self.finished_unix_ms?.checked_sub(self.started_unix_ms?)?;
        Some(Duration::from_millis(span))
    }
}

impl Report for Jobs {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        if self.jobs.is_empty() {
            return writeln!(out, "There are no jobs.");
        }
        let header = [
            "job",
            "name",
            "state",
            "frames",
            "done",
            "failed",
            "pixels",
            "left",
            "submitted",
        ];
        let mut table = columns(header);
        for job in &self.jobs {
            table.add_row([
                job.job.to_string(),
                job.name.clone(),
                job.state.to_owned(),
                job.frames.clone(),
                format!("{}/{}", job.images_done, job.images_total),
                job.images_failed.to_string(),
                format!("{} %", job.percent()),
                job.left_seconds
                    .map_or_else(String::new, |left| duration(Duration::from_secs_f64(left))),
                ago(job.submitted_unix_ms),
            ]);
        }
        writeln!(out, "{}", table.trim_fmt())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        self.jobs
            .iter()
            .try_for_each(|job| writeln!(out, "{}", job.job))
    }
}

impl Report for Job {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "job {} ({}): {}", self.job, self.name, self.state)?;
        writeln!(
            out,
            "  frames  {}: {} of {} done, {} failed",
            self.frames, self.images_done, self.images_total, self.images_failed
        )?;
        writeln!(
            out,
            "  pixels  {} % of {} ({}x{} a frame, {})",
            self.percent(),
            self.pixels,
            self.width,
            self.height,
            match &self.tile {
                Some(tile) => format!("{} tiles of {tile}", self.tiles_per_image),
                None => "tiles cut by time".to_owned(),
            }
        )?;
        writeln!(
            out,
            "  blocks  {} done, {} again; tiles: {} out, {} failed, {} lost with their workers",
            self.blocks_done,
            self.blocks_again,
            self.attempts_live,
            self.attempts_failed,
            self.attempts_lost
        )?;
        if self.undecided > 0 {
            writeln!(
                out,
                "  WRONG   {} blocks were rendered twice with different pixels: `flyby job log {}` names the workers",
                self.undecided, self.job
            )?;
        } else if self.incidents > 0 {
            writeln!(
                out,
                "  {} blocks were rendered twice with different pixels; a third worker decided, and what was wrong is rendered again",
                self.incidents
            )?;
        }
        if self.unverified > 0 {
            writeln!(
                out,
                "  {} tiles were to be verified and were not: no other worker could render them in time",
                self.unverified
            )?;
        }
        self.rank(out)?;
        if let (Some(left), Some(early), Some(late)) = (
            self.left_seconds,
            self.left_seconds_early,
            self.left_seconds_late,
        ) {
            writeln!(
                out,
                "  left    about {} ({} to {})",
                duration(Duration::from_secs_f64(left)),
                duration(Duration::from_secs_f64(early)),
                duration(Duration::from_secs_f64(late))
            )?;
        }
        write!(out, "  time    submitted {}", ago(self.submitted_unix_ms))?;
        if let Some(wall) = self.wall() {
            write!(out, ", took {}", duration(wall))?;
        }
        writeln!(out, ", {:.1} s of rendering", self.render_seconds)?;
        writeln!(out, "  scene   {}", self.scene_digest)?;
        if let Some(rays) = self.counters.get("rays") {
            writeln!(out, "  rays    {}", amount(*rays as f64).trim_end())?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.state)
    }
}

impl Report for Whole {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        self.job.table(out)?;
        let mut table = columns(["frame", "state", "pixels", "film digest", "files"]);
        for image in &self.images {
            let files: Vec<&str> = image.files.iter().map(|file| file.name.as_str()).collect();
            table.add_row([
                image.image.to_string(),
                image.state.to_owned(),
                image.pixels_done.to_string(),
                image
                    .film_digest
                    .as_deref()
                    .map_or_else(String::new, |digest| digest[..16].to_owned()),
                image.error.clone().unwrap_or_else(|| files.join(", ")),
            ]);
        }
        writeln!(out, "{}", table.trim_fmt())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        self.job.quiet(out)
    }
}

impl Report for Workers {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        if self.workers.is_empty() {
            return writeln!(out, "There are no workers: start one with `flyby worker`.");
        }
        let header = [
            "worker", "name", "state", "threads", "simd", "labels", "tiles", "blocks", "heard",
        ];
        let mut table = columns(header);
        for worker in &self.workers {
            table.add_row([
                worker.worker.clone(),
                worker.name.clone(),
                worker.state.to_owned(),
                worker.threads.to_string(),
                worker.simd_level.clone(),
                worker.labels.join(","),
                format!("{}/{}", worker.attempts, worker.credit),
                worker.blocks.to_string(),
                ago(worker.heard_unix_ms),
            ]);
        }
        writeln!(out, "{}", table.trim_fmt())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut workers = self.workers.iter();
        workers.try_for_each(|worker| writeln!(out, "{}", worker.worker))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_keeps_its_field_names() {
        let summary = proto::JobSummary {
            job: 3,
            name: "flyby".into(),
            state: JobState::Done.into(),
            frames: Some(FrameRange::new(0, 24, 1).unwrap().into()),
            description_digest: vec![7; 32],
            formats: vec![FrameFormat::Exr.into(), FrameFormat::Png8.into()],
            started_unix_ms: 1_000,
            finished_unix_ms: 3_500,
            ..proto::JobSummary::default()
        };
        let whole = Whole {
            job: summary.into(),
            images: vec![
                proto::ImageStatus {
                    image: 4,
                    state: ImageState::Failed.into(),
                    error: "no space left".into(),
                    ..proto::ImageStatus::default()
                }
                .into(),
            ],
        };
        let json = serde_json::to_value(&whole).unwrap();
        assert_eq!(json["job"], 3);
        assert_eq!(json["state"], "done");
        assert_eq!(json["frames"], "0..24");
        assert_eq!(json["formats"], serde_json::json!(["exr", "png"]));
        assert_eq!(json["scene_digest"], "07".repeat(32));
        assert_eq!(json["images"][0]["error"], "no space left");
        assert_eq!(json["images"][0]["film_digest"], serde_json::Value::Null);
        assert_eq!(whole.job.wall(), Some(Duration::from_millis(2_500)));
        let mut table = Vec::new();
        whole.table(&mut table).unwrap();
        assert!(String::from_utf8(table).unwrap().contains("no space left"));
    }

    #[test]
    fn times_of_day() {
        assert_eq!(clock(86_400_000 + 3_723_004), "01:02:03");
    }
}
