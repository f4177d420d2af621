//! Binary PPM (P6), of 8 or 16 bits.

use std::io::{BufRead, Read};

use super::{FileKind, Part, Picture, SampleKind, Samples, Source, Window, damaged, planes};
use crate::error::ImageError;

/// Most bytes of the header, comments included.
const HEADER_BYTES_MAX: u64 = 64 * 1024;

pub(super) fn read(mut source: Source<'_>) -> Result<Picture, ImageError> {
    let mut header = Header {
        reader: (&mut source.reader).take(HEADER_BYTES_MAX),
        read: 0,
    };
    let numbers = header.numbers();
    let header_bytes = header.read;
    let [width, height, top] = match numbers {
        Ok(numbers) => numbers.map(u64::from),
        Err(Broken::Io(error)) => return Err(ImageError::io("read", source.path, error)),
        Err(Broken::Form) => {
            return Err(damaged(
                source.path,
                "its header is not P6, width, height and largest code",
            ));
        }
    };
    let kind = match top {
        1..=255 => SampleKind::U8,
        256..=65_535 => SampleKind::U16,
        _ => {
            return Err(damaged(
                source.path,
                format_args!("its largest code is {top}"),
            ));
        }
    };
    let expected = super::check_size(source.path, width, height, 3 * kind.bytes(), 0)?;
    let found = source.bytes.saturating_sub(header_bytes);
    if found < expected {
        return Err(damaged(
            source.path,
            format_args!("it has {found} bytes of pixels instead of {expected}"),
        ));
    }
    let mut bytes = Vec::new();
    (&mut source.reader)
        .take(expected)
        .read_to_end(&mut bytes)
        .map_err(|error| ImageError::io("read", source.path, error))?;
    if bytes.len() as u64 != expected {
        return Err(damaged(source.path, "it ended while it was read"));
    }
    let side = |pixels| u32::try_from(pixels).expect("checked against the largest side");
    let window = Window {
        x: 0,
        y: 0,
        width: side(width),
        height: side(height),
    };
    Ok(Picture {
        kind: FileKind::Ppm,
        packing: format!("codes 0 to {top}"),
        parts: vec![Part {
            name: None,
            data_window: window,
            display_window: window,
            channels: planes(&["R", "G", "B"], &Samples::from_be_bytes(kind, bytes)),
        }],
        metadata: Vec::new(),
    })
}

/// Why a header could not be read.
enum Broken {
    Io(std::io::Error),
    Form,
}

/// The words of a PPM's header.
struct Header<R> {
    reader: R,
    /// Bytes read so far.
    read: u64,
}

impl<R: BufRead> Header<R> {
    /// Width, height and largest code, after the two letters that told the format.
    fn numbers(&mut self) -> Result<[u32; 3], Broken> {
        self.byte()?;
        self.byte()?;
        Ok([self.number()?, self.number()?, self.number()?])
    }

    fn byte(&mut self) -> Result<u8, Broken> {
        let buffer = self.reader.fill_buf().map_err(Broken::Io)?;
        let byte = *buffer.first().ok_or(Broken::Form)?;
        self.reader.consume(1);
        self.read += 1;
        Ok(byte)
    }

    /// The next number, after white space and comments, with the one white space that ends it.
    fn number(&mut self) -> Result<u32, Broken> {
        let mut byte = self.byte()?;
        while byte.is_ascii_whitespace() || byte == b'#' {
            if byte == b'#' {
                while self.byte()? != b'\n' {}
            }
            byte = self.byte()?;
        }
        let mut number = 0_u32;
        while byte.is_ascii_digit() {
            number = number
                .checked_mul(10)
                .and_then(|n| n.checked_add(u32::from(byte - b'0')))
                .ok_or(Broken::Form)?;
            byte = self.byte()?;
        }
        if byte.is_ascii_whitespace() {
            Ok(number)
        } else {
            Err(Broken::Form)
        }
    }
}
