//! Binary PPM of 8 bits: the thesis's own format (§C.3.6). It holds no metadata.

use std::io::{BufWriter, Write};

use model::Digest;

use super::Source;
use super::publish::Pending;
use crate::digest::StoredHasher;
use crate::error::ImageError;
use crate::frame::png::{Depth, Rows, hash_head};
use crate::read::FileKind;
use crate::scratch::Strip;

/// Writes the frame and returns the digest of what it stores.
pub(super) fn write(source: &Source<'_>, pending: &Pending) -> Result<Digest, ImageError> {
    let failed = |error| ImageError::io("write", pending.target(), error);
    let window = source.scratch.window();
    let display = source.request.view.prepare(255);
    let mut hasher = StoredHasher::new(FileKind::Ppm, 1);
    hash_head(&mut hasher, window, Depth::Eight);
    let mut out = BufWriter::with_capacity(1 << 16, pending.file());
    write!(out, "P6\n{} {}\n255\n", window.width(), window.height()).map_err(failed)?;
    let of = |strip: &Strip, rows: &mut Rows| {
        Depth::Eight.encode(strip, &display, rows);
        Ok(())
    };
    let each = |rows: &mut Rows| {
        hasher.samples(&rows.hashed);
        out.write_all(&rows.interleaved).map_err(failed)
    };
    (source.scratch).for_each_strip(source.request.threads, of, each)?;
    out.flush().map_err(failed)?;
    Ok(hasher.finish())
}
