//! `flyby submit`: hands a job to a coordinator, and follows it if asked to.

use std::io::{self, Write};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};

use clap::Args;
use image::{Format, frame_name};
use indicatif::HumanBytes;
use model::{FrameRange, ImageNumber, JobId, Resolution};
use serde::Serialize;

use super::job::{make_folder, until_over};
use super::render::movie_of;
use crate::error::{Ending, Error};
use crate::existing::{self, Survey, Wanted, survey};
use crate::farm::fetch::Fetched;
use crate::farm::follow::ending;
use crate::farm::link::block_on;
use crate::farm::submit::Submission;
use crate::farm::view::{Job, Whole};
use crate::options::{
    Context, Existing, FarmOptions, FileOptions, FrameOptions, PlaceOptions, SceneOptions,
};
use crate::output::{self, Report, say};
use crate::stop::Stop;
use crate::values;

#[derive(Args, Debug)]
pub(crate) struct Submit {
    #[command(flatten)]
    pub(crate) scene: SceneOptions,

    #[command(flatten)]
    pub(crate) frames: FrameOptions,

    /// Wait, and fetch the frames into this folder as they are finished.
    #[arg(short, long, value_name = "DIR", help_heading = "Results")]
    pub(crate) out: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) files: FileOptions,

    /// Follow the job until it is over; Ctrl-C leaves it alone (exit code 5 if it failed).
    #[arg(long, help_heading = "Farm")]
    pub(crate) watch: bool,

    /// What to call the job; its files are named after it [default: the scene's name].
    #[arg(long, value_name = "NAME", help_heading = "Farm")]
    pub(crate) name: Option<String>,

    /// Size of the tiles that workers are given; pixels do not depend on it.
    #[arg(long, value_name = "WxH", value_parser = values::resolution, help_heading = "How to compute it")]
    pub(crate) tile: Option<Resolution>,

    /// Fewest pixels of a tile, all of one size: the squarest that divides the image [default: tiles that take about the same time].
    #[arg(
        long,
        value_name = "N",
        conflicts_with = "tile",
        help_heading = "How to compute it"
    )]
    pub(crate) min_tile_pixels: Option<NonZeroU64>,

    #[command(flatten)]
    pub(crate) place: PlaceOptions,

    #[command(flatten)]
    pub(crate) farm: FarmOptions,
}

/// `submit`.
#[derive(Serialize)]
pub(crate) struct SubmitReport {
    /// The job's number; null where every frame was there already.
    pub(crate) job: Option<u64>,
    /// What it is called.
    name: String,
    /// The frames submitted.
    frames: String,
    /// Digest of the scene with all its settings.
    scene_digest: String,
    /// Bytes that it may need on the coordinator's disk, if nothing of its frames could be compressed.
    disk_needed_bytes: u64,
    /// Bytes that are free there; null where that is not known.
    disk_free_bytes: Option<u64>,
    /// The job at its end, where it was followed.
    pub(crate) result: Option<Job>,
    /// Where the frames are, where they were fetched.
    pub(crate) folder: Option<PathBuf>,
    /// Files that were fetched.
    pub(crate) fetched: Vec<PathBuf>,
    /// Files that were there already.
    pub(crate) kept: Vec<PathBuf>,
    /// The movie, where one was made.
    pub(crate) movie: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(context: &Context, options: &Submit) -> Result<Ending, Error> {
    if options.files.movie && options.out.is_none() {
        return Err(Error::usage(
            "a movie is made of fetched frames, so there must be a folder for them",
        )
        .next("say where with `-o DIR`"));
    }
    let scene = options.scene.load()?;
    let frames = scene.frames(options.frames.frames)?;
    let name = options.name.as_deref().unwrap_or(&scene.description().name);
    let order = Order {
        submission: Submission {
            scene: &scene,
            name,
            frames,
            tile: options.tile,
            min_tile_pixels: options.min_tile_pixels,
            place: options.place.clone(),
            formats: options.files.formats(),
            settings_json: options.scene.settings_json(),
        },
        target: options.out.as_deref().map(|folder| Target {
            folder,
            existing: options.files.existing,
            movie: options.files.movie,
        }),
        watch: options.watch,
    };
    let stop = Stop::on_signals()?;
    let report = order.carry_out(&stop, || Ok((context.clone(), options.farm.clone(), ())))?;
    output::print(context.output, &report)?;
    Ok(report.result.as_ref().map_or(Ending::Done, ending))
}

/// A job with what is to become of it.
pub(crate) struct Order<'a> {
    /// The job.
    pub(crate) submission: Submission<'a>,
    /// Where its frames go, if anywhere.
    pub(crate) target: Option<Target<'a>>,
    /// Whether to wait for its end even if nothing is fetched.
    pub(crate) watch: bool,
}

/// Where the frames of a job go.
#[derive(Clone, Copy)]
pub(crate) struct Target<'a> {
    /// The user's folder; it is made if it is not there.
    pub(crate) folder: &'a Path,
    /// What to do about frames that are there.
    pub(crate) existing: Existing,
    /// Whether to make a movie at the end.
    pub(crate) movie: bool,
}

impl Order<'_> {
    /// Submits what is not there yet, and waits for it where that is asked for.
    ///
    /// `farm` is asked for a coordinator once there is something to submit; what it answers
    /// last is kept until the job is over. Fails as interrupted where the user stops
    /// waiting; the job then goes on.
    pub(crate) fn carry_out<G>(
        mut self,
        stop: &Stop,
        farm: impl FnOnce() -> Result<(Context, FarmOptions, G), Error>,
    ) -> Result<SubmitReport, Error> {
        let all = self.submission.frames;
        let images: Vec<ImageNumber> = all.iter().collect();
        let stem = self.stem();
        let survey = self.survey(&images, &stem)?;
        let mut report = SubmitReport::new(&self);
        report.kept = survey
            .kept
            .iter()
            .flat_map(|(image, _)| self.files(*image, &stem))
            .collect();
        match span(&survey.missing, all.step()) {
            None => {
                let folder = self.target.map_or(Path::new("."), |target| target.folder);
                say(format_args!(
                    "all {} frames are in `{}` already, of this scene and these settings: nothing is submitted \
                     (`--existing replace` renders them again)",
                    images.len(),
                    folder.display()
                ));
            }
            Some(missing) => {
                self.submission.frames = missing;
                report.frames = missing.to_string();
                let (context, farm, _guard) = farm()?;
                self.submit(&context, &farm, stop, &mut report)?;
            }
        }
        if let Some(target) = self
            .target
            .filter(|target| target.movie && report.is_whole())
        {
            let frames = images
                .iter()
                .map(|image| target.folder.join(frame_name(&stem, *image, Format::Png8)));
            let fps = self.submission.scene.description().film.fps;
            let frames: Vec<PathBuf> = frames.collect();
            report.movie = movie_of(target.folder, &stem, &frames, fps, stop)?;
        }
        Ok(report)
    }

    fn submit(
        &self,
        context: &Context,
        farm: &FarmOptions,
        stop: &Stop,
        report: &mut SubmitReport,
    ) -> Result<(), Error> {
        let submitted = block_on(async {
            tokio::select! {
                () = stop.wait() => Err(Error::interrupted("interrupted while submitting")
                    .next("`flyby job list` says whether the job was taken")),
                submitted = self.submission.hand_in(context, farm) => submitted,
            }
        })?;
        let job = JobId(submitted.job);
        let (name, frames) = (self.submission.name, self.submission.frames);
        let needed = submitted.disk_needed_bytes;
        say(format_args!(
            "job {job}: {name}, frames {frames}; at most {} on the coordinator's disk",
            HumanBytes(needed)
        ));
        if let Some(free) = submitted.disk_free_bytes.filter(|&free| free < needed) {
            say(format_args!(
                "only {} are free there: frames are usually smaller than that, and the farm waits where the disk \
                 is full until there is room",
                HumanBytes(free)
            ));
        }
        report.job = Some(job.0);
        report.disk_needed_bytes = needed;
        report.disk_free_bytes = submitted.disk_free_bytes;
        if self.watch || self.target.is_some() {
            let target = self.target.map(|target| (target.folder, target.existing));
            let (whole, fetched) = block_on(until_over(context, farm, job, stop, target))?;
            report.take(whole, fetched);
        }
        Ok(())
    }

    /// What the coordinator will call the files.
    fn stem(&self) -> String {
        match existing::stem(self.submission.name) {
            kept if kept == "frame" => existing::stem(&self.submission.scene.description().name),
            kept => kept,
        }
    }

    fn files(&self, image: ImageNumber, stem: &str) -> Vec<PathBuf> {
        let folder = self.target.map_or(Path::new(""), |target| target.folder);
        let formats = self.submission.formats.iter();
        formats
            .map(|format| folder.join(frame_name(stem, image, format)))
            .collect()
    }

    fn survey(&self, images: &[ImageNumber], stem: &str) -> Result<Survey, Error> {
        let Some(target) = self.target else {
            return Ok(Survey {
                kept: Vec::new(),
                missing: images.to_vec(),
            });
        };
        make_folder(target.folder)?;
        let wanted = Wanted {
            folder: target.folder,
            stem,
            images,
            formats: self.submission.formats,
            scene: self.submission.scene.digest,
            revision: render::REVISION,
        };
        survey(&wanted, target.existing)
    }
}

/// The shortest range that holds these images, all of one range of that step.
fn span(images: &[ImageNumber], step: u32) -> Option<FrameRange> {
    let (first, last) = (images.first()?, images.last()?);
    FrameRange::new(first.0, last.0.checked_add(1)?, step).ok()
}

impl SubmitReport {
    fn new(order: &Order<'_>) -> Self {
        Self {
            job: None,
            name: order.submission.name.to_owned(),
            frames: order.submission.frames.to_string(),
            scene_digest: order.submission.scene.digest.to_string(),
            disk_needed_bytes: 0,
            disk_free_bytes: None,
            result: None,
            folder: order.target.map(|target| target.folder.to_owned()),
            fetched: Vec::new(),
            kept: Vec::new(),
            movie: None,
        }
    }

    fn take(&mut self, whole: Whole, fetched: Vec<Fetched>) {
        self.result = Some(whole.job);
        for file in fetched {
            match file {
                Fetched::New(path) => self.fetched.push(path),
                Fetched::Kept(path) if self.kept.contains(&path) => {}
                Fetched::Kept(path) => self.kept.push(path),
            }
        }
    }

    /// Whether every frame is there.
    fn is_whole(&self) -> bool {
        self.result.as_ref().is_none_or(|job| job.state == "done")
    }
}

impl Report for SubmitReport {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        match (&self.result, self.job) {
            (Some(job), _) => job.table(out)?,
            (None, Some(job)) => writeln!(
                out,
                "job {job} is submitted: `flyby job watch {job}` follows it"
            )?,
            (None, None) => {}
        }
        if let Some(folder) = &self.folder {
            let (fetched, kept) = (self.fetched.len(), self.kept.len());
            writeln!(
                out,
                "{fetched} files fetched into {}, {kept} kept that were there already",
                folder.display()
            )?;
        }
        if let Some(movie) = &self.movie {
            writeln!(out, "movie {}", movie.display())?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        self.job.map_or(Ok(()), |job| writeln!(out, "{job}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_one_range() {
        let images = |numbers: &[u32]| numbers.iter().copied().map(ImageNumber).collect::<Vec<_>>();
        let text =
            |numbers: &[u32], step| span(&images(numbers), step).map(|range| range.to_string());
        assert_eq!(text(&[], 1), None);
        assert_eq!(text(&[7], 1), Some("7".into()));
        assert_eq!(text(&[3, 4, 9], 1), Some("3..10".into()));
        assert_eq!(text(&[10, 30], 10), Some("10..31:10".into()));
    }
}
