//! `flyby demo`: a whole farm of processes on this machine, rendering a short flyby.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use image::Formats;
use scene::{Overrides, Source};
use serde::Serialize;

use super::render::processors;
use super::submit::{Order, SubmitReport, Target};
use crate::error::{Ending, Error};
use crate::farm::local::{LocalFarm, Troubles};
use crate::farm::submit::Submission;
use crate::farm::view::Job;
use crate::load::{self, Scene};
use crate::options::{Context, Existing, PlaceOptions};
use crate::output::{self, Report, say};
use crate::stop::Stop;

/// The scene, part of the program, so that the demo needs no file.
const SCENE: &str = include_str!("../../scenes/demo.toml");

/// Worker processes.
const WORKERS: usize = 2;

#[derive(Args, Debug)]
pub(crate) struct Demo {
    /// Folder for frames and movie; it is made if it is not there.
    #[arg(short, long, value_name = "DIR", default_value = "flyby-demo")]
    out: PathBuf,

    /// What to do about frames that are there already.
    #[arg(long, value_enum, default_value_t)]
    existing: Existing,
}

/// `demo`.
#[derive(Serialize)]
struct DemoReport {
    /// Where everything is.
    folder: PathBuf,
    /// Frames in there.
    frames: usize,
    /// The movie, where ffmpeg made one.
    movie: Option<PathBuf>,
    /// The job as it ended; null where every frame was there already.
    result: Option<Job>,
}

/// Runs the command.
pub(crate) fn run(context: &Context, options: &Demo) -> Result<Ending, Error> {
    let source = Source {
        name: "demo.toml".to_owned(),
        text: SCENE.to_owned(),
    };
    let loaded = scene::parse(source, "demo", Path::new("."), &Overrides::default());
    let scene = Scene::new(loaded.map_err(|error| load::mistakes(&error))?)?;
    let frames = scene.frames(None)?;
    let stop = Stop::on_signals()?;
    let order = Order {
        submission: Submission {
            scene: &scene,
            name: &scene.description().name,
            frames,
            tile: None,
            min_tile_pixels: None,
            place: PlaceOptions::default(),
            formats: Formats::new([image::Format::Exr, image::Format::Png8]),
            settings_json: serde_json::json!({ "scene": "demo.toml" }).to_string(),
        },
        target: Some(Target {
            folder: &options.out,
            existing: options.existing,
            movie: true,
        }),
        watch: true,
    };
    let troubles = Troubles::default();
    let carried_out = order.carry_out(&stop, || {
        say(format_args!(
            "starting a coordinator and {WORKERS} workers on this machine"
        ));
        let threads = (processors() / WORKERS).max(1);
        let farm = LocalFarm::start(WORKERS, threads, &stop, &troubles)?;
        let (context, options) = farm.context(context);
        Ok((context, options, farm))
    });
    let done = carried_out.map_err(|error| match (troubles.first(), error.ending()) {
        (Some(trouble), _) => trouble,
        (None, Ending::Interrupted) => interrupted(&options.out),
        (None, _) => error,
    })?;
    let report = DemoReport::new(options, frames.count() as usize, done);
    let ending = report
        .result
        .as_ref()
        .map_or(Ending::Done, crate::farm::follow::ending);
    output::print(context.output, &report)?;
    Ok(ending)
}

fn interrupted(folder: &Path) -> Error {
    let folder = folder.display();
    Error::interrupted("the demo was interrupted, and its processes are gone").next(format!(
        "frames that were finished are in `{folder}`: run the same command again to render the others"
    ))
}

impl DemoReport {
    fn new(options: &Demo, frames: usize, done: SubmitReport) -> Self {
        let missing = |job: &Job| job.images_total.saturating_sub(job.images_done) as usize;
        let missing = done.result.as_ref().map_or(0, missing);
        Self {
            folder: options.out.clone(),
            frames: frames.saturating_sub(missing),
            movie: done.movie,
            result: done.result,
        }
    }
}

impl Report for DemoReport {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let folder = self.folder.display();
        if let Some(job) = &self.result {
            job.table(out)?;
        }
        writeln!(out, "{} frames, each EXR and PNG: {folder}", self.frames)?;
        if let Some(movie) = &self.movie {
            writeln!(out, "the movie: {}", movie.display())?;
        }
        if self.frames == 0 {
            return Ok(());
        }
        writeln!(
            out,
            "one frame in numbers: flyby image info {folder}/demo_0000.exr"
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.folder.display())
    }
}
