//! What `sites.toml` says of each site: appendix C's `grid.conf` (thesis §C.3.2).

mod file;
pub(crate) mod microseconds;
mod mistake;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use model::Span;

pub use file::{FILE_BYTES_MAX, parse, read};
pub use mistake::{Mistake, SitesError};

/// All sites, by name.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Sites(pub Vec<Site>);

/// A cluster with a queue of its own, a host, or this machine.
#[derive(Clone, PartialEq, Eq, Debug, serde::Serialize, serde::Deserialize)]
pub struct Site {
    /// What it is called: letters, digits, `-` and `_`, 32 at most.
    pub name: String,
    /// Its queue.
    pub kind: Kind,
    /// Who begins: its workers, or the coordinator.
    pub mode: Mode,
    /// Where ssh logs in; `None`: on this machine.
    pub address: Option<String>,
    /// Further options of ssh, such as `-F`, `/path/to/config`.
    pub ssh_options: Vec<String>,
    /// A line of shell that runs before anything else there, such as `module load slurm`.
    pub setup: Option<String>,
    /// Fewest pixels of a tile, where whole images are submitted.
    pub min_tile_pixels: u64,
    /// Most tasks of one array; the queue's own limit holds besides.
    pub max_array_size: Option<u32>,
    /// Most allocations that run at a time, as far as the user or the queue (`maxujobs`) allows; `None`: no limit. Polled, tasks: of
    /// all arrays on hosts without a queue, of each in a queue, whose own limits hold for all.
    pub max_running: Option<u32>,
    /// How often the queue is asked.
    #[serde(with = "microseconds")]
    pub poll: Span,
    /// In pilot mode allocations, in poll mode images, that wait in the queue beyond what runs (thesis §C.3.5).
    pub ahead: u32,
    /// How long an allocation may run; `None`: as long as the queue lets it.
    #[serde(with = "microseconds::perhaps")]
    pub time_limit: Option<Span>,
    /// Partition (Slurm) or queue (Grid Engine); `None`: the queue's usual one.
    pub queue: Option<String>,
    /// Whom the queue charges: account (Slurm) or project (Grid Engine).
    pub account: Option<String>,
    /// The parallel environment that gives one host's slots, where `threads` is not 1 (Grid Engine).
    pub parallel_environment: Option<String>,
    /// Further options of `sbatch` or `qsub`, a word each.
    pub submit: Vec<String>,
    /// Labels of its workers, beside `site.NAME`.
    pub labels: Vec<String>,
    /// Render threads of an allocation.
    pub threads: u32,
    /// Memory of an allocation in bytes; `None`: what the queue gives.
    pub memory_bytes: Option<u64>,
    /// The folder there where all of ours lies; `~/` is the home there.
    pub folder: String,
    /// The program there.
    pub program: String,
    /// A script in the place of the one in `deploy/`.
    pub template: Option<PathBuf>,
    /// A worker without a tile for so long gives its allocation back.
    #[serde(with = "microseconds")]
    pub idle: Span,
    /// In poll mode what the site has begun stays its own for so long while it cannot be reached.
    #[serde(with = "microseconds")]
    pub patience: Span,
    /// Where the site's workers reach the coordinator; `None`: where it listens.
    pub coordinator: Option<String>,
    /// What becomes of an allocation that somebody deleted.
    pub cancelled: Cancelled,
}

/// What gives out a site's processors.
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Slurm.
    Slurm,
    /// Sun, Son of, Univa or Open Grid Engine.
    GridEngine,
    /// A host without a queue, over ssh.
    Ssh,
    /// This machine, without a queue.
    Local,
}

/// Who begins.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Workers dial the coordinator.
    Pilot,
    /// Nothing there dials; the coordinator brings images and fetches tiles.
    Poll,
    /// Pilot, unless the site's hosts cannot reach the coordinator.
    #[default]
    Auto,
}

/// What becomes of an allocation that somebody else deleted.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Cancelled {
    /// Another is submitted in its place, after a while.
    #[default]
    Replace,
    /// The site gets none until the coordinator is started again.
    Stop,
}

impl Site {
    /// The label that all its workers have.
    pub fn label(&self) -> String {
        format!("site.{}", self.name)
    }

    /// Where it is, for people.
    pub fn place(&self) -> &str {
        self.address.as_deref().unwrap_or("this machine")
    }
}

impl Sites {
    /// The site of this name.
    pub fn named(&self, name: &str) -> Option<&Site> {
        self.0.iter().find(|site| site.name == name)
    }
}

impl Kind {
    /// As the file says it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Slurm => "slurm",
            Self::GridEngine => "gridengine",
            Self::Ssh => "ssh",
            Self::Local => "local",
        }
    }
}

impl Mode {
    /// As the file says it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pilot => "pilot",
            Self::Poll => "poll",
            Self::Auto => "auto",
        }
    }
}
