//! What a site is like, for `flyby site check`: the host where one logs in, its queue, the program there.

use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use model::Span;
use serde::Deserialize;

use crate::camp::Camp;
use crate::error::ClusterError;
use crate::queue::{About, Array, Limits};
use crate::sites::{Mode, Site};
use crate::way::{LIMIT, Way};
use crate::words::{quote, quote_path};

/// How long a host of the queue may take to dial.
const NODE_TIME: Span = Span::from_secs(60);

/// How long the queue may take to give one.
const NODE_LIMIT: Span = Span::from_secs(300);

/// The host where one logs in.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Host {
    /// Its name.
    pub name: String,
    /// Such as `Linux 6.1.0 x86_64`.
    pub system: String,
    /// Such as `glibc 2.36`; empty where it does not say.
    pub libc: String,
    /// Its processor's name.
    pub processor: String,
    /// How many of them.
    pub processors: Option<u32>,
    /// How far its clock is ahead of ours in milliseconds; as exact as half the time of the way there and back.
    pub clock_ahead_ms: i64,
    /// How long that way took.
    pub round_trip_ms: u64,
    /// Bytes free where our folder lies.
    pub free_bytes: Option<u64>,
    /// Whether the coordinator's address answers from there; `None` where none was asked for or nobody could try.
    pub dials: Option<bool>,
}

/// The program there, as `flyby version --output json` tells it.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize)]
pub struct Program {
    /// Name and version.
    pub build: String,
    /// Revision of its renderer.
    pub revision: u32,
    /// The best instruction set of the machine there.
    pub simd: String,
    /// Processors of the machine there.
    pub processors: u32,
}

/// All that was found. What could not be found out is an error of its own.
#[derive(Debug)]
pub struct Survey {
    /// The host.
    pub host: Result<Host, ClusterError>,
    /// Whether the farm's folder takes more; `None` where the host cannot be reached.
    pub room: Option<Result<(), ClusterError>>,
    /// Its queue; `None` where the host cannot be reached.
    pub queue: Option<Result<(About, Limits), ClusterError>>,
    /// The program; `None` where the host cannot be reached.
    pub program: Option<Result<Program, ClusterError>>,
    /// A host of the queue, where one was asked for.
    pub node: Option<Result<Node, ClusterError>>,
}

/// Whether a host of the queue is asked for, too.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Nodes {
    /// Only the host where one logs in is looked at.
    No,
    /// One task is submitted.
    One,
}

/// Looks at a site. `coordinator` is where its workers would dial.
pub fn look(camp: &Camp, coordinator: Option<&str>, nodes: Nodes) -> Survey {
    let (site, way, queue) = (&camp.site, &camp.way, &camp.queue);
    let host = host(site, way, coordinator);
    let can = host.is_ok();
    let asked = coordinator.filter(|_| can && nodes == Nodes::One);
    Survey {
        room: can.then(|| camp.has_room()),
        queue: can.then(|| queue.about().and_then(|about| Ok((about, queue.limits()?)))),
        program: can.then(|| program(site, way)),
        node: asked.map(|coordinator| node(camp, coordinator)),
        host,
    }
}

/// The mode that fits a site: what it says, or, where that is left open, whether its workers can dial.
pub fn fitting(site: &Site, dials: Option<bool>) -> Mode {
    match (site.mode, dials) {
        (Mode::Auto, Some(false)) => Mode::Poll,
        (Mode::Auto, _) => Mode::Pilot,
        (mode, _) => mode,
    }
}

/// Looks at the host where one logs in; `coordinator` is where its workers would dial.
pub fn host(site: &Site, way: &Way, coordinator: Option<&str>) -> Result<Host, ClusterError> {
    let dial = coordinator.map_or_else(|| "echo dials=unknown".to_owned(), dial);
    let script = format!(
        "echo now=$(date +%s%3N)\n\
         echo name=$(uname -n)\n\
         echo system=$(uname -srm)\n\
         echo libc=$(getconf GNU_LIBC_VERSION 2>/dev/null || ldd --version 2>&1 | head -n 1)\n\
         echo processor=$(sed -n 's/^model name[^:]*: *//p' /proc/cpuinfo | head -n 1)\n\
         echo processors=$(nproc 2>/dev/null)\n\
         d={folder}; while [ ! -d \"$d\" ]; do d=$(dirname \"$d\"); done\n\
         echo free=$(df -Pk \"$d\" | awk 'NR == 2 {{ print $4 }}')\n\
         {dial}\n",
        folder = quote_path(&site.folder),
    );
    // The first login makes the connection that the clock is then read over.
    way.run("logging in", ":", LIMIT)?;
    let before = SystemTime::now();
    let said = way.run("looking at the host", &script, LIMIT)?;
    let took = before.elapsed().unwrap_or_default();
    let value = |name: &str| value(&said.stdout, name);
    let here = milliseconds(before);
    Ok(Host {
        name: value("name").to_owned(),
        system: value("system").to_owned(),
        libc: value("libc").to_owned(),
        processor: value("processor").to_owned(),
        processors: value("processors").parse().ok(),
        // It is the first thing that is printed.
        clock_ahead_ms: value("now")
            .parse()
            .map_or(0, |there: i64| there.saturating_sub(here)),
        round_trip_ms: u64::try_from(took.as_millis()).unwrap_or(u64::MAX),
        free_bytes: value("free")
            .parse::<u64>()
            .ok()
            .and_then(|kibibytes| kibibytes.checked_mul(1_024)),
        dials: answers(&said.stdout),
    })
}

/// The script that says whether an address answers.
fn dial(address: &str) -> String {
    let (host, port) = address.rsplit_once(':').unwrap_or((address, "0"));
    // Of the shells bash alone can dial.
    let target = format!("/dev/tcp/{}/{port}", host.trim_matches(['[', ']']));
    format!(
        "if ! command -v bash >/dev/null || ! command -v timeout >/dev/null; then echo dials=unknown; \
         elif timeout 5 bash -c {} 2>/dev/null; then echo dials=yes; else echo dials=no; fi",
        quote(&format!(": <{target}"))
    )
}

/// What a script printed under a name.
fn value<'a>(said: &'a str, name: &str) -> &'a str {
    let lines = said.lines();
    let mut found = lines.filter_map(|line| line.strip_prefix(name)?.strip_prefix('='));
    found.next().map_or("", str::trim)
}

fn answers(said: &str) -> Option<bool> {
    match value(said, "dials") {
        "yes" => Some(true),
        "no" => Some(false),
        _ => None,
    }
}

/// A host that the queue gave.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Node {
    /// Its name.
    pub name: String,
    /// Whether the coordinator's address answers from there; `None` where nobody could try.
    pub dials: Option<bool>,
}

/// Has a host that the queue gives try to dial; takes as long as the queue does, and no longer than five minutes.
pub fn node(camp: &Camp, coordinator: &str) -> Result<Node, ClusterError> {
    let name = format!("{}check-{}", camp.prefix(), milliseconds(SystemTime::now()));
    let array = Array {
        script: format!(
            "echo name=$(uname -n)\n{}\necho end=here",
            dial(coordinator)
        ),
        log: camp.log(&name),
        name: name.clone(),
        tasks: 1,
        running_max: None,
        time_limit: Some(NODE_TIME),
    };
    let id = camp.queue.submit(&array)?;
    let found = await_node(camp, &name);
    // Whatever came of it, nothing of it stays in the queue.
    camp.queue.delete(&[id])?;
    found
}

fn await_node(camp: &Camp, array: &str) -> Result<Node, ClusterError> {
    let deadline = Instant::now() + Duration::from_micros(NODE_LIMIT.0);
    while Instant::now() < deadline {
        let said = camp.log_of(array, 1)?;
        if value(&said, "end") == "here" {
            return Ok(Node {
                name: value(&said, "name").to_owned(),
                dials: answers(&said),
            });
        }
        thread::sleep(Duration::from_secs(1));
    }
    Err(ClusterError::TimedOut {
        attempt: "waiting for a host of the queue".to_owned(),
        limit: NODE_LIMIT,
    })
}

fn milliseconds(time: SystemTime) -> i64 {
    let since = time.duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO);
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}

/// Asks the program at the site what it is.
pub fn program(site: &Site, way: &Way) -> Result<Program, ClusterError> {
    let attempt = format!("running {} there", site.program);
    let script = format!("{} version --output json", quote_path(&site.program));
    let said = way
        .ask(&attempt, &site.program, &script)
        .map_err(|error| match error {
            // Of what is missing in a queue it is said otherwise.
            ClusterError::Missing { program, said } => ClusterError::Program {
                path: program,
                site: site.name.clone(),
                what: said,
            },
            error => error,
        })?;
    serde_json::from_str(&said).map_err(|error| ClusterError::Nonsense {
        attempt,
        what: error.to_string(),
        said: crate::way::brief(&said),
    })
}
