//! The files that a scene is made of: ordinary, of limited size, below the scene's folder.

use std::cell::RefCell;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use model::Digest;

use super::FILE_BYTES_MAX;
use crate::description::AssetRef;
use crate::rules::{ASSET_BYTES_MAX, ASSETS_MAX};

/// The files that a scene names, in the order of their first mention: whoever reads the scene shares one list.
pub(crate) struct Files {
    folder: PathBuf,
    read: RefCell<Vec<(AssetRef, Arc<[u8]>)>>,
}

impl Files {
    /// None so far; all will lie below `folder`.
    pub(crate) fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            read: RefCell::default(),
        }
    }

    /// The number of a file and its bytes, or a sentence that says why there are none.
    pub(crate) fn get(&self, name: &str) -> Result<(u32, Arc<[u8]>), String> {
        let mut read = self.read.borrow_mut();
        let index = match read.iter().position(|(asset, _)| asset.name == name) {
            Some(index) => index,
            None => {
                if read.len() >= ASSETS_MAX {
                    return Err(format!("a scene names at most {ASSETS_MAX} files"));
                }
                read.push(read_asset(&self.folder, name)?);
                read.len() - 1
            }
        };
        let number = u32::try_from(index).expect("ASSETS_MAX fits");
        Ok((number, read[index].1.clone()))
    }

    /// All of them.
    pub(crate) fn take(&self) -> Vec<(AssetRef, Arc<[u8]>)> {
        self.read.take()
    }
}

/// The text of a scene file, or a sentence that says why there is none.
pub(super) fn read_text(path: &Path) -> Result<String, String> {
    let bytes = read(path, FILE_BYTES_MAX)?;
    String::from_utf8(bytes).map_err(|cause| {
        let line = cause.as_bytes()[..cause.utf8_error().valid_up_to()]
            .iter()
            .filter(|byte| **byte == b'\n')
            .count()
            + 1;
        format!("the file is no text: line {line} is not UTF-8")
    })
}

/// A file that a scene names, by content, or a sentence that says why not.
fn read_asset(folder: &Path, name: &str) -> Result<(AssetRef, Arc<[u8]>), String> {
    let relative = Path::new(name);
    let inside = relative
        .components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    let real = |path: &Path| {
        path.canonicalize()
            .map_err(|cause| format!("cannot open `{name}`: {cause}"))
    };
    if !inside || name.is_empty() {
        return Err(format!(
            "`{name}` does not lie below the scene file's folder"
        ));
    }
    let path = real(&folder.join(relative))?;
    // A symbolic link may lead elsewhere.
    if !path.starts_with(real(folder)?) {
        return Err(format!("`{name}` leads out of the scene file's folder"));
    }
    let bytes = read(&path, ASSET_BYTES_MAX)?;
    let asset = AssetRef {
        name: name.to_owned(),
        digest: Digest(*blake3::hash(&bytes).as_bytes()),
        bytes: bytes.len() as u64,
    };
    Ok((asset, bytes.into()))
}

fn read(path: &Path, bytes_max: u64) -> Result<Vec<u8>, String> {
    let refuse = |cause: std::io::Error| format!("cannot read the file: {cause}");
    // Asked before opening: opening a pipe could wait for ever.
    if !path.metadata().map_err(refuse)?.is_file() {
        return Err("this is not an ordinary file".into());
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(bytes_max + 1).read_to_end(&mut bytes))
        .map_err(refuse)?;
    if bytes.len() as u64 > bytes_max {
        return Err(format!("the file is larger than {} MiB", bytes_max >> 20));
    }
    Ok(bytes)
}
