//! Reading a frame of any kind into memory, whoever wrote it.
//!
//! A file is told by its first bytes, never by its name. What it claims about its size is checked
//! against [`SIDE_MAX`], [`DECODED_BYTES_MAX`] and the length of the file before anything of that
//! size is allocated.

mod exr;
mod png;
mod ppm;
mod samples;

use std::fmt;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use model::Rect;
use model::rect::SIDE_MAX;

use crate::error::ImageError;

pub use self::samples::SampleKind;
pub(crate) use self::samples::Samples;

/// Most bytes that the samples of a frame may take in memory when it is read.
pub const DECODED_BYTES_MAX: u64 = 4 << 30;

/// Most channels of all parts of a frame together.
const CHANNELS_MAX: usize = 1024;

/// What kind of file a frame is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FileKind {
    /// OpenEXR.
    Exr,
    /// PNG.
    Png,
    /// Binary PPM (P6).
    Ppm,
}

impl FileKind {
    /// Its name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::Png => "png",
            Self::Ppm => "ppm",
        }
    }
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A rectangle of pixels as files have it: it may begin left of or above the image.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Window {
    /// First column.
    pub x: i32,
    /// First row.
    pub y: i32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Window {
    /// A rectangle of an image, whose sides are at most [`SIDE_MAX`].
    pub(crate) fn of(rect: Rect) -> Self {
        let place = |at: u32| i32::try_from(at).expect("a side is at most 65,536 pixels");
        Self {
            x: place(rect.x0),
            y: place(rect.y0),
            width: rect.width(),
            height: rect.height(),
        }
    }
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            x,
            y,
            width,
            height,
        } = self;
        write!(f, "{width}x{height} at ({x}, {y})")
    }
}

/// A frame in memory.
#[derive(Debug)]
pub(crate) struct Picture {
    pub(crate) kind: FileKind,
    /// How it is packed, for people.
    pub(crate) packing: String,
    /// At least one.
    pub(crate) parts: Vec<Part>,
    /// Sorted by name.
    pub(crate) metadata: Vec<(String, String)>,
}

/// One part of a frame; all but multi-part EXR have one.
#[derive(Debug)]
pub(crate) struct Part {
    pub(crate) name: Option<String>,
    pub(crate) data_window: Window,
    pub(crate) display_window: Window,
    /// Sorted by name.
    pub(crate) channels: Vec<Channel>,
}

/// One plane of a part.
#[derive(Debug)]
pub(crate) struct Channel {
    pub(crate) name: String,
    /// Row by row, as many as the part's data window has pixels.
    pub(crate) samples: Samples,
}

/// A file opened for reading, with what its decoder needs to know about it.
struct Source<'a> {
    path: &'a Path,
    /// Length of the file.
    bytes: u64,
    reader: BufReader<File>,
}

/// Reads a whole frame.
pub(crate) fn picture(path: &Path) -> Result<Picture, ImageError> {
    let failed = |source| ImageError::io("read", path, source);
    let file = File::open(path).map_err(|source| ImageError::io("open", path, source))?;
    let metadata = file.metadata().map_err(failed)?;
    let mut source = Source {
        path,
        bytes: metadata.len(),
        reader: BufReader::with_capacity(1 << 16, file),
    };
    let mut first = Vec::new();
    (&mut source.reader)
        .take(8)
        .read_to_end(&mut first)
        .map_err(failed)?;
    source.reader.rewind().map_err(failed)?;
    match first.as_slice() {
        [0x76, 0x2f, 0x31, 0x01, ..] => exr::read(source),
        b"\x89PNG\r\n\x1a\n" => png::read(source),
        [b'P', b'6', white, ..] if white.is_ascii_whitespace() || *white == b'#' => {
            ppm::read(source)
        }
        _ => Err(ImageError::NotAnImage {
            path: path.to_owned(),
        }),
    }
}

/// Fails if a part of this size, beside `before` bytes of other parts, exceeds the limits; returns
/// the bytes of all.
fn check_size(
    path: &Path,
    width: u64,
    height: u64,
    pixel_bytes: u64,
    before: u64,
) -> Result<u64, ImageError> {
    let too_large = |claim| ImageError::TooLarge {
        path: path.to_owned(),
        claim,
    };
    if width == 0 || height == 0 {
        return Err(damaged(path, "it has no pixels"));
    }
    if width > u64::from(SIDE_MAX) || height > u64::from(SIDE_MAX) {
        return Err(too_large(format!(
            "it claims {width}x{height} pixels, the limit is {SIDE_MAX} along a side"
        )));
    }
    let bytes = before.saturating_add((width * height).saturating_mul(pixel_bytes));
    if bytes > DECODED_BYTES_MAX {
        return Err(too_large(format!(
            "its pixels take {bytes} bytes of memory, the limit is {DECODED_BYTES_MAX}"
        )));
    }
    Ok(bytes)
}

fn damaged(path: &Path, what: impl fmt::Display) -> ImageError {
    ImageError::Damaged {
        path: path.to_owned(),
        what: what.to_string(),
    }
}

/// The planes B, G, R (or Y, with A where there is alpha) of interleaved samples.
fn planes(names: &[&str], interleaved: &Samples) -> Vec<Channel> {
    let mut channels: Vec<_> = names
        .iter()
        .enumerate()
        .map(|(index, name)| Channel {
            name: (*name).to_owned(),
            samples: interleaved.every(index, names.len()),
        })
        .collect();
    channels.sort_by(|a, b| a.name.cmp(&b.name));
    channels
}
