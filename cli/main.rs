//! The `flyby` program: the only place where all parts meet.
//!
//! `main` reads the environment and the configuration file once ([`twins`], [`places`]), lets
//! clap read the command line, and hands the command what it needs; no other file looks at
//! the environment. Each command stands in a file of its own under `commands/`.

mod bench;
mod caret;
mod commands;
mod daemon;
mod error;
mod existing;
mod farm;
mod gallery;
mod load;
mod movie;
mod noise;
mod options;
mod output;
mod places;
mod plot;
mod progress;
mod render;
mod site;
mod stop;
mod twins;
mod values;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory as _, FromArgMatches as _};

use commands::Cli;
use error::{Ending, Error};
use places::{Named, Surroundings};
use twins::{ConfigFile, Sources};

fn main() -> ExitCode {
    let ended = match run() {
        Ok(ending) => ending,
        // Whoever read the output has what he wanted.
        Err(error) if error.is_broken_pipe() => Ending::Done,
        Err(error) => {
            output::say(format_args!("error: {error}"));
            error.ending()
        }
    };
    ended.into()
}

fn run() -> Result<Ending, Error> {
    let environment: BTreeMap<OsString, OsString> = std::env::vars_os().collect();
    let around = Surroundings::new(&environment);
    let sources = Sources {
        file: read_configuration(&around)?,
        environment,
    };
    let program = twins::apply(Cli::command(), &sources)?;
    let parsed = program
        .try_get_matches()
        .and_then(|matches| Cli::from_arg_matches(&matches));
    match parsed {
        Ok(cli) => commands::run(cli, around.state_folder()),
        Err(error) => {
            // clap prints help to standard output and mistakes to standard error.
            let _ = error.print();
            Ok(if error.use_stderr() {
                Ending::Usage
            } else {
                Ending::Done
            })
        }
    }
}

fn read_configuration(around: &Surroundings) -> Result<ConfigFile, Error> {
    let Some((path, named)) = around.config_file() else {
        return Ok(ConfigFile::default());
    };
    match std::fs::read_to_string(&path) {
        Ok(text) => ConfigFile::parse(path.display().to_string(), &text),
        Err(error) if named == Named::ByCustom && error.kind() == std::io::ErrorKind::NotFound => {
            Ok(ConfigFile::default())
        }
        Err(error) => {
            let path = path.display();
            Err(Error::usage(format!("cannot read the configuration `{path}`")).because(error))
        }
    }
}
