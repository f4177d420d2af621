//! A job's scene description and assets, as workers fetch them.

use std::path::PathBuf;

use model::Digest;

/// A folder with the scene's bytes, and each asset's under its digest.
#[derive(Clone, Debug)]
pub(crate) struct SceneFiles {
    pub(crate) root: PathBuf,
    pub(crate) description: Digest,
    pub(crate) assets: Vec<Digest>,
}

impl SceneFiles {
    /// Where a scene description's bytes are, if they are these.
    pub(crate) fn scene(&self, digest: Digest) -> Option<PathBuf> {
        (digest == self.description).then(|| self.scene_path())
    }

    /// Where an asset's bytes are, if it is one of these.
    pub(crate) fn asset(&self, digest: Digest) -> Option<PathBuf> {
        let known = self.assets.contains(&digest);
        known.then(|| self.asset_path(digest))
    }

    pub(crate) fn scene_path(&self) -> PathBuf {
        self.root.join("scene")
    }

    pub(crate) fn asset_path(&self, digest: Digest) -> PathBuf {
        self.root.join(digest.to_string())
    }
}
