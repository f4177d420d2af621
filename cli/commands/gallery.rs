//! `flyby gallery`: the figures of the thesis that have a formula, rendered into one page.

use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use image::{Format, Formats, FrameMetadata, frame_name};
use model::ImageNumber;
use render::EvalSettings;
use serde::Serialize;

use super::job::make_folder;
use super::render::processors;
use crate::daemon::software;
use crate::error::{Ending, Error};
use crate::existing::stem;
use crate::gallery::index::{Figure, Index};
use crate::gallery::page;
use crate::gallery::record::{Record, Records};
use crate::gallery::size;
use crate::gallery::telling::{Picture, Telling};
use crate::load::{Scene, mistakes, readable};
use crate::options::{Context, SceneOptions};
use crate::output::{self, Report};
use crate::progress::duration;
use crate::render::{News, Plan};
use crate::stop::Stop;
use crate::values;

#[derive(Args, Debug)]
pub(crate) struct Gallery {
    /// Folder of the scenes; figures/gallery.toml in it lists what is shown.
    #[arg(value_name = "DIR", default_value = "scenes")]
    scenes: PathBuf,

    /// Folder for the page and its pictures; it is made if it is not there.
    #[arg(
        short,
        long,
        value_name = "DIR",
        default_value = "gallery",
        help_heading = "Results"
    )]
    out: PathBuf,

    /// Render only this figure, named by its number or its picture; may be repeated. The page
    /// shows the others too if they are there.
    #[arg(long, value_name = "NAME", help_heading = "What to render")]
    only: Vec<String>,

    /// Render every picture in its scene's own size, with all its rays; without it pictures are at
    /// most 360 pixels wide and high, with four rays a pixel.
    #[arg(long, help_heading = "What to render")]
    full: bool,

    /// Render threads [default: one for each processor].
    #[arg(long, value_name = "N", value_parser = values::at_least_one, help_heading = "How to compute it")]
    threads: Option<usize>,
}

/// `gallery`.
#[derive(Serialize)]
struct GalleryReport {
    /// The page.
    page: PathBuf,
    /// Its figures, in order.
    figures: Vec<Record>,
    /// Pictures that this run rendered.
    rendered: usize,
    /// Pictures that were there already, of these scenes and this renderer.
    kept: usize,
    /// Figures that `--only` left out and that have no picture yet.
    missing: usize,
}

/// Runs the command.
pub(crate) fn run(context: &Context, options: &Gallery) -> Result<Ending, Error> {
    let index = Index::read(&options.scenes.join("figures/gallery.toml"))?;
    for name in &options.only {
        if !index.figures.iter().any(|figure| figure.is_called(name)) {
            return Err(Error::usage(format!("the gallery has no figure `{name}`"))
                .next(format!("choose among {}", index.names())));
        }
    }
    // Mistakes are said before minutes are spent on what stands before them.
    let scenes: Vec<Scene> = index
        .figures
        .iter()
        .map(|figure| scene_of(options, figure))
        .collect::<Result<_, _>>()?;
    let stop = Stop::on_signals()?;
    make_folder(&options.out)?;
    let mut records = Records::read(&options.out);
    let mut report = GalleryReport {
        page: options.out.join("index.html"),
        figures: Vec::new(),
        rendered: 0,
        kept: 0,
        missing: 0,
    };
    let count = index.figures.len();
    for (at, (figure, scene)) in index.figures.iter().zip(&scenes).enumerate() {
        let wanted =
            options.only.is_empty() || options.only.iter().any(|name| figure.is_called(name));
        let record = if let Some(record) = records.of(&options.out, figure, scene) {
            report.kept += 1;
            record
        } else if wanted {
            let record = picture(context, options, (at + 1, count), figure, scene, &stop).map_err(
                |error| error.within(format!("figure {} (`{}`)", figure.number, figure.scene)),
            )?;
            records.keep(&options.out, record.clone())?;
            report.rendered += 1;
            record
        } else {
            report.missing += 1;
            continue;
        };
        report.figures.push(record);
    }
    write_page(options, &index, &report)?;
    output::print(context.output, &report)?;
    Ok(Ending::Done)
}

/// The scene of a figure with what the index and the size of its picture change in it.
fn scene_of(options: &Gallery, figure: &Figure) -> Result<Scene, Error> {
    let mut asked = SceneOptions {
        scene: options.scenes.join(&figure.scene),
        resolution: None,
        rays: None,
        crop: None,
        set: figure.set.clone(),
    };
    readable(&asked.scene)?;
    if !options.full {
        let loaded =
            scene::load(&asked.scene, &asked.overrides()).map_err(|error| mistakes(&error))?;
        let (resolution, rays) = size::on_the_page(&loaded.description, figure);
        (asked.resolution, asked.rays) = (Some(resolution), Some(rays));
    }
    asked.load()
}

/// Renders the picture of one figure.
fn picture(
    context: &Context,
    options: &Gallery,
    place: (usize, usize),
    figure: &Figure,
    scene: &Scene,
    stop: &Stop,
) -> Result<Record, Error> {
    let image = ImageNumber(figure.frame);
    if figure.frame >= scene.description().film.images {
        return Err(Error::usage(format!(
            "the scene `{}` has no frame {}, which figure {} shows",
            figure.scene, figure.frame, figure.number
        )));
    }
    let assets = scene.assets();
    let threads = options.threads.unwrap_or_else(processors);
    let plan = Plan {
        description: scene.description(),
        digest: scene.digest,
        assets: &assets,
        images: vec![image],
        folder: options.out.clone(),
        stem: stem(&figure.name),
        formats: Formats::new([Format::Png8]),
        tile: None,
        threads,
        settings: EvalSettings::default(),
        metadata: FrameMetadata {
            scene_digest: scene.digest,
            revision: render::REVISION,
            settings: String::new(),
            statistics: String::new(),
            software: software(),
            frames_per_second: scene.description().film.fps,
            comments: format!("figure {}", figure.number),
        },
    };
    let total = scene.description().film.window.area();
    let mut telling = Telling::new(context.output, figure, place, total);
    let outcome = crate::render::render(&plan, stop, |done, news| {
        if matches!(news, News::Progress) {
            telling.update(done.pixels);
        }
    });
    telling.finish(match outcome {
        Ok(_) => Picture::Done,
        Err(_) => Picture::Failed,
    });
    let outcome = outcome?;
    Ok(Record {
        name: figure.name.clone(),
        number: figure.number.clone(),
        picture: frame_name(&plan.stem, image, Format::Png8).into(),
        scene_digest: scene.digest.to_string(),
        frame: figure.frame,
        revision: render::REVISION,
        seconds: outcome.wall.as_secs_f64(),
        threads,
        rays: outcome.counts.rays + outcome.counts.shadow_rays,
        evaluations: outcome.counts.evaluations,
    })
}

/// Writes the page next to its pictures, whole or not at all.
fn write_page(options: &Gallery, index: &Index, report: &GalleryReport) -> Result<(), Error> {
    let failed = || Error::failed(format!("cannot write the page `{}`", report.page.display()));
    let shown = report.figures.iter().filter_map(|record| {
        let figure = index
            .figures
            .iter()
            .find(|figure| figure.name == record.name)?;
        Some((figure, record))
    });
    let mut entries = Vec::new();
    for (figure, record) in shown {
        let read = |path: PathBuf| {
            fs::read(&path).map_err(|error| {
                Error::failed(format!("cannot read `{}`", path.display())).because(error)
            })
        };
        entries.push(page::Entry {
            figure,
            record,
            png: read(options.out.join(&record.picture))?,
            scene: String::from_utf8_lossy(&read(options.scenes.join(&figure.scene))?).into_owned(),
        });
    }
    let mut pending =
        tempfile::NamedTempFile::new_in(&options.out).map_err(|error| failed().because(error))?;
    pending
        .write_all(page::html(&entries).as_bytes())
        .map_err(|error| failed().because(error))?;
    pending
        .persist(&report.page)
        .map_err(|error| failed().because(error))?;
    Ok(())
}

impl Report for GalleryReport {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut table = output::columns(["figure", "picture", "time", "rays/s", "evaluations/ray"]);
        for record in &self.figures {
            table.add_row([
                record.number.clone(),
                record.picture.display().to_string(),
                duration(Duration::from_secs_f64(record.seconds)),
                record.rate(),
                format!("{:.1}", record.evaluations_per_ray()),
            ]);
        }
        writeln!(out, "{table}")?;
        writeln!(
            out,
            "{}: {} rendered, {} kept{}",
            self.page.display(),
            self.rendered,
            self.kept,
            match self.missing {
                0 => String::new(),
                missing => format!(", {missing} not rendered yet"),
            }
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.page.display())
    }
}
