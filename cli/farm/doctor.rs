//! What is wrong with a farm, and what to do about it: every part is looked at, whatever the others say.

mod certificates;

use std::fs;
use std::io::{self, Write};
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use indicatif::HumanBytes;
use serde::Serialize;
use wire::place::{self, NotFound};
use wire::proto::{FarmInfo, InfoRequest, ListWorkersRequest};

use crate::daemon;
use crate::error::Error;
use crate::farm::view::{self, Worker};
use crate::options::{Context, FarmOptions};
use crate::output::Report;

/// Room below which a disk will soon be full.
const ROOM_LOW: u64 = 2 << 30;

/// Clocks that differ by more confuse logs, and by minutes certificates.
const CLOCKS_APART: Duration = Duration::from_secs(5);

/// How something stands.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Verdict {
    /// As it should be.
    Fine,
    /// The farm works, and somebody should look.
    Doubtful,
    /// The farm does not work, or does wrong.
    Bad,
}

/// `farm doctor`.
#[derive(Serialize)]
pub(crate) struct Examination {
    /// The worst of all.
    pub(crate) verdict: Verdict,
    /// What was looked at, in order.
    findings: Vec<Finding>,
}

/// One thing that was looked at.
#[derive(Serialize)]
pub(crate) struct Finding {
    /// What; of a farm `state`, `token`, `store`, `authority`, `joined`, `coordinator`, `versions`, `clock`, `certificate`, `disk`,
    /// `workers`, `pixels`.
    part: &'static str,
    /// How it stands.
    pub(crate) verdict: Verdict,
    /// What was found, a sentence.
    found: String,
    /// What to do; null where nothing is.
    next: Option<String>,
}

impl Finding {
    pub(crate) fn fine(part: &'static str, found: impl Into<String>) -> Self {
        Self {
            part,
            verdict: Verdict::Fine,
            found: found.into(),
            next: None,
        }
    }

    pub(crate) fn doubtful(
        part: &'static str,
        found: impl Into<String>,
        next: impl Into<String>,
    ) -> Self {
        Self {
            part,
            verdict: Verdict::Doubtful,
            found: found.into(),
            next: Some(next.into()),
        }
    }

    pub(crate) fn bad(
        part: &'static str,
        found: impl Into<String>,
        next: impl Into<String>,
    ) -> Self {
        Self {
            verdict: Verdict::Bad,
            ..Self::doubtful(part, found, next)
        }
    }
}

/// Writes findings for people, with what to do.
pub(crate) fn write_findings(findings: &[Finding], out: &mut dyn Write) -> io::Result<()> {
    for finding in findings {
        let mark = match finding.verdict {
            Verdict::Fine => "fine",
            Verdict::Doubtful => "look",
            Verdict::Bad => "BAD ",
        };
        writeln!(out, "{mark}  {:<12} {}", finding.part, finding.found)?;
        if let Some(next) = &finding.next {
            writeln!(out, "{:>19}{next}", "")?;
        }
    }
    Ok(())
}

impl Report for Examination {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        write_findings(&self.findings, out)
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let bad = |finding: &&Finding| finding.verdict != Verdict::Fine;
        let mut findings = self.findings.iter().filter(bad);
        findings.try_for_each(|finding| writeln!(out, "{}", finding.part))
    }
}

/// Looks at everything that can be seen from here.
pub(crate) async fn look(context: &Context, options: &FarmOptions) -> Result<Examination, Error> {
    let state = context.state()?;
    let mut findings = Vec::new();
    if let Some(file) = &context.token_file {
        findings.push(certificates::token_file(file));
    } else if options.coordinator.is_none() {
        findings.push(state_folder(&state));
        findings.push(token(&state));
        findings.extend(store(&state));
        findings.extend(certificates::authority(&state));
    }
    findings.extend(certificates::joined(&state));
    findings.extend(farm(context, options, &state).await);
    let worst = findings.iter().map(|finding| finding.verdict).max();
    Ok(Examination {
        verdict: worst.unwrap_or(Verdict::Fine),
        findings,
    })
}

fn state_folder(state: &Path) -> Finding {
    let shown = state.display();
    match fs::metadata(state) {
        Err(error) => Finding::bad(
            "state",
            format!("the state folder {shown} cannot be looked at: {error}"),
            "`flyby coordinator` makes it; or name the right one with `--state`",
        ),
        Ok(metadata) if metadata.permissions().mode() & 0o022 != 0 => Finding::bad(
            "state",
            format!("others may write into the state folder {shown}"),
            format!("`chmod go-w {shown}`"),
        ),
        Ok(_) => Finding::fine("state", format!("{shown}")),
    }
}

fn token(state: &Path) -> Finding {
    let path = state.join(place::TOKEN_FILE);
    let shown = path.display();
    match (place::token(state), fs::metadata(&path)) {
        (Err(error), _) => Finding::bad(
            "token",
            error.to_string(),
            "the coordinator makes one when it starts where there is none",
        ),
        (Ok(_), Ok(metadata)) if metadata.permissions().mode() & 0o077 != 0 => Finding::bad(
            "token",
            format!("others can read the token {shown}"),
            format!(
                "`chmod 600 {shown}`; to make a new one, stop the coordinator and remove the file first"
            ),
        ),
        (Ok(_), _) => Finding::fine("token", "only its owner can read it"),
    }
}

/// The store, as far as it can be looked at: a coordinator that runs holds it.
fn store(state: &Path) -> Option<Finding> {
    let path = state.join("farm.sqlite");
    let lock = fs::File::open(state.join("lock")).ok()?;
    if !path.exists() {
        return None;
    }
    if let Err(fs::TryLockError::WouldBlock) = lock.try_lock() {
        return Some(Finding::fine(
            "store",
            "in use by the coordinator; every page of it is looked at where none runs",
        ));
    }
    let checked = store::Sqlite::open(&path).and_then(|mut store| store.check());
    Some(match checked {
        Ok(()) => Finding::fine("store", "every page of it is whole"),
        Err(error) => Finding::bad(
            "store",
            Error::failed("it cannot be used")
                .because(error)
                .to_string(),
            format!(
                "put a copy back, or move {} away: finished frames stay, and jobs that were not over must be submitted again",
                path.display()
            ),
        ),
    })
}

/// The coordinator, and what it says.
async fn farm(context: &Context, options: &FarmOptions, state: &Path) -> Vec<Finding> {
    let address = match (context.way(options), place::coordinator(state)) {
        (Ok(way), _) => way.to_string(),
        (Err(_), Ok(coordinator)) => coordinator.address.to_string(),
        (Err(error), _) if context.token_file.is_some() || options.coordinator.is_some() => {
            return vec![Finding::bad("coordinator", error.to_string(), "see above")];
        }
        (Err(_), Err(error)) => {
            let next = match error {
                NotFound::NotRunning(_) => "start one with `flyby coordinator`",
                _ => "stop the coordinator, remove the file, and start it again",
            };
            return vec![Finding::bad("coordinator", error.to_string(), next)];
        }
    };
    let mut farm = match context.connect(options).await {
        Ok(farm) => farm,
        Err(error) => {
            return vec![Finding::bad(
                "coordinator",
                error.to_string(),
                "if it was killed, start it again: its jobs go on where they were",
            )];
        }
    };
    let asked = Instant::now();
    let info = match farm.info(InfoRequest {}).await {
        Ok(info) => info.into_inner(),
        Err(status) => {
            let failure = wire::Failure::from(status);
            return vec![Finding::bad(
                "coordinator",
                format!("it answers at {address}, and refuses: {}", failure.sentence),
                "use the token of its own state folder: `--state`",
            )];
        }
    };
    let round_trip = asked.elapsed();
    let mut findings = vec![
        Finding::fine(
            "coordinator",
            format!(
                "answers at {address} in {:.1} ms, started {}",
                round_trip.as_secs_f64() * 1e3,
                view::ago(info.started_unix_ms)
            ),
        ),
        versions(&info),
        clock(info.now_unix_ms, round_trip),
        certificates::own(info.certificate_until_unix_ms, info.now_unix_ms),
        disk(&info),
    ];
    match farm.list_workers(ListWorkersRequest {}).await {
        Ok(answer) => {
            let workers = answer.into_inner().workers;
            let workers: Vec<_> = workers.into_iter().map(Worker::from).collect();
            findings.push(crew(&workers, info.revision, info.jobs_running));
        }
        Err(status) => findings.push(Finding::bad(
            "workers",
            wire::Failure::from(status).sentence,
            "ask again in a moment",
        )),
    }
    findings.push(pixels(info.incidents, info.undecided));
    findings
}

fn versions(info: &FarmInfo) -> Finding {
    let (here, there) = (daemon::software(), &info.build);
    if info.revision != render::REVISION {
        return Finding::doubtful(
            "versions",
            format!(
                "the coordinator takes pixels of renderer revision {}, this program makes those of {}",
                info.revision,
                render::REVISION
            ),
            "what `flyby render` makes here differs from its frames: use one version everywhere",
        );
    }
    if here != *there {
        return Finding::doubtful(
            "versions",
            format!("the coordinator is {there}, this program {here}; their pixels are equal"),
            "use one version everywhere",
        );
    }
    Finding::fine(
        "versions",
        format!("{here}, renderer revision {}", info.revision),
    )
}

fn clock(theirs_unix_ms: u64, round_trip: Duration) -> Finding {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    let ours = since.unwrap_or_default();
    let apart = Duration::from_millis(theirs_unix_ms).abs_diff(ours);
    let apart = apart.saturating_sub(round_trip);
    if apart > CLOCKS_APART {
        return Finding::doubtful(
            "clock",
            format!(
                "the coordinator's clock and this one are {} s apart",
                apart.as_secs()
            ),
            "let both follow a time server; frames do not depend on it, certificates and times in logs do",
        );
    }
    Finding::fine("clock", "the coordinator's and this one agree")
}

fn disk(info: &FarmInfo) -> Finding {
    if !info.trouble.is_empty() {
        return Finding::bad(
            "disk",
            format!("the coordinator waits for it: {}", info.trouble),
            "make room (`flyby farm clean --frames`): the farm goes on by itself",
        );
    }
    match (info.disk_free_bytes, info.disk_bytes) {
        (Some(free), Some(all)) => {
            let found = format!(
                "{} of {} free at {}",
                HumanBytes(free),
                HumanBytes(all),
                info.state
            );
            match free < ROOM_LOW {
                true => Finding::doubtful(
                    "disk",
                    found,
                    "`flyby farm clean --frames` removes frames of old jobs; where it is full the farm waits, and loses nothing",
                ),
                false => Finding::fine("disk", found),
            }
        }
        _ => Finding::doubtful(
            "disk",
            "the system does not say how full it is",
            "look there yourself",
        ),
    }
}

fn crew(workers: &[Worker], revision: u32, jobs_running: u32) -> Finding {
    let in_state = |state: &str| {
        workers
            .iter()
            .filter(|worker| worker.state == state)
            .count()
    };
    let away = in_state("away");
    let here = workers.len() - away;
    let name = |worker: &Worker| worker.name.clone();
    let aside = workers
        .iter()
        .filter(|worker| worker.aside_until_unix_ms.is_some());
    let aside: Vec<_> = aside.map(name).collect();
    let expelled = workers.iter().filter(|worker| worker.expelled);
    let expelled: Vec<_> = expelled.map(name).collect();
    let foreign = workers.iter().filter(|worker| worker.revision != revision);
    let foreign: Vec<_> = foreign.map(name).collect();
    if here == 0 && jobs_running > 0 {
        return Finding::bad(
            "workers",
            format!("{jobs_running} jobs wait, and no worker is connected"),
            "start workers with `flyby worker`",
        );
    }
    if !expelled.is_empty() {
        return Finding::bad(
            "workers",
            format!(
                "{} made wrong pixels where two others agreed, and get no tiles for an hour",
                expelled.join(", ")
            ),
            "those machines compute wrongly: drain their workers; once one is mended, start the coordinator again to let it back at once",
        );
    }
    if !aside.is_empty() {
        return Finding::doubtful(
            "workers",
            format!(
                "{} failed tiles that others rendered, and get none for a while",
                aside.join(", ")
            ),
            "`flyby job log` says how they failed; look at those machines",
        );
    }
    if !foreign.is_empty() {
        return Finding::doubtful(
            "workers",
            format!(
                "{} are of another renderer revision: they serve older jobs alone",
                foreign.join(", ")
            ),
            "start them again with the coordinator's version once those jobs are over",
        );
    }
    Finding::fine("workers", format!("{here} connected, {away} away"))
}

fn pixels(incidents: u64, undecided: u64) -> Finding {
    match (undecided, incidents) {
        (0, 0) => Finding::fine("pixels", "no two renderings of a block differed"),
        (0, count) => Finding::fine(
            "pixels",
            format!(
                "{count} blocks were rendered twice with different pixels; a third worker decided, and what was wrong is rendered again"
            ),
        ),
        (count, _) => Finding::bad(
            "pixels",
            format!("{count} blocks were rendered twice with different pixels"),
            "`flyby job log` names the workers: one of those machines computes wrongly; drain them, and render those jobs' frames again",
        ),
    }
}
