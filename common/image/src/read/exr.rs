//! OpenEXR in any layout that the `exr` crate decodes: scan lines or tiles, any compression but
//! those it lacks, many parts, levels (the largest is read). Deep data is not read.

use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::error::Error as ExrError;
use exr::image::FlatSamples;
use exr::image::read::image::ReadLayers;
use exr::image::read::layers::ReadChannels;
use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, IntegerBounds, SampleType, Text};
use exr::meta::header::Header;

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
    let packing = packing(&reader.headers()[0]);
    let metadata = metadata(reader.headers());
    let windows: Vec<_> = reader.headers().iter().map(Header::data_window).collect();
    let image = exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_chunks(reader)
        .map_err(failed)?;
    let display_window = window(image.attributes.display_window);
    let parts = image
        .layer_data
        .into_iter()
        .zip(windows)
        .map(|(layer, data_window)| Part {
            name: layer.attributes.layer_name.as_ref().map(string),
            data_window: window(data_window),
            display_window,
            channels: layer
                .channel_data
                .list
                .into_iter()
                .map(|channel| Channel {
                    name: string(&channel.name),
                    samples: match channel.sample_data {
                        FlatSamples::F16(samples) => Samples::F16(samples),
                        FlatSamples::F32(samples) => Samples::F32(samples),
                        FlatSamples::U32(samples) => Samples::U32(samples),
                    },
                })
                .collect(),
        })
        .collect();
    Ok(Picture {
        kind: FileKind::Exr,
        packing,
        parts,
        metadata,
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
