//! What a site is like, for `flyby site check`: the host where one logs in, its queue, the program there.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::Deserialize;

use crate::error::ClusterError;
use crate::queue::{About, Limits, Queue};
use crate::sites::{Mode, Site};
use crate::way::{LIMIT, Way};
use crate::words::{quote, quote_path};

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
    /// Its queue; `None` where the host cannot be reached.
    pub queue: Option<Result<(About, Limits), ClusterError>>,
    /// The program; `None` where the host cannot be reached.
    pub program: Option<Result<Program, ClusterError>>,
}

/// Looks at a site. `coordinator` is where its workers would dial.
pub fn look(site: &Site, way: &Way, queue: &dyn Queue, coordinator: Option<&str>) -> Survey {
    let host = host(site, way, coordinator);
    let can = host.is_ok();
    Survey {
        queue: can.then(|| queue.about().and_then(|about| Ok((about, queue.limits()?)))),
        program: can.then(|| program(site, way)),
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
    let dial = coordinator.and_then(|address| address.rsplit_once(':')).map_or_else(
        || "echo dials=unknown".to_owned(),
        |(host, port)| {
            // Of the shells bash alone can dial.
            let target = format!("/dev/tcp/{}/{port}", host.trim_matches(['[', ']']));
            format!(
                "if ! command -v bash >/dev/null || ! command -v timeout >/dev/null; then echo dials=unknown; \
                 elif timeout 5 bash -c {} 2>/dev/null; then echo dials=yes; else echo dials=no; fi",
                quote(&format!(": <{target}"))
            )
        },
    );
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
    let value = |name: &str| {
        let lines = said.stdout.lines();
        let found = lines.filter_map(|line| line.strip_prefix(name)?.strip_prefix('='));
        found.map(str::trim).next().unwrap_or_default()
    };
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
        dials: match value("dials") {
            "yes" => Some(true),
            "no" => Some(false),
            _ => None,
        },
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
