//! OpenEXR in any layout that the `exr` crate decodes: scan lines or tiles, any compression but
//! those it lacks, many parts, levels (the largest is read). Deep data is not read.

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::lines::LineRef;
use exr::compression::Compression;
use exr::error::Error as ExrError;
use exr::math::Vec2;
use exr::meta::attribute::{AttributeValue, IntegerBounds, SampleType, Text};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};
use half::f16;

use super::{CHANNELS_MAX, Channel, FileKind, Part, Picture, SampleKind, Samples, Source, Window};
use super::{check_size, damaged};
use crate::error::ImageError;

/// Bytes that each chunk takes in the file at least: its offset, its place, its length.
const CHUNK_BYTES_MIN: u64 = 16;

/// Longest side of a tile.
const TILE_SIDE_MAX: usize = 8192;

/// Attributes that say how the file is packed, not what it is about.
const TECHNICAL: [&str; 12] = [
    "channels",
    "chunkCount",
    "compression",
    "dataWindow",
    "displayWindow",
    "lineOrder",
    "name",
    "pixelAspectRatio",
    "screenWindowCenter",
    "screenWindowWidth",
    "tiles",
    "type",
];

pub(super) fn read(source: Source<'_>) -> Result<Picture, ImageError> {
    let path = source.path;
    // The crate is written for files that mean well: where one makes it panic, the file is
    // damaged, and the panic ends here.
    catch_unwind(AssertUnwindSafe(|| decode(source)))
        .unwrap_or_else(|_| Err(damaged(path, "its structure contradicts itself")))
}

fn decode(source: Source<'_>) -> Result<Picture, ImageError> {
    let Source {
        path,
        bytes,
        reader,
    } = source;
    let failed = |error| match error {
        ExrError::Io(source) if source.kind() != std::io::ErrorKind::UnexpectedEof => {
            ImageError::io("read", path, source)
        }
        ExrError::Io(_) => damaged(path, "it ends too early"),
        ExrError::NotSupported(what) => ImageError::Unsupported {
            path: path.to_owned(),
            what: what.into_owned(),
        },
        other => damaged(path, other),
    };
    let reader = exr::block::read(reader, false).map_err(failed)?;
    check(path, bytes, reader.headers())?;
    let meta = reader.meta_data().clone();
    let mut parts: Vec<_> = meta.headers.iter().map(part).collect();
    let chunks = reader
        .filter_chunks(false, |_, tile, _| tile.is_largest_resolution_level())
        .map_err(failed)?;
    let (mut pixels, mut seen) = (0, BTreeSet::new());
    for chunk in chunks {
        let chunk = chunk.map_err(failed)?;
        if !is_modest(&chunk, &meta) {
            return Err(damaged(path, "a block claims more values than it can hold"));
        }
        let block = UncompressedBlock::decompress_chunk(chunk, &meta, false).map_err(failed)?;
        let Vec2(x, y) = block.index.pixel_position;
        if !seen.insert((block.index.layer, y, x)) {
            return Err(damaged(path, "a block comes twice"));
        }
        let part = &mut parts[block.index.layer];
        pixels += block.index.pixel_size.area();
        for line in block.lines(&meta.headers[block.index.layer].channels) {
            place(line, part).ok_or_else(|| damaged(path, "a block leaves its image"))?;
        }
    }
    let expected: usize = meta.headers.iter().map(|h| h.layer_size.area()).sum();
    if pixels != expected {
        return Err(damaged(path, "blocks are missing"));
    }
    Ok(Picture {
        kind: FileKind::Exr,
        packing: packing(&meta.headers[0]),
        parts,
        metadata: metadata(&meta.headers),
    })
}

/// An empty part of the size that its header says.
fn part(header: &Header) -> Part {
    let pixels = header.layer_size.area();
    let channels = header.channels.list.iter().map(|channel| Channel {
        name: string(&channel.name),
        samples: match channel.sample_type {
            SampleType::F16 => Samples::F16(vec![f16::ZERO; pixels]),
            SampleType::F32 => Samples::F32(vec![0.0; pixels]),
            SampleType::U32 => Samples::U32(vec![0; pixels]),
        },
    });
    Part {
        name: header.own_attributes.layer_name.as_ref().map(string),
        data_window: window(header.data_window()),
        display_window: window(header.shared_attributes.display_window),
        channels: channels.collect(),
    }
}

/// Copies a line of a block to its place; `None` if it has none.
fn place(line: LineRef<'_>, part: &mut Part) -> Option<()> {
    let width = part.data_window.width as usize;
    let Vec2(x, y) = line.location.position;
    let count = line.location.sample_count;
    if x + count > width {
        return None;
    }
    let row = y * width + x..y * width + x + count;
    let bytes = line.value;
    match &mut part.channels.get_mut(line.location.channel)?.samples {
        Samples::F16(samples) => copy(bytes, samples.get_mut(row)?, f16::from_ne_bytes),
        Samples::F32(samples) => copy(bytes, samples.get_mut(row)?, f32::from_ne_bytes),
        Samples::U32(samples) => copy(bytes, samples.get_mut(row)?, u32::from_ne_bytes),
        Samples::U8(_) | Samples::U16(_) => return None,
    }
    Some(())
}

fn copy<T, const N: usize>(bytes: &[u8], to: &mut [T], value: fn([u8; N]) -> T) {
    for (to, bytes) in to.iter_mut().zip(bytes.chunks_exact(N)) {
        *to = value(bytes.try_into().expect("chunks of N bytes"));
    }
}

/// Whether the counts at the head of a DWA block, which its decoder believes, fit its size.
///
/// The head is eleven `u64`, little-endian: version, unpacked and packed length of the plain
/// values, packed lengths of three more sections, then the lengths and counts these unpack to,
/// and a flag.
fn is_modest(chunk: &Chunk, meta: &MetaData) -> bool {
    let header = &meta.headers[chunk.layer_index];
    if !matches!(
        header.compression,
        Compression::DWAA(_) | Compression::DWAB(_)
    ) {
        return true;
    }
    let bytes = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        _ => return true,
    };
    // A packed run is at most one and a half times its values.
    let most = 2 * header.max_block_byte_size().min(header.total_pixel_bytes()) as u64 + 1024;
    [1, 6, 7, 8, 9].into_iter().all(|index| {
        bytes
            .get(index * 8..index * 8 + 8)
            .is_none_or(|count| u64::from_le_bytes(count.try_into().expect("8 bytes")) <= most)
    })
}

/// Refuses what is too large, before anything of that size is allocated.
fn check(path: &std::path::Path, file_bytes: u64, headers: &[Header]) -> Result<(), ImageError> {
    let too_large = |claim: String| ImageError::TooLarge {
        path: path.to_owned(),
        claim,
    };
    let (mut bytes, mut channels, mut chunks) = (0, 0_usize, 0_u64);
    for header in headers {
        let pixel_bytes: u64 = header
            .channels
            .list
            .iter()
            .map(|channel| kind(channel.sample_type).bytes())
            .sum();
        let size = header.layer_size;
        bytes = check_size(path, size.0 as u64, size.1 as u64, pixel_bytes, bytes)?;
        channels += header.channels.list.len();
        if header
            .channels
            .list
            .iter()
            .any(|c| c.sampling != Vec2(1, 1))
        {
            return Err(ImageError::Unsupported {
                path: path.to_owned(),
                what: "it has subsampled channels".to_owned(),
            });
        }
        chunks = chunks.saturating_add(header.chunk_count as u64);
        if let BlockDescription::Tiles(tiles) = header.blocks
            && tiles.tile_size.0.max(tiles.tile_size.1) > TILE_SIDE_MAX
        {
            return Err(too_large(format!(
                "its tiles are longer than {TILE_SIDE_MAX} pixels along a side"
            )));
        }
    }
    if channels > CHANNELS_MAX {
        return Err(too_large(format!(
            "it has {channels} channels, the limit is {CHANNELS_MAX}"
        )));
    }
    if chunks.saturating_mul(CHUNK_BYTES_MIN) > file_bytes {
        return Err(damaged(path, "it is too short for the size it claims"));
    }
    Ok(())
}

fn kind(sample: SampleType) -> SampleKind {
    match sample {
        SampleType::F16 => SampleKind::F16,
        SampleType::F32 => SampleKind::F32,
        SampleType::U32 => SampleKind::U32,
    }
}

fn window(bounds: IntegerBounds) -> Window {
    let side = |pixels| u32::try_from(pixels).unwrap_or(u32::MAX);
    Window {
        x: bounds.position.0,
        y: bounds.position.1,
        width: side(bounds.size.0),
        height: side(bounds.size.1),
    }
}

fn string(text: &Text) -> String {
    String::from_utf8_lossy(text.as_slice()).into_owned()
}

fn packing(header: &Header) -> String {
    let blocks = match header.blocks {
        BlockDescription::ScanLines => "scan lines".to_owned(),
        BlockDescription::Tiles(tiles) => {
            format!("tiles of {}x{}", tiles.tile_size.0, tiles.tile_size.1)
        }
    };
    format!("{blocks}, {}", header.compression)
}

/// What the parts say about themselves, sorted by name, each once.
fn metadata(headers: &[Header]) -> Vec<(String, String)> {
    let mut metadata: Vec<_> = headers
        .iter()
        .flat_map(Header::all_named_attributes)
        .map(|(name, value)| (String::from_utf8_lossy(name).into_owned(), value))
        .filter(|(name, _)| !TECHNICAL.contains(&name.as_str()))
        .map(|(name, value)| (name, describe(&value)))
        .collect();
    metadata.sort();
    metadata.dedup();
    metadata
}

fn describe(value: &AttributeValue) -> String {
    match value {
        AttributeValue::Text(text) => string(text),
        AttributeValue::TextVector(texts) => {
            texts.iter().map(string).collect::<Vec<_>>().join(", ")
        }
        AttributeValue::Rational((dividend, divisor)) => format!("{dividend}/{divisor}"),
        AttributeValue::F32(number) => number.to_string(),
        AttributeValue::F64(number) => number.to_string(),
        AttributeValue::I32(number) => number.to_string(),
        AttributeValue::Bytes { bytes, .. } | AttributeValue::Custom { bytes, .. } => {
            format!("{} bytes", bytes.len())
        }
        AttributeValue::Preview(preview) => {
            format!("picture of {}x{}", preview.size.0, preview.size.1)
        }
        other => format!("{other:?}"),
    }
}
