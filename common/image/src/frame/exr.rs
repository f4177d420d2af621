//! OpenEXR: one part, every channel of the film, tiles of a strip's height, ZIP.
//!
//! Tiles are written row by row from strips, through the `exr` crate's chunk interface. Compressing them is most of
//! the work, and can be shared by threads; the bytes are the same.

use std::collections::HashMap;
use std::fs::File;
use std::io::{
    self, BufRead as _, BufReader, BufWriter, Read as _, Seek as _, SeekFrom, Write as _,
};
use std::path::Path;

use exr::block::chunk::{Chunk, CompressedBlock, CompressedTileBlock, TileCoordinates};
use exr::block::writer::ChunksWriter;
use exr::error::Error as ExrError;
use exr::math::{RoundingMode, Vec2};
use exr::meta::BlockDescription;
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, IntegerBounds, LevelMode, LineOrder, SampleType, Text,
    TileDescription,
};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use half::f16;
use half::slice::HalfFloatSliceExt;
use model::film::{CHANNEL_COUNT, CHANNELS, Storage};
use model::rect::GRID_SQUARE;
use model::{Digest, Rect};

use super::Source;
use super::publish::Pending;
use super::zip::Zip;
use crate::digest::StoredHasher;
use crate::error::ImageError;
use crate::read::{FileKind, SampleKind, Window};
use crate::scratch::{Scratch, Strip, append_le_bytes};

// The `exr` crate takes samples in the machine's order of bytes, the digest little-endian ones;
// the same lines serve both.
const _: () = assert!(
    cfg!(target_endian = "little"),
    "frames are written little-endian only"
);

/// Side of a tile: that of a grid square and the height of a strip.
const TILE: usize = GRID_SQUARE as usize;

/// Where the attributes begin: behind the magic number and the version.
const HEADER_FROM: u64 = 8;

/// Largest finite half; light beyond it is stored as this, never as infinity.
const HALF_MAX: f32 = 65_504.0;

/// An EXR in the making.
pub(super) struct Begun {
    window: Rect,
    channels: [usize; CHANNEL_COUNT],
    hasher: StoredHasher,
    /// Tiles from the window's top.
    made: Made,
    kept: usize,
}

impl Begun {
    /// Of a film's pixels.
    pub(super) fn new(scratch: &Scratch) -> Self {
        let window = scratch.window();
        let channels = sorted_channels();
        let mut hasher = StoredHasher::new(FileKind::Exr, 1);
        hasher.part(
            "",
            Window::of(window),
            Window::of(scratch.identity().resolution.rect()),
            channels
                .iter()
                .map(|index| (CHANNELS[*index].name, sample_kind(*index))),
        );
        Self {
            window,
            channels,
            hasher,
            made: Made::default(),
            kept: 0,
        }
    }

    /// Takes the next strip of a scratch file.
    pub(super) fn take(&mut self, scratch: &Scratch, strip: &Strip) -> Result<(), ImageError> {
        let first = self.made.tiles.len();
        let taken = self.made.take(strip, self.window, &self.channels);
        taken.map_err(|error| refused(scratch.path(), error))?;
        self.hasher.samples(&self.made.lines.bytes);
        for (_, chunk) in &mut self.made.tiles[first..] {
            if let CompressedBlock::Tile(block) = &mut chunk.compressed_block {
                // Room for what did not become smaller was for that one alone.
                block.compressed_pixels_le.shrink_to_fit();
                self.kept += block.compressed_pixels_le.len();
            }
        }
        Ok(())
    }

    /// Bytes that it keeps.
    pub(super) fn kept(&self) -> usize {
        self.kept
    }

    /// Writes the frame and returns the digest of what it stores.
    pub(super) fn write(
        self,
        source: &Source<'_>,
        pending: &Pending,
    ) -> Result<Digest, ImageError> {
        let Self {
            window,
            channels,
            mut hasher,
            made,
            ..
        } = self;
        let mut out = BufWriter::with_capacity(1 << 16, pending.file());
        // An error of ours has to pass through the crate's closure, which knows its own only.
        let mut ours = None;
        let failed = |error| refused(pending.target(), error);
        exr::block::write(
            &mut out,
            [header(source, &channels)].into_iter().collect(),
            true,
            |_, chunks| {
                for (number, chunk) in made.tiles {
                    chunks.write_chunk(number, chunk)?;
                }
                let of = |strip: &Strip, made: &mut Made| {
                    made.take(strip, window, &channels).map_err(failed)
                };
                let each = |Made { lines, tiles, .. }: &mut Made| {
                    hasher.samples(&lines.bytes);
                    for (number, chunk) in tiles.drain(..) {
                        chunks.write_chunk(number, chunk).map_err(failed)?;
                    }
                    Ok(())
                };
                source.for_each_strip(of, each).map_err(|error| {
                    ours = Some(error);
                    ExrError::Aborted
                })
            },
        )
        .map_err(|error| ours.take().unwrap_or_else(|| failed(error)))?;
        let io = |source| ImageError::io("write", pending.target(), source);
        out.flush().map_err(io)?;
        sort_attributes(pending.file()).map_err(io)?;
        Ok(hasher.finish())
    }
}

/// Puts the attributes of a file's header in the order of their names: the `exr` crate leaves some in that of a hash map,
/// which is never the same twice.
fn sort_attributes(mut file: &File) -> io::Result<()> {
    let mut reader = BufReader::new(file);
    reader.seek(SeekFrom::Start(HEADER_FROM))?;
    let mut attributes = Vec::new();
    loop {
        // Name and kind end with a zero each, the length of the value follows; a name without letters ends the header.
        let mut attribute = Vec::new();
        if reader.read_until(0, &mut attribute)? <= 1 {
            break;
        }
        reader.read_until(0, &mut attribute)?;
        let mut length = [0; 4];
        reader.read_exact(&mut length)?;
        attribute.extend(length);
        let length = u64::from(u32::from_le_bytes(length));
        reader.by_ref().take(length).read_to_end(&mut attribute)?;
        attributes.push(attribute);
    }
    attributes.sort();
    file.seek(SeekFrom::Start(HEADER_FROM))?;
    file.write_all(&attributes.concat())
}

/// What becomes of a strip, and the memory that it takes.
#[derive(Default)]
struct Made {
    lines: Lines,
    zip: Zip,
    /// With their numbers in the file.
    tiles: Vec<(usize, Chunk)>,
}

impl Made {
    /// Adds the tiles of a strip, and holds its lines.
    fn take(
        &mut self,
        strip: &Strip,
        window: Rect,
        channels: &[usize; CHANNEL_COUNT],
    ) -> Result<(), ExrError> {
        self.lines.take(strip, window, channels);
        let (row, columns) = (self.lines.row, self.lines.width.div_ceil(TILE));
        for column in 0..columns {
            let samples = self.lines.tile(column);
            let compressed_pixels_le = self.zip.compress(samples).map_err(io::Error::from)?;
            let block = CompressedTileBlock {
                coordinates: TileCoordinates {
                    tile_index: Vec2(column, row),
                    level_index: Vec2(0, 0),
                },
                compressed_pixels_le,
            };
            let chunk = Chunk {
                layer_index: 0,
                compressed_block: CompressedBlock::Tile(block),
            };
            self.tiles.push((row * columns + column, chunk));
        }
        Ok(())
    }
}

/// The lines of a strip as they are stored: for each row, for each channel of the file, its bytes.
#[derive(Default)]
struct Lines {
    /// Number of its row of tiles.
    row: usize,
    /// Pixels of a line.
    width: usize,
    /// Bytes of a sample, for each line of a row.
    sizes: [usize; CHANNEL_COUNT],
    bytes: Vec<u8>,
}

impl Lines {
    /// Those of a strip, in place of what it held.
    fn take(&mut self, strip: &Strip, window: Rect, channels: &[usize; CHANNEL_COUNT]) {
        self.bytes.clear();
        for y in strip.rows() {
            for &channel in channels {
                let samples = strip.row(channel, y);
                match CHANNELS[channel].storage {
                    Storage::Half => append_half_bytes(samples, &mut self.bytes),
                    Storage::Float => append_le_bytes(samples, &mut self.bytes),
                }
            }
        }
        self.row = (strip.rows().start - window.y0) as usize / TILE;
        self.width = window.width() as usize;
        self.sizes = channels.map(|channel| match CHANNELS[channel].storage {
            Storage::Half => size_of::<f16>(),
            Storage::Float => size_of::<f32>(),
        });
    }

    /// The samples of a tile: for each row, for each channel.
    fn tile(&self, column: usize) -> Vec<u8> {
        let x = column * TILE;
        let end = self.width.min(x + TILE);
        let mut samples = Vec::new();
        let (mut line, mut sizes) = (0, self.sizes.iter().cycle());
        while line < self.bytes.len()
            && let Some(size) = sizes.next()
        {
            samples.extend_from_slice(&self.bytes[line + x * size..line + end * size]);
            line += self.width * size;
        }
        samples
    }
}

/// Appends the nearest halves, little-endian; the largest finite one for what lies beyond.
fn append_half_bytes(samples: &[f32], out: &mut Vec<u8>) {
    let limited: Vec<f32> = samples
        .iter()
        .map(|value| value.clamp(-HALF_MAX, HALF_MAX))
        .collect();
    let mut halves = vec![f16::ZERO; samples.len()];
    halves.convert_from_f32_slice(&limited);
    let from = out.len();
    out.resize(from + halves.len() * 2, 0);
    let (words, _) = out[from..].as_chunks_mut();
    for (bytes, half) in words.iter_mut().zip(halves) {
        *bytes = half.to_le_bytes();
    }
}

/// The film's channels in the order of the file, which is that of their names.
fn sorted_channels() -> [usize; CHANNEL_COUNT] {
    let mut channels = std::array::from_fn(|index| index);
    channels.sort_by_key(|index: &usize| CHANNELS[*index].name);
    channels
}

fn sample_kind(channel: usize) -> SampleKind {
    match CHANNELS[channel].storage {
        Storage::Half => SampleKind::F16,
        Storage::Float => SampleKind::F32,
    }
}

fn header(source: &Source<'_>, channels: &[usize; CHANNEL_COUNT]) -> Header {
    let window = source.scratch.window();
    let size = |rect: Rect| Vec2(rect.width() as usize, rect.height() as usize);
    let place = |at: u32| i32::try_from(at).expect("a side is at most 65,536 pixels");
    let whole = source.scratch.identity().resolution.rect();
    let descriptions = channels.iter().map(|index| {
        let sample_type = match CHANNELS[*index].storage {
            Storage::Half => SampleType::F16,
            Storage::Float => SampleType::F32,
        };
        ChannelDescription::named(text(CHANNELS[*index].name), sample_type)
    });
    let metadata = &source.request.metadata;
    let attributes = LayerAttributes {
        layer_name: None,
        layer_position: Vec2(place(window.x0), place(window.y0)),
        software_name: Some(text(&metadata.software)),
        comments: (!metadata.comments.is_empty()).then(|| text(&metadata.comments)),
        frames_per_second: metadata.rate(),
        other: metadata
            .texts(source.film_digest)
            .into_iter()
            .map(|(name, value)| (text(name), AttributeValue::Text(text(&value))))
            .collect::<HashMap<_, _>>(),
        ..LayerAttributes::default()
    };
    Header::new(text("film"), size(window), descriptions.collect())
        .with_attributes(attributes)
        .with_shared_attributes(ImageAttributes::new(IntegerBounds::new(
            (0, 0),
            size(whole),
        )))
        .with_encoding(
            exr::compression::Compression::ZIP16,
            BlockDescription::Tiles(TileDescription {
                tile_size: Vec2(TILE, TILE),
                level_mode: LevelMode::Singular,
                rounding_mode: RoundingMode::Down,
            }),
            LineOrder::Increasing,
        )
}

/// A text as UTF-8, which is how programs of today read EXR's bytes.
fn text(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}

fn refused(path: &Path, error: ExrError) -> ImageError {
    match error {
        ExrError::Io(source) => ImageError::io("write", path, source),
        other => ImageError::Encode {
            path: path.to_owned(),
            source: other.into(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_beyond_a_half_is_never_infinite() {
        for (value, stored) in [
            (1e30, f16::MAX),
            (-1e30, f16::MIN),
            (65_519.0, f16::MAX),
            (0.18, f16::from_f32_const(0.18)),
            // Halfway between two halves: the even one.
            (2049.0, f16::from_f32_const(2048.0)),
        ] {
            let mut bytes = Vec::new();
            append_half_bytes(&[value; 9], &mut bytes);
            assert_eq!(bytes, stored.to_le_bytes().repeat(9));
        }
    }
}
