//! TLS: how a farm's parts know each other over a network.
//!
//! A coordinator is an authority of its own: it signs its own certificate and those of its workers. Nobody is
//! known by the address that is dialled: clients know no host name that they could rely on (a node is reached by
//! whichever of its addresses routes, a login node through a tunnel that ends on loopback, and a machine that
//! moves keeps its state folder). So a client is told the authority's fingerprint, with its token, and expects
//! of whoever answers a certificate that this authority signed for one fixed name, [`COORDINATOR`].
//!
//! - [`certificate`]: what a certificate of a farm says.
//! - [`client`]: the client's side: the fingerprint, and a worker's own certificate.
//! - `dial`: reaching a coordinator, and why that fails.
//! - [`token_file`]: what a user is given to reach a farm by.

pub mod certificate;
pub mod client;
pub(crate) mod dial;
pub mod token_file;

use std::sync::Arc;

use rustls::crypto::CryptoProvider;

/// The name that a coordinator's certificate is made out to, whatever its addresses.
pub const COORDINATOR: &str = "coordinator.flyby";

/// The protocol within TLS, as both sides announce it.
pub const ALPN: &[u8] = b"h2";

/// The one set of ciphers. It is ring's: AWS-LC takes a minute of processor time to build.
pub fn provider() -> Arc<CryptoProvider> {
    Arc::new(rustls::crypto::ring::default_provider())
}

/// TLS 1.3 and nothing older: both ends are this program.
pub const VERSIONS: &[&rustls::SupportedProtocolVersion] = &[&rustls::version::TLS13];
