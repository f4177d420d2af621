//! The film digest: the name of an image's pixels before any file format touched them.

use model::film::{CHANNEL_COUNT, CHANNELS};
use model::{Digest, Rect};

use super::Scratch;
use super::strip::{Strip, append_le_bytes};
use crate::error::ImageError;

/// Rises when what the digest is taken over changes.
const FILM_DIGEST_VERSION: u32 = 1;

impl Scratch {
    /// BLAKE3 (derive-key, context `flyby film v1`) of the finished film: the version, the
    /// window's corners x0 y0 x1 y1, the number of channels and each name after its length, all
    /// numbers `u32` little-endian; then for each row of the window, for each channel, the row's
    /// `f32` little-endian, with −0 made +0.
    ///
    /// It does not depend on tiling, order or interruptions. Fails if pixels are missing or the
    /// file cannot be read. Holds a strip of 32 rows in memory.
    pub fn film_digest(&self) -> Result<Digest, ImageError> {
        let window = self.window();
        self.film_digest_from(window.y0, FilmHasher::new(window), 1)
    }

    /// The same by so many threads, where all rows above `row` have been hashed.
    pub(crate) fn film_digest_from(
        &self,
        row: u32,
        mut hasher: FilmHasher,
        threads: usize,
    ) -> Result<Digest, ImageError> {
        let bytes = |strip: &Strip, bytes: &mut Vec<u8>| {
            collect(strip, bytes);
            Ok(())
        };
        self.for_each_strip(row, threads, bytes, |bytes| {
            hasher.hasher.update(bytes);
            Ok(())
        })?;
        Ok(Digest(*hasher.hasher.finalize().as_bytes()))
    }
}

/// Takes a film from the top.
#[derive(Debug)]
pub(crate) struct FilmHasher {
    hasher: blake3::Hasher,
    bytes: Vec<u8>,
}

impl FilmHasher {
    /// For the film of a window.
    pub(crate) fn new(window: Rect) -> Self {
        let mut hasher = blake3::Hasher::new_derive_key("flyby film v1");
        let mut number = |value: u32| {
            hasher.update(&value.to_le_bytes());
        };
        number(FILM_DIGEST_VERSION);
        let Rect { x0, y0, x1, y1 } = window;
        [x0, y0, x1, y1].into_iter().for_each(&mut number);
        number(u32::try_from(CHANNEL_COUNT).expect("a handful of channels"));
        for channel in CHANNELS {
            let length = u32::try_from(channel.name.len()).expect("a short name");
            hasher.update(&length.to_le_bytes());
            hasher.update(channel.name.as_bytes());
        }
        Self {
            hasher,
            bytes: Vec::new(),
        }
    }

    /// Takes the next strip.
    pub(crate) fn take(&mut self, strip: &Strip) {
        collect(strip, &mut self.bytes);
        self.hasher.update(&self.bytes);
    }
}

/// The bytes of a strip, in place of what `bytes` held; of short pieces the hash takes several times as long.
fn collect(strip: &Strip, bytes: &mut Vec<u8>) {
    bytes.clear();
    for y in strip.rows() {
        for channel in 0..CHANNEL_COUNT {
            append_le_bytes(strip.row(channel, y), bytes);
        }
    }
}
