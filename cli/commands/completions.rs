//! `flyby completions` and `flyby man`: what shells and manual readers want, made from the options.

use std::fs;
use std::io::{self, Write as _};
use std::path::PathBuf;

use clap::{Args, Command};
use clap_complete::Shell;

use crate::error::{Ending, Error};

#[derive(Args, Debug)]
pub(crate) struct Completions {
    /// The shell.
    shell: Shell,
}

#[derive(Args, Debug)]
pub(crate) struct Man {
    /// Folder for the pages, one for each command; it is made if it is not there.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

/// Prints a completion script.
pub(crate) fn completions(options: &Completions, mut program: Command) -> Result<Ending, Error> {
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut program, "flyby", &mut script);
    io::stdout()
        .lock()
        .write_all(&script)
        .map_err(|error| Error::failed("cannot print the completions").because(error))?;
    Ok(Ending::Done)
}

/// Writes the manual pages.
pub(crate) fn man(options: &Man, program: Command) -> Result<Ending, Error> {
    let written = fs::create_dir_all(&options.folder)
        .and_then(|()| clap_mangen::generate_to(program, &options.folder));
    written.map_err(|error| {
        let folder = options.folder.display();
        Error::failed(format!("cannot write the manual pages to `{folder}`")).because(error)
    })?;
    Ok(Ending::Done)
}
