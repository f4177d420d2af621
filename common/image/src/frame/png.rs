//! PNG of 8 or 16 bits, RGB, sRGB, without alpha: the film's colour is premultiplied over black,
//! which is what a viewer should see, sky (alpha 0) included.

use std::io::{BufWriter, Write};

use model::{Digest, Rect};
use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, SrgbRenderingIntent};

use super::Source;
use super::publish::Pending;
use crate::digest::StoredHasher;
use crate::error::ImageError;
use crate::read::{FileKind, SampleKind, Window};
use crate::scratch::Strip;
use crate::view::{Display, ViewTransform};

/// Bits of one sample.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Depth {
    Eight,
    Sixteen,
}

impl Depth {
    fn top(self) -> u16 {
        match self {
            Self::Eight => 255,
            Self::Sixteen => 65_535,
        }
    }

    /// The rows of a strip, in place of what `rows` held.
    fn encode(self, strip: &Strip, display: &Display, rows: &mut Rows) {
        match self {
            Self::Eight => rows.take::<1>(strip, display),
            Self::Sixteen => rows.take::<2>(strip, display),
        }
    }
}

/// Some rows of a PNG or PPM.
#[derive(Default)]
struct Rows {
    /// R, G, B per pixel; 16 bits big-endian.
    interleaved: Vec<u8>,
    /// The same as the digest of stored values takes it: for each row all of B, G and R, little-endian.
    hashed: Vec<u8>,
}

impl Rows {
    /// Those of a strip, with so many bytes a sample.
    fn take<const BYTES: usize>(&mut self, strip: &Strip, display: &Display) {
        let width = strip.row(0, strip.rows().start).len();
        for stored in [&mut self.interleaved, &mut self.hashed] {
            stored.resize(strip.rows().len() * width * 3 * BYTES, 0);
        }
        let (samples, _) = self.interleaved.as_chunks_mut::<BYTES>();
        let (pixels, _) = samples.as_chunks_mut::<3>();
        let (hashed, _) = self.hashed.as_chunks_mut::<BYTES>();
        let rows = pixels.chunks_mut(width).zip(hashed.chunks_mut(3 * width));
        for (y, (pixels, hashed)) in strip.rows().zip(rows) {
            let [red, green, blue] = [0, 1, 2].map(|channel| strip.row(channel, y));
            let (hashed_blue, rest) = hashed.split_at_mut(width);
            let (hashed_green, hashed_red) = rest.split_at_mut(width);
            for (i, pixel) in pixels.iter_mut().enumerate() {
                let codes = display.codes([red[i], green[i], blue[i]]);
                let bytes = codes.map(|code| code.to_le_bytes());
                for (stored, bytes) in pixel.iter_mut().zip(bytes) {
                    for (stored, byte) in stored.iter_mut().rev().zip(bytes) {
                        *stored = byte;
                    }
                }
                let [red, green, blue] =
                    bytes.map(|bytes| std::array::from_fn(|place| bytes[place]));
                (hashed_red[i], hashed_green[i], hashed_blue[i]) = (red, green, blue);
            }
        }
    }
}

/// A PNG or PPM in the making.
pub(super) struct Begun {
    depth: Depth,
    display: Display,
    hasher: StoredHasher,
    /// Rows from the window's top.
    samples: Vec<u8>,
    /// Memory of a strip's.
    rows: Rows,
}

impl Begun {
    /// Of a window's pixels.
    pub(super) fn new(kind: FileKind, depth: Depth, window: Rect, view: ViewTransform) -> Self {
        let mut hasher = StoredHasher::new(kind, 1);
        hash_head(&mut hasher, window, depth);
        Self {
            depth,
            display: view.prepare(depth.top()),
            hasher,
            samples: Vec::new(),
            rows: Rows::default(),
        }
    }

    /// Takes the next strip.
    pub(super) fn take(&mut self, strip: &Strip) {
        self.depth.encode(strip, &self.display, &mut self.rows);
        self.hasher.samples(&self.rows.hashed);
        self.samples.extend_from_slice(&self.rows.interleaved);
    }

    /// Bytes that it keeps.
    pub(super) fn kept(&self) -> usize {
        self.samples.len()
    }

    /// Writes what there is and all rows that are to come; returns the digest of what is stored.
    pub(super) fn write_rows(
        self,
        source: &Source<'_>,
        mut write: impl FnMut(&[u8]) -> Result<(), ImageError>,
    ) -> Result<Digest, ImageError> {
        let Self {
            depth,
            display,
            mut hasher,
            samples,
            ..
        } = self;
        write(&samples)?;
        let of = |strip: &Strip, rows: &mut Rows| {
            depth.encode(strip, &display, rows);
            Ok(())
        };
        let each = |rows: &mut Rows| {
            hasher.samples(&rows.hashed);
            write(&rows.interleaved)
        };
        source.for_each_strip(of, each)?;
        Ok(hasher.finish())
    }

    /// Writes a PNG and returns the digest of what it stores.
    pub(super) fn write(
        self,
        source: &Source<'_>,
        pending: &Pending,
    ) -> Result<Digest, ImageError> {
        let failed = |error| refused(pending, error);
        let window = source.scratch.window();
        let out = BufWriter::with_capacity(1 << 16, pending.file());
        let encoder = describe(
            source,
            Encoder::new(out, window.width(), window.height()),
            self.depth,
        );
        let mut writer = encoder.and_then(Encoder::write_header).map_err(failed)?;
        let mut stream = writer.stream_writer().map_err(failed)?;
        let digest = self.write_rows(source, |samples| {
            stream
                .write_all(samples)
                .map_err(|error| ImageError::io("write", pending.target(), error))
        })?;
        stream.finish().map_err(failed)?;
        writer.finish().map_err(failed)?;
        Ok(digest)
    }
}

/// Depth, colour space and metadata.
fn describe<W: Write>(
    source: &Source<'_>,
    mut encoder: Encoder<'static, W>,
    depth: Depth,
) -> Result<Encoder<'static, W>, EncodingError> {
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(match depth {
        Depth::Eight => BitDepth::Eight,
        Depth::Sixteen => BitDepth::Sixteen,
    });
    encoder.set_compression(Compression::Fast);
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    let metadata = &source.request.metadata;
    for (name, text) in metadata.texts(source.film_digest) {
        encoder.add_itxt_chunk(name.to_owned(), text)?;
    }
    encoder.add_itxt_chunk("Software".to_owned(), metadata.software.clone())?;
    let rate = metadata.frames_per_second.to_string();
    encoder.add_itxt_chunk("framesPerSecond".to_owned(), rate)?;
    if !metadata.comments.is_empty() {
        encoder.add_itxt_chunk("Comment".to_owned(), metadata.comments.clone())?;
    }
    Ok(encoder)
}

fn refused(pending: &Pending, error: EncodingError) -> ImageError {
    match error {
        EncodingError::IoError(source) => ImageError::io("write", pending.target(), source),
        other => ImageError::Encode {
            path: pending.target().to_owned(),
            source: other.into(),
        },
    }
}

/// Begins the only part of a PNG or PPM in the digest of stored values.
fn hash_head(hasher: &mut StoredHasher, window: Rect, depth: Depth) {
    let size = Window {
        x: 0,
        y: 0,
        width: window.width(),
        height: window.height(),
    };
    let kind = match depth {
        Depth::Eight => SampleKind::U8,
        Depth::Sixteen => SampleKind::U16,
    };
    // Sorted by name, like every part's channels.
    let channels = ["B", "G", "R"].map(|name| (name, kind));
    hasher.part("", size, size, channels.into_iter());
}
