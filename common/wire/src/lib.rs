//! What passes between coordinator, workers and users.
//!
//! - [`proto`]: the messages, generated from `proto/flyby/v1`, whose comments are the reference.
//! - [`convert`]: from messages into `model`'s types, so that inside the farm
//!   nothing is left to validate; and back.
//! - [`block`]: the block record, the same bytes wherever finished pixels travel.
//! - [`spool`]: finished blocks in a file.
//! - [`failure`]: why a call failed: a kind, whether to try again, a sentence.
//! - [`auth`]: the token that guards a coordinator, as metadata.
//! - [`place`]: the state folder's files through which the parts on one machine find each other.
//! - [`version`]: which protocol versions two sides can speak.
//! - `link` (feature `grpc`): the settings that both ends of a connection share.
//! - `tls` (feature `grpc`): how a farm's parts know each other over a network.
//! - `way` (feature `grpc`): how a coordinator is reached, on this machine or over a network.
//!
//! Generated types stop at the shells: neither core knows this crate.

#[cfg(feature = "grpc")]
pub mod auth;
pub mod block;
pub mod convert;
pub mod failure;
#[cfg(feature = "grpc")]
pub mod link;
#[cfg(feature = "grpc")]
pub mod place;
pub mod spool;
#[cfg(feature = "grpc")]
pub mod tls;
pub mod version;
#[cfg(feature = "grpc")]
pub mod way;

/// The messages and service stubs of `proto/flyby/v1`.
#[allow(
    missing_docs,
    unreachable_pub,
    unused_qualifications,
    clippy::all,
    clippy::cast_possible_truncation,
    clippy::allow_attributes_without_reason,
    rustdoc::all,
    reason = "generated code; its documentation stands in the .proto files"
)]
pub mod proto {
    include!(concat!(env!("OUT_DIR"), "/flyby.v1.rs"));
}

pub use block::{BlockHeader, RecordError};
pub use convert::BadMessage;
pub use failure::Failure;
