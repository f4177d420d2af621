//! What the daemons share: their log, their runtime, how they say that they run.

use std::future::Future;
use std::io::{self, IsTerminal as _, Read as _, Write};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::thread;

use clap::Args;
use serde::Serialize;
use tracing_subscriber::EnvFilter;

use crate::error::Error;
use crate::output::{self, Format, Report};
use crate::stop::Stop;

/// Options of the daemons.
#[derive(Args, Clone, Debug)]
pub(crate) struct DaemonOptions {
    /// What to log to standard error: error, warn, info, debug, trace, or parts of the
    /// program with their levels (`info,server=debug`).
    #[arg(long, value_name = "FILTER", default_value = "info")]
    log: String,

    /// Stop when standard input ends, as the processes of `flyby demo` do.
    #[arg(long)]
    while_input_open: bool,
}

impl DaemonOptions {
    /// Starts the log.
    pub(crate) fn log(&self) -> Result<(), Error> {
        let filter = EnvFilter::builder().parse(&self.log).map_err(|error| {
            Error::usage(format!("`--log {}` is no filter", self.log)).because(error)
        })?;
        tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_writer(io::stderr)
            .with_ansi(io::stderr().is_terminal())
            .init();
        Ok(())
    }

    /// Has `stop` set when standard input ends, if that is asked for.
    pub(crate) fn stop_with_input(&self, stop: &Stop) {
        if !self.while_input_open {
            return;
        }
        let stop = stop.clone();
        thread::spawn(move || {
            let mut input = io::stdin().lock();
            let mut bytes = [0; 256];
            // What is written there means nothing; its end, or an error, means that nobody is left.
            while matches!(input.read(&mut bytes), Ok(1..)) {}
            stop.now();
        });
    }
}

/// Runs a daemon's work on a runtime with a thread per core.
pub(crate) fn block_on<T>(work: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
    tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|error| Error::failed("cannot start the runtime").because(error))?
        .block_on(work)
}

/// Name and version of this program, as frames and farms know it.
pub(crate) fn software() -> String {
    format!("flyby {}", env!("CARGO_PKG_VERSION"))
}

/// A coordinator that has started: what it prints once it listens.
#[derive(Serialize)]
pub(crate) struct Started {
    /// Where it listens.
    address: SocketAddr,
    /// Its state folder.
    state: PathBuf,
    /// Its process.
    pid: u32,
}

impl Started {
    /// A coordinator that listens.
    pub(crate) fn coordinator(address: SocketAddr, state: &Path) -> Self {
        Self {
            address,
            state: state.to_owned(),
            pid: std::process::id(),
        }
    }
}

impl Report for Started {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "The coordinator listens on {}, with its state in {}.",
            self.address,
            self.state.display()
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.address)
    }
}

/// Says that a daemon runs; that nobody reads it is no reason to stop.
pub(crate) fn say_started(format: Format, started: &Started) -> Result<(), Error> {
    match output::print(format, started) {
        Err(error) if !error.is_broken_pipe() => Err(error),
        _ => Ok(()),
    }
}
