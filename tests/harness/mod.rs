//! What the farm's tests stand on: the program just built, run as real processes on loopback,
//! each test in a temporary folder of its own.
//!
//! - [`Place`]: a temporary folder, and commands of `flyby` run in it.
//! - [`Process`]: one running process; killed, with all it started, when it is dropped.
//! - [`Farm`]: a coordinator, its workers and its jobs.
//! - [`Proxy`]: a link between a worker and its coordinator that can be cut and frozen.
//! - [`SmallDisk`]: a folder on a disk of its own, which can be filled.
//! - [`frames`]: frames as files, to be compared byte for byte.
//! - [`raw`]: a client that says to a coordinator what no worker of ours would say.
//! - [`wait`]: waiting for conditions; nothing here sleeps for a time and hopes.
//! - [`need`]: tools that a machine may lack.
//!
//! When a test fails, what its processes wrote is printed as they are dropped.

mod command;
mod disk;
mod farm;
pub(crate) mod frames;
mod job;
pub(crate) mod need;
mod place;
mod process;
mod proxy;
pub(crate) mod raw;
pub(crate) mod scenes;
pub(crate) mod wait;

pub(crate) use command::Outcome;
pub(crate) use disk::SmallDisk;
pub(crate) use farm::{Farm, Moment, free_address};
pub(crate) use job::Job;
pub(crate) use place::Place;
pub(crate) use process::{Process, Signal};
pub(crate) use proxy::Proxy;
