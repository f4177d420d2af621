//! Scene files: TOML in, a [`Description`] or every mistake out.
//!
//! The file is read into a tree whose every part knows where it was written
//! ([`tree`]); overrides are laid over it ([`overrides`]); [`sections`] reads it
//! by the one table of keys ([`keys`]) from which the schema is made too. A
//! mistake never ends the reading: all are collected. What the numbers may be is
//! decided by [`crate::rules`], what the surface must be by [`crate::ground`] and
//! [`crate::bound`], whoever wrote it.

mod assets;
mod keys;
mod mistake;
mod overrides;
mod quantity;
mod section;
mod sections;
mod tree;

use std::path::Path;
use std::sync::Arc;

pub(crate) use assets::Files;
pub(crate) use keys::{Key, Presence, SCENE, Shape};
pub use mistake::{Mistake, Place, SceneError, Source};
pub use overrides::Overrides;
pub(crate) use quantity::{Dimension, nearest};

use crate::description::{AssetRef, Description};
use section::Reader;

/// Most bytes of a scene file.
pub const FILE_BYTES_MAX: u64 = 1 << 20;

/// A scene as loaded: valid, its graph in canonical order.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub description: Description,
    /// The files that it names, in the order of `description.assets`.
    pub assets: Vec<(AssetRef, Arc<[u8]>)>,
    /// What is allowed but hardly meant.
    pub warnings: Vec<Mistake>,
    /// The file and the overrides, for showing warnings.
    pub sources: Vec<Source>,
}

/// Reads and checks a scene file.
///
/// Reads the file and those that it names, all below the file's folder.
/// Costs milliseconds, a few tens where a camera flies low over the ground.
///
/// # Errors
///
/// Every mistake that was found, each with its place in the file or in an override.
pub fn load(path: &Path, overrides: &Overrides) -> Result<Loaded, SceneError> {
    let name = path.display().to_string();
    let text =
        assets::read_text(path).map_err(|message| SceneError::unplaced(name.clone(), message))?;
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let stem = path
        .file_stem()
        .and_then(|stem| stem.to_str())
        .unwrap_or("scene");
    parse(Source { name, text }, stem, folder, overrides)
}

/// Reads and checks the text of a scene file.
///
/// `stem` is the scene's name if the text gives none, `folder` is where the files that it names are.
///
/// # Errors
///
/// As [`load`].
pub fn parse(
    source: Source,
    stem: &str,
    folder: &Path,
    overrides: &Overrides,
) -> Result<Loaded, SceneError> {
    let mut sources = vec![source];
    let mut mistakes = Vec::new();
    let mut root = tree::parse(&sources[0].text, 0, &mut mistakes);
    overrides.lay_over(&mut root, &mut sources, &mut mistakes);
    if !mistakes.is_empty() {
        return Err(SceneError::new(sources, mistakes));
    }
    let reader = Reader::new(&sources);
    let result = sections::scene(&reader, &root, stem, folder);
    let warnings = reader.warnings();
    match result {
        Ok((description, assets)) => Ok(Loaded {
            description,
            assets,
            warnings,
            sources,
        }),
        Err(mistakes) => Err(SceneError::new(sources, mistakes)),
    }
}

#[cfg(test)]
mod tests;
