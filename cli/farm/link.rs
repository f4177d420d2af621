//! The way to a coordinator, and what its refusals mean for the exit code.

use std::future::Future;
use std::net::{SocketAddr, ToSocketAddrs as _};
use std::path::PathBuf;

use wire::Failure;
use wire::auth::Token;
use wire::failure::Retry;
use wire::link::Farm;
use wire::place;
use wire::proto::ErrorKind;
use wire::tls::token_file::TokenFile;
use wire::way::Way;

use crate::error::{Ending, Error};
use crate::options::{Context, FarmOptions};

/// Runs a client's work on a runtime of its own.
pub(crate) fn block_on<T>(work: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|error| Error::failed("cannot start the runtime").because(error))?
        .block_on(work)
}

impl Context {
    /// The state folder.
    pub(crate) fn state(&self) -> Result<PathBuf, Error> {
        self.state.clone().ok_or_else(|| {
            Error::usage("no state folder: neither `$HOME` nor `$XDG_STATE_HOME` is set")
                .next("name one with `--state`")
        })
    }

    /// The token's file that was named, if one was.
    pub(crate) fn token_file(&self) -> Result<Option<TokenFile>, Error> {
        let Some(path) = &self.token_file else {
            return Ok(None);
        };
        TokenFile::read(path).map(Some).map_err(|error| {
            let unusable = Error::usage(error.to_string());
            match std::error::Error::source(&error) {
                Some(source) => unusable.because(source.to_string()),
                None => unusable,
            }
        })
    }

    /// How the coordinator is reached: as the token's file says, or on this machine by its state folder.
    pub(crate) fn way(&self, options: &FarmOptions) -> Result<Way, Error> {
        if let Some(file) = self.token_file()? {
            return Way::by_token(&file, options.coordinator.clone())
                .map_err(|failure| Error::failed("cannot set up TLS").because(failure));
        }
        Ok(Way::local(self.here(options)?, self.token()?))
    }

    /// An address of this machine, which alone is reached in the clear: as told, or where the coordinator says in its state
    /// folder that it listens.
    pub(crate) fn here(&self, options: &FarmOptions) -> Result<SocketAddr, Error> {
        let Some(named) = &options.coordinator else {
            let coordinator = place::coordinator(&self.state()?).map_err(not_found)?;
            return Ok(coordinator.address);
        };
        let resolved = named.to_socket_addrs().map_err(|error| {
            Error::unreachable(format!("the coordinator's address {named} is not known"))
                .because(error)
        })?;
        let mut addresses = resolved.filter(|address| address.ip().to_canonical().is_loopback());
        addresses.next().ok_or_else(|| {
            Error::usage(format!(
                "the coordinator at {named} is reached by TLS, and for that a token is needed"
            ))
            .next("make one where it runs (`flyby token create --out FILE`), bring the file here, and name it with `--token-file FILE`; on its own machine leave `--coordinator` away")
        })
    }

    /// The coordinator's token, from the state folder.
    pub(crate) fn token(&self) -> Result<Token, Error> {
        place::token(&self.state()?).map_err(not_found)
    }

    /// Opens a connection to the coordinator.
    pub(crate) async fn connect(&self, options: &FarmOptions) -> Result<Farm, Error> {
        let way = self.way(options)?;
        wire::link::farm(&way).await.map_err(|failure| {
            let sure = failure.kind == ErrorKind::Unauthenticated;
            let refused = Error::unreachable(failure.sentence);
            match sure {
                // The sentence says what to do.
                true => refused,
                false => refused.next(
                    "start one with `flyby coordinator`, or say where it is with `--coordinator`",
                ),
            }
        })
    }
}

fn not_found(error: place::NotFound) -> Error {
    // Its text is a sentence that says what to do.
    let attempt = error.to_string();
    let unreachable = Error::unreachable(attempt);
    match std::error::Error::source(&error) {
        Some(source) => unreachable.because(source.to_string()),
        None => unreachable,
    }
}

/// A coordinator's refusal as this program's; `attempt` says what was asked of it.
pub(crate) fn refused(attempt: impl Into<String>, failure: impl Into<Failure>) -> Error {
    let failure = failure.into();
    let ending = match failure.kind {
        ErrorKind::BadRequest | ErrorKind::BadScene | ErrorKind::NotFound | ErrorKind::Conflict => {
            Ending::Usage
        }
        ErrorKind::Unauthenticated
        | ErrorKind::Forbidden
        | ErrorKind::WrongProtocol
        | ErrorKind::WrongRevision
        | ErrorKind::Limit
        | ErrorKind::Stopping => Ending::Unreachable,
        _ if failure.retry == Retry::Later => Ending::Unreachable,
        _ => Ending::Failed,
    };
    Error::new(ending, attempt).because(failure)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_coordinator_is_a_sentence_with_what_to_do() {
        let folder = tempfile::tempdir().unwrap();
        let context = Context {
            output: crate::output::Format::Table,
            state: Some(folder.path().to_owned()),
            token_file: None,
        };
        let error = context
            .here(&FarmOptions { coordinator: None })
            .unwrap_err();
        assert_eq!(error.ending(), Ending::Unreachable);
        assert!(error.to_string().contains("flyby coordinator"), "{error}");
    }

    #[test]
    fn in_the_clear_only_this_machine_is_reached_by_whatever_name() {
        let context = Context {
            output: crate::output::Format::Table,
            state: None,
            token_file: None,
        };
        let here = |name: &str| {
            context.here(&FarmOptions {
                coordinator: Some(name.to_owned()),
            })
        };
        assert_eq!(here("127.0.0.1:7").unwrap().port(), 7);
        assert!(here("localhost:7").unwrap().ip().is_loopback());
        assert_eq!(here("192.0.2.7:7").unwrap_err().ending(), Ending::Usage);
        let unknown = here("nobody.invalid:7").unwrap_err();
        assert_eq!(unknown.ending(), Ending::Unreachable);
        assert!(
            unknown.to_string().contains("nobody.invalid:7"),
            "{unknown}"
        );
    }

    #[test]
    fn refusals_have_their_codes() {
        let code = |kind| refused("cannot show the job", Failure::new(kind, "no")).ending();
        assert_eq!(code(ErrorKind::NotFound), Ending::Usage);
        assert_eq!(code(ErrorKind::Unauthenticated), Ending::Unreachable);
        assert_eq!(code(ErrorKind::Internal), Ending::Failed);
        let gone = Failure::later(ErrorKind::Unspecified, "the link died");
        assert_eq!(refused("cannot", gone).ending(), Ending::Unreachable);
    }
}
