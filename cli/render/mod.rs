//! Rendering in this process: `line` says which block is next, `engine` renders it.

mod engine;
mod line;

pub(crate) use engine::{Done, News, Outcome, Plan, render};
