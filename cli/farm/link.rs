//! The way to a coordinator, and what its refusals mean for the exit code.

use std::future::Future;
use std::net::SocketAddr;
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
            let address = options.coordinator.map(|address| address.to_string());
            return Way::by_token(&file, address)
                .map_err(|failure| Error::failed("cannot set up TLS").because(failure));
        }
        let address = self.address(options)?;
        Ok(Way::local(self.on_this_machine(address)?, self.token()?))
    }

    /// An address that is reached in the clear, which only one of this machine may be.
    pub(crate) fn on_this_machine(&self, address: SocketAddr) -> Result<SocketAddr, Error> {
        match address.ip().to_canonical().is_loopback() {
            true => Ok(address),
            false => Err(Error::usage(format!(
                "the coordinator at {address} is reached by TLS, and for that a token is needed"
            ))
            .next("make one where it runs (`flyby token create --out FILE`), bring the file here, and name it with `--token-file FILE`; on its own machine leave `--coordinator` away")),
        }
    }

    /// Where the coordinator listens: as told, or as it says in its state folder.
    pub(crate) fn address(&self, options: &FarmOptions) -> Result<SocketAddr, Error> {
        match options.coordinator {
            Some(address) => Ok(address),
            None => place::coordinator(&self.state()?)
                .map(|coordinator| coordinator.address)
                .map_err(not_found),
        }
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
            .address(&FarmOptions { coordinator: None })
            .unwrap_err();
        assert_eq!(error.ending(), Ending::Unreachable);
        assert!(error.to_string().contains("flyby coordinator"), "{error}");
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
