//! What may go wrong with frames on disk, and the sentence for each.

use std::io;
use std::path::{Path, PathBuf};

use model::{Rect, Resolution};

/// Why a frame could not be assembled, written or read.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The system refused an operation on a file or folder.
    #[error("cannot {attempted} {}", path.display())]
    Io {
        /// What was attempted, as it stands after "cannot".
        attempted: &'static str,
        /// On which path.
        path: PathBuf,
        /// What the system answered.
        source: io::Error,
    },
    /// The file system, or the user's share of it, is full.
    #[error("no space left to {attempted} {}: free some and run again", path.display())]
    DiskFull {
        /// What was attempted, as it stands after "cannot".
        attempted: &'static str,
        /// On which path.
        path: PathBuf,
        /// What the system answered.
        source: io::Error,
    },
    /// Somebody else holds the scratch file.
    #[error("another process is rendering into {}: wait for it or use another folder", path.display())]
    Busy {
        /// The scratch file.
        path: PathBuf,
    },
    /// The file at a scratch file's place is something else, so it is left alone.
    #[error("{} is not a scratch file of this program: move it away", path.display())]
    NotAScratch {
        /// The file found there.
        path: PathBuf,
    },
    /// The window of an image is empty, lies outside the image, or the image is too large.
    #[error("the window {window} does not lie in an image of {}x{} pixels, or a side exceeds {}", resolution.width, resolution.height, model::rect::SIDE_MAX, window = Corners(*window))]
    BadWindow {
        /// The window asked for.
        window: Rect,
        /// The size of the whole image.
        resolution: Resolution,
    },
    /// The rectangle is not inside one grid square, or not inside the window.
    #[error("{rect} is no block of the window {window}", rect = Corners(*rect), window = Corners(*window))]
    NotABlock {
        /// The rectangle sent.
        rect: Rect,
        /// The window of the image.
        window: Rect,
    },
    /// A block came with the wrong number of bytes.
    #[error("the block {rect} has {found} bytes instead of {expected}", rect = Corners(*rect))]
    PayloadLength {
        /// The block.
        rect: Rect,
        /// Bytes that its pixels take.
        expected: usize,
        /// Bytes that came.
        found: usize,
    },
    /// A block holds a NaN or an infinity.
    #[error("channel {channel} at pixel ({x}, {y}) is {value}: a film holds finite numbers only")]
    NotFinite {
        /// Name of the channel.
        channel: &'static str,
        /// Column in the whole image.
        x: u32,
        /// Row in the whole image.
        y: u32,
        /// What stood there.
        value: f32,
    },
    /// Pixels of the window are still missing.
    #[error("{missing} pixels of {} are not rendered yet", path.display())]
    Incomplete {
        /// The scratch file.
        path: PathBuf,
        /// How many.
        missing: u64,
    },
    /// The exposure is not a usable number.
    #[error("an exposure of {stops} stops is out of range: use -64 to 64")]
    BadExposure {
        /// The exposure asked for.
        stops: f64,
    },
    /// No format was asked for.
    #[error("no format is asked for: choose from exr, png, png16, ppm")]
    NoFormat,
    /// The stem of the file names cannot be part of a file name.
    #[error("`{stem}` cannot begin a file name: use letters, digits, `-` and `_`")]
    BadStem {
        /// The stem asked for.
        stem: String,
    },
    /// A text of the metadata cannot be stored.
    #[error("the metadata `{name}` cannot be stored: {reason}")]
    BadMetadata {
        /// Which text.
        name: String,
        /// Why not.
        reason: &'static str,
    },
    /// An encoder refused to write.
    #[error("cannot encode {}", path.display())]
    Encode {
        /// The frame being written.
        path: PathBuf,
        /// What the encoder said.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The file begins like none of the formats that are read.
    #[error("{} is neither EXR, PNG nor binary PPM (P6)", path.display())]
    NotAnImage {
        /// The file.
        path: PathBuf,
    },
    /// The file is larger, or claims to be, than what is read.
    #[error("{} is too large to read: {claim}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What it claims, and the limit.
        claim: String,
    },
    /// The file is damaged or truncated.
    #[error("{} is damaged: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The file is valid but uses a feature that is not read.
    #[error("{} cannot be read: {what}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The feature.
        what: String,
    },
    /// Two frames differ in what they are, so that their pixels cannot be compared.
    #[error("{} and {} cannot be compared: {what}", a.display(), b.display())]
    NotComparable {
        /// The first frame.
        a: PathBuf,
        /// The second frame.
        b: PathBuf,
        /// What differs.
        what: String,
    },
}

impl ImageError {
    /// An error of the system, a full disk apart from all others.
    pub(crate) fn io(attempted: &'static str, path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::DiskFull {
                attempted,
                path,
                source,
            },
            _ => Self::Io {
                attempted,
                path,
                source,
            },
        }
    }

    /// Whether more space on the disk would mend it.
    pub fn is_disk_full(&self) -> bool {
        matches!(self, Self::DiskFull { .. })
    }
}

/// A rectangle as `(x0, y0)..(x1, y1)`.
struct Corners(Rect);

impl std::fmt::Display for Corners {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Rect { x0, y0, x1, y1 } = self.0;
        write!(f, "({x0}, {y0})..({x1}, {y1})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_told_apart_from_other_errors() {
        let error = |code| {
            let source = io::Error::from_raw_os_error(code);
            ImageError::io("write a block to", Path::new("/frames/s"), source)
        };
        // ENOSPC and EDQUOT on one side, EIO on the other.
        assert!(error(28).is_disk_full() && error(122).is_disk_full());
        assert!(!error(5).is_disk_full());
        assert_eq!(
            error(28).to_string(),
            "no space left to write a block to /frames/s: free some and run again"
        );
    }
}
