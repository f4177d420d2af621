//! `flyby site check`: what was found at a site, what is wrong with it, and which mode fits.

use std::io::{self, Write};

use cluster::survey::{self, Program, Survey};
use cluster::{About, ClusterError, Limits, Mode, Site};
use indicatif::HumanBytes;
use model::Span;
use serde::Serialize;

use crate::output::Report;
use crate::progress::duration;

pub(crate) use crate::farm::doctor::Verdict;
use crate::farm::doctor::{Finding, write_findings};

/// Clocks that differ by more confuse logs, and certificates.
const CLOCKS_APART_MS: u64 = 5_000;

/// Room below which a disk will soon be full.
const ROOM_LOW: u64 = 1 << 30;

/// `site check`.
#[derive(Serialize)]
pub(crate) struct Checks {
    /// The worst of all.
    pub(crate) verdict: Verdict,
    /// Each site.
    sites: Vec<Check>,
}

/// A site that was looked at.
#[derive(Serialize)]
pub(crate) struct Check {
    /// Its name.
    site: String,
    /// Where it is.
    place: String,
    /// The worst of its findings.
    verdict: Verdict,
    /// The mode that fits: `pilot` or `poll`; null where nobody can tell.
    mode: Option<&'static str>,
    /// The queue's name and version.
    queue: Option<String>,
    /// The queue's limits.
    limits: Option<LimitsView>,
    /// The program there.
    program: Option<ProgramView>,
    /// How far its clock is ahead of this one's, milliseconds.
    clock_ahead_ms: Option<i64>,
    /// Whether the coordinator's address answers from there.
    dials: Option<bool>,
    /// What was looked at, in order: `login`, `clock`, `disk`, `queue`, `limits`, `program`, `node`, `address`, `mode`.
    findings: Vec<Finding>,
}

/// What a queue lets one user have; null where there is no limit or it does not say.
#[derive(Serialize)]
struct LimitsView {
    array_tasks: Option<u32>,
    array_running: Option<u32>,
    running: Option<u32>,
    jobs: Option<u32>,
    time_s: Option<u64>,
    time_usual_s: Option<u64>,
    queues: Vec<String>,
    slots_free: Option<u32>,
    slots: Option<u32>,
}

/// The program at a site.
#[derive(Serialize)]
struct ProgramView {
    build: String,
    revision: u32,
    simd: String,
    processors: u32,
}

impl Checks {
    pub(crate) fn new(sites: Vec<Check>) -> Self {
        let worst = sites.iter().map(|site| site.verdict).max();
        Self {
            verdict: worst.unwrap_or(Verdict::Fine),
            sites,
        }
    }
}

impl Check {
    /// Judges what was seen. `coordinator` is where workers would dial.
    pub(crate) fn new(site: &Site, seen: Survey, coordinator: Option<&str>) -> Self {
        let mut findings = Vec::new();
        let host = match seen.host {
            Ok(host) => {
                findings.extend(of_host(site, &host));
                Some(host)
            }
            Err(error) => {
                findings.push(trouble("login", &error));
                None
            }
        };
        if let Some(Err(error)) = &seen.room {
            findings.push(trouble("disk", error));
        }
        let mut queue = None;
        let mut limits = None;
        match seen.queue {
            Some(Ok((about, found))) => {
                findings.push(of_queue(site, &about, &found));
                findings.extend(of_limits(site, &found));
                queue = Some(format!("{} {}", about.name, about.version));
                limits = Some(LimitsView::from(found));
            }
            Some(Err(error)) => findings.push(trouble("queue", &error)),
            None => {}
        }
        let mut program = None;
        match seen.program {
            Some(Ok(found)) => {
                findings.push(of_program(site, &found));
                program = Some(ProgramView::from(found));
            }
            Some(Err(error)) => findings.push(no_program(site, &error)),
            None => {}
        }
        let mut dials = host.as_ref().and_then(|host| host.dials);
        match seen.node {
            Some(Ok(node)) => {
                // It is there that workers run.
                dials = node.dials.or(dials);
                findings.push(of_node(&node));
            }
            Some(Err(error)) => findings.push(trouble("node", &error)),
            None => {}
        }
        let mode = host.as_ref().map(|_| survey::fitting(site, dials));
        if let Some(mode) = mode {
            findings.extend(of_mode(mode, dials, coordinator));
        }
        let worst = findings.iter().map(|finding| finding.verdict).max();
        Self {
            site: site.name.clone(),
            place: site.place().to_owned(),
            verdict: worst.unwrap_or(Verdict::Fine),
            mode: mode.map(Mode::name),
            queue,
            limits,
            program,
            clock_ahead_ms: host.as_ref().map(|host| host.clock_ahead_ms),
            dials,
            findings,
        }
    }
}

fn trouble(part: &'static str, error: &ClusterError) -> Finding {
    Finding::bad(part, error.to_string(), error.next())
}

fn of_host(site: &Site, host: &survey::Host) -> Vec<Finding> {
    let processors = host
        .processors
        .map_or_else(String::new, |count| format!("{count} × "));
    let mut findings = vec![Finding::fine(
        "login",
        format!(
            "{}, {}, {}, {processors}{}",
            host.name, host.system, host.libc, host.processor
        ),
    )];
    let apart = host
        .clock_ahead_ms
        .unsigned_abs()
        .saturating_sub(host.round_trip_ms);
    findings.push(match apart > CLOCKS_APART_MS {
        true => Finding::doubtful(
            "clock",
            format!("its clock differs by {} s", host.clock_ahead_ms / 1_000),
            "have both machines keep the time by NTP",
        ),
        false => Finding::fine(
            "clock",
            format!(
                "its clock agrees; there and back takes {} ms",
                host.round_trip_ms
            ),
        ),
    });
    if let Some(free) = host.free_bytes {
        let found = format!("{} free where {} lies", HumanBytes(free), site.folder);
        findings.push(match free < ROOM_LOW {
            true => Finding::doubtful("disk", found, "make room there, or name another `folder`"),
            false => Finding::fine("disk", found),
        });
    }
    findings
}

fn of_queue(site: &Site, about: &About, limits: &Limits) -> Finding {
    let slots = limits.slots.map_or_else(String::new, |(free, all)| {
        format!(", {free} of {all} slots free")
    });
    let found = format!("{} {}{slots}", about.name, about.version);
    match &site.queue {
        Some(queue) if !limits.queues.is_empty() && !limits.queues.contains(queue) => Finding::bad(
            "queue",
            format!("{found}; it has no `{queue}`"),
            format!(
                "name one of {} in the site's `queue`",
                limits.queues.join(", ")
            ),
        ),
        _ => Finding::fine("queue", found),
    }
}

fn of_limits(site: &Site, limits: &Limits) -> Vec<Finding> {
    let mut said = Vec::new();
    let mut add = |what: &str, limit: Option<String>| {
        said.extend(limit.map(|limit| format!("{what} {limit}")));
    };
    let number = |limit: Option<u32>| limit.map(|limit| limit.to_string());
    let time = |limit: Option<Span>| {
        limit.map(|limit| duration(std::time::Duration::from_micros(limit.0)))
    };
    add("tasks of an array", number(limits.array_tasks));
    add("of them running", number(limits.array_running));
    add("running of one user", number(limits.running));
    add("jobs of one user", number(limits.jobs));
    add("time", time(limits.time));
    let mut findings = Vec::new();
    if !said.is_empty() {
        findings.push(Finding::fine(
            "limits",
            format!("at most: {}", said.join(", ")),
        ));
    }
    if let (Some(asked), Some(most)) = (site.max_array_size, limits.array_tasks)
        && asked > most
    {
        findings.push(Finding::doubtful(
            "limits",
            format!("`max_array_size` is {asked}, and an array may have {most} tasks: the queue's limit holds"),
            format!("write max_array_size = {most}"),
        ));
    }
    if let (Some(asked), Some(most)) = (site.time_limit, limits.time)
        && asked > most
    {
        findings.push(Finding::bad(
            "limits",
            "`time_limit` is longer than the queue allows",
            "lower it, or name another `queue`",
        ));
    }
    findings
}

fn of_program(site: &Site, program: &Program) -> Finding {
    let found = format!(
        "{}, renderer revision {}, {}",
        program.build, program.revision, program.simd
    );
    match program.revision == render::REVISION {
        true => Finding::fine("program", found),
        false => Finding::bad(
            "program",
            format!(
                "{found}: this one makes pixels of revision {}",
                render::REVISION
            ),
            format!("`flyby site install {}`", site.name),
        ),
    }
}

fn of_node(node: &survey::Node) -> Finding {
    let name = &node.name;
    match node.dials {
        Some(true) => Finding::fine(
            "node",
            format!("{name} ran a task and reaches the coordinator"),
        ),
        Some(false) => Finding::doubtful(
            "node",
            format!("{name} ran a task and does not reach the coordinator"),
            "open the coordinator's port to the hosts of the queue, or write mode = \"poll\"",
        ),
        None => Finding::doubtful(
            "node",
            format!("{name} ran a task, and has no bash or timeout to dial by"),
            "submit a job: `flyby site list` says whether its workers come",
        ),
    }
}

fn no_program(site: &Site, error: &ClusterError) -> Finding {
    match error {
        ClusterError::Program { .. } => Finding::bad(
            "program",
            format!("{} is not there", site.program),
            format!("`flyby site install {}`", site.name),
        ),
        error => trouble("program", error),
    }
}

fn of_mode(mode: Mode, dials: Option<bool>, coordinator: Option<&str>) -> Vec<Finding> {
    let mut findings = Vec::new();
    let address = coordinator.unwrap_or("the coordinator");
    findings.extend(match (dials, mode) {
        (Some(true), _) => Some(Finding::fine(
            "address",
            format!("{address} answers from there"),
        )),
        (Some(false), Mode::Pilot) => Some(Finding::bad(
            "address",
            format!("{address} does not answer from there, and pilot mode needs it"),
            "start the coordinator, open its port, or write mode = \"poll\"",
        )),
        (Some(false), _) => Some(Finding::doubtful(
            "address",
            format!("{address} does not answer from there"),
            "poll mode works without; for pilot mode open the coordinator's port",
        )),
        (None, _) => None,
    });
    let why = match (mode, dials) {
        (Mode::Poll, _) => "poll: the coordinator brings images and fetches tiles",
        (_, None) => {
            "pilot, if its workers reach the coordinator: start one, or name it with `--coordinator`"
        }
        _ => "pilot: its workers dial the coordinator",
    };
    findings.push(Finding::fine("mode", why));
    findings
}

impl From<Limits> for LimitsView {
    fn from(limits: Limits) -> Self {
        let seconds = |limit: Option<Span>| limit.map(|limit| limit.0 / 1_000_000);
        Self {
            array_tasks: limits.array_tasks,
            array_running: limits.array_running,
            running: limits.running,
            jobs: limits.jobs,
            time_s: seconds(limits.time),
            time_usual_s: seconds(limits.time_usual),
            queues: limits.queues,
            slots_free: limits.slots.map(|(free, _)| free),
            slots: limits.slots.map(|(_, all)| all),
        }
    }
}

impl From<Program> for ProgramView {
    fn from(program: Program) -> Self {
        Self {
            build: program.build,
            revision: program.revision,
            simd: program.simd,
            processors: program.processors,
        }
    }
}

impl Report for Checks {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        for (index, site) in self.sites.iter().enumerate() {
            if index > 0 {
                writeln!(out)?;
            }
            writeln!(out, "{} ({})", site.site, site.place)?;
            write_findings(&site.findings, out)?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let wrong = self
            .sites
            .iter()
            .filter(|site| site.verdict != Verdict::Fine);
        let mut wrong = wrong.map(|site| &site.site);
        wrong.try_for_each(|site| writeln!(out, "{site}"))
    }
}
