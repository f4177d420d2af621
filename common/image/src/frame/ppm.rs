//! Binary PPM of 8 bits: the thesis's own format (§C.3.6). It holds no metadata.

use std::io::{BufWriter, Write};

use model::Digest;

use super::Source;
use super::publish::Pending;
use crate::digest::StoredHasher;
use crate::error::ImageError;
use crate::frame::png::{Depth, hash_head, hash_row};
use crate::read::FileKind;

/// Writes the frame and returns the digest of what it stores.
pub(super) fn write(source: &Source<'_>, pending: &Pending) -> Result<Digest, ImageError> {
    let failed = |error| ImageError::io("write", pending.target(), error);
    let window = source.scratch.window();
    let display = source.request.view.prepare(255);
    let mut hasher = StoredHasher::new(FileKind::Ppm, 1);
    hash_head(&mut hasher, window, Depth::Eight);
    let mut out = BufWriter::with_capacity(1 << 16, pending.file());
    write!(out, "P6\n{} {}\n255\n", window.width(), window.height()).map_err(failed)?;
    let mut row = Vec::new();
    source.scratch.for_each_strip(|strip| {
        for y in strip.rows() {
            Depth::Eight.encode(strip, y, &display, &mut row);
            hash_row(&mut hasher, &row, Depth::Eight);
            out.write_all(&row).map_err(failed)?;
        }
        Ok(())
    })?;
    out.flush().map_err(failed)?;
    Ok(hasher.finish())
}
