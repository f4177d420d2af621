//! Starting and stopping a coordinator.

use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use image::ImageError;
use model::{Epoch, JobId};
use store::{Sqlite, StoreError};
use tokio::net::TcpListener;
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;
use wire::auth::Token;

use crate::clock::Clock;
use crate::config::Config;
use crate::grpc::{self, Door};
use crate::input::{Gates, Input, News};
use crate::shell::{Kept, Shell};
use crate::sites::Sites;
use crate::state::{State, StateError};
use crate::storage::Storage;
use crate::trust::{Trust, acceptor, addresses};

/// News that wait for the loop; whoever has more waits.
const NEWS_MAX: usize = 64;

/// How long open streams may take to end once everybody was told that the coordinator stops.
const STOP_TIMEOUT: Duration = Duration::from_secs(5);

/// Why a coordinator did not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The state folder cannot be used.
    #[error(transparent)]
    State(#[from] StateError),
    /// The store cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// What the store says of a job cannot be understood.
    #[error(
        "the store says of job {job} what cannot be understood ({what}); start the version that took it, or move the store away to begin without it"
    )]
    Job {
        /// The job.
        job: JobId,
        /// What is wrong.
        what: String,
    },
    /// A scratch file cannot be read.
    #[error("an image that is being rendered cannot be gone on with")]
    Scratch(#[source] ImageError),
    /// Another program listens there.
    #[error("port {} is in use at {}: stop the other program, or choose another port", .0.port(), .0.ip())]
    PortInUse(SocketAddr),
    /// The system refused to listen.
    #[error("cannot listen on {address}")]
    Listen {
        /// Where.
        address: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// TLS cannot be set up.
    #[error("cannot set up TLS with the certificate authority of the state folder")]
    Tls(#[source] rustls::Error),
    /// What this farm is called at its sites cannot be kept.
    #[error(transparent)]
    Sites(#[from] cluster::ClusterError),
    /// The system refused a thread.
    #[error("cannot start a thread")]
    Thread(#[source] io::Error),
}

/// The store failed in a way that will not pass.
#[derive(Debug, thiserror::Error)]
#[error("the coordinator had to stop, since its store can be used no more: {0}")]
pub struct StoreBroken(String);

/// A coordinator that runs. Dropping it without [`Running::shutdown`] leaves it running
/// as long as the runtime does.
#[derive(Debug)]
pub struct Running {
    address: SocketAddr,
    local: SocketAddr,
    epoch: Epoch,
    token: Token,
    inputs: mpsc::Sender<Input>,
    news: mpsc::Sender<News>,
    stop: oneshot::Sender<()>,
    shell: JoinHandle<Result<(), String>>,
    server: JoinHandle<Result<(), tonic::transport::Error>>,
}

/// Starts a coordinator over a state folder.
///
/// Answers once it listens; from then on it runs on the runtime that this is called on, until
/// [`Running::run_until`] stops it.
pub async fn start(config: Config) -> Result<Running, StartError> {
    let config = Arc::new(config);
    let state = Arc::new(State::take(&config.state)?);
    let mut store = Sqlite::open(&state.store())?;
    let (kept, open) = Kept::read(&state, &mut store)?;
    let trust = Arc::new(Trust::open(&state, config.certificate_life)?);
    let listening = Listening::on(config.listen).await?;
    let Listening { address, local, .. } = listening;
    state.announce(local)?;
    let connections =
        acceptor::accept(listening.listeners, &trust.authority).map_err(StartError::Tls)?;

    let (inputs, taken) = mpsc::channel(config.limits.inputs_max);
    let (news, heard) = mpsc::channel(NEWS_MAX);
    let storage =
        Storage::start(news.clone(), Box::new(store), open).map_err(StartError::Thread)?;
    let jobs = kept.len();
    let addresses = addresses::of(&config.advertise, address);
    let gates = Gates::new(config.limits.blocks_in_flight_max);
    let sites = Sites::start(
        &config,
        &state,
        (address, &addresses),
        &trust,
        (&inputs, &gates),
    )?;
    let board = sites.board().clone();
    let mut shell = Shell::new(
        config.clone(),
        state.clone(),
        Clock::start(),
        storage,
        sites,
    );
    shell.recall(kept);
    let shell = tokio::spawn(shell.run(heard, taken));
    let door = Door::new(
        inputs.clone(),
        config,
        state.clone(),
        trust,
        addresses,
        (board, gates),
    );
    let (stop, stopped) = oneshot::channel();
    let token = state.token().clone();
    let server = tokio::spawn(grpc::serve(connections, Arc::new(door), async {
        let _ = stopped.await;
    }));
    tracing::info!(
        %address,
        epoch = state.epoch().0,
        jobs,
        "the coordinator listens"
    );
    Ok(Running {
        address,
        local,
        epoch: state.epoch(),
        token,
        inputs,
        news,
        stop,
        shell,
        server,
    })
}

/// Where a coordinator listens.
struct Listening {
    listeners: Vec<TcpListener>,
    /// Where it was told to.
    address: SocketAddr,
    /// Where it does on this machine.
    local: SocketAddr,
}

impl Listening {
    /// Listens there, and on loopback too: on the same port, or another where that is taken.
    async fn on(wanted: SocketAddr) -> Result<Self, StartError> {
        let listener = listen(wanted).await?;
        let address = bound(&listener, wanted)?;
        let loopback = |port| SocketAddr::from((Ipv4Addr::LOCALHOST, port));
        if address.ip().is_loopback()
            || address == SocketAddr::from((Ipv4Addr::UNSPECIFIED, address.port()))
        {
            let local = match address.ip().is_loopback() {
                true => address,
                false => loopback(address.port()),
            };
            return Ok(Self {
                listeners: vec![listener],
                address,
                local,
            });
        }
        let inner = match listen(loopback(address.port())).await {
            Err(StartError::PortInUse(_)) => listen(loopback(0)).await?,
            inner => inner?,
        };
        Ok(Self {
            local: bound(&inner, loopback(0))?,
            listeners: vec![listener, inner],
            address,
        })
    }
}

fn bound(listener: &TcpListener, wanted: SocketAddr) -> Result<SocketAddr, StartError> {
    listener.local_addr().map_err(|source| StartError::Listen {
        address: wanted,
        source,
    })
}

async fn listen(address: SocketAddr) -> Result<TcpListener, StartError> {
    TcpListener::bind(address)
        .await
        .map_err(|source| match source.kind() {
            io::ErrorKind::AddrInUse => StartError::PortInUse(address),
            _ => StartError::Listen { address, source },
        })
}

impl Running {
    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Where it listens on this machine, in the clear.
    pub fn local(&self) -> SocketAddr {
        self.local
    }

    /// How often a coordinator was started over its state folder.
    pub fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// Its token.
    pub fn token(&self) -> &Token {
        &self.token
    }

    /// Lets it run until `asked` says to stop it, or until it must stop; then stops it: workers and watchers are
    /// told; jobs go on at the next start. Answers when everything has ended.
    ///
    /// An error says that its store can be used no more.
    pub async fn run_until(mut self, asked: impl Future<Output = ()>) -> Result<(), StoreBroken> {
        let ended = tokio::select! {
            () = asked => {
                // An error says that the loop has ended already.
                let _ = self.news.send(News::Stop).await;
                (&mut self.shell).await
            }
            ended = &mut self.shell => ended,
        };
        let result = ended.unwrap_or_else(|_| {
            tracing::error!("the coordinator's loop died of a mistake in this program");
            Ok(())
        });
        drop(self.stop);
        drop(self.inputs);
        let mut server = self.server;
        if tokio::time::timeout(STOP_TIMEOUT, &mut server)
            .await
            .is_err()
        {
            server.abort();
        }
        tracing::info!("the coordinator has stopped");
        result.map_err(StoreBroken)
    }

    /// Stops it now.
    pub async fn shutdown(self) -> Result<(), StoreBroken> {
        self.run_until(std::future::ready(())).await
    }
}
