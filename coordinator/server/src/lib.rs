//! The coordinator: the only clock, runtime and disk around the scheduler.
//!
//! One loop (`shell`) owns the scheduler: it waits for whichever input is first, turns it
//! into an event, lets the scheduler decide, and performs the effects. Around it:
//!
//! - `state`: the state folder, its lock, token and epoch.
//! - `grpc`: messages in and out; here generated types begin and end.
//! - `trust`: certificates, tokens, and the gate before every call.
//! - `inbox`: submissions as they arrive, checked against their digests.
//! - `storage`: a thread that writes blocks at their place, makes them durable and keeps the store, and one
//!   that encodes finished images. `about`, `scene_files`: what else is kept of a job.
//! - `hook`: the operator's program that is run when a job is over.
//! - `sites`: a thread for each cluster or host that allocations are submitted to.
//! - `space`: what a job needs of the disk, and what the disk has.
//! - `job`, `worker`: what is known of them beside what the scheduler knows: log, files,
//!   watchers; links.
//!
//! It names no worker's code: they meet in `wire`. `agent`'s `tests/farm.rs` shows the whole.

mod about;
mod clock;
mod config;
mod grpc;
mod hook;
mod inbox;
mod input;
mod job;
mod scene_files;
mod shell;
mod sites;
mod space;
mod start;
mod state;
mod storage;
mod trust;
mod worker;

pub use config::{Config, Limits};
pub use start::{Running, StartError, StoreBroken, start};
pub use state::StateError;
