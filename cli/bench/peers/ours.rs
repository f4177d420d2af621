//! Renders a scene in memory on the calling thread.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use model::ImageNumber;
use render::{Counts, EvalSettings, ImageRenderer};

use super::rows::Ours;
use crate::error::Error;
use crate::load::Scene;
use crate::options::SceneOptions;

impl Ours {
    /// Writes the scene's file, as it is, into a folder.
    pub(crate) fn write(&self, folder: &Path) -> Result<PathBuf, Error> {
        let file = folder.join("ours.toml");
        fs::write(&file, self.text).map_err(|error| {
            Error::failed(format!("cannot write `{}`", file.display())).because(error)
        })?;
        Ok(file)
    }

    /// Reads the scene, with `more` changed in it.
    pub(crate) fn load(&self, folder: &Path, more: &[String]) -> Result<Scene, Error> {
        let file = self.write(folder)?;
        let set = self.set.iter().map(|&set| set.to_owned());
        SceneOptions {
            scene: file,
            resolution: None,
            rays: None,
            crop: None,
            set: set.chain(more.iter().cloned()).collect(),
        }
        .load()
    }
}

/// Renders image 0 block by block, its preparation included; gives what was counted.
pub(crate) fn render(scene: &Scene) -> Result<Counts, Error> {
    let failed = |error: &dyn std::error::Error| {
        Error::failed("cannot render the scene").because(error.to_string())
    };
    let assets = scene.assets();
    let image = ImageRenderer::new(
        scene.description(),
        &assets,
        ImageNumber(0),
        EvalSettings::default(),
    )
    .map_err(|error| failed(&error))?;
    let never = AtomicBool::new(false);
    let mut pixels = Vec::new();
    let mut counts = Counts::default();
    for block in scene.description().film.window.blocks() {
        counts += image
            .render_block(block, &never, &mut pixels)
            .map_err(|error| failed(&error))?;
    }
    Ok(counts)
}
