//! `flyby scene`: what is wrong with a scene, what it holds, what may stand in one.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Subcommand;
use scene::{Mistake, Source, Summary};
use serde::Serialize;
use serde_json::Value;

use crate::error::{Ending, Error};
use crate::load::{self, Scene};
use crate::options::{Context, SceneOptions};
use crate::output::{self, Format, Report};

#[derive(Subcommand, Debug)]
pub(crate) enum SceneCommand {
    /// Reports every mistake of a scene with its place (exit code 2 if there is one).
    Check(SceneOptions),
    /// Says what a scene holds once it is read: size, frames, camera, fields, digest.
    Show(SceneOptions),
    /// Prints the JSON Schema of scene files, which editors complete and check by.
    Schema,
}

/// Runs the command.
pub(crate) fn run(context: &Context, command: SceneCommand) -> Result<Ending, Error> {
    match command {
        SceneCommand::Check(options) => check(context, &options),
        SceneCommand::Show(options) => show(context, &options),
        SceneCommand::Schema => schema(),
    }
}

/// `scene check`.
#[derive(Serialize)]
struct Check {
    /// The scene file.
    scene: PathBuf,
    /// Whether it can be rendered.
    valid: bool,
    /// Its digest with all settings, if so.
    digest: Option<String>,
    /// What is wrong, in the order of the places.
    mistakes: Vec<Found>,
    /// What is allowed but hardly meant.
    warnings: Vec<Found>,
}

/// A mistake or a warning.
#[derive(Serialize)]
struct Found {
    /// The file, or the option that it stands in.
    source: String,
    /// Its line, from 1.
    line: usize,
    /// Its column, in characters from 1.
    column: usize,
    /// What is wrong.
    message: String,
    /// A few words about the place.
    label: String,
    /// What to do about it.
    help: Option<String>,
}

impl Found {
    fn all(mistakes: &[Mistake], sources: &[Source]) -> Vec<Self> {
        let found = |mistake: &Mistake| {
            let source = &sources[mistake.place.source];
            let (line, column) = source.line_and_column(mistake.place.span.start);
            Self {
                source: source.name.clone(),
                line,
                column,
                message: mistake.message.clone(),
                label: mistake.label.clone(),
                help: mistake.help.clone(),
            }
        };
        mistakes.iter().map(found).collect()
    }
}

fn check(context: &Context, options: &SceneOptions) -> Result<Ending, Error> {
    load::readable(&options.scene)?;
    let scene = options.scene.clone();
    match scene::load(&scene, &options.overrides()) {
        Ok(loaded) => {
            let warnings = Found::all(&loaded.warnings, &loaded.sources);
            let named = Scene::new(loaded)?;
            let check = Check {
                scene,
                valid: true,
                digest: Some(named.digest.to_string()),
                mistakes: Vec::new(),
                warnings,
            };
            output::print(context.output, &check)?;
            Ok(Ending::Done)
        }
        // People are shown the lines; programs are told the places.
        Err(error) if context.output == Format::Json => {
            let check = Check {
                scene,
                valid: false,
                digest: None,
                mistakes: Found::all(&error.mistakes, &error.sources),
                warnings: Vec::new(),
            };
            output::print(context.output, &check)?;
            Ok(Ending::Usage)
        }
        Err(error) => Err(load::mistakes(&error)),
    }
}

impl Report for Check {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let digest = self.digest.as_deref().unwrap_or_default();
        writeln!(
            out,
            "{}: no mistakes; digest {digest}",
            self.scene.display()
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.digest.as_deref().unwrap_or_default())
    }
}

/// `scene show`: the scene's own summary.
#[derive(Serialize)]
#[serde(transparent)]
struct Show(Summary);

fn show(context: &Context, options: &SceneOptions) -> Result<Ending, Error> {
    let scene = options.load()?;
    let summary = scene::describe(scene.description())
        .map_err(|error| Error::usage("this scene cannot be rendered").because(error))?;
    output::print(context.output, &Show(summary))?;
    Ok(Ending::Done)
}

impl Report for Show {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let fields = serde_json::to_value(&self.0).map_err(io::Error::other)?;
        for (name, value) in fields.as_object().into_iter().flatten() {
            let name = name.replace('_', " ");
            match value {
                Value::String(text) => writeln!(out, "{name:<16} {text}")?,
                value => writeln!(out, "{name:<16} {value}")?,
            }
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.0.digest)
    }
}

fn schema() -> Result<Ending, Error> {
    let mut out = io::stdout().lock();
    serde_json::to_writer_pretty(&mut out, &scene::schema())
        .map_err(io::Error::from)
        .and_then(|()| writeln!(out))
        .map_err(|error| Error::failed("cannot print the schema").because(error))?;
    Ok(Ending::Done)
}
