//! Encoding a finished scratch file into frames.
//!
//! Every format is written strip by strip under a hidden name; only when all of them are whole
//! and synced do they get their names, so that a frame that can be seen is a frame that is done.

pub(crate) mod exr;
pub(crate) mod formats;
pub(crate) mod metadata;
mod png;
mod ppm;
pub(crate) mod publish;
mod zip;

use std::path::PathBuf;

use model::{Digest, ImageNumber};

use self::formats::{Format, Formats, frame_name};
use self::metadata::FrameMetadata;
use self::publish::{Pending, sync_folder_of};
use crate::error::ImageError;
use crate::scratch::Scratch;
use crate::share::in_order;
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
}

/// Encodes a finished scratch file into frames and puts them in place, durably.
///
/// Files of the same names are replaced. Fails, leaving no new file behind but those already
/// named, if pixels are missing, the request cannot be met, or the system refuses; the scratch
/// file stays as it is in any case.
pub fn finish(scratch: &Scratch, request: &FrameRequest) -> Result<FinishedFrame, ImageError> {
    check(request)?;
    let source = Source {
        scratch,
        request,
        film_digest: scratch.film_digest_by(request.threads)?,
    };
    let formats: Vec<Format> = request.formats.iter().collect();
    let written = in_order(formats, request.threads, |format| write(&source, format));
    let written: Vec<Written> = written.into_iter().collect::<Result<_, _>>()?;
    let mut files = Vec::new();
    for Written {
        pending,
        format,
        digest,
        bytes,
    } in written
    {
        let path = pending.publish()?;
        files.push(FinishedFile {
            path,
            format,
            digest,
            bytes,
        });
    }
    if let Some(file) = files.first() {
        sync_folder_of(&file.path)?;
    }
    Ok(FinishedFrame {
        film_digest: source.film_digest,
        files,
    })
}

/// A frame that is whole and durable, and has no name yet.
struct Written {
    pending: Pending,
    format: Format,
    digest: Digest,
    bytes: u64,
}

fn write(source: &Source<'_>, format: Format) -> Result<Written, ImageError> {
    let request = source.request;
    let name = frame_name(&request.stem, request.number, format);
    let pending = Pending::create(&request.folder, &name)?;
    let digest = match format {
        Format::Exr => exr::write(source, &pending),
        Format::Png8 => png::write(source, &pending, png::Depth::Eight),
        Format::Png16 => png::write(source, &pending, png::Depth::Sixteen),
        Format::Ppm => ppm::write(source, &pending),
    }?;
    let bytes = pending.sync()?;
    Ok(Written {
        pending,
        format,
        digest,
        bytes,
    })
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
