//! What `flyby bench` measures: [`thesis`] fixes what is cast at what, [`cast`] counts, [`report`] prints;
//! [`peers`] compares this renderer with other programs, [`threads`] threads with processes, [`techniques`] the
//! tracer with itself; [`farm`] counts what it takes to have anything rendered elsewhere.

pub(crate) mod cast;
pub(crate) mod cells;
pub(crate) mod clock;
pub(crate) mod farm;
pub(crate) mod peers;
pub(crate) mod report;
pub(crate) mod techniques;
pub(crate) mod thesis;
pub(crate) mod threads;

#[cfg(test)]
mod tests;
