//! Our scenes beside other programs' on the same surfaces, one thread each.
//!
//! [`rows`] says what is compared with what and which ratio is wanted, [`pairs`] makes the sides ready, [`report`]
//! prints. Sides: [`ours`] is this renderer, [`povray`] and `fidget` are the peers that draw, [`noise`] evaluates points, [`methods`]
//! casts single rays; [`limit`] says what our time is spent on. Only rendering is timed: no reading of scenes, no encoding, no disk.
//! Both sides take turns, so that what else the machine does falls on both.

pub(crate) mod clock;
#[cfg(feature = "peers")]
pub(crate) mod fidget;
pub(crate) mod limit;
pub(crate) mod methods;
pub(crate) mod noise;
pub(crate) mod ours;
pub(crate) mod pairs;
pub(crate) mod povray;
pub(crate) mod report;
pub(crate) mod rows;

/// Why the crates among the peers are left out.
#[cfg(not(feature = "peers"))]
pub(crate) const NOT_BUILT: &str =
    "the crate is not part of this build (cargo build --release --features peers)";
