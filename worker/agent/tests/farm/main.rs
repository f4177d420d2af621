//! Coordinator and workers in one process, over loopback, with a painter whose pixels
//! are known: what a user and a worker see of a farm, and what is left behind.
#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot go on fails where it stands"
)]

mod faults;
mod harness;
mod hostile;
mod jobs;
mod painter;
mod proxy;
