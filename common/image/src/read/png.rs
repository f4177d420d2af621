//! PNG of any colour type; palettes and depths below 8 bits are expanded to 8.

use png::{BitDepth, ColorType, Decoder, DecodingError, Limits, Transformations};

use super::{
    FileKind, Part, Picture, SampleKind, Samples, Source, Window, check_size, damaged, planes,
};
use crate::error::ImageError;

/// Deflate, and so PNG, cannot grow by more than this when it is unpacked.
const GROWTH_MAX: u64 = 1032;

/// Most bytes that the decoder may hold beside the pixels: texts, profiles, a row or two.
const DECODER_BYTES_MAX: usize = 64 << 20;

pub(super) fn read(source: Source<'_>) -> Result<Picture, ImageError> {
    let Source {
        path,
        bytes: file_bytes,
        reader,
    } = source;
    let failed = |error| match error {
        DecodingError::IoError(source) if source.kind() != std::io::ErrorKind::UnexpectedEof => {
            ImageError::io("read", path, source)
        }
        other => damaged(path, other),
    };
    let limits = Limits {
        bytes: DECODER_BYTES_MAX,
    };
    let mut decoder = Decoder::new_with_limits(reader, limits);
    decoder.set_transformations(Transformations::EXPAND);
    let (width, height) = decoder.read_header_info().map_err(failed)?.size();
    check_size(path, width.into(), height.into(), 8, 0)?;
    let mut reader = decoder.read_info().map_err(failed)?;
    let (color, depth) = reader.output_color_type();
    let names: &[&str] = match color {
        ColorType::Grayscale => &["Y"],
        ColorType::GrayscaleAlpha => &["Y", "A"],
        ColorType::Rgb => &["R", "G", "B"],
        _ => &["R", "G", "B", "A"],
    };
    let kind = match depth {
        BitDepth::Sixteen => SampleKind::U16,
        _ => SampleKind::U8,
    };
    let pixels = u64::from(width) * u64::from(height);
    let expected = pixels * names.len() as u64 * kind.bytes();
    // A sample of one bit has become a byte, hence the 8.
    if expected / 8 / GROWTH_MAX > file_bytes {
        return Err(damaged(path, "it is too short for the size it claims"));
    }
    let length = usize::try_from(expected).expect("checked against the largest size");
    if reader.output_buffer_size() != Some(length) {
        return Err(damaged(path, "its rows have an unexpected length"));
    }
    let mut bytes = vec![0; length];
    reader.next_frame(&mut bytes).map_err(failed)?;
    reader.finish().map_err(failed)?;
    let window = Window {
        x: 0,
        y: 0,
        width,
        height,
    };
    let info = reader.info();
    Ok(Picture {
        kind: FileKind::Png,
        packing: format!(
            "{}{}",
            if info.interlaced {
                "interlaced"
            } else {
                "rows"
            },
            if info.srgb.is_some() { ", sRGB" } else { "" }
        ),
        parts: vec![Part {
            name: None,
            data_window: window,
            display_window: window,
            channels: planes(names, &Samples::from_be_bytes(kind, bytes)),
        }],
        metadata: metadata(info),
    })
}

/// The texts of a PNG, sorted by name; those that do not unpack are left out.
fn metadata(info: &png::Info<'_>) -> Vec<(String, String)> {
    let plain = info
        .uncompressed_latin1_text
        .iter()
        .map(|text| (text.keyword.clone(), text.text.clone()));
    let packed = info
        .compressed_latin1_text
        .iter()
        .filter_map(|text| Some((text.keyword.clone(), text.get_text().ok()?)));
    let international = info
        .utf8_text
        .iter()
        .filter_map(|text| Some((text.keyword.clone(), text.get_text().ok()?)));
    let mut metadata: Vec<_> = plain.chain(packed).chain(international).collect();
    metadata.sort();
    metadata
}
