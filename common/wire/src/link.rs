//! The settings that both ends of a connection share, and a client's way in.
//!
//! HTTP/2's windows default to 1 MiB for a stream *and* for a connection, so one stalled
//! upload would starve all others; and nobody would notice a dead link.

use std::fmt::Display;
use std::time::Duration;

use tonic::codegen::InterceptedService;
use tonic::transport::{Channel, Endpoint};

use crate::Failure;
use crate::auth::Bearer;
use crate::proto::farm_client::FarmClient;
use crate::proto::joining_client::JoiningClient;
use crate::proto::workers_client::WorkersClient;
use crate::way::Way;

/// Bytes under way on one connection.
pub const CONNECTION_WINDOW_BYTES: u32 = 16 << 20;

/// Bytes under way on one stream.
pub const STREAM_WINDOW_BYTES: u32 = 2 << 20;

/// Largest message on any stream; a block's is about 32 KiB, a chunk's about 1 MiB.
pub const MESSAGE_BYTES_MAX: usize = 2 << 20;

/// Most bytes of a scene, an asset or a frame in one message.
pub const CHUNK_BYTES: usize = 1 << 20;

/// How long a connection is silent before the other side is asked whether it lives.
pub const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(10);

/// How long the other side may take to answer that.
pub const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(20);

/// How long opening a connection may take.
pub const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Largest asset.
pub const ASSET_BYTES_MAX: u64 = 256 << 20;

/// The end of a connection to `authority` (a host or an address, and perhaps a port), with this module's settings;
/// nothing is opened yet.
pub fn endpoint(authority: impl Display) -> Endpoint {
    Endpoint::from_shared(format!("http://{authority}"))
        .expect("a host with a port is an authority")
        .connect_timeout(CONNECT_TIMEOUT)
        .tcp_nodelay(true)
        .initial_connection_window_size(CONNECTION_WINDOW_BYTES)
        .initial_stream_window_size(STREAM_WINDOW_BYTES)
        .http2_keep_alive_interval(KEEPALIVE_INTERVAL)
        .keep_alive_timeout(KEEPALIVE_TIMEOUT)
        .keep_alive_while_idle(true)
}

/// A user's client over an open connection.
pub type Farm = FarmClient<InterceptedService<Channel, Bearer>>;

/// A worker's client over an open connection.
pub type Workers = WorkersClient<InterceptedService<Channel, Bearer>>;

/// The client of whoever wants a certificate, over an open connection.
pub type Joining = JoiningClient<InterceptedService<Channel, Bearer>>;

/// Opens a connection for a user.
pub async fn farm(way: &Way) -> Result<Farm, Failure> {
    let channel = way.open().await?;
    Ok(FarmClient::with_interceptor(channel, way.bearer())
        .max_decoding_message_size(MESSAGE_BYTES_MAX)
        .max_encoding_message_size(MESSAGE_BYTES_MAX))
}

/// Opens a connection for a worker.
pub async fn workers(way: &Way) -> Result<Workers, Failure> {
    let channel = way.open().await?;
    Ok(WorkersClient::with_interceptor(channel, way.bearer())
        .max_decoding_message_size(MESSAGE_BYTES_MAX)
        .max_encoding_message_size(MESSAGE_BYTES_MAX))
}

/// Opens a connection for whoever wants a certificate.
pub async fn joining(way: &Way) -> Result<Joining, Failure> {
    let channel = way.open().await?;
    Ok(JoiningClient::with_interceptor(channel, way.bearer())
        .max_decoding_message_size(MESSAGE_BYTES_MAX)
        .max_encoding_message_size(MESSAGE_BYTES_MAX))
}
