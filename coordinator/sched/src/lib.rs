//! The scheduler: events in, effects out, and nothing else.
//!
//! It decides which worker renders which tile of which image, which reports
//! count, and when an image or a job is over. It knows no clock, file, socket,
//! thread or randomness, nor what a scene is: to it a tile is a rectangle and
//! an attempt. The shell around it (`server`) turns whatever happens into an
//! [`Event`], calls [`Sched::handle`] and performs the [`Effect`]s in order.
//!
//! What always holds, after every event (`Sched::check_invariants` says it in code):
//! a tile has at most two live attempts, and each of them ends by its blocks, by being given
//! back or by a limit; a worker never holds more than its credit by a new lease; no pixel is counted
//! twice; an image is encoded when its last pixel is durable, and never before.
//!
//! `tests/histories.rs` shows it whole under random events.
#![no_std]

extern crate alloc;

mod adopt;
mod aside;
mod attempt;
mod attempts;
mod blocks;
mod check;
mod command;
mod compare;
mod config;
mod costs;
mod demand;
mod effect;
mod estimate;
mod event;
mod images;
mod invariants;
mod job;
mod jobs;
mod leasing;
mod links;
mod live;
pub mod load;
mod market;
mod needs;
mod pace;
mod pixels;
mod places;
mod recall;
mod refusal;
mod region;
mod roster;
mod sched;
mod spread;
mod tail;
mod tile;
mod tiling;
mod timers;
mod verify;
mod view;
mod why;
mod work;
mod worker;
mod wrong;

pub use command::Command;
pub use config::{Config, IMAGES_IN_FLIGHT_LEAST, Limits, TailGain};
pub use demand::Demand;
pub use effect::{Effect, JobOutcome, RevokeReason};
pub use event::{BlockRef, Event, LinkId, Submission, TileShape};
pub use needs::{Needs, Offer, Queue};
pub use refusal::{BlockRefusal, CommandRefusal, SubmitRefusal, Verdict, WorkerRefusal};
pub use sched::Sched;
pub use view::{
    Estimate, ImageCounts, ImageFailure, ImageState, ImageView, JobState, JobView, Link, Paused,
    Trust, WorkerView,
};
pub use why::{WhyImage, WhyJob, WhyTile, WhyWorker};
