//! Reaching a coordinator over TLS, and why that fails, in words that say what to do.
//!
//! All addresses are tried at once, and the first behind which the right coordinator answers is taken: a private
//! address may lead to somebody else's machine.

use std::future::Future;
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use hyper_util::rt::TokioIo;
use rustls::pki_types::ServerName;
use rustls::{AlertDescription, CertificateError, ClientConfig};
use tokio::net::TcpStream;
use tokio::task::JoinSet;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tonic::codegen::Service;
use tonic::codegen::http::Uri;

use super::COORDINATOR;
use super::certificate::{moment, now};
use crate::Failure;
use crate::proto::ErrorKind;

/// How long one address may take to be reached and to show its certificate: less than a connection may
/// ([`crate::link::CONNECT_TIMEOUT`]), so that it is said which of them did not answer.
const DIAL_TIMEOUT: Duration = Duration::from_secs(4);

/// Reaches a coordinator for a channel, now and whenever its connection broke.
#[derive(Clone)]
pub(crate) struct Dialler {
    addresses: Arc<[String]>,
    config: Arc<ClientConfig>,
}

impl Dialler {
    /// One that tries these addresses.
    pub(crate) fn new(addresses: &[String], config: Arc<ClientConfig>) -> Self {
        Self {
            addresses: addresses.into(),
            config,
        }
    }
}

impl Service<Uri> for Dialler {
    type Response = TokioIo<TlsStream<TcpStream>>;
    type Error = DialError;
    type Future = Pin<Box<dyn Future<Output = Result<Self::Response, DialError>> + Send>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), DialError>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, _: Uri) -> Self::Future {
        let dialler = self.clone();
        Box::pin(async move { dialler.dial().await.map(TokioIo::new) })
    }
}

impl Dialler {
    /// Tries all addresses at once; where none leads there, the error that says most.
    async fn dial(self) -> Result<TlsStream<TcpStream>, DialError> {
        let mut trials = JoinSet::new();
        for address in &*self.addresses {
            let (address, config) = (address.clone(), self.config.clone());
            trials.spawn(async move {
                let reached = reach(&address, config);
                let reached = tokio::time::timeout(DIAL_TIMEOUT, reached).await;
                reached
                    .unwrap_or_else(|_| Err(io::Error::from(io::ErrorKind::TimedOut)))
                    .map_err(|error| DialError::new(address, &error))
            });
        }
        let mut worst: Option<DialError> = None;
        while let Some(trial) = trials.join_next().await {
            match trial {
                Ok(Ok(stream)) => return Ok(stream),
                Ok(Err(error))
                    if worst
                        .as_ref()
                        .is_none_or(|worst| worst.weight() < error.weight()) =>
                {
                    worst = Some(error);
                }
                _ => {}
            }
        }
        Err(worst.unwrap_or(DialError {
            address: "no address".to_owned(),
            trouble: Trouble::Unreachable("none is named".to_owned()),
        }))
    }
}

async fn reach(address: &str, config: Arc<ClientConfig>) -> io::Result<TlsStream<TcpStream>> {
    let stream = TcpStream::connect(address).await?;
    stream.set_nodelay(true)?;
    let name = ServerName::try_from(COORDINATOR).expect("it is the name of a host");
    TlsConnector::from(config).connect(name, stream).await
}

/// Why an address does not lead to the coordinator.
#[derive(Debug, thiserror::Error)]
#[error("{}", self.failure().sentence)]
pub(crate) struct DialError {
    address: String,
    trouble: Trouble,
}

#[derive(Debug)]
enum Trouble {
    /// Nobody answers.
    Unreachable(String),
    /// Whoever answers speaks no TLS.
    Plain,
    /// TLS failed in some other way.
    Strange(String),
    /// The certificate counts from later on, by this clock.
    TooYoung { not_before: u64 },
    /// The certificate has expired, by this clock.
    Expired { not_after: u64 },
    /// Whoever answers has another authority.
    Foreign,
}

impl DialError {
    fn new(address: String, error: &io::Error) -> Self {
        let tls = error.get_ref().and_then(|inner| inner.downcast_ref());
        let trouble = match tls {
            None if error.kind() == io::ErrorKind::UnexpectedEof => Trouble::Strange(
                "it closed the connection without a word, as a coordinator does that has too many callers".to_owned(),
            ),
            None => Trouble::Unreachable(error.to_string()),
            Some(rustls::Error::InvalidMessage(_)) => Trouble::Plain,
            Some(rustls::Error::AlertReceived(
                AlertDescription::UnknownCA | AlertDescription::DecryptError,
            )) => Trouble::Foreign,
            Some(rustls::Error::InvalidCertificate(certificate)) => match certificate {
                CertificateError::NotValidYetContext { not_before, .. } => Trouble::TooYoung {
                    not_before: not_before.as_secs(),
                },
                CertificateError::ExpiredContext { not_after, .. } => Trouble::Expired {
                    not_after: not_after.as_secs(),
                },
                CertificateError::UnknownIssuer | CertificateError::BadSignature => {
                    Trouble::Foreign
                }
                other => Trouble::Strange(other.to_string()),
            },
            Some(other) => Trouble::Strange(other.to_string()),
        };
        Self { address, trouble }
    }

    /// How much it says about what to do.
    fn weight(&self) -> u8 {
        match self.trouble {
            Trouble::Unreachable(_) => 0,
            Trouble::Strange(_) => 1,
            Trouble::Plain => 2,
            Trouble::Foreign => 3,
            Trouble::TooYoung { .. } | Trouble::Expired { .. } => 4,
        }
    }

    /// As the failure of what was asked for, and whether it may be over later.
    pub(crate) fn failure(&self) -> Failure {
        let Self { address, trouble } = self;
        let clock = moment(now());
        match trouble {
            Trouble::Unreachable(why) => Failure::later(
                ErrorKind::Unspecified,
                format!("no coordinator answers at {address}: {why}"),
            ),
            Trouble::Strange(why) => Failure::later(
                ErrorKind::Unspecified,
                format!("no TLS connection to {address}: {why}"),
            ),
            Trouble::Plain => Failure::new(
                ErrorKind::Unauthenticated,
                format!(
                    "what answers at {address} speaks no TLS: it is no coordinator, or one of an older version; look at the address, or start the coordinator's new version"
                ),
            ),
            Trouble::Foreign => Failure::new(
                ErrorKind::Unauthenticated,
                format!(
                    "the coordinator at {address} has another authority than the one that the token names: its state folder is new, or it is another coordinator; make a new token there with `flyby token create`"
                ),
            ),
            // Clocks are set right and certificates renewed while the other side waits.
            Trouble::TooYoung { not_before } => Failure::later(
                ErrorKind::Unauthenticated,
                format!(
                    "the certificate of the coordinator at {address} counts from {} on, and this machine's clock says {clock}: one of the two clocks is wrong; let both follow a time server",
                    moment(*not_before)
                ),
            ),
            Trouble::Expired { not_after } => Failure::later(
                ErrorKind::Unauthenticated,
                format!(
                    "the certificate of the coordinator at {address} counted until {}, and this machine's clock says {clock}: a coordinator that runs renews it in time, so one of the two clocks is wrong; let both follow a time server",
                    moment(*not_after)
                ),
            ),
        }
    }
}
