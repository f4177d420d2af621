//! `flyby bench threads`: what threads of one process do beside as many processes.

use std::path::{Path, PathBuf};

use clap::Args;
use model::Resolution;

use crate::bench::threads::{BUDGET, Measured, SCENES, Threads, rays, render};
use crate::error::{Ending, Error};
use crate::existing::stem;
use crate::load::readable;
use crate::options::Context;
use crate::output;
use crate::progress::Progress;
use crate::stop::Stop;

#[derive(Args, Debug)]
pub(crate) struct Options {
    /// Scene files whose image 0 is rendered [default: the scenes of `bench peers`, with as many rays as take over a second].
    #[arg(value_name = "SCENE")]
    scenes: Vec<PathBuf>,

    /// Threads, and processes beside them.
    #[arg(long, value_name = "N", default_value_t = 2,
          value_parser = clap::value_parser!(u32).range(2..=256))]
    threads: u32,

    /// Pairs of each scene; the median counts.
    #[arg(long, value_name = "N", default_value_t = 5,
          value_parser = clap::value_parser!(u32).range(1..=1_000))]
    runs: u32,

    /// Pixels of every scene, as `render` takes them: for scenes that would take less than a second.
    #[arg(long, value_name = "WxH", value_parser = crate::values::resolution)]
    resolution: Option<Resolution>,
}

impl Options {
    /// What `render` is told of the resolution.
    fn size(&self) -> impl Iterator<Item = String> {
        let size = self
            .resolution
            .map(|size| format!("{}x{}", size.width, size.height));
        size.into_iter()
            .flat_map(|size| ["--resolution".to_owned(), size])
    }
}

/// What is rendered.
struct Chosen {
    name: String,
    file: PathBuf,
    /// Options of `render`.
    settings: Vec<String>,
}

/// Runs the command.
pub(crate) fn run(context: &Context, options: &Options) -> Result<Ending, Error> {
    let folder = tempfile::tempdir()
        .map_err(|error| Error::failed("cannot make a folder for the frames").because(error))?;
    let stop = Stop::on_signals()?;
    let chosen = chosen(options, folder.path())?;
    let total = chosen.len() as u64 * u64::from(options.runs);
    let mut progress = Progress::new(context.output, total, 0);
    let mut done = 0;
    let mut threads = Threads {
        threads: options.threads,
        runs: options.runs,
        budget: BUDGET,
        scenes: Vec::new(),
    };
    for Chosen {
        name,
        file,
        settings,
    } in chosen
    {
        let mut pairs = Vec::new();
        for turn in 0..options.runs {
            if stop.is_set() {
                return Err(Error::interrupted("the measurement was stopped"));
            }
            progress.update(done, name.clone());
            let together = || render(&file, &settings, folder.path(), (1, options.threads));
            let apart = || render(&file, &settings, folder.path(), (options.threads, 1));
            // Whatever comes and goes beside it falls on both sides.
            pairs.push(if turn % 2 == 0 {
                let first = together()?;
                (first, apart()?)
            } else {
                let first = apart()?;
                (together()?, first)
            });
            done += 1;
        }
        threads.scenes.extend(Measured::of(name, &pairs));
    }
    progress.finish();
    output::print(context.output, &threads)?;
    Ok(Ending::Done)
}

fn chosen(options: &Options, folder: &Path) -> Result<Vec<Chosen>, Error> {
    if options.scenes.is_empty() {
        return SCENES
            .into_iter()
            .map(|(name, ours)| {
                let place = folder.join(name);
                std::fs::create_dir_all(&place)
                    .map_err(|error| Error::failed("cannot make a folder").because(error))?;
                let file = ours.write(&place)?;
                let mut settings = vec!["--rays".to_owned(), "1".to_owned()];
                settings.extend(options.size());
                for set in ours.set {
                    settings.extend(["--set".to_owned(), (*set).to_owned()]);
                }
                let once = render(&file, &settings, &place, (1, 1))?;
                let rays = rays(once.seconds, options.threads);
                if rays > 1 {
                    settings[1] = rays.to_string();
                    settings.extend(["--set", "sampling.filter_order=4"].map(str::to_owned));
                }
                Ok(Chosen {
                    name: name.to_owned(),
                    file,
                    settings,
                })
            })
            .collect();
    }
    let files = options.scenes.iter();
    files
        .map(|file| {
            readable(file)?;
            let name = file.file_stem().unwrap_or_default().to_string_lossy();
            Ok(Chosen {
                name: stem(&name),
                file: file.clone(),
                settings: options.size().collect(),
            })
        })
        .collect()
}
