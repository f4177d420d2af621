//! Encoding a finished scratch file into frames.
//!
//! Every format is written strip by strip under a hidden name; only when all of them are whole
//! and synced do they get their names, so that a frame that can be seen is a frame that is done.

mod encoding;
pub(crate) mod exr;
pub(crate) mod formats;
pub(crate) mod metadata;
mod png;
mod ppm;
pub(crate) mod publish;
mod zip;

use std::path::PathBuf;

use model::{Digest, ImageNumber};

pub use self::encoding::Encoding;
use self::formats::{Format, Formats};
use self::metadata::FrameMetadata;
use crate::error::ImageError;
use crate::scratch::{Scratch, Strip};
use crate::view::ViewTransform;

/// What to make of a finished scratch file.
#[derive(Clone, Debug)]
pub struct FrameRequest {
    /// Where the frames go; it must exist.
    pub folder: PathBuf,
    /// What the names of the files begin with.
    pub stem: String,
    /// The image's number in its animation.
    pub number: ImageNumber,
    /// Which files to write; at least one.
    pub formats: Formats,
    /// What EXR and PNG frames say about themselves.
    pub metadata: FrameMetadata,
    /// How light becomes colour in PNG and PPM frames.
    pub view: ViewTransform,
    /// Threads that encode at a time, about, this one included; nothing of the frames depends on it.
    pub threads: usize,
}

/// The frames of one image, in place and durable.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FinishedFrame {
    /// Name of the pixels, as [`Scratch::film_digest`] gives it.
    pub film_digest: Digest,
    /// One for each format asked for, in the order of [`Format::ALL`].
    pub files: Vec<FinishedFile>,
}

/// One frame in place.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FinishedFile {
    /// Where it stands.
    pub path: PathBuf,
    /// What it is.
    pub format: Format,
    /// Name of what it stores, as [`file_digest`](crate::file_digest) gives it.
    pub digest: Digest,
    /// Its length.
    pub bytes: u64,
}

/// What the encoders share: where the pixels are and what is said about them.
struct Source<'a> {
    scratch: &'a Scratch,
    request: &'a FrameRequest,
    film_digest: Digest,
    /// The first row of pixels that has not been encoded.
    row: u32,
}

impl Source<'_> {
    /// [`Scratch::for_each_strip`] of what has not been encoded.
    fn for_each_strip<R: Default + Send>(
        &self,
        of: impl Fn(&Strip, &mut R) -> Result<(), ImageError> + Sync,
        each: impl FnMut(&mut R) -> Result<(), ImageError>,
    ) -> Result<(), ImageError> {
        (self.scratch).for_each_strip(self.row, self.request.threads, of, each)
    }
}

/// Encodes a finished scratch file into frames and puts them in place, durably.
///
/// Files of the same names are replaced. Fails, leaving no new file behind but those already
/// named, if pixels are missing, the request cannot be met, or the system refuses; the scratch
/// file stays as it is in any case.
pub fn finish(scratch: &Scratch, request: &FrameRequest) -> Result<FinishedFrame, ImageError> {
    Encoding::new(scratch, request.formats, request.view).finish(scratch, request)
}

fn check(request: &FrameRequest) -> Result<(), ImageError> {
    if request.formats.is_empty() {
        return Err(ImageError::NoFormat);
    }
    if !formats::is_stem(&request.stem) {
        return Err(ImageError::BadStem {
            stem: request.stem.clone(),
        });
    }
    if !request.view.is_usable() {
        return Err(ImageError::BadExposure {
            stops: request.view.exposure_stops,
        });
    }
    request.metadata.check()
}
