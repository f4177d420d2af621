//! How a coordinator is reached: in the clear on this machine, or by TLS from wherever.
//!
//! A TLS way has several addresses, since nobody knows beforehand which of a coordinator's leads to it from where.

use std::fmt;
use std::net::SocketAddr;
use std::sync::Arc;

use rustls::ClientConfig;
use tonic::transport::Channel;

use crate::Failure;
use crate::auth::{Bearer, Token};
use crate::link;
use crate::proto::ErrorKind;
use crate::tls::dial::{DialError, Dialler};
use crate::tls::token_file::TokenFile;
use crate::tls::{COORDINATOR, client};

/// How a coordinator is reached.
#[derive(Clone)]
pub struct Way(Kind);

#[derive(Clone)]
enum Kind {
    Plain(SocketAddr, Token),
    Tls {
        addresses: Vec<String>,
        config: Arc<ClientConfig>,
        token: Option<Token>,
    },
}

/// Where it leads.
impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Kind::Plain(address, _) => address.fmt(f),
            Kind::Tls { addresses, .. } => f.write_str(&addresses.join(" or ")),
        }
    }
}

impl fmt::Debug for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Way({self})")
    }
}

impl Way {
    /// To a coordinator on this machine, in the clear, guarded by the token of its state folder.
    pub fn local(coordinator: SocketAddr, token: Token) -> Self {
        Self(Kind::Plain(coordinator, token))
    }

    /// Over TLS to any of these addresses, by a configuration of [`client::config`]; with a token on every call
    /// where there is one.
    pub fn tls(addresses: Vec<String>, config: Arc<ClientConfig>, token: Option<Token>) -> Self {
        Self(Kind::Tls {
            addresses,
            config,
            token,
        })
    }

    /// Over TLS as a token's file says, to its addresses or to another that leads there.
    pub fn by_token(file: &TokenFile, address: Option<String>) -> Result<Self, Failure> {
        let config = client::config(file.authority, None);
        let config =
            config.map_err(|error| Failure::new(ErrorKind::Internal, error.to_string()))?;
        let addresses = address.map_or_else(|| file.addresses.clone(), |address| vec![address]);
        Ok(Self::tls(addresses, config, Some(file.secret.clone())))
    }

    /// What its calls carry.
    pub(crate) fn bearer(&self) -> Bearer {
        match &self.0 {
            Kind::Plain(_, token) => Bearer(Some(token.clone())),
            Kind::Tls { token, .. } => Bearer(token.clone()),
        }
    }

    /// Opens a connection.
    pub async fn open(&self) -> Result<Channel, Failure> {
        let opened = match &self.0 {
            Kind::Plain(address, _) => link::endpoint(address).connect().await,
            Kind::Tls {
                addresses, config, ..
            } => {
                let dialler = Dialler::new(addresses, config.clone());
                link::endpoint(COORDINATOR)
                    .connect_with_connector(dialler)
                    .await
            }
        };
        opened.map_err(|error| self.failure(&error))
    }

    /// Why a connection could not be opened, and whether it may be later.
    fn failure(&self, error: &(dyn std::error::Error + 'static)) -> Failure {
        let mut words = format!("no coordinator answers at {self}");
        let mut cause = error.source();
        while let Some(error) = cause {
            if let Some(refusal) = error.downcast_ref::<DialError>() {
                return refusal.failure();
            }
            let text = error.to_string();
            if !words.contains(&text) {
                words = format!("{words}: {text}");
            }
            cause = error.source();
        }
        Failure::later(ErrorKind::Unspecified, words)
    }
}
