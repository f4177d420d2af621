//! `flyby worker`: runs a worker until it is told to stop; with a verb, manages workers.

use std::fs::{self, File};
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use agent::{Admission, Ask, ExitReason, Invitation, RenderPainter, RunError};
use clap::{Args, Subcommand};
use model::Span;
use render::SimdLevel;
use serde::Serialize;
use tokio::sync::mpsc;
use wire::place;
use wire::proto::{self, ListWorkersRequest, WorkerList};

use super::render::processors;
use crate::daemon::{self, DaemonOptions};
use crate::error::{Ending, Error};
use crate::farm::link::{block_on, refused};
use crate::farm::view::{self, Reason, Workers};
use crate::options::{Context, FarmOptions};
use crate::output;
use crate::stop::Stop;
use crate::values;

#[derive(Args, Debug)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct WorkerCommand {
    #[command(subcommand)]
    verb: Option<Verb>,

    #[command(flatten)]
    worker: Worker,
}

#[derive(Subcommand, Debug)]
enum Verb {
    /// Lists the workers that the coordinator knows.
    List(List),
    /// Says why a worker has not more to do.
    Why(Why),
    /// Has workers finish what they hold and leave.
    Drain(Drain),
}

#[derive(Args, Debug)]
struct Why {
    /// Its name or number.
    #[arg(value_name = "WORKER")]
    named: String,
    #[command(flatten)]
    farm: FarmOptions,
}

#[derive(Args, Debug)]
struct Drain {
    /// Their names or numbers.
    #[arg(value_name = "WORKER", required_unless_present = "all")]
    named: Vec<String>,

    /// Every worker.
    #[arg(long, conflicts_with = "named")]
    all: bool,

    #[command(flatten)]
    farm: FarmOptions,
}

#[derive(Args, Debug)]
struct List {
    #[command(flatten)]
    farm: FarmOptions,
}

#[derive(Args, Debug)]
struct Worker {
    #[command(flatten)]
    farm: FarmOptions,

    /// Render threads [default: one for each processor].
    #[arg(long, value_name = "N", value_parser = values::at_least_one)]
    threads: Option<usize>,

    /// Tiles to hold beyond those that are rendered [default: as many as it takes that no thread waits].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(..=4096))]
    ahead: Option<u32>,

    /// What it calls itself; one with a name keeps its number and the files of scenes in the
    /// state folder [default: the machine's name and the process].
    #[arg(long, value_name = "NAME")]
    name: Option<String>,

    /// Instruction set; pixels do not depend on it [default: the best of this machine].
    #[arg(long, value_name = "LEVEL")]
    simd: Option<SimdLevel>,

    /// A label that jobs may ask for; may be repeated.
    #[arg(long, value_name = "LABEL", value_parser = values::label)]
    label: Vec<String>,

    /// How long it may run, such as 12 h: it takes no tile that would not be finished by then, and leaves in time.
    #[arg(long, value_name = "TIME", value_parser = values::span)]
    time_limit: Option<Span>,

    /// Leaves when there was nothing to do for so long, such as 2 min.
    #[arg(long, value_name = "TIME", value_parser = values::span)]
    idle: Option<Span>,

    #[command(flatten)]
    daemon: DaemonOptions,
}

/// Runs the command.
pub(crate) fn run(context: &Context, command: WorkerCommand) -> Result<Ending, Error> {
    match command.verb {
        None => work(context, &command.worker),
        Some(Verb::List(options)) => block_on(list(context, &options.farm)),
        Some(Verb::Why(options)) => block_on(why(context, &options)),
        Some(Verb::Drain(options)) => block_on(drain(context, options)),
    }
}

/// What `worker why` asks about.
#[derive(Serialize)]
struct Asked {
    /// The worker, as it was asked for.
    worker: String,
}

async fn why(context: &Context, options: &Why) -> Result<Ending, Error> {
    let mut farm = context.connect(&options.farm).await?;
    let answer = farm
        .why(proto::WhyRequest {
            worker: Some(options.named.clone()),
            ..proto::WhyRequest::default()
        })
        .await
        .map_err(|status| refused("cannot say why the worker waits", status))?;
    let reason = Reason {
        asked: Asked {
            worker: options.named.clone(),
        },
        why: answer.into_inner().sentence,
    };
    output::print(context.output, &reason)?;
    Ok(Ending::Done)
}

async fn drain(context: &Context, options: Drain) -> Result<Ending, Error> {
    let mut farm = context.connect(&options.farm).await?;
    let answer = farm
        .drain_workers(proto::DrainRequest {
            workers: options.named,
            all: options.all,
        })
        .await
        .map_err(|status| refused("cannot drain the workers", status))?;
    print(context, answer.into_inner())
}

fn print(context: &Context, workers: WorkerList) -> Result<Ending, Error> {
    let workers = workers.workers.into_iter().map(view::Worker::from);
    let workers = workers.collect();
    output::print(context.output, &Workers { workers })?;
    Ok(Ending::Done)
}

async fn list(context: &Context, options: &FarmOptions) -> Result<Ending, Error> {
    let mut farm = context.connect(options).await?;
    let answer = farm
        .list_workers(ListWorkersRequest {})
        .await
        .map_err(|status| refused("cannot list the workers", status))?;
    print(context, answer.into_inner())
}

fn work(context: &Context, options: &Worker) -> Result<Ending, Error> {
    let admission = admission(context, options)?;
    let coordinator = admission.to_string();
    let home = match &options.name {
        Some(name) => Some(Home::take(&context.state()?, name)?),
        None => None,
    };
    let threads = options.threads.unwrap_or_else(processors);
    let threads = u32::try_from(threads).ok().and_then(NonZeroU32::new);
    let name = options.name.clone().unwrap_or_else(usual_name);
    let config = agent::Config {
        ahead: options.ahead,
        state: home.as_ref().map(|home| home.folder.clone()),
        build: daemon::software(),
        memory_bytes: memory_bytes(),
        labels: options.label.clone(),
        idle: options.idle,
        time_limit: options.time_limit,
        ..agent::Config::new(admission, name, threads.unwrap_or(NonZeroU32::MIN))
    };
    let painter = RenderPainter::new(options.simd.unwrap_or_else(SimdLevel::best));
    options.daemon.log()?;
    let stop = Stop::on_signals()?;
    options.daemon.stop_with_input(&stop);
    let ended = daemon::block_on(async {
        let (asks, heard) = mpsc::channel(1);
        let told = tokio::spawn(async move {
            stop.wait().await;
            // A worker that has ended by itself needs no telling.
            let _ = asks.send(Ask::Stop).await;
        });
        let ended = agent::run(config, Arc::new(painter), heard).await;
        told.abort();
        ended.map_err(cannot_run)
    })?;
    match ended {
        ExitReason::Drained | ExitReason::Stopped | ExitReason::Idle => Ok(Ending::Done),
        ExitReason::Refused { reason } => Err(Error::unreachable(format!(
            "the coordinator at {coordinator} refuses this worker"
        ))
        .because(reason)),
        ExitReason::GaveUp { reason } => Err(Error::unreachable(format!(
            "the coordinator at {coordinator} was not reached for too long"
        ))
        .because(reason)
        .next("start one with `flyby coordinator`, then this worker again")),
    }
}

/// How it gets to the coordinator: by a token's file, or on this machine by the state folder.
fn admission(context: &Context, options: &Worker) -> Result<Admission, Error> {
    let Some(file) = context.token_file()? else {
        return Ok(Admission::Local {
            coordinator: context.here(&options.farm)?,
            token: context.token()?,
        });
    };
    if file.role != "worker" {
        return Err(Error::usage(format!(
            "the token has the role `{}`, and workers join by one of the role `worker`",
            file.role
        ))
        .next("make one with `flyby token create --role worker`"));
    }
    let keep = context.state.as_deref();
    Ok(Admission::Invited(Invitation {
        file,
        address: options.farm.coordinator.clone(),
        keep: keep.map(|state| state.join(place::JOINED_FOLDER)),
    }))
}

fn cannot_run(error: RunError) -> Error {
    Error::failed("cannot run the worker").because(error)
}

/// The folder of a named worker, which this process alone uses.
struct Home {
    folder: PathBuf,
    _lock: File,
}

impl Home {
    fn take(state: &Path, name: &str) -> Result<Self, Error> {
        let folder = state.join("workers").join(crate::existing::stem(name));
        let attempt = || format!("cannot use the folder `{}`", folder.display());
        fs::create_dir_all(&folder).map_err(|error| Error::failed(attempt()).because(error))?;
        let lock = File::create(folder.join("lock"))
            .map_err(|error| Error::failed(attempt()).because(error))?;
        match lock.try_lock() {
            Ok(()) => Ok(Self {
                folder,
                _lock: lock,
            }),
            Err(fs::TryLockError::WouldBlock) => Err(Error::failed(format!(
                "another worker that is called `{name}` runs here"
            ))
            .next("choose another `--name`, or give none")),
            Err(fs::TryLockError::Error(error)) => Err(Error::failed(attempt()).because(error)),
        }
    }
}

/// The machine's name and this process.
fn usual_name() -> String {
    let machine = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let machine = match machine.trim() {
        "" => "worker",
        name => name,
    };
    format!("{machine}-{}", std::process::id())
}

/// The memory of this machine; 0 where it is not known.
fn memory_bytes() -> u64 {
    let text = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    total_memory(&text).unwrap_or(0)
}

fn total_memory(meminfo: &str) -> Option<u64> {
    let line = meminfo
        .lines()
        .find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_name_one_worker() {
        let state = tempfile::tempdir().unwrap();
        let first = Home::take(state.path(), "left").unwrap();
        let second = Home::take(state.path(), "left").err().unwrap();
        assert!(
            second
                .to_string()
                .contains("another worker that is called `left`")
        );
        drop(first);
        assert!(Home::take(state.path(), "left").is_ok());
    }

    #[test]
    fn memory_as_the_system_says_it() {
        let said = "MemTotal:       16384 kB\nMemFree: 1 kB\n";
        assert_eq!(total_memory(said), Some(16_384 * 1024));
        assert_eq!(total_memory(""), None);
    }
}
