//! `flyby bench techniques`: what each technique of the tracer gains, what each method costs, and that none changes a pixel.

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};

use crate::bench::techniques::{Measured, SCENES, Techniques};
use crate::error::{Ending, Error};
use crate::options::Context;
use crate::output;
use crate::progress::Progress;

#[derive(Args, Debug)]
pub(crate) struct Options {
    /// Scenes to measure [default: all].
    #[arg(value_name = "SCENE", value_parser = scenes())]
    scenes: Vec<String>,

    /// Pixels along a side.
    #[arg(long, value_name = "N", default_value_t = 96,
          value_parser = clap::value_parser!(u32).range(8..=1024))]
    side: u32,

    /// N of the N × N rays per pixel of the scene whose camera flies.
    #[arg(long, value_name = "N", default_value_t = 4,
          value_parser = clap::value_parser!(u32).range(1..=16))]
    rays: u32,
}

fn scenes() -> PossibleValuesParser {
    SCENES
        .iter()
        .map(|(name, _)| PossibleValue::new(name))
        .collect::<Vec<_>>()
        .into()
}

/// Runs the command; fails if a pixel differs.
pub(crate) fn run(context: &Context, options: &Options) -> Result<Ending, Error> {
    let folder = tempfile::tempdir()
        .map_err(|error| Error::failed("cannot make a folder for the scenes").because(error))?;
    let mut progress = Progress::new(context.output, SCENES.len() as u64, 0);
    let mut techniques = Techniques {
        side: options.side,
        scenes: Vec::new(),
    };
    for (number, (name, ours)) in (0..).zip(SCENES) {
        if !options.scenes.is_empty() && !options.scenes.iter().any(|scene| scene == name) {
            continue;
        }
        progress.update(number, name);
        let mut more = vec![format!("film.resolution=\"{0}x{0}\"", options.side)];
        if name == "flight" {
            more.push(format!("sampling.rays={}", options.rays));
        }
        let scene = ours.load(folder.path(), &more)?;
        techniques.scenes.push(Measured::of(name, &scene)?);
    }
    progress.finish();
    output::print(context.output, &techniques)?;
    let mut all = techniques.scenes.iter().flat_map(Measured::others);
    Ok(if all.all(|one| one.is_equal) {
        Ending::Done
    } else {
        Ending::Different
    })
}
