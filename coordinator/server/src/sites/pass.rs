//! What the workers of a site join by.

use std::cell::RefCell;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cluster::ClusterError;
use cluster::pilot::Dials;
use tokio::runtime::Handle;
use wire::Failure;
use wire::tls::certificate::now;
use wire::tls::token_file::TokenFile;

use crate::trust::Trust;
use crate::trust::role::Role;

/// How long a token for a site is good, seconds. What waits in a queue for longer than half of it finds a newer
/// one in its file.
const LIFE: u64 = 14 * 24 * 3_600;

/// Workers that may join by one token.
const USES: u32 = 100_000;

/// What is in the file that a site's workers find.
pub(crate) enum Pass {
    /// The state folder's own token, where the coordinator listens on loopback alone: they come from there.
    Owner(PathBuf),
    /// A token that they join by, over TLS.
    Token(Token),
}

/// A token of a site, made when it is first needed.
pub(crate) struct Token {
    pub(crate) trust: Arc<Trust>,
    /// Where the coordinator can be reached.
    pub(crate) addresses: Vec<String>,
    pub(crate) runtime: Handle,
    /// The file's line, and until when it is brought to the site, seconds since 1970.
    pub(crate) made: RefCell<Option<(String, u64)>>,
}

impl Pass {
    /// The file's content. It is a secret.
    pub(crate) fn content(&self) -> Result<String, ClusterError> {
        let failed = |attempted, path: &Path, source| ClusterError::File {
            attempted,
            path: path.display().to_string(),
            source,
        };
        match self {
            Self::Owner(path) => {
                fs::read_to_string(path).map_err(|source| failed("read the token in", path, source))
            }
            Self::Token(token) => token.line().map_err(|failure| {
                let path = token.trust.tokens.path();
                failed("make a token in", path, io::Error::other(failure))
            }),
        }
    }

    /// How a worker that finds it gets to the coordinator, which other workers dial there.
    pub(crate) fn dials<'a>(&self, coordinator: &'a str) -> Dials<'a> {
        match self {
            Self::Owner(_) => Dials::Address(coordinator),
            Self::Token(_) => Dials::TokenFile,
        }
    }
}

impl Token {
    fn line(&self) -> Result<String, Failure> {
        let now = now();
        if let Some((line, until)) = &*self.made.borrow()
            && now < *until
        {
            return Ok(line.clone());
        }
        let made = self.trust.tokens.create(Role::Worker, Some(USES), LIFE);
        let (token, secret) = self.runtime.block_on(made)?;
        let file = TokenFile {
            id: token.id,
            role: Role::Worker.to_string(),
            secret,
            authority: self.trust.authority.fingerprint(),
            addresses: self.addresses.clone(),
        };
        let line = file.reveal();
        *self.made.borrow_mut() = Some((line.clone(), now + LIFE / 2));
        Ok(line)
    }
}
