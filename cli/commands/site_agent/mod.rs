//! `flyby site-agent`: what a coordinator calls on a login node in poll mode, and what the tasks of its arrays run: the
//! six scripts of thesis §C.3.1. Nobody types it; `cluster::orders` says what is asked and answered.
//!
//! Every call may be cut off at any point and made again. Only one that submits makes a folder: where `flyby site clean` has removed it
//! a look does not bring it back.

mod end;
mod folder;
mod look;
mod run;
mod sub;

use std::io::{self, Read as _, Write as _};
use std::path::PathBuf;

use clap::{Args, Subcommand};
use cluster::ClusterError;
use cluster::orders::Look;
use serde::de::DeserializeOwned;

use self::folder::Folder;
use crate::error::{Ending, Error};

/// Most bytes of a request: an image of 75,000 tiles has 8 MB.
const REQUEST_BYTES_MAX: u64 = 64 << 20;

#[derive(Subcommand, Debug)]
pub(crate) enum SiteAgent {
    /// Renders the tile of one task: what an array runs.
    Run(Run),
    /// Submits an image, or the rest of one, as an array; prints the queue's number of it.
    Sub(Where),
    /// Ends arrays or tasks.
    Del(Where),
    /// Says how the arrays stand.
    Ls(Where),
    /// Says how the arrays stand, and sends blocks that are finished.
    Get(Where),
    /// Removes arrays that have ended, and scenes.
    Rm(Where),
}

#[derive(Args, Debug)]
pub(crate) struct Where {
    /// The folder of the farm at this site.
    #[arg(long, value_name = "DIR")]
    folder: PathBuf,
}

#[derive(Args, Debug)]
pub(crate) struct Run {
    /// The folder of the farm at this site.
    #[arg(long, value_name = "DIR")]
    folder: PathBuf,

    /// The array's name.
    #[arg(long, value_name = "NAME")]
    array: String,

    /// The task's number, from 1.
    #[arg(long, value_name = "N")]
    task: u32,
}

/// Runs the command.
pub(crate) fn run(command: &SiteAgent) -> Result<Ending, Error> {
    match command {
        SiteAgent::Run(run) => {
            run::run(&Folder::new(&run.folder), &run.array, run.task)?;
        }
        SiteAgent::Sub(place) => {
            let id = sub::submit(&Folder::made(&place.folder)?, read()?)?;
            say(format!("{id}\n").as_bytes())?;
        }
        SiteAgent::Del(place) => end::delete(&Folder::new(&place.folder), read()?)?,
        SiteAgent::Ls(place) => {
            let request = Look {
                wants: Vec::new(),
                ..read()?
            };
            look::look(&Folder::new(&place.folder), request)?;
        }
        SiteAgent::Get(place) => look::look(&Folder::new(&place.folder), read()?)?,
        SiteAgent::Rm(place) => end::remove(&Folder::new(&place.folder), &read()?)?,
    }
    Ok(Ending::Done)
}

/// The request on standard input.
fn read<T: DeserializeOwned>() -> Result<T, Error> {
    let mut text = Vec::new();
    let read = io::stdin().take(REQUEST_BYTES_MAX).read_to_end(&mut text);
    read.map_err(|error| Error::failed("cannot read the request").because(error))?;
    serde_json::from_slice(&text).map_err(|error| {
        Error::usage("the request on standard input cannot be understood")
            .because(error)
            .next("coordinator and site may have different versions: `flyby site install SITE`")
    })
}

fn say(bytes: &[u8]) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    let said = out.write_all(bytes).and_then(|()| out.flush());
    said.map_err(|error| Error::failed("cannot answer").because(error))
}

/// What the queue said, or why it could not be asked.
fn queue(attempt: &str) -> impl Fn(ClusterError) -> Error {
    let attempt = attempt.to_owned();
    move |error| {
        let next = error.next();
        Error::failed(attempt.clone()).because(error).next(next)
    }
}
