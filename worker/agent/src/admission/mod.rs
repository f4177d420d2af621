//! How a worker gets to its coordinator: on this machine by the state folder's token, from another one by a
//! certificate that it got for a token once and renews in time.
//!
//! - `member`: the certificate: joining, renewing.
//! - `kept`: where it is kept, so that a worker that is started again needs no second token.

mod kept;
mod member;

use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;

use tokio::sync::watch;
use wire::Failure;
use wire::auth::Token;
use wire::link::Workers;
use wire::tls::token_file::TokenFile;
use wire::way::Way;

use crate::RunError;
use member::Member;

/// How a worker gets to its coordinator.
#[derive(Clone, Debug)]
pub enum Admission {
    /// It runs on this machine.
    Local {
        /// Where it listens.
        coordinator: SocketAddr,
        /// The token of its state folder.
        token: Token,
    },
    /// It gave out a token.
    Invited(Invitation),
}

/// A token for workers, and what a worker does with it.
#[derive(Clone, Debug)]
pub struct Invitation {
    /// The token, with all that it says.
    pub file: TokenFile,
    /// Another address to dial than those it names.
    pub address: Option<String>,
    /// The folder below which certificates are kept; `None`: nowhere.
    pub keep: Option<PathBuf>,
}

/// Where it leads.
impl fmt::Display for Admission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Local { coordinator, .. } => coordinator.fmt(f),
            Self::Invited(invitation) => f.write_str(&invitation.addresses().join(" or ")),
        }
    }
}

impl Invitation {
    fn addresses(&self) -> Vec<String> {
        match &self.address {
            Some(address) => vec![address.clone()],
            None => self.file.addresses.clone(),
        }
    }
}

/// The way in, as a running worker has it.
#[derive(Debug)]
pub(crate) enum Access {
    Local(Way),
    Member(Box<Member>),
}

impl Access {
    pub(crate) fn new(admission: &Admission) -> Result<Self, RunError> {
        Ok(match admission {
            Admission::Local { coordinator, token } => {
                Self::Local(Way::local(*coordinator, token.clone()))
            }
            Admission::Invited(invitation) => {
                Self::Member(Box::new(Member::new(invitation.clone())?))
            }
        })
    }

    /// The way to dial now; a worker that has no certificate joins first.
    pub(crate) async fn way(&self) -> Result<Way, Failure> {
        match self {
            Self::Local(way) => Ok(way.clone()),
            Self::Member(member) => member.way().await,
        }
    }

    /// Renews what must be renewed, for ever. Calls on a connection count no longer than the certificate that it was
    /// opened with, so that scenes are then fetched over a new one.
    pub(crate) async fn renew(&self, fetching: &watch::Sender<Option<Workers>>) {
        match self {
            Self::Local(_) => std::future::pending().await,
            Self::Member(member) => member.renew(fetching).await,
        }
    }
}
