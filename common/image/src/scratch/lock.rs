//! Opening a scratch file for one process alone.

use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::Path;

use crate::error::ImageError;

/// How often an opened file may turn out to have been removed by the process that held it.
const ATTEMPTS_MAX: usize = 8;

/// Opens or creates the file and locks it; the lock ends with the file's last handle, so it never
/// outlives a process. Where the file system knows no locks, none is taken.
pub(super) fn open_locked(path: &Path) -> Result<File, ImageError> {
    let failed = |source| ImageError::io("open", path, source);
    let busy = || ImageError::Busy {
        path: path.to_owned(),
    };
    for _ in 0..ATTEMPTS_MAX {
        let file = File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(busy()),
            Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {}
            Err(TryLockError::Error(source)) => {
                return Err(ImageError::io("lock", path, source));
            }
        }
        let ours = file.metadata().map_err(failed)?;
        match std::fs::metadata(path) {
            Ok(there) if (there.dev(), there.ino()) == (ours.dev(), ours.ino()) => return Ok(file),
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(source) => return Err(failed(source)),
        }
    }
    Err(busy())
}

/// Reads from the beginning of the file as much as there is.
pub(super) fn read_up_to(file: &File, buffer: &mut [u8]) -> std::io::Result<usize> {
    let mut read = 0;
    while read < buffer.len() {
        match file.read_at(&mut buffer[read..], read as u64) {
            Ok(0) => break,
            Ok(more) => read += more,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(read)
}
