//! `flyby coordinator`: runs a coordinator until it is told to stop.

use std::net::{Ipv4Addr, SocketAddr};
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};

use clap::Args;
use model::Span;
use server::StartError;

use crate::bench::farm::null;
use crate::daemon::{self, DaemonOptions, Started};
use crate::error::Error;
use crate::options::Context;
use crate::stop::Stop;
use crate::{Ending, values};

#[derive(Args, Debug)]
pub(crate) struct Coordinator {
    /// Where to listen; `0.0.0.0:7359` is every address of this machine. Port 0 takes any free one. Whoever is not on this
    /// machine speaks TLS, and needs a token (`flyby token create`).
    #[arg(long, value_name = "ADDR", default_value_t = SocketAddr::from((Ipv4Addr::LOCALHOST, wire::place::DEFAULT_PORT)))]
    listen: SocketAddr,

    /// Where other machines reach it, for the files of tokens, such as farm.example.org:7359; may be repeated [default:
    /// where it listens, or the addresses by which this machine reaches others].
    #[arg(long, value_name = "HOST:PORT", value_parser = values::host_port)]
    advertise: Vec<String>,

    /// How long certificates count: its own, and those of workers. They are renewed at two thirds of that; 3 s to 31 d.
    #[arg(long, value_name = "TIME", default_value = "24 h", value_parser = values::certificate_life)]
    certificate_life: Span,

    /// A worker of which nothing is heard for so long is lost, such as 4 s.
    #[arg(long, value_name = "TIME", default_value = "4 s", value_parser = values::span)]
    liveness: Span,

    /// How many tiles of a hundred are rendered once more by another worker and compared to the bit; where two differ a third
    /// decides, and what the wrong one made is rendered again. Frames wait for it, so there should be three workers or more without
    /// time limits. 0 is none.
    #[arg(long, value_name = "PERCENT", default_value = "0", value_parser = values::percent)]
    verify: u32,

    /// A program to run whenever a job is over; its environment names the job: FLYBY_JOB, FLYBY_JOB_NAME,
    /// FLYBY_JOB_STATE (done, failed or cancelled), FLYBY_JOB_FRAMES, FLYBY_JOB_FRAMES_DONE, FLYBY_JOB_FRAMES_FAILED and
    /// FLYBY_JOB_FOLDER, where its frames are. One run at a time, of ten minutes at most; one that runs when the coordinator stops is killed.
    #[arg(long, value_name = "PROGRAM")]
    on_job_end: Option<PathBuf>,

    /// A file of sites, such as deploy/sites.toml in the source: clusters and hosts to which allocations of workers are
    /// submitted as the jobs need them. `flyby site check` says what each is like.
    #[arg(long, value_name = "FILE")]
    sites: Option<PathBuf>,

    /// Takes the pixels of `bench farm` and no others; refused over any other state folder than its own.
    #[arg(long, hide = true)]
    null_renderer: bool,

    #[command(flatten)]
    daemon: DaemonOptions,
}

/// Runs the command.
pub(crate) fn run(context: &Context, options: &Coordinator) -> Result<Ending, Error> {
    let state = context.state()?;
    let revision = match options.null_renderer {
        true => null::revision_over(&state)?,
        false => model::Revision(render::REVISION),
    };
    let usual = server::Config::new(state, revision, daemon::software());
    let config = server::Config {
        listen: options.listen,
        advertise: options.advertise.clone(),
        certificate_life: options.certificate_life,
        liveness_limit: options.liveness,
        // Four heartbeats may be missed, and one a second is enough.
        heartbeat_interval: Span((options.liveness.0 / 4).clamp(1_000, 1_000_000)),
        verify: options.verify,
        sites: match &options.sites {
            Some(path) => super::site::read(path)?.0,
            None => Vec::new(),
        },
        on_job_end: options.on_job_end.as_deref().map(program).transpose()?,
        ..usual
    };
    let state = config.state.clone();
    options.daemon.log()?;
    let stop = Stop::on_signals()?;
    options.daemon.stop_with_input(&stop);
    daemon::block_on(async {
        let running = server::start(config).await.map_err(not_started)?;
        let address = running.address();
        daemon::say_started(context.output, &Started::coordinator(address, &state))?;
        let ended = running.run_until(stop.wait()).await;
        ended.map_err(|broken| Error::failed("the coordinator had to stop").because(broken))?;
        Ok(Ending::Done)
    })
}

/// The hook's program, which must be there now and not only when the first job is over.
fn program(path: &Path) -> Result<PathBuf, Error> {
    let attempt = || format!("cannot use `{}` for --on-job-end", path.display());
    let found = path.canonicalize();
    let found = found.map_err(|error| Error::usage(attempt()).because(error))?;
    let metadata = std::fs::metadata(&found);
    let metadata = metadata.map_err(|error| Error::usage(attempt()).because(error))?;
    if !metadata.is_file() || metadata.permissions().mode() & 0o111 == 0 {
        return Err(Error::usage(attempt())
            .because("it is not a program")
            .next("`chmod +x` it, if it is a script"));
    }
    Ok(found)
}

fn not_started(error: StartError) -> Error {
    match error {
        StartError::PortInUse(address) => Error::failed(format!(
            "cannot listen on {address}: another program listens there"
        ))
        .next("perhaps a coordinator still runs: stop it, or choose another port with `--listen`"),
        error => Error::failed("cannot start the coordinator").because(error),
    }
}
