//! The files that a scene names, by content: the renderer opens none itself.

use std::collections::BTreeMap;
use std::sync::Arc;

use model::Digest;

/// The bytes of a scene's assets, found by their digests; cheap to clone.
///
/// Whoever fetched the bytes has compared them with the digest.
#[derive(Clone, Default, Debug)]
pub struct Assets(BTreeMap<Digest, Arc<[u8]>>);

impl Assets {
    /// No assets.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds an asset.
    pub fn insert(&mut self, digest: Digest, bytes: Arc<[u8]>) {
        self.0.insert(digest, bytes);
    }

    /// The bytes of that digest, if they are here.
    pub fn bytes(&self, digest: Digest) -> Option<&Arc<[u8]>> {
        self.0.get(&digest)
    }
}

impl FromIterator<(Digest, Arc<[u8]>)> for Assets {
    fn from_iter<I: IntoIterator<Item = (Digest, Arc<[u8]>)>>(assets: I) -> Self {
        Self(assets.into_iter().collect())
    }
}
