//! Sites on real engines: Slurm, Grid Engine and ssh hosts on this machine, started by the scripts in `scripts/` and
//! stopped with each test. They are skipped by name where they cannot run.

#![allow(
    clippy::unwrap_used,
    reason = "a test ends where something is not as it must be"
)]
#![allow(
    dead_code,
    unused_imports,
    reason = "the harness serves the other tests too, and this binary uses a part of it"
)]

#[path = "../harness/mod.rs"]
mod harness;

mod agent;
mod backends;
mod commands;
mod engine;
mod flight;
mod full_folder;
mod gridengine;
mod orphans;
mod pilot;
mod poll;
mod readme;
mod rough;
mod slots;
mod timelimit;
mod two_sites;
