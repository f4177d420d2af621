//! The worker's function: events in, effects out, and nothing else.
//!
//! It decides when to dial, which tiles to start, which blocks to send and
//! resend, what to give back and when to leave. It knows no clock, file, socket
//! or thread, nor what a pixel is. The shell around it (`agent`) turns whatever happens
//! into an [`Event`], calls [`Session::handle`] and performs the [`Effect`]s in order.
//!
//! What always holds, after every event (`Session::check_invariants` says it in code):
//! at most [`Config::threads`] tiles run; at most [`Config::unacked_blocks_max`] blocks are
//! kept, as long as the shell pauses rendering when told; every block that is kept is sent again
//! on every new link until it is answered; a tile is started at most once.
#![no_std]

extern crate alloc;

mod ahead;
mod backoff;
mod config;
mod effect;
mod event;
mod held;
mod idle;
mod invariants;
mod leave;
mod link;
mod session;
mod tiles;

pub use backoff::Backoff;
pub use config::Config;
pub use effect::{Effect, ExitReason};
pub use event::{BlockVerdict, Event, Retry, Welcome};
pub use session::{LinkState, Session, Summary};
