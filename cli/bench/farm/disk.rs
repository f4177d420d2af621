//! What a disk syncs, by itself.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::Path;
use std::time::{Duration, Instant};

use crate::error::Error;

/// Bytes of a small write.
const SMALL: usize = 4 << 10;

/// Bytes of a large write: as many whole blocks as the coordinator syncs at a time.
const LARGE: usize = 256 * model::film::BLOCK_BYTES_MAX;

/// How long each is written, at most.
const TIME: Duration = Duration::from_secs(2);

/// Most large writes.
const LARGE_MAX: u32 = 64;

/// What it syncs.
pub(crate) struct Disk {
    /// How often it syncs 4 KiB in a second.
    pub(crate) syncs_per_second: f64,
    /// Megabytes (10⁶) in a second where 8 MiB are synced at a time.
    pub(crate) megabytes_per_second: f64,
}

impl Disk {
    /// Measures the disk of a folder.
    pub(crate) fn of(folder: &Path) -> Result<Self, Error> {
        let path = folder.join("sync");
        let measured = (|| {
            let syncs_per_second = rate(&path, SMALL, u32::MAX)?;
            let per_second = rate(&path, LARGE, LARGE_MAX)?;
            std::fs::remove_file(&path)?;
            Ok(Self {
                syncs_per_second,
                megabytes_per_second: per_second * LARGE as f64 / 1e6,
            })
        })();
        measured.map_err(|error: io::Error| {
            Error::failed(format!("cannot write to `{}`", path.display()))
                .because(error)
                .next("choose a folder with a gigabyte of room with `--folder`")
        })
    }
}

/// How many times a second so many bytes are appended to a new file and synced.
fn rate(path: &Path, bytes: usize, most: u32) -> io::Result<f64> {
    let mut file = File::create(path)?;
    // A disk that compresses is not to gain by it.
    let noise: Vec<u8> = (0_u32..)
        .take(bytes)
        .map(|i| i.wrapping_mul(0x9e37_79b9).to_be_bytes()[0])
        .collect();
    let begun = Instant::now();
    let mut count = 0;
    while count < most && (count == 0 || begun.elapsed() < TIME) {
        file.write_all(&noise)?;
        file.sync_data()?;
        count += 1;
    }
    Ok(f64::from(count) / begun.elapsed().as_secs_f64())
}
