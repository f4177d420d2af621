//! The worker: threads, files and the link around the session.
//!
//! One loop (`shell`) owns the session: it waits for whichever input is first, turns it into
//! an event, lets the session decide, and performs the effects. Around it:
//!
//! - `admission`: how it gets to the coordinator: on this machine by a token, from another by a certificate.
//! - `link`: the two connections to the coordinator, and what passes on them.
//! - `pool`: render threads, one tile each at a time, block by block.
//! - `scenes`: descriptions and assets, fetched once and kept, in memory and on disk.
//! - `images`: images opened for rendering, shared by the threads.
//! - [`Painter`]: the door to rendering; [`RenderPainter`] is the program's.
//!
//! It names no coordinator's code: they meet in `wire`. `tests/farm.rs` shows the whole.

mod admission;
mod config;
mod identity;
mod images;
mod input;
mod link;
mod painter;
mod pool;
mod scenes;
mod shell;
mod stop;

pub use admission::{Admission, Invitation};
pub use config::{Config, RunError};
pub use painter::{Assets, Cancelled, Counters, OpenImage, Painter, RenderPainter};
pub use session::ExitReason;
pub use shell::run;
pub use stop::{Ask, Asks, signals};
