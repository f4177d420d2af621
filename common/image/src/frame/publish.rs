//! Putting a file in place whole or not at all.

use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::error::ImageError;

/// A file being written under a hidden name in the folder where it will stand. Dropped before it
/// is [put in place](Pending::publish), it is removed.
#[derive(Debug)]
pub(crate) struct Pending {
    file: File,
    partial: PathBuf,
    target: PathBuf,
}

impl Pending {
    /// Begins `folder/name` as `folder/.name.partial`.
    pub(crate) fn create(folder: &Path, name: &str) -> Result<Self, ImageError> {
        let partial = folder.join(format!(".{name}.partial"));
        // Some formats are finished by a look at what was written.
        let mut options = File::options();
        let options = options.read(true).write(true).create(true).truncate(true);
        let file = options
            .open(&partial)
            .map_err(|source| ImageError::io("create", &partial, source))?;
        Ok(Self {
            file,
            partial,
            target: folder.join(name),
        })
    }

    /// Where to write.
    pub(crate) fn file(&self) -> &File {
        &self.file
    }

    /// Where it will stand; the path that errors name.
    pub(crate) fn target(&self) -> &Path {
        &self.target
    }

    /// Makes its bytes durable and says how many they are.
    pub(crate) fn sync(&self) -> Result<u64, ImageError> {
        let synced = self.file.sync_all().and_then(|()| self.file.metadata());
        match synced {
            Ok(metadata) => Ok(metadata.len()),
            Err(source) => Err(ImageError::io("sync", &self.target, source)),
        }
    }

    /// Gives it its name, in place of what had it. The name is durable once its folder is
    /// synced.
    pub(crate) fn publish(self) -> Result<(), ImageError> {
        std::fs::rename(&self.partial, &self.target)
            .map_err(|source| ImageError::io("put in place", &self.target, source))
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        // After `publish` nothing has this name; before, an error is already on its way.
        let _ = std::fs::remove_file(&self.partial);
    }
}

/// Makes the names in the folder of `path` durable, where the file system can.
pub(crate) fn sync_folder_of(path: &Path) -> Result<(), ImageError> {
    let folder = match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        Err(error)
            if !matches!(
                error.kind(),
                ErrorKind::InvalidInput | ErrorKind::Unsupported
            ) =>
        {
            Err(ImageError::io("sync the folder", folder, error))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<_> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_there_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let pending = Pending::create(folder.path(), "a.ppm").unwrap();
        pending.file().write_all(b"half").unwrap();
        assert_eq!(names(folder.path()), [".a.ppm.partial"]);
        drop(pending);
        assert_eq!(names(folder.path()), [""; 0]);

        let pending = Pending::create(folder.path(), "a.ppm").unwrap();
        pending.file().write_all(b"whole").unwrap();
        assert_eq!(pending.sync().unwrap(), 5);
        pending.publish().unwrap();
        assert_eq!(names(folder.path()), ["a.ppm"]);
    }
}
