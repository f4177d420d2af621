//! Rendering in this process: `line` says which block is next, `engine` renders it, `statistics` says what it took.

mod crew;
mod engine;
mod line;
mod statistics;

pub(crate) use engine::{Done, News, Outcome, Plan, render};
pub(crate) use statistics::Statistics;
