//! Files of samples: height maps and volumes.
//!
//! Two formats, told apart by their first bytes:
//!
//! - **PNG**, grey, 8 or 16 bits: a height map seen from above, its upper edge towards +y. Black is 0, white 1.
//! - **A raw grid**: the line `flyby-grid 1`, a line of one to three whole numbers, the samples along x, y and z, and then
//!   as many little-endian 32-bit floats, x running fastest, y from below. `printf 'flyby-grid 1\n64 64\n'` writes the head of one.

use std::io::Cursor;

use field::grid::{SAMPLES_MAX, Samples};

/// How a raw grid begins.
const MAGIC: &[u8] = b"flyby-grid 1\n";

/// How a PNG begins.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Most bytes of the line that holds a raw grid's sides.
const SIDES_LINE_MAX: usize = 64;

/// The samples of a file, or a sentence, without its full stop, that says why there are none.
///
/// Takes bytes from anybody; memory stays within a few times what the samples take.
pub fn decode(bytes: &[u8]) -> Result<Samples, String> {
    if let Some(rest) = bytes.strip_prefix(MAGIC) {
        raw(rest)
    } else if bytes.starts_with(PNG) {
        picture(bytes)
    } else {
        Err("the file is neither a PNG image nor a raw grid that begins with `flyby-grid 1`".into())
    }
}

fn raw(rest: &[u8]) -> Result<Samples, String> {
    let form = || "the second line of a raw grid holds two or three whole numbers, its sides";
    let line = rest
        .iter()
        .take(SIDES_LINE_MAX)
        .position(|&byte| byte == b'\n');
    let line = line.ok_or_else(form)?;
    let text = std::str::from_utf8(&rest[..line]).map_err(|_| form())?;
    let given: Vec<usize> = text
        .split_ascii_whitespace()
        .map(str::parse)
        .collect::<Result<_, _>>()
        .map_err(|_| form())?;
    let sides = match given[..] {
        [x, y] => [x, y, 1],
        [x, y, z] => [x, y, z],
        _ => return Err(form().into()),
    };
    let count = Samples::count(sides).map_err(|error| error.to_string())?;
    let data = &rest[line + 1..];
    if data.len() != 4 * count {
        return Err(format!(
            "a raw grid of {count} samples has {} bytes after its second line, not {}",
            4 * count,
            data.len()
        ));
    }
    let values = data
        .chunks_exact(4)
        .map(|bytes| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
        .collect();
    Samples::new(sides, values).map_err(|error| error.to_string())
}

fn picture(bytes: &[u8]) -> Result<Samples, String> {
    let damaged = |error: png::DecodingError| format!("the PNG image cannot be read: {error}");
    let limits = png::Limits {
        bytes: 4 * SAMPLES_MAX,
    };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(damaged)?;
    let info = reader.info();
    let (width, height) = (info.width as usize, info.height as usize);
    let count = Samples::count([width, height, 1]).map_err(|error| error.to_string())?;
    let size = reader
        .output_buffer_size()
        .filter(|size| *size <= 8 * count)
        .ok_or("the PNG image is too large")?;
    let mut pixels = vec![0; size];
    let frame = reader.next_frame(&mut pixels).map_err(damaged)?;
    if frame.color_type != png::ColorType::Grayscale {
        return Err(format!(
            "a height map is a grey PNG image, not one of type {:?}",
            frame.color_type
        ));
    }
    let rows = pixels.chunks_exact(frame.line_size).take(height).rev();
    let values = match frame.bit_depth {
        png::BitDepth::Sixteen => rows
            .flat_map(|row| row.chunks_exact(2))
            .map(|pair| f32::from(u16::from_be_bytes([pair[0], pair[1]])) / 65_535.0)
            .collect(),
        _ => rows
            .flatten()
            .map(|&byte| f32::from(byte) / 255.0)
            .collect(),
    };
    Samples::new([width, height, 1], values).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(bits: png::BitDepth, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 4, 4);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(bits);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn pictures_are_seen_from_above() {
        let mut data = [0; 32];
        // The last pixel of the upper row, white.
        data[6..8].copy_from_slice(&[255, 255]);
        let samples = decode(&grey(png::BitDepth::Sixteen, &data)).unwrap();
        assert_eq!(samples.sides(), [4, 4, 1]);
        assert_eq!(samples.values()[15], 1.0);
        assert_eq!(samples.values()[..15], [0.0; 15]);
        let eight: Vec<u8> = (0..16).map(|i| i * 17).collect();
        let samples = decode(&grey(png::BitDepth::Eight, &eight)).unwrap();
        assert_eq!(samples.values()[0], 204.0 / 255.0);
    }

    #[test]
    fn raw_grids_hold_floats() {
        let mut bytes = b"flyby-grid 1\n4 5 6\n".to_vec();
        for i in 0u8..120 {
            bytes.extend(f32::from(i).to_le_bytes());
        }
        let samples = decode(&bytes).unwrap();
        assert_eq!(samples.sides(), [4, 5, 6]);
        assert_eq!(samples.values()[119], 119.0);
        bytes.pop();
        assert!(decode(&bytes).unwrap_err().contains("480 bytes"));
    }

    #[test]
    fn what_is_no_grid_is_said_so() {
        for (bytes, said) in [
            (&b"hello"[..], "neither"),
            (b"flyby-grid 1\n4\n", "two or three"),
            (b"flyby-grid 1\n4 4", "two or three"),
            (b"flyby-grid 1\n4 -4\n", "two or three"),
            (b"flyby-grid 1\n2 4\n", "at least 4"),
            (b"flyby-grid 1\n4096 99999999\n", "at most"),
            (b"flyby-grid 1\n99999999999 99999999999 9\n", "at most"),
            (b"\x89PNG\r\n\x1a\nnonsense", "cannot be read"),
        ] {
            let error = decode(bytes).unwrap_err();
            assert!(error.contains(said), "{said}: {error}");
        }
        let mut whole = grey(png::BitDepth::Eight, &[7; 16]);
        whole.truncate(whole.len() / 2);
        assert!(decode(&whole).is_err());
        let mut nan = b"flyby-grid 1\n4 4\n".to_vec();
        nan.extend([255; 64]);
        assert!(decode(&nan).unwrap_err().contains("finite"));
    }
}
