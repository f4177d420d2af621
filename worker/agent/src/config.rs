//! What a worker is started with, and why one does not start.

use std::io;
use std::num::NonZeroU32;
use std::path::PathBuf;

use model::Span;

use crate::admission::Admission;

/// What a worker is started with. None of it changes a pixel.
#[derive(Clone, Debug)]
pub struct Config {
    /// How it gets to the coordinator.
    pub admission: Admission,
    /// What the worker calls itself, 1 to 200 bytes.
    pub name: String,
    /// Render threads; each renders one tile at a time.
    pub threads: NonZeroU32,
    /// Tiles held beyond those; `None`: as many as it takes that no thread waits.
    pub ahead: Option<u32>,
    /// Where its id and the assets it fetched are kept; `None`: nowhere.
    pub state: Option<PathBuf>,
    /// This program's version, shown to users.
    pub build: String,
    /// The memory of this machine in bytes; 0 is not known.
    pub memory_bytes: u64,
    /// Labels that jobs may ask for.
    pub labels: Vec<String>,
    /// It leaves where it has nothing to do for so long; `None`: it waits for ever.
    pub idle: Option<Span>,
    /// How long it may run from its start; it leaves in time. `None`: nobody set a limit.
    pub time_limit: Option<Span>,
}

impl Config {
    /// A worker of so many threads, with the usual settings.
    pub fn new(admission: Admission, name: impl Into<String>, threads: NonZeroU32) -> Self {
        Self {
            admission,
            name: name.into(),
            threads,
            ahead: None,
            state: None,
            build: String::new(),
            memory_bytes: 0,
            labels: Vec::new(),
            idle: None,
            time_limit: None,
        }
    }
}

/// Why a worker could not run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Its state folder cannot be used.
    #[error("cannot {attempted} {}", path.display())]
    State {
        /// What was attempted, as it stands after "cannot".
        attempted: &'static str,
        /// On which path.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The system has no random numbers.
    #[error("the system gives no random numbers: {0}")]
    Random(String),
    /// The system refused a thread.
    #[error("cannot start a render thread")]
    Thread(#[source] io::Error),
}
