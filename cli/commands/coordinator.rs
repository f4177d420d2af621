//! `flyby coordinator`: runs a coordinator until it is told to stop.

use std::net::{Ipv4Addr, SocketAddr};

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
    /// Where to listen; on this machine only. Port 0 takes any free one.
    #[arg(long, value_name = "ADDR", default_value_t = SocketAddr::from((Ipv4Addr::LOCALHOST, wire::place::DEFAULT_PORT)))]
    listen: SocketAddr,

    /// A worker of which nothing is heard for so long is lost, such as 4 s.
    #[arg(long, value_name = "TIME", default_value = "4 s", value_parser = values::span)]
    liveness: Span,

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
        liveness_limit: options.liveness,
        // Four heartbeats may be missed, and one a second is enough.
        heartbeat_interval: Span((options.liveness.0 / 4).clamp(1_000, 1_000_000)),
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

fn not_started(error: StartError) -> Error {
    match error {
        StartError::NotLoopback(_) => Error::usage("cannot start the coordinator").because(error),
        StartError::PortInUse(address) => Error::failed(format!(
            "cannot listen on {address}: another program listens there"
        ))
        .next("perhaps a coordinator still runs: stop it, or choose another port with `--listen`"),
        error => Error::failed("cannot start the coordinator").because(error),
    }
}
