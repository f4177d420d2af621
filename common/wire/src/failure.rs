//! Why a call failed: a kind, whether to try again, and a sentence for the user.
//!
//! A failure travels as the gRPC status's details (`ErrorDetail`), with the
//! sentence as its message too, so that any gRPC tool shows it.

use crate::proto::{ErrorDetail, ErrorKind};
use crate::{BadMessage, RecordError};

/// Whether the same request may succeed later without anyone changing anything.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Retry {
    /// It may: try again after a while.
    Later,
    /// It will not: someone must change something first.
    Never,
}

/// An answer that is an error.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{sentence}")]
pub struct Failure {
    /// What kind of failure.
    pub kind: ErrorKind,
    /// Whether to try again.
    pub retry: Retry,
    /// What is wrong and what to do.
    pub sentence: String,
}

impl Failure {
    /// A failure that will happen again until someone changes something.
    pub fn new(kind: ErrorKind, sentence: impl Into<String>) -> Self {
        Self {
            kind,
            retry: Retry::Never,
            sentence: sentence.into(),
        }
    }

    /// A failure that may be over later.
    pub fn later(kind: ErrorKind, sentence: impl Into<String>) -> Self {
        Self {
            retry: Retry::Later,
            ..Self::new(kind, sentence)
        }
    }

    /// As the message that travels.
    pub fn detail(&self) -> ErrorDetail {
        ErrorDetail {
            kind: self.kind.into(),
            retryable: self.retry == Retry::Later,
            sentence: self.sentence.clone(),
        }
    }
}

impl From<ErrorDetail> for Failure {
    fn from(detail: ErrorDetail) -> Self {
        Self {
            kind: detail.kind(),
            retry: if detail.retryable {
                Retry::Later
            } else {
                Retry::Never
            },
            sentence: detail.sentence,
        }
    }
}

impl From<BadMessage> for Failure {
    fn from(bad: BadMessage) -> Self {
        Self::new(ErrorKind::BadRequest, bad.to_string())
    }
}

impl From<RecordError> for Failure {
    fn from(bad: RecordError) -> Self {
        match bad {
            // Bytes that were changed on their way may arrive whole the next time.
            RecordError::Checksum => Self::later(ErrorKind::DigestMismatch, bad.to_string()),
            _ => Self::new(ErrorKind::BadRequest, bad.to_string()),
        }
    }
}

#[cfg(feature = "grpc")]
mod grpc {
    use prost::Message;
    use tonic::{Code, Status};

    use super::{Failure, Retry};
    use crate::BadMessage;
    use crate::proto::{ErrorDetail, ErrorKind};

    /// The gRPC code of a kind, as `common.proto` documents it.
    fn code(kind: ErrorKind) -> Code {
        match kind {
            ErrorKind::Unspecified => Code::Unknown,
            ErrorKind::BadRequest | ErrorKind::BadScene => Code::InvalidArgument,
            ErrorKind::DigestMismatch => Code::DataLoss,
            ErrorKind::NotFound | ErrorKind::AttemptDead => Code::NotFound,
            ErrorKind::Unauthenticated => Code::Unauthenticated,
            ErrorKind::Forbidden => Code::PermissionDenied,
            ErrorKind::Limit => Code::ResourceExhausted,
            ErrorKind::WrongProtocol | ErrorKind::WrongRevision => Code::FailedPrecondition,
            ErrorKind::Conflict => Code::AlreadyExists,
            ErrorKind::NotReady | ErrorKind::Stopping => Code::Unavailable,
            ErrorKind::Storage | ErrorKind::Internal => Code::Internal,
        }
    }

    impl From<Failure> for Status {
        fn from(failure: Failure) -> Self {
            let details = failure.detail().encode_to_vec();
            Self::with_details(code(failure.kind), failure.sentence, details.into())
        }
    }

    impl From<BadMessage> for Status {
        fn from(bad: BadMessage) -> Self {
            Failure::from(bad).into()
        }
    }

    impl From<Status> for Failure {
        /// What the other side said; or, where it said nothing, what became of the link.
        ///
        /// A dead link shows as `Unknown` ("h2 protocol error"), `Unavailable`
        /// or `Cancelled` without details: all of these may be over later.
        fn from(status: Status) -> Self {
            if !status.details().is_empty()
                && let Ok(detail) = ErrorDetail::decode(status.details())
            {
                return detail.into();
            }
            let retry = match status.code() {
                Code::Unknown
                | Code::Unavailable
                | Code::Cancelled
                | Code::Aborted
                | Code::DeadlineExceeded
                | Code::Internal => Retry::Later,
                _ => Retry::Never,
            };
            let kind = match status.code() {
                Code::ResourceExhausted | Code::OutOfRange => ErrorKind::Limit,
                Code::Unauthenticated => ErrorKind::Unauthenticated,
                Code::PermissionDenied => ErrorKind::Forbidden,
                Code::Unimplemented => ErrorKind::WrongProtocol,
                Code::InvalidArgument => ErrorKind::BadRequest,
                Code::NotFound => ErrorKind::NotFound,
                _ => ErrorKind::Unspecified,
            };
            Self {
                kind,
                retry,
                sentence: words(&status),
            }
        }
    }

    /// A status in words: its message and what caused it, innermost last.
    fn words(status: &Status) -> String {
        let mut words = if status.message().is_empty() {
            status.code().description().to_owned()
        } else {
            status.message().to_owned()
        };
        let mut cause = std::error::Error::source(status);
        while let Some(error) = cause {
            let text = error.to_string();
            if !words.contains(&text) {
                words = format!("{words}: {text}");
            }
            cause = error.source();
        }
        words
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn a_failure_survives_its_journey() {
            let failure = Failure::later(ErrorKind::NotReady, "not yet");
            let status = Status::from(failure.clone());
            assert_eq!(status.code(), Code::Unavailable);
            assert_eq!(status.message(), "not yet");
            assert_eq!(Failure::from(status), failure);
        }

        #[test]
        fn a_dead_link_may_come_back_and_a_refusal_not() {
            let dead = Failure::from(Status::unknown("h2 protocol error"));
            assert_eq!(dead.retry, Retry::Later);
            let refused = Failure::from(Status::unimplemented(""));
            assert_eq!(refused.retry, Retry::Never);
            assert!(!refused.sentence.is_empty());
        }
    }
}
