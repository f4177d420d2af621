//! What was rendered already, and what it took: `gallery.json` beside the pictures.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::index::Figure;
use crate::error::Error;
use crate::load::Scene;
use crate::progress::amount;

const FILE: &str = "gallery.json";

/// What one picture is of, and what it took.
#[derive(Clone, Serialize, Deserialize, PartialEq, Debug)]
pub(crate) struct Record {
    /// The figure's name.
    pub(crate) name: String,
    /// Its number in the thesis.
    pub(crate) number: String,
    /// The picture's file name.
    pub(crate) picture: PathBuf,
    /// Digest of the scene with all its settings.
    pub(crate) scene_digest: String,
    /// Which of its frames.
    pub(crate) frame: u32,
    /// The renderer's revision.
    pub(crate) revision: u32,
    /// How long it took, in seconds.
    pub(crate) seconds: f64,
    /// On how many threads.
    pub(crate) threads: usize,
    /// Rays from the camera and to the sun.
    pub(crate) rays: u64,
    /// Evaluations of the surface's field.
    pub(crate) evaluations: u64,
}

impl Record {
    /// Rays a second, for people.
    pub(crate) fn rate(&self) -> String {
        amount(self.rays as f64 / self.seconds.max(1e-9))
            .trim_end()
            .to_owned()
    }

    /// Evaluations for each ray.
    pub(crate) fn evaluations_per_ray(&self) -> f64 {
        self.evaluations as f64 / self.rays.max(1) as f64
    }
}

/// The records of a folder.
#[derive(Default)]
pub(crate) struct Records(Vec<Record>);

impl Records {
    /// Those of a folder; none where they cannot be read, since all can be rendered again.
    pub(crate) fn read(folder: &Path) -> Self {
        let text = fs::read_to_string(folder.join(FILE)).unwrap_or_default();
        Self(serde_json::from_str(&text).unwrap_or_default())
    }

    /// The record of a figure whose picture is there and is of this scene and this renderer.
    pub(crate) fn of(&self, folder: &Path, figure: &Figure, scene: &Scene) -> Option<Record> {
        let digest = scene.digest.to_string();
        let record = self.0.iter().find(|record| {
            record.name == figure.name
                && record.scene_digest == digest
                && record.frame == figure.frame
                && record.revision == render::REVISION
                // The file may come from anywhere: only a plain name beside it is a picture.
                && record.picture.file_name() == Some(record.picture.as_os_str())
        })?;
        folder.join(&record.picture).is_file().then(|| Record {
            number: figure.number.clone(),
            ..record.clone()
        })
    }

    /// Adds a record in the place of the figure's last, and writes them all.
    pub(crate) fn keep(&mut self, folder: &Path, record: Record) -> Result<(), Error> {
        self.0.retain(|other| other.name != record.name);
        self.0.push(record);
        let path = folder.join(FILE);
        let write = || {
            let mut pending = tempfile::NamedTempFile::new_in(folder)?;
            serde_json::to_writer_pretty(&mut pending, &self.0)?;
            pending.flush()?;
            pending.persist(&path)?;
            Ok::<_, std::io::Error>(())
        };
        write().map_err(|error| {
            Error::failed(format!("cannot write `{}`", path.display())).because(error)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_survive_and_replace_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let record = |seconds| Record {
            name: "a".into(),
            number: "3.14a".into(),
            picture: "a_0000.png".into(),
            scene_digest: "0".into(),
            frame: 0,
            revision: 1,
            seconds,
            threads: 1,
            rays: 3_000_000,
            evaluations: 60_000_000,
        };
        let mut records = Records::read(folder.path());
        records.keep(folder.path(), record(1.0)).unwrap();
        records.keep(folder.path(), record(2.0)).unwrap();
        let read = Records::read(folder.path());
        assert_eq!(read.0, [record(2.0)]);
        assert_eq!(read.0[0].rate(), "1.50 M");
        assert_eq!(read.0[0].evaluations_per_ray(), 20.0);
    }
}
