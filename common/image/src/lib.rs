//! Frames on disk: assembling an image from blocks, encoding it, and reading frames back.
//!
//! - [`Scratch`] is the file in which the blocks of one image come together, in any order, from
//!   any tiling, across interruptions. It knows what is done and names the film it holds
//!   ([`Scratch::film_digest`]).
//! - [`finish`] encodes a complete scratch file into frames (EXR, PNG, PPM), strip by strip, and
//!   puts them in place only when every one of them is whole and synced.
//! - [`file_digest`], [`info`] and [`compare`] read any frame back, by what it stores and not by
//!   how it is packed.
//!
//! It never learns what a scene, a tile or an attempt is. All input and output blocks; memory is
//! bounded by a few strips of 32 rows while writing, 64 MiB of them or one, and by [`DECODED_BYTES_MAX`] while reading.
//! The tests in `tests/whole_way` show it whole.

mod compare;
mod digest;
mod error;
mod frame;
mod info;
mod read;
mod scratch;
mod share;
mod view;

pub use compare::{Comparison, Difference, compare};
pub use digest::file_digest;
pub use error::ImageError;
pub use frame::formats::{BadFormats, Format, Formats, frame_name};
pub use frame::metadata::{FrameMetadata, METADATA_TEXT_MAX};
pub use frame::{Encoding, FinishedFile, FinishedFrame, FrameRequest, finish};
pub use info::{ChannelInfo, FrameInfo, PartInfo, info};
pub use read::{DECODED_BYTES_MAX, FileKind, SampleKind, Window};
pub use scratch::{Opened, Scratch, ScratchIdentity};
pub use share::in_order;
pub use view::ViewTransform;
