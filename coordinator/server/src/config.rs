//! How a coordinator runs: every limit of the shell, in one value.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use model::{Epoch, Revision, Span};

/// What a coordinator is started with.
#[derive(Clone, Debug)]
pub struct Config {
    /// The state folder; made if it is not there.
    pub state: PathBuf,
    /// Where to listen. Port 0 takes any free one. Where it is not loopback, loopback is listened on too, for what runs
    /// on this machine.
    pub listen: SocketAddr,
    /// Where other machines can reach it, each a host or an address with a port; empty: where it listens.
    pub advertise: Vec<String>,
    /// How long certificates count: its own, and those of workers that joined.
    pub certificate_life: Span,
    /// The renderer revision whose pixels it takes.
    pub revision: Revision,
    /// This program's version, shown to users and written into frames.
    pub build: String,
    /// How often workers say that they live.
    pub heartbeat_interval: Span,
    /// A worker of which nothing is heard for so long is lost.
    pub liveness_limit: Span,
    /// Of a million tiles, so many are rendered once more by another worker and compared to the bit.
    pub verify: u32,
    /// A program that is run whenever a job is over; `None`: none.
    pub on_job_end: Option<PathBuf>,
    /// Sites that it submits to.
    pub sites: Vec<cluster::Site>,
    /// Limits on what others may make it hold.
    pub limits: Limits,
}

/// What others may make a coordinator hold. What the scheduler holds has limits of its own.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Submissions that arrive at the same time.
    pub submissions_max: usize,
    /// Bytes of one submission's assets together.
    pub asset_bytes_max: u64,
    /// Blocks that are received and not yet durable; each is at most 32 KiB.
    pub blocks_in_flight_max: usize,
    /// Messages waiting for the loop.
    pub inputs_max: usize,
    /// Messages waiting for one worker; one that lets more gather is cut off and may come back.
    pub worker_messages_max: usize,
    /// Lines kept of one job's log.
    pub log_lines_max: usize,
    /// Watchers of all jobs together.
    pub watchers_max: usize,
}

impl Config {
    /// The usual settings over a state folder, for a renderer's revision.
    pub fn new(state: PathBuf, revision: Revision, build: impl Into<String>) -> Self {
        Self {
            state,
            listen: (Ipv4Addr::LOCALHOST, wire::place::DEFAULT_PORT).into(),
            advertise: Vec::new(),
            certificate_life: Span::from_secs(24 * 3600),
            revision,
            build: build.into(),
            heartbeat_interval: Span::from_secs(1),
            liveness_limit: Span::from_secs(4),
            verify: 0,
            on_job_end: None,
            sites: Vec::new(),
            limits: Limits::default(),
        }
    }
}

/// Most workers: all must fit into one message.
const WORKERS_MAX: u32 = 2_000;

/// How the scheduler of a coordinator decides.
pub(crate) fn scheduling(config: &Config, epoch: Epoch) -> sched::Config {
    sched::Config {
        revision: Some(config.revision),
        liveness_limit: config.liveness_limit,
        verify: config.verify,
        limits: sched::Limits {
            workers_max: WORKERS_MAX,
            ..sched::Limits::default()
        },
        ..sched::Config::new(epoch)
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            submissions_max: 8,
            asset_bytes_max: 1 << 30,
            blocks_in_flight_max: 2_048,
            inputs_max: 4_096,
            worker_messages_max: 4_096,
            log_lines_max: 1_000,
            watchers_max: 1_000,
        }
    }
}
