//! `flyby render`: renders frames in this process; interrupted, it goes on where it was.

use std::io::{self, Write};
use std::iter;
use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use image::{Format, FrameMetadata, Opened};
use model::{Digest, ImageNumber, Resolution};
use render::{Arithmetic, EvalSettings, Means, SimdLevel};
use serde::Serialize;

use super::job::make_folder;
use crate::daemon::software;
use crate::error::{Ending, Error};
use crate::existing::{Survey, Wanted, stem, survey};
use crate::load::Scene;
use crate::movie::{self, Movie};
use crate::options::{Context, FileOptions, FrameOptions, SceneOptions};
use crate::output::{self, Report, say};
use crate::progress::{Progress, amount, duration};
use crate::render::{Done, News, Outcome, Plan, Statistics};
use crate::stop::Stop;
use crate::values;

#[derive(Args, Debug)]
pub(crate) struct Render {
    #[command(flatten)]
    scene: SceneOptions,

    #[command(flatten)]
    frames: FrameOptions,

    /// Folder for the frames; it is made if it is not there [default: the scene's name].
    #[arg(short, long, value_name = "DIR", help_heading = "Results")]
    out: Option<PathBuf>,

    #[command(flatten)]
    files: FileOptions,

    /// Also report what was counted (rays, evaluations, steps), averages per ray, and time by part.
    #[arg(long, help_heading = "Results")]
    stats: bool,

    /// Render threads [default: one for each processor].
    #[arg(long, value_name = "N", value_parser = values::at_least_one, help_heading = "How to compute it")]
    threads: Option<usize>,

    /// Size of the tiles that the work is done in; pixels do not depend on it.
    #[arg(long, value_name = "WxH", value_parser = values::resolution, help_heading = "How to compute it")]
    tile: Option<Resolution>,

    /// Instruction set; pixels do not depend on it [default: the best of this machine].
    #[arg(long, value_name = "LEVEL", help_heading = "How to compute it")]
    simd: Option<SimdLevel>,

    /// How rays find how far they may step; pixels do not depend on it. `auto` tries all that may be fastest on some rays of each image.
    #[arg(long, value_name = "METHOD", default_value = AUTO, value_parser = methods(), help_heading = "How to compute it")]
    method: String,
}

/// The method that chooses.
const AUTO: &str = "auto";

fn methods() -> PossibleValuesParser {
    let about = |means| match means {
        Means::Values => {
            "speculative sphere tracing (thesis fig. 5.5) by local bounds of the field's change"
        }
        Means::Tangents => "also by derivatives along the ray",
        Means::Stretches => "also by the derivative's range on the stretch ahead",
        Means::Ranges(Arithmetic::Intervals) => "subdivision (thesis fig. 5.8) by intervals",
        Means::Ranges(Arithmetic::Affine) => "subdivision by affine forms",
        Means::Ranges(Arithmetic::Reduced) => "subdivision by reduced affine forms",
    };
    let auto = PossibleValue::new(AUTO).help("the cheapest on some rays of each image");
    let means = Means::ALL.map(|means| PossibleValue::new(means.name()).help(about(means)));
    iter::once(auto).chain(means).collect::<Vec<_>>().into()
}

/// `render`.
#[derive(Serialize)]
struct RenderReport {
    /// Where the frames are.
    folder: PathBuf,
    /// Digest of the scene with all its settings.
    scene_digest: String,
    /// Revision of the renderer.
    revision: u32,
    /// The frames asked for, in order.
    frames: Vec<Frame>,
    /// Frames that this run finished.
    frames_rendered: usize,
    /// Frames that were there already.
    frames_kept: usize,
    /// Blocks that this run rendered.
    blocks_rendered: u64,
    /// Blocks that an interrupted run had left in scratch files.
    blocks_kept: u64,
    /// Pixels that this run rendered.
    pixels_rendered: u64,
    /// Pixels that an interrupted run had left in scratch files.
    pixels_kept: u64,
    /// How long it took, in seconds.
    seconds: f64,
    /// Render threads.
    threads: usize,
    /// What was counted and measured in this run, where `--stats` asks for it.
    statistics: Option<Statistics>,
    /// The movie, where one was made.
    movie: Option<PathBuf>,
}

/// One frame.
#[derive(Serialize)]
struct Frame {
    /// Its number.
    frame: u32,
    /// Digest of all its values, where an EXR or PNG says it.
    film_digest: Option<String>,
    /// Its files.
    files: Vec<PathBuf>,
    /// Whether it was there already.
    kept: bool,
}

/// Runs the command.
pub(crate) fn run(context: &Context, options: &Render) -> Result<Ending, Error> {
    let scene = options.scene.load()?;
    let images: Vec<ImageNumber> = scene.frames(options.frames.frames)?.iter().collect();
    let name = stem(&scene.description().name);
    let folder = options.out.clone().unwrap_or_else(|| name.clone().into());
    let formats = options.files.formats();
    let stop = Stop::on_signals()?;
    make_folder(&folder)?;
    let wanted = Wanted {
        folder: &folder,
        stem: &name,
        images: &images,
        formats,
        scene: scene.digest,
        revision: render::REVISION,
    };
    let Survey { kept, missing } = survey(&wanted, options.files.existing)?;
    if !kept.is_empty() {
        say(format_args!(
            "{} of {} frames are in `{}` already, of this scene and these settings: they are kept \
             (`--existing replace` renders them again)",
            kept.len(),
            images.len(),
            folder.display()
        ));
    }
    let assets = scene.assets();
    let plan = Plan {
        description: scene.description(),
        digest: scene.digest,
        assets: &assets,
        images: missing,
        folder: folder.clone(),
        stem: name.clone(),
        formats,
        tile: options.tile,
        threads: options.threads.unwrap_or_else(processors),
        settings: EvalSettings {
            level: options.simd.unwrap_or_else(SimdLevel::best),
            means: Means::from_name(&options.method),
        },
        metadata: metadata(&scene, &options.scene),
    };
    let outcome = render(context, &plan, &stop)?;
    let movie = if options.files.movie {
        let frames: Vec<PathBuf> = images
            .iter()
            .map(|image| wanted.path(*image, Format::Png8))
            .collect();
        let fps = scene.description().film.fps;
        movie_of(&folder, &name, &frames, fps, &stop)?
    } else {
        None
    };
    let report = RenderReport {
        scene_digest: scene.digest.to_string(),
        revision: render::REVISION,
        frames: frames(&wanted, &kept, &outcome),
        frames_rendered: outcome.frames.len(),
        frames_kept: kept.len(),
        blocks_rendered: outcome.blocks,
        blocks_kept: outcome.blocks_found,
        pixels_rendered: outcome.counts.pixels,
        pixels_kept: outcome.pixels_found,
        seconds: outcome.wall.as_secs_f64(),
        threads: plan.threads,
        statistics: options
            .stats
            .then(|| Statistics::new(&outcome.counts, &outcome.spent, &outcome.methods)),
        movie,
        folder,
    };
    output::print(context.output, &report)?;
    Ok(Ending::Done)
}

/// One thread for each processor that this process may use.
pub(crate) fn processors() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// Makes a movie of the frames, or says why there is none.
pub(crate) fn movie_of(
    folder: &std::path::Path,
    stem: &str,
    frames: &[PathBuf],
    fps: f64,
    stop: &Stop,
) -> Result<Option<PathBuf>, Error> {
    match movie::make(folder, stem, frames, fps, stop)? {
        Movie::Made(path) => Ok(Some(path)),
        Movie::NoEncoder => {
            say(movie::HOW_TO_INSTALL);
            Ok(None)
        }
    }
}

fn metadata(scene: &Scene, options: &SceneOptions) -> FrameMetadata {
    FrameMetadata {
        scene_digest: scene.digest,
        revision: render::REVISION,
        settings: options.settings_json(),
        statistics: String::new(),
        software: software(),
        frames_per_second: scene.description().film.fps,
        comments: String::new(),
    }
}

/// Renders with a progress bar; where it is interrupted, says what is left and how to go on.
fn render(context: &Context, plan: &Plan<'_>, stop: &Stop) -> Result<Outcome, Error> {
    let window = plan.description.film.window.area();
    let frames = plan.images.len();
    let mut progress = Progress::new(context.output, window * frames as u64, 0);
    let mut finished = 0_u32;
    let rendered = crate::render::render(plan, stop, |done, news| {
        match news {
            News::Found(image, opened) => progress.say(found(image, opened, window)),
            News::Frame => finished += 1,
            News::Progress => {}
        }
        show(&mut progress, done, finished, frames);
    });
    progress.finish();
    rendered.map_err(|error| {
        if error.ending() != Ending::Interrupted {
            return error;
        }
        let folder = plan.folder.display();
        Error::interrupted(format!(
            "interrupted: {finished} of {frames} frames are done, and what was rendered of others is \
             in hidden scratch files in `{folder}`"
        ))
        .next("run the same command again: it goes on where it was")
    })
}

fn show(progress: &mut Progress, done: Done, finished: u32, frames: usize) {
    progress.set_before(done.pixels_found);
    let about = format!(
        "frame {finished} of {frames}, {:.2} frames/s, {}rays/s",
        progress.rate(f64::from(finished)),
        amount(progress.rate(done.rays as f64)),
    );
    progress.update(done.pixels, about);
}

/// What to say about a scratch file that was there.
fn found(image: ImageNumber, opened: Opened, window: u64) -> String {
    match opened {
        Opened::Resumed { pixels_done, .. } => {
            let percent = pixels_done * 100 / window.max(1);
            format!("frame {image} goes on where it was: {percent} % are rendered already")
        }
        Opened::StartedAnew | Opened::New => format!(
            "frame {image} was begun with another scene or other settings: it is begun anew"
        ),
    }
}

/// Every frame asked for, rendered now or kept.
fn frames(
    wanted: &Wanted<'_>,
    kept: &[(ImageNumber, Option<Digest>)],
    outcome: &Outcome,
) -> Vec<Frame> {
    let rendered = outcome.frames.iter();
    let rendered = rendered.map(|(image, frame)| (*image, Some(frame.film_digest), false));
    let kept = kept.iter().map(|(image, film)| (*image, *film, true));
    let mut frames: Vec<_> = rendered.chain(kept).collect();
    frames.sort_by_key(|(image, ..)| *image);
    let frames = frames.into_iter().map(|(image, film, kept)| Frame {
        frame: image.0,
        film_digest: film.map(|digest| digest.to_string()),
        files: wanted
            .formats
            .iter()
            .map(|format| wanted.path(image, format))
            .collect(),
        kept,
    });
    frames.collect()
}

impl Report for RenderReport {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "{} frames in {}: {} rendered, {} kept",
            self.frames.len(),
            self.folder.display(),
            self.frames_rendered,
            self.frames_kept
        )?;
        writeln!(
            out,
            "took {} on {} threads; scene {}",
            duration(Duration::from_secs_f64(self.seconds)),
            self.threads,
            &self.scene_digest[..16]
        )?;
        if let Some(statistics) = &self.statistics {
            statistics.table(out)?;
        }
        if let Some(movie) = &self.movie {
            writeln!(out, "movie {}", movie.display())?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut files = self.frames.iter().flat_map(|frame| &frame.files);
        files.try_for_each(|file| writeln!(out, "{}", file.display()))
    }
}
