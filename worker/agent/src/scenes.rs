//! Scenes and their assets: fetched once, compared with their digests, and kept.
//!
//! In memory the latest few scenes stay; on disk, where the worker has a state folder, the
//! assets stay for its next start.

mod fetch;
mod shelf;

use std::path::Path;
use std::sync::Arc;

use model::Digest;
use scene::Description;
use tokio::sync::Mutex;
use wire::Failure;
use wire::link::{ASSET_BYTES_MAX, Workers};
use wire::proto::ErrorKind;

use self::fetch::{What, fetch};
use self::shelf::Shelf;
use crate::painter::Assets;

/// Most scenes that are kept in memory beside those in use.
const SCENES_MAX: usize = 8;

/// Most bytes of one scene's assets together.
const SCENE_ASSET_BYTES_MAX: u64 = 1 << 30;

/// A scene, ready to be opened.
#[derive(Debug)]
pub(crate) struct Scene {
    pub(crate) digest: Digest,
    pub(crate) description: Description,
    pub(crate) assets: Assets,
}

/// The scenes of a worker.
#[derive(Debug)]
pub(crate) struct Scenes {
    /// The most recently used last. Held while one is fetched, so that each is fetched once.
    kept: Mutex<Vec<Arc<Scene>>>,
    shelf: Option<Shelf>,
}

impl Scenes {
    /// Keeps assets below a state folder, if there is one.
    pub(crate) fn new(state: Option<&Path>) -> Self {
        Self {
            kept: Mutex::default(),
            shelf: state.map(|state| Shelf::new(state.join("assets"))),
        }
    }

    /// A scene, from here or over the link.
    pub(crate) async fn scene(
        &self,
        digest: Digest,
        link: &mut Workers,
    ) -> Result<Arc<Scene>, Failure> {
        let mut kept = self.kept.lock().await;
        let scene = match kept.iter().position(|scene| scene.digest == digest) {
            Some(place) => kept.remove(place),
            None => Arc::new(self.fetch(digest, &kept, link).await?),
        };
        kept.push(scene.clone());
        let excess = kept.len().saturating_sub(SCENES_MAX);
        kept.drain(..excess);
        Ok(scene)
    }

    /// A scene, if it is here and none is being fetched.
    pub(crate) fn at_hand(&self, digest: Digest) -> Option<Arc<Scene>> {
        let mut kept = self.kept.try_lock().ok()?;
        let place = kept.iter().position(|scene| scene.digest == digest)?;
        let scene = kept.remove(place);
        kept.push(scene.clone());
        Some(scene)
    }

    async fn fetch(
        &self,
        digest: Digest,
        kept: &[Arc<Scene>],
        link: &mut Workers,
    ) -> Result<Scene, Failure> {
        let bytes = fetch(What::Scene, digest, scene::BYTES_MAX as u64, link).await?;
        let found = scene::digest_of(&bytes);
        if found != digest {
            return Err(damaged("scene", digest));
        }
        let description = Description::from_bytes(&bytes)
            .map_err(|error| Failure::new(ErrorKind::BadScene, error.to_string()))?;
        tracing::info!(scene = %digest, name = description.name, "fetched a scene");
        let mut assets = Assets::new();
        let mut room = SCENE_ASSET_BYTES_MAX;
        for asset in &description.assets {
            room = room
                .checked_sub(asset.bytes)
                .filter(|_| asset.bytes <= ASSET_BYTES_MAX)
                .ok_or_else(|| {
                    Failure::new(
                        ErrorKind::Limit,
                        format!("the asset `{}` is too large for this worker", asset.name),
                    )
                })?;
            let known = kept
                .iter()
                .find_map(|scene| scene.assets.get(&asset.digest));
            let bytes = match known {
                Some(bytes) => bytes.clone(),
                None => self.asset(asset.digest, asset.bytes, link).await?,
            };
            assets.insert(asset.digest, bytes);
        }
        Ok(Scene {
            digest,
            description,
            assets,
        })
    }

    async fn asset(
        &self,
        digest: Digest,
        bytes_max: u64,
        link: &mut Workers,
    ) -> Result<Arc<[u8]>, Failure> {
        if let Some(shelf) = &self.shelf
            && let Some(bytes) = shelf.take(digest).await
        {
            return Ok(bytes.into());
        }
        let bytes = fetch(What::Asset, digest, bytes_max, link).await?;
        if *blake3::hash(&bytes).as_bytes() != digest.0 {
            return Err(damaged("asset", digest));
        }
        if let Some(shelf) = &self.shelf {
            shelf.put(digest, &bytes).await;
        }
        Ok(bytes.into())
    }
}

fn damaged(what: &str, digest: Digest) -> Failure {
    Failure::later(
        ErrorKind::DigestMismatch,
        format!("the bytes that the coordinator sent are not those of the {what} {digest}"),
    )
}
