//! Binary PPM of 8 bits: the thesis's own format (§C.3.6). It holds no metadata.

use std::io::{BufWriter, Write};

use model::Digest;

use super::Source;
use super::png;
use super::publish::Pending;
use crate::error::ImageError;

/// Writes the frame and returns the digest of what it stores.
pub(super) fn write(
    begun: png::Begun,
    source: &Source<'_>,
    pending: &Pending,
) -> Result<Digest, ImageError> {
    let failed = |error| ImageError::io("write", pending.target(), error);
    let window = source.scratch.window();
    let mut out = BufWriter::with_capacity(1 << 16, pending.file());
    write!(out, "P6\n{} {}\n255\n", window.width(), window.height()).map_err(failed)?;
    let digest = begun.write_rows(source, |samples| out.write_all(samples).map_err(failed))?;
    out.flush().map_err(failed)?;
    Ok(digest)
}
