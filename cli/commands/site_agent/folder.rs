//! The folder of a farm at its site, as `cluster::orders` describes it.

use std::fs::{self, DirBuilder, File};
use std::io::{self, Write as _};
use std::os::unix::fs::DirBuilderExt as _;
use std::path::{Path, PathBuf};

use cluster::orders::Order;

use crate::error::Error;

/// Most bytes of an order.
const ORDER_BYTES_MAX: u64 = 64 << 20;

/// The folder.
#[derive(Debug)]
pub(super) struct Folder(PathBuf);

impl Folder {
    pub(super) fn new(root: &Path) -> Self {
        Self(root.to_owned())
    }

    /// The folder, with what must be in it.
    pub(super) fn made(root: &Path) -> Result<Self, Error> {
        let folder = Self::new(root);
        for path in [folder.arrays(), folder.scenes()] {
            let mut builder = DirBuilder::new();
            builder
                .recursive(true)
                .mode(0o700)
                .create(&path)
                .map_err(cannot("make", &path))?;
        }
        Ok(folder)
    }

    pub(super) fn root(&self) -> &Path {
        &self.0
    }

    pub(super) fn arrays(&self) -> PathBuf {
        self.0.join("arrays")
    }

    pub(super) fn scenes(&self) -> PathBuf {
        self.0.join("scenes")
    }

    /// The folder of an array. Its name is checked: it is part of a path that may be removed.
    pub(super) fn array(&self, name: &str) -> Result<PathBuf, Error> {
        Ok(self.arrays().join(checked(name)?))
    }

    /// A scene description or an asset.
    pub(super) fn scene(&self, digest: &str) -> Result<PathBuf, Error> {
        Ok(self.scenes().join(checked(digest)?))
    }

    /// The blocks of a task.
    pub(super) fn blocks(&self, array: &str, task: u32) -> Result<PathBuf, Error> {
        Ok(self.array(array)?.join(format!("{task}.blocks")))
    }

    /// What an array is to render.
    pub(super) fn order(&self, array: &str) -> Result<Order, Error> {
        let path = self.array(array)?.join("order.json");
        let bytes = fs::metadata(&path)
            .and_then(|about| match about.len() {
                0..=ORDER_BYTES_MAX => fs::read(&path),
                _ => Err(io::Error::other("it is too large")),
            })
            .map_err(cannot("read", &path))?;
        serde_json::from_slice(&bytes).map_err(|error| {
            Error::failed(format!("the order `{}` is damaged", path.display())).because(error)
        })
    }

    /// Whether the queue took an array: its number there.
    pub(super) fn id(&self, array: &str) -> Result<Option<String>, Error> {
        let path = self.array(array)?.join("id");
        match fs::read_to_string(&path) {
            Ok(id) => Ok(Some(id)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(cannot("read", &path)(error)),
        }
    }
}

/// A name that is one part of a path.
fn checked(name: &str) -> Result<&str, Error> {
    let may_be = |letter: char| letter.is_ascii_alphanumeric() || "-_.".contains(letter);
    match !name.is_empty() && !name.starts_with('.') && name.chars().all(may_be) {
        true => Ok(name),
        false => Err(Error::usage(format!(
            "`{name}` is no name of an array or a scene"
        ))),
    }
}

/// Writes a file whole or not at all, durably.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let fresh = path.with_extension(format!("new.{}", std::process::id()));
    let written = (|| {
        let mut file = File::create(&fresh)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        fs::rename(&fresh, path)?;
        sync_parent(path)
    })();
    if written.is_err() {
        // What is wrong with the file itself matters more.
        let _ = fs::remove_file(&fresh);
    }
    written.map_err(cannot("write", path))
}

/// Makes names in a path's folder durable.
pub(super) fn sync_parent(path: &Path) -> io::Result<()> {
    File::open(path.parent().unwrap_or(path))?.sync_all()
}

/// What could not be done with a path.
pub(super) fn cannot(attempt: &str, path: &Path) -> impl Fn(io::Error) -> Error + use<> {
    let attempt = format!("cannot {attempt} `{}`", path.display());
    move |error| Error::failed(attempt.clone()).because(error)
}
