//! `flyby farm`: how the farm stands, what is wrong with it, what can be cleaned away.

use std::io::{self, Write};

use clap::{Args, Subcommand};
use indicatif::HumanBytes;
use model::Span;
use serde::Serialize;
use wire::proto::{self, FarmInfo, InfoRequest, ListSitesRequest, SiteList};

use crate::error::{Ending, Error};
use crate::farm::doctor::{self, Verdict};
use crate::farm::link::{block_on, refused};
use crate::farm::view;
use crate::options::{Context, FarmOptions};
use crate::output::{self, Report, columns};
use crate::site::view::SiteView;
use crate::values;

#[derive(Subcommand, Debug)]
pub(crate) enum FarmCommand {
    /// Says how the farm stands: coordinator, workers, jobs, disk.
    Status(Status),
    /// Looks for what is wrong with the farm, and says what to do (exit code 1 if there is something).
    Doctor(Doctor),
    /// Forgets jobs that are over for long; with --frames, removes their frames too.
    Clean(Clean),
}

#[derive(Args, Debug)]
pub(crate) struct Status {
    #[command(flatten)]
    farm: FarmOptions,
}

#[derive(Args, Debug)]
pub(crate) struct Doctor {
    #[command(flatten)]
    farm: FarmOptions,
}

#[derive(Args, Debug)]
pub(crate) struct Clean {
    /// Only jobs that are over for so long, such as 30 d.
    #[arg(long, value_name = "TIME", default_value = "30 d", value_parser = values::span)]
    older: Span,

    /// Their finished frames on the coordinator's disk go too, and those that forgotten jobs left.
    #[arg(long)]
    frames: bool,

    /// Only say what would go.
    #[arg(long)]
    dry_run: bool,

    #[command(flatten)]
    farm: FarmOptions,
}

/// Runs the command.
pub(crate) fn run(context: &Context, command: FarmCommand) -> Result<Ending, Error> {
    match command {
        FarmCommand::Status(options) => block_on(status(context, &options.farm)),
        FarmCommand::Doctor(options) => {
            let report = block_on(doctor::look(context, &options.farm))?;
            output::print(context.output, &report)?;
            Ok(match report.verdict {
                Verdict::Bad => Ending::Failed,
                Verdict::Fine | Verdict::Doubtful => Ending::Done,
            })
        }
        FarmCommand::Clean(options) => block_on(clean(context, &options)),
    }
}

/// `farm status`.
#[derive(Serialize)]
struct FarmStatus {
    /// The coordinator's version.
    build: String,
    /// Revision of the renderer whose pixels it takes.
    revision: u32,
    /// How often it was started over its state folder.
    epoch: u64,
    /// When it was started, milliseconds since 1970 (UTC).
    started_unix_ms: u64,
    /// Its state folder, on its machine.
    state: String,
    /// Jobs that are not over.
    jobs_running: u32,
    /// Jobs that it remembers.
    jobs: u32,
    /// Workers whose link is open.
    workers_connected: u32,
    /// Of those, how many get no tiles since they failed too many.
    workers_aside: u32,
    /// Their render threads.
    threads: u32,
    /// Tiles that workers hold.
    attempts_live: u32,
    /// Blocks of which two renderings differed.
    incidents: u64,
    /// Of those, the ones of which no third worker has decided who is right.
    undecided: u64,
    /// Bytes free on the disk of its state folder; null where not known.
    disk_free_bytes: Option<u64>,
    /// Bytes of that disk.
    disk_bytes: Option<u64>,
    /// Its sites.
    sites: Vec<SiteView>,
    /// What the coordinator waits for, where its disk is in trouble.
    trouble: Option<String>,
}

impl FarmStatus {
    fn new(info: FarmInfo, sites: SiteList) -> Self {
        Self {
            build: info.build,
            revision: info.revision,
            epoch: info.epoch,
            started_unix_ms: info.started_unix_ms,
            state: info.state,
            jobs_running: info.jobs_running,
            jobs: info.jobs,
            workers_connected: info.workers_connected,
            workers_aside: info.workers_aside,
            threads: info.threads,
            attempts_live: info.attempts_live,
            incidents: info.incidents,
            undecided: info.undecided,
            disk_free_bytes: info.disk_free_bytes,
            disk_bytes: info.disk_bytes,
            sites: sites.sites.into_iter().map(SiteView::from).collect(),
            trouble: Some(info.trouble).filter(|trouble| !trouble.is_empty()),
        }
    }
}

impl Report for FarmStatus {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "coordinator {}, renderer revision {}, started {} (start {} over {})",
            self.build,
            self.revision,
            view::ago(self.started_unix_ms),
            self.epoch,
            self.state
        )?;
        write!(
            out,
            "  workers  {} connected with {} threads, {} tiles out",
            self.workers_connected, self.threads, self.attempts_live
        )?;
        match self.workers_aside {
            0 => writeln!(out)?,
            aside => writeln!(out, "; {aside} set aside: `flyby worker list`")?,
        }
        writeln!(
            out,
            "  jobs     {} running, {} remembered",
            self.jobs_running, self.jobs
        )?;
        if let (Some(free), Some(all)) = (self.disk_free_bytes, self.disk_bytes) {
            writeln!(
                out,
                "  disk     {} of {} free",
                HumanBytes(free),
                HumanBytes(all)
            )?;
        }
        for (index, site) in self.sites.iter().enumerate() {
            let heading = if index == 0 { "sites" } else { "" };
            writeln!(out, "  {heading:<8} {}", site.line())?;
            if let Some(trouble) = site.trouble() {
                writeln!(out, "           {trouble}")?;
            }
        }
        if self.undecided > 0 {
            writeln!(
                out,
                "  WRONG    {} blocks had two renderings that differ: `flyby farm doctor`",
                self.undecided
            )?;
        }
        match &self.trouble {
            Some(trouble) => writeln!(out, "  WAITS    for its disk: {trouble}"),
            None => Ok(()),
        }
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.workers_connected)
    }
}

async fn status(context: &Context, options: &FarmOptions) -> Result<Ending, Error> {
    let mut farm = context.connect(options).await?;
    let info = farm
        .info(InfoRequest {})
        .await
        .map_err(|status| refused("cannot ask how the farm stands", status))?;
    let sites = farm
        .list_sites(ListSitesRequest {})
        .await
        .map_err(|status| refused("cannot ask how the sites stand", status))?;
    let status = FarmStatus::new(info.into_inner(), sites.into_inner());
    output::print(context.output, &status)?;
    Ok(Ending::Done)
}

/// `farm clean`.
#[derive(Serialize)]
struct Cleaned {
    /// Whether nothing was done but to look.
    dry_run: bool,
    /// What went, or would.
    jobs: Vec<CleanedJob>,
}

/// A job that went, or would.
#[derive(Serialize)]
struct CleanedJob {
    /// Its number.
    job: u64,
    /// What its user called it; empty for one that was forgotten before.
    name: String,
    /// Bytes of its frames that went too.
    frame_bytes: u64,
}

impl Report for Cleaned {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let bytes = self.jobs.iter().map(|job| job.frame_bytes).sum();
        if !self.jobs.is_empty() {
            let mut table = columns(["job", "name", "frames"]);
            for job in &self.jobs {
                let bytes = HumanBytes(job.frame_bytes).to_string();
                table.add_row([job.job.to_string(), job.name.clone(), bytes]);
            }
            writeln!(out, "{}", table.trim_fmt())?;
        }
        writeln!(
            out,
            "{} jobs {} forgotten, {} of frames {} removed",
            self.jobs.len(),
            if self.dry_run { "would be" } else { "are" },
            HumanBytes(bytes),
            if self.dry_run { "would be" } else { "are" },
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut jobs = self.jobs.iter();
        jobs.try_for_each(|job| writeln!(out, "{}", job.job))
    }
}

async fn clean(context: &Context, options: &Clean) -> Result<Ending, Error> {
    let mut farm = context.connect(&options.farm).await?;
    let answer = farm
        .clean(proto::CleanRequest {
            older_ms: options.older.0 / 1_000,
            frames: options.frames,
            dry_run: options.dry_run,
        })
        .await
        .map_err(|status| refused("cannot clean the farm", status))?;
    let jobs = answer.into_inner().jobs.into_iter();
    let jobs = jobs.map(|job| CleanedJob {
        job: job.job,
        name: job.name,
        frame_bytes: job.bytes,
    });
    let cleaned = Cleaned {
        dry_run: options.dry_run,
        jobs: jobs.collect(),
    };
    output::print(context.output, &cleaned)?;
    Ok(Ending::Done)
}
