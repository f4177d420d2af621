//! Messages in and out: where generated types begin and end.
//!
//! Each call is checked here, turned into an input of the loop, and answered. Nothing in
//! here decides anything about the farm.

mod bytes;
mod clean;
mod control;
mod delivery;
mod joining;
mod tokens;
mod user;
mod workers;

use std::collections::BTreeSet;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio_stream::wrappers::ReceiverStream;
use tonic::Request;
use tonic::transport::Server;
use wire::link;
use wire::proto::farm_server::FarmServer;
use wire::proto::joining_server::JoiningServer;
use wire::proto::workers_server::WorkersServer;
use wire::proto::{self, ErrorKind};
use wire::{BadMessage, Failure, convert};

use crate::config::Config;
use crate::inbox::Inbox;
use crate::input::{Gates, Input, Reply};
use crate::sites::Board;
use crate::space::Space;
use crate::state::State;
use crate::trust::Trust;
use crate::trust::acceptor::Connection;
use crate::trust::gate::{Gated, Who};

pub(crate) use self::delivery::read as read_delivery;

/// Most calls at the same time on one connection.
const STREAMS_MAX: u32 = 256;

/// Most bytes of a label.
const LABEL_BYTES_MAX: usize = 64;

/// Largest message of somebody whom nobody knows yet.
const JOINING_BYTES_MAX: usize = 4_096;

/// How long whoever opens a stream may take to say who it is.
const HELLO_TIMEOUT: Duration = Duration::from_secs(10);

/// What every call needs.
#[derive(Debug)]
pub(crate) struct Door {
    inputs: mpsc::Sender<Input>,
    config: Arc<Config>,
    state: Arc<State>,
    trust: Arc<Trust>,
    /// Where other machines can reach it.
    addresses: Vec<String>,
    loopback_only: bool,
    inbox: Inbox,
    submissions: Arc<Semaphore>,
    gates: Gates,
    watchers: Arc<Semaphore>,
    sites: Board,
}

impl Door {
    pub(crate) fn new(
        inputs: mpsc::Sender<Input>,
        config: Arc<Config>,
        state: Arc<State>,
        trust: Arc<Trust>,
        addresses: Vec<String>,
        (sites, gates): (Board, Gates),
    ) -> Self {
        let limits = &config.limits;
        Self {
            inputs,
            inbox: Inbox::new(state.inbox(), limits.asset_bytes_max),
            submissions: Arc::new(Semaphore::new(limits.submissions_max)),
            watchers: Arc::new(Semaphore::new(limits.watchers_max)),
            loopback_only: config.listen.ip().is_loopback(),
            sites,
            gates,
            config,
            state,
            trust,
            addresses,
        }
    }

    /// Hands something to the loop.
    async fn feed(&self, input: Input) -> Result<(), Failure> {
        self.inputs.send(input).await.map_err(|_| stopping())
    }

    /// Asks the loop, and waits for its answer.
    async fn ask<T>(&self, input: impl FnOnce(Reply<T>) -> Input) -> Result<T, Failure> {
        let (reply, answer) = oneshot::channel();
        self.feed(input(reply)).await?;
        answer.await.unwrap_or_else(|_| Err(stopping()))
    }

    /// How much room the disk of the state folder has.
    async fn space(&self) -> Option<Space> {
        let state = self.state.clone();
        let asked = tokio::task::spawn_blocking(move || Space::at(state.root()));
        asked.await.ok().flatten()
    }
}

fn stopping() -> Failure {
    Failure::later(ErrorKind::Stopping, "the coordinator is stopping")
}

/// Who asks, as the gate found out.
fn who<T>(request: &Request<T>) -> Who {
    // Nothing passes the gate without.
    let who = request.extensions().get().copied();
    who.unwrap_or(Who::Stranger)
}

/// Serves until `stop` is there and every stream has ended.
pub(crate) async fn serve(
    connections: ReceiverStream<std::io::Result<Connection>>,
    door: Arc<Door>,
    stop: impl Future<Output = ()>,
) -> Result<(), tonic::transport::Error> {
    let trust = door.trust.clone();
    let farm = FarmServer::from_arc(door.clone())
        .max_decoding_message_size(link::MESSAGE_BYTES_MAX)
        .max_encoding_message_size(link::MESSAGE_BYTES_MAX);
    let workers = WorkersServer::from_arc(door.clone())
        .max_decoding_message_size(link::MESSAGE_BYTES_MAX)
        .max_encoding_message_size(link::MESSAGE_BYTES_MAX);
    let joining = JoiningServer::from_arc(door).max_decoding_message_size(JOINING_BYTES_MAX);
    Server::builder()
        .initial_connection_window_size(link::CONNECTION_WINDOW_BYTES)
        .initial_stream_window_size(link::STREAM_WINDOW_BYTES)
        .max_concurrent_streams(STREAMS_MAX)
        .http2_keepalive_interval(Some(link::KEEPALIVE_INTERVAL))
        .http2_keepalive_timeout(Some(link::KEEPALIVE_TIMEOUT))
        .add_service(Gated::new(farm, trust.clone()))
        .add_service(Gated::new(workers, trust.clone()))
        .add_service(Gated::new(joining, trust))
        .serve_with_incoming_shutdown(connections, stop)
        .await
}

/// Labels of a worker, or that a job asks for; how many there may be is the scheduler's to say.
pub(crate) fn labels(
    labels: Vec<String>,
    field: &'static str,
) -> Result<BTreeSet<String>, BadMessage> {
    let label = |label| convert::text(label, field, 1..=LABEL_BYTES_MAX);
    labels.into_iter().map(label).collect()
}

/// A format as a message names it.
pub(crate) fn format_message(format: image::Format) -> proto::FrameFormat {
    match format {
        image::Format::Exr => proto::FrameFormat::Exr,
        image::Format::Png8 => proto::FrameFormat::Png8,
        image::Format::Png16 => proto::FrameFormat::Png16,
        image::Format::Ppm => proto::FrameFormat::Ppm,
    }
}

/// The format that a message names.
pub(crate) fn format(message: proto::FrameFormat) -> image::Format {
    match message {
        proto::FrameFormat::Unspecified | proto::FrameFormat::Exr => image::Format::Exr,
        proto::FrameFormat::Png8 => image::Format::Png8,
        proto::FrameFormat::Png16 => image::Format::Png16,
        proto::FrameFormat::Ppm => image::Format::Ppm,
    }
}
