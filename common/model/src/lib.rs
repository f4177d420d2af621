//! The farm's nouns: ids, rectangles, frame ranges, film channels, attempts and time.
//!
//! Every other crate may name this one and this one names nobody. It knows no
//! clock, file, socket or wire format (`no_std` keeps it so); what it decides is
//! how an image is cut ([`rect`]), what a film holds ([`film`]) and how things are called.
#![no_std]

extern crate alloc;

pub mod digest;
pub mod film;
pub mod frames;
pub mod ids;
pub mod lease;
pub mod rect;
pub mod time;
pub mod words;

pub use digest::Digest;
pub use frames::FrameRange;
pub use ids::{AttemptId, Epoch, ImageNumber, ImageRef, JobId, Revision, SubmissionId, WorkerId};
pub use lease::{Begun, Lease, Running};
pub use rect::{Rect, Resolution};
pub use time::{Span, Timestamp};
