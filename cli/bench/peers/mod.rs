//! Our scenes beside other programs' on the same surfaces, one thread each.
//!
//! [`rows`] says what is compared with what and which ratio is wanted, [`povray`] runs the peer,
//! [`ours`] this renderer, [`report`] prints. Only rendering is timed: no reading of scenes, no
//! encoding, no disk. Both sides take turns, so that what else the machine does falls on both.

pub(crate) mod ours;
pub(crate) mod povray;
pub(crate) mod report;
pub(crate) mod rows;
