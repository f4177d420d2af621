//! Scene descriptions and assets at a site: each is brought once, and removed when nothing there needs it.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io;
use std::path::PathBuf;

use cluster::ClusterError;
use cluster::orders::scene_file;
use model::{Digest, Span};
use scene::Description;
use tokio::sync::oneshot;

use super::Trouble;
use super::line::Cut;
use crate::input::{Input, Query, Wanted};
use crate::sites::errand::Errand;

/// How long a file may take to arrive.
const LIMIT: Span = Span::from_secs(1_800);

/// What is known of the files there.
#[derive(Default)]
pub(super) struct Scenes {
    /// The files that are there.
    there: BTreeSet<String>,
    /// The assets of scenes that were brought.
    assets: BTreeMap<Digest, Vec<Digest>>,
}

impl Scenes {
    /// The files that are there now.
    pub(super) fn are(&mut self, files: &[String]) {
        self.there.extend(files.iter().cloned());
    }

    /// Whether nothing is there.
    pub(super) fn is_empty(&self) -> bool {
        self.there.is_empty()
    }

    /// The files that no scene of these needs.
    pub(super) fn unneeded(&mut self, scenes: &BTreeSet<Digest>) -> BTreeSet<String> {
        self.assets.retain(|scene, _| scenes.contains(scene));
        let assets = self.assets.values().flatten();
        let needed: BTreeSet<String> = scenes.iter().chain(assets).map(Digest::to_string).collect();
        // The assets of a scene that an earlier coordinator brought are not known.
        let are_known = scenes.iter().all(|scene| self.assets.contains_key(scene));
        match are_known {
            true => self.there.difference(&needed).cloned().collect(),
            false => BTreeSet::new(),
        }
    }

    /// These were removed.
    pub(super) fn are_gone(&mut self, files: &BTreeSet<String>) {
        self.there.retain(|file| !files.contains(file));
    }

    /// Brings a scene and its assets, as far as they are not there.
    pub(super) fn bring(&mut self, errand: &Errand, digest: &str) -> Result<(), Trouble> {
        let Ok(scene) = digest.parse::<Digest>() else {
            return Ok(());
        };
        let assets = match self.assets.entry(scene) {
            Entry::Occupied(known) => known.get().clone(),
            Entry::Vacant(place) => place.insert(assets_of(errand, scene)?).clone(),
        };
        for asset in assets {
            self.put(errand, asset, Wanted::Asset)?;
        }
        self.put(errand, scene, Wanted::Scene)
    }

    fn put(&mut self, errand: &Errand, digest: Digest, wanted: Wanted) -> Result<(), Trouble> {
        if self.there.contains(&digest.to_string()) {
            return Ok(());
        }
        let path = path(errand, digest, wanted)?;
        let failed = cannot("read", &path);
        let file = File::open(&path).map_err(&failed)?;
        let bytes = file.metadata().map_err(&failed)?.len();
        let camp = &errand.camp;
        let there = scene_file(camp, digest);
        camp.way.put(file, bytes, &there, 0o600, LIMIT)?;
        self.there.insert(digest.to_string());
        Ok(())
    }
}

/// The assets of a scene.
fn assets_of(errand: &Errand, scene: Digest) -> Result<Vec<Digest>, Trouble> {
    let path = path(errand, scene, Wanted::Scene)?;
    let failed = cannot("read the scene", &path);
    let bytes = fs::read(&path).map_err(&failed)?;
    let description = Description::from_bytes(&bytes)
        .map_err(|error| failed(io::Error::other(error.to_string())))?;
    let assets = description.assets.iter().map(|asset| asset.digest);
    Ok(assets.collect())
}

/// Where the bytes of a digest are here.
fn path(errand: &Errand, digest: Digest, wanted: Wanted) -> Result<PathBuf, Trouble> {
    let (reply, answer) = oneshot::channel();
    let asked = Input::Ask(Query::Bytes(digest, wanted, reply));
    let asked = errand.inputs.blocking_send(asked);
    asked.map_err(|_| Cut::Stopping)?;
    let found = answer.blocking_recv().map_err(|_| Cut::Stopping)?;
    let found = found.unwrap_or_default();
    found
        .into_iter()
        .find(|path| path.is_file())
        .ok_or_else(|| {
            let gone = io::Error::other("its job is gone");
            Trouble::Site(cannot("find the file", &PathBuf::from(digest.to_string()))(
                gone,
            ))
        })
}

fn cannot(
    attempted: &'static str,
    path: &std::path::Path,
) -> impl Fn(io::Error) -> ClusterError + use<> {
    let path = path.display().to_string();
    move |source| ClusterError::File {
        attempted,
        path: path.clone(),
        source,
    }
}
