//! What `flyby bench` measures: [`thesis`] fixes what is cast at what, [`cast`] counts, [`report`] prints;
//! [`peers`] compares this renderer with other programs.

pub(crate) mod cast;
pub(crate) mod cells;
pub(crate) mod clock;
pub(crate) mod peers;
pub(crate) mod report;
pub(crate) mod thesis;

#[cfg(test)]
mod tests;
