//! What a user meets at the command line: help, exit codes, twins, scenes and frames.
//!
//! Farms of processes are `tests/farm`'s.

#![allow(
    clippy::unwrap_used,
    reason = "a test ends where something is not as it must be"
)]

mod bench;
mod gallery;
mod help;
mod image;
mod noise;
mod place;
mod render;
mod scene;
mod twins;
