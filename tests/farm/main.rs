//! The farm as a user meets it: the program just built, as real processes on this machine.
//!
//! One module for each behaviour that a user could name. The slow ones are ignored unless
//! `tests/run --all` asks for them.

#![allow(
    clippy::unwrap_used,
    reason = "a test ends where something is not as it must be"
)]

#[path = "../harness/mod.rs"]
mod harness;

mod bad_places;
mod bad_scenes;
mod bad_words;
mod cancel;
mod chaos;
mod commands;
mod demo;
mod deploy;
mod doctor;
mod failures;
mod full_disk;
mod hook;
mod hostile_messages;
mod kubernetes;
mod ranks;
mod readers;
mod readme;
mod restart;
mod resume;
mod same_pixels;
mod stopping;
mod trust;
