//! The file digest: the name of what a frame stores, however it is packed.

use std::path::Path;

use model::Digest;

use crate::error::ImageError;
use crate::read::{self, FileKind, SampleKind, Window};

/// BLAKE3 (derive-key, context `flyby stored values v1`) of the values that a frame stores.
///
/// Texts are taken after their length, numbers are 32 bits, little-endian. The format (`exr`,
/// `png`, `ppm`); the number of parts; for each part its name, its data window and its display
/// window (x, y, width, height each), the number of channels, for each channel, sorted by name,
/// its name and the kind of its samples; then for each row, for each channel, the row's samples,
/// little-endian. Compression, tiling, line order and metadata do not enter.
///
/// Fails if the file cannot be read or is no whole image. See
/// [`DECODED_BYTES_MAX`](crate::DECODED_BYTES_MAX) for the memory it may take.
pub fn file_digest(path: impl AsRef<Path>) -> Result<Digest, ImageError> {
    let picture = read::picture(path.as_ref())?;
    let mut hasher = StoredHasher::new(picture.kind, picture.parts.len());
    let mut row = Vec::new();
    for part in &picture.parts {
        hasher.part(
            part.name.as_deref().unwrap_or(""),
            part.data_window,
            part.display_window,
            part.channels
                .iter()
                .map(|c| (c.name.as_str(), c.samples.kind())),
        );
        for y in 0..part.data_window.height as usize {
            for channel in &part.channels {
                row.clear();
                channel
                    .samples
                    .row_bytes(y, part.data_window.width as usize, &mut row);
                hasher.samples(&row);
            }
        }
    }
    Ok(hasher.finish())
}

/// Takes the stored values in the digest's order, from a reader or from an encoder.
pub(crate) struct StoredHasher(blake3::Hasher);

impl StoredHasher {
    /// Begins a file.
    pub(crate) fn new(kind: FileKind, parts: usize) -> Self {
        let mut hasher = Self(blake3::Hasher::new_derive_key("flyby stored values v1"));
        hasher.text(kind.name());
        hasher.count(parts);
        hasher
    }

    /// Begins a part; `channels` come sorted by name.
    pub(crate) fn part<'a>(
        &mut self,
        name: &str,
        data_window: Window,
        display_window: Window,
        channels: impl ExactSizeIterator<Item = (&'a str, SampleKind)>,
    ) {
        self.text(name);
        for window in [data_window, display_window] {
            self.0.update(&window.x.to_le_bytes());
            self.0.update(&window.y.to_le_bytes());
            self.0.update(&window.width.to_le_bytes());
            self.0.update(&window.height.to_le_bytes());
        }
        self.count(channels.len());
        for (name, kind) in channels {
            self.text(name);
            self.text(kind.name());
        }
    }

    /// A row of a channel, little-endian.
    pub(crate) fn samples(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The digest.
    pub(crate) fn finish(self) -> Digest {
        Digest(*self.0.finalize().as_bytes())
    }

    fn text(&mut self, text: &str) {
        self.count(text.len());
        self.0.update(text.as_bytes());
    }

    fn count(&mut self, count: usize) {
        let count = u32::try_from(count).expect("names and lists of a header are short");
        self.0.update(&count.to_le_bytes());
    }
}
