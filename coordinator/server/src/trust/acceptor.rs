//! Connections, as they come: what speaks TLS is heard out, what does not is told apart by its first byte.
//!
//! A caller that says nothing costs a place among those that arrive, for a few seconds; where no place is free the
//! one that arrives longest loses its own, so that nobody who speaks up waits for those who do not.

use std::collections::VecDeque;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use rustls::RootCertStore;
use rustls::server::{NoServerSessionStorage, ServerConfig};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::task::{AbortHandle, JoinSet};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::server::Connected;
use wire::tls::certificate::Claims;
use wire::tls::{ALPN, VERSIONS, provider};

use super::anytime::Anytime;
use super::authority::Authority;
use super::room::{Place, Room};

/// How long a caller may take until it has been heard out: its first byte, and all of TLS.
const ARRIVAL_TIMEOUT: Duration = Duration::from_secs(10);

/// Most callers that arrive at the same time on one address.
pub(super) const ARRIVING_MAX: usize = 256;

/// Callers that have arrived and wait to be served.
const ARRIVED_MAX: usize = 64;

/// How long to wait after the system could not hand over a connection, because there are too many.
const PAUSE: Duration = Duration::from_millis(50);

/// What the first byte of TLS is: a handshake's record.
const HANDSHAKE: u8 = 0x16;

/// Who calls, as far as its connection tells.
#[derive(Clone, Debug)]
pub(crate) struct Caller {
    pub(crate) peer: SocketAddr,
    pub(crate) line: Line,
}

/// What a connection is.
#[derive(Clone, Debug)]
pub(crate) enum Line {
    /// In the clear, from this machine.
    Loopback,
    /// In the clear, from elsewhere.
    Open,
    /// Whatever it is, there is no room for it.
    Over,
    /// TLS; with the certificate that was shown and is this authority's, if one was.
    Tls(Option<Arc<Claims>>),
}

/// What a connection gives to those who serve it.
pub(crate) struct Connection {
    io: Io,
    caller: Caller,
    /// Held while the connection is open.
    _place: Place,
}

enum Io {
    Plain(TcpStream),
    Tls(Box<TlsStream<TcpStream>>),
}

/// Callers that have arrived on all these addresses, until what this answers is dropped.
pub(crate) fn accept(
    listeners: Vec<TcpListener>,
    authority: &Arc<Authority>,
) -> Result<ReceiverStream<io::Result<Connection>>, rustls::Error> {
    let tls = TlsAcceptor::from(Arc::new(config(authority)?));
    let (arrived, connections) = mpsc::channel(ARRIVED_MAX);
    let room = Room::of_process();
    for listener in listeners {
        tokio::spawn(listen(listener, tls.clone(), room.clone(), arrived.clone()));
    }
    Ok(connections.into())
}

fn config(authority: &Arc<Authority>) -> Result<ServerConfig, rustls::Error> {
    let mut roots = RootCertStore::empty();
    roots.add(authority.certificate().clone())?;
    let verifier = Anytime::new(roots)?;
    let mut config = ServerConfig::builder_with_provider(provider())
        .with_protocol_versions(VERSIONS)?
        .with_client_cert_verifier(Arc::new(verifier))
        .with_cert_resolver(authority.clone());
    config.alpn_protocols = vec![ALPN.to_vec()];
    // Nothing is taken up again: a session would outlive its certificate.
    config.session_storage = Arc::new(NoServerSessionStorage {});
    config.send_tls13_tickets = 0;
    Ok(config)
}

async fn listen(
    listener: TcpListener,
    tls: TlsAcceptor,
    room: Room,
    arrived: mpsc::Sender<io::Result<Connection>>,
) {
    let mut arriving = JoinSet::new();
    let mut oldest_first: VecDeque<AbortHandle> = VecDeque::new();
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            Some(_) = arriving.join_next(), if !arriving.is_empty() => continue,
            () = arrived.closed() => return,
        };
        let (stream, peer) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                tracing::warn!(%error, "a connection could not be taken");
                tokio::time::sleep(PAUSE).await;
                continue;
            }
        };
        oldest_first.retain(|arrival| !arrival.is_finished());
        if oldest_first.len() >= ARRIVING_MAX
            && let Some(oldest) = oldest_first.pop_front()
        {
            tracing::debug!("too many callers arrive at once: the oldest is dropped");
            oldest.abort();
        }
        let (tls, room, arrived) = (tls.clone(), room.clone(), arrived.clone());
        oldest_first.push_back(arriving.spawn(async move {
            let arrival = arrive(stream, peer, tls, &room);
            let arrival = tokio::time::timeout(ARRIVAL_TIMEOUT, arrival).await;
            match arrival {
                Ok(Ok(connection)) => {
                    // Nobody serves any more.
                    let _ = arrived.send(Ok(connection)).await;
                }
                Ok(Err(error)) => tracing::debug!(%peer, %error, "a caller did not arrive"),
                Err(_) => tracing::debug!(%peer, "a caller took too long to arrive"),
            }
        }));
    }
}

async fn arrive(
    stream: TcpStream,
    peer: SocketAddr,
    tls: TlsAcceptor,
    room: &Room,
) -> io::Result<Connection> {
    stream.set_nodelay(true)?;
    let mut first = [0];
    if stream.peek(&mut first).await? == 0 {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    let (io, line) = if first[0] == HANDSHAKE {
        let stream = tls.accept(stream).await?;
        let shown = stream.get_ref().1.peer_certificates();
        let claims = match shown.and_then(<[_]>::first) {
            None => None,
            Some(certificate) => {
                let claims = Claims::read(certificate);
                Some(Arc::new(claims.ok_or(io::ErrorKind::InvalidData)?))
            }
        };
        (Io::Tls(Box::new(stream)), Line::Tls(claims))
    } else if peer.ip().to_canonical().is_loopback() {
        (Io::Plain(stream), Line::Loopback)
    } else {
        (Io::Plain(stream), Line::Open)
    };
    let Some(place) = room.place() else {
        return Err(io::Error::other("too many connections are open"));
    };
    let line = match place.is_over {
        true => Line::Over,
        false => line,
    };
    Ok(Connection {
        io,
        caller: Caller { peer, line },
        _place: place,
    })
}

impl Connected for Connection {
    type ConnectInfo = Caller;

    fn connect_info(&self) -> Caller {
        self.caller.clone()
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        match &mut self.io {
            Io::Plain(stream) => Pin::new(stream).poll_read(context, buffer),
            Io::Tls(stream) => Pin::new(stream).poll_read(context, buffer),
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        match &mut self.io {
            Io::Plain(stream) => Pin::new(stream).poll_write(context, bytes),
            Io::Tls(stream) => Pin::new(stream).poll_write(context, bytes),
        }
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        match &mut self.io {
            Io::Plain(stream) => Pin::new(stream).poll_write_vectored(context, slices),
            Io::Tls(stream) => Pin::new(stream).poll_write_vectored(context, slices),
        }
    }

    fn is_write_vectored(&self) -> bool {
        match &self.io {
            Io::Plain(stream) => stream.is_write_vectored(),
            Io::Tls(stream) => stream.is_write_vectored(),
        }
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.io {
            Io::Plain(stream) => Pin::new(stream).poll_flush(context),
            Io::Tls(stream) => Pin::new(stream).poll_flush(context),
        }
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.io {
            Io::Plain(stream) => Pin::new(stream).poll_shutdown(context),
            Io::Tls(stream) => Pin::new(stream).poll_shutdown(context),
        }
    }
}
