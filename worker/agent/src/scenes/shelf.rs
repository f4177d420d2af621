//! Assets on disk, so that a worker that starts again need not fetch them again.
//!
//! Everything in here may fail without harm: what is not on the shelf is fetched.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use model::Digest;

/// Most bytes on a shelf; what was not used for longest goes first.
const SHELF_BYTES_MAX: u64 = 4 << 30;

/// A folder of files named by the digests of their bytes.
#[derive(Debug)]
pub(super) struct Shelf {
    folder: PathBuf,
}

impl Shelf {
    pub(super) fn new(folder: PathBuf) -> Self {
        Self { folder }
    }

    /// The bytes of a digest, if they are here and whole.
    pub(super) async fn take(&self, digest: Digest) -> Option<Vec<u8>> {
        let path = self.folder.join(digest.to_string());
        let taken = tokio::task::spawn_blocking(move || {
            let bytes = fs::read(&path).ok()?;
            if *blake3::hash(&bytes).as_bytes() == digest.0 {
                let touched =
                    fs::File::open(&path).and_then(|file| file.set_modified(SystemTime::now()));
                if let Err(error) = touched {
                    tracing::debug!(path = %path.display(), %error, "cannot note that an asset was used");
                }
                Some(bytes)
            } else {
                tracing::warn!(path = %path.display(), "an asset on disk is damaged: it is fetched again");
                None
            }
        });
        taken.await.ok().flatten()
    }

    /// Puts bytes on the shelf, and takes others off it where it is full.
    pub(super) async fn put(&self, digest: Digest, bytes: &[u8]) {
        let (folder, bytes) = (self.folder.clone(), bytes.to_vec());
        let put = tokio::task::spawn_blocking(move || put(&folder, digest, &bytes));
        if let Ok(Err(error)) = put.await {
            tracing::warn!(folder = %self.folder.display(), %error, "an asset could not be kept on disk");
        }
    }
}

fn put(folder: &Path, digest: Digest, bytes: &[u8]) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    make_room(folder, bytes.len() as u64)?;
    // Two workers may share the folder.
    let fresh = folder.join(format!(".{digest}.{}", std::process::id()));
    let written =
        fs::write(&fresh, bytes).and_then(|()| fs::rename(&fresh, folder.join(digest.to_string())));
    if written.is_err() {
        let _ = fs::remove_file(&fresh);
    }
    written
}

fn make_room(folder: &Path, wanted: u64) -> io::Result<()> {
    let mut files = Vec::new();
    let mut total = wanted;
    for file in fs::read_dir(folder)? {
        let file = file?;
        let metadata = file.metadata()?;
        total = total.saturating_add(metadata.len());
        files.push((metadata.modified()?, metadata.len(), file.path()));
    }
    files.sort();
    for (_, bytes, path) in files {
        if total <= SHELF_BYTES_MAX {
            break;
        }
        fs::remove_file(path)?;
        total -= bytes;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn only_whole_bytes_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let shelf = Shelf::new(folder.path().join("assets"));
        let digest = Digest(*blake3::hash(b"grass").as_bytes());
        assert_eq!(shelf.take(digest).await, None);
        shelf.put(digest, b"grass").await;
        assert_eq!(shelf.take(digest).await, Some(b"grass".to_vec()));
        fs::write(shelf.folder.join(digest.to_string()), b"gras").unwrap();
        assert_eq!(shelf.take(digest).await, None);
    }
}
