//! What the store keeps for the coordinator beside what it understands itself, as JSON.

use std::collections::BTreeMap;

use image::{FinishedFile, Format, Formats};
use model::{Digest, Resolution};
use serde::{Deserialize, Serialize};
use wire::proto;

use crate::job::Counters;

/// Of a job: how its images are stored, and which files its workers need.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct JobAbout {
    /// What file names begin with.
    pub(crate) stem: String,
    /// By the names that users give them.
    pub(crate) formats: Vec<String>,
    /// The settings that its user gave, as JSON.
    pub(crate) settings: String,
    /// Columns and rows.
    pub(crate) resolution: (u32, u32),
    pub(crate) frames_per_second: f64,
    pub(crate) exposure_stops: f64,
    /// The program that took it.
    pub(crate) software: String,
    /// Digests of its assets, in hexadecimal.
    pub(crate) assets: Vec<String>,
}

/// Of an image that is in its place.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct ImageAbout {
    pub(crate) files: Vec<FileAbout>,
    pub(crate) counters: Counters,
}

/// Of a finished file.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct FileAbout {
    pub(crate) format: String,
    pub(crate) name: String,
    pub(crate) bytes: u64,
    pub(crate) digest: String,
}

impl JobAbout {
    pub(crate) fn formats(&self) -> Option<Formats> {
        let formats: Option<Vec<_>> = self.formats.iter().map(|name| format(name)).collect();
        Some(Formats::new(formats?))
    }

    pub(crate) fn assets(&self) -> Option<Vec<Digest>> {
        let assets = self.assets.iter().map(|digest| digest.parse().ok());
        assets.collect()
    }

    pub(crate) fn resolution(&self) -> Resolution {
        let (width, height) = self.resolution;
        Resolution { width, height }
    }
}

impl FileAbout {
    pub(crate) fn of(file: &FinishedFile) -> Self {
        let name = file.path.file_name().unwrap_or_default();
        Self {
            format: file.format.to_string(),
            name: name.to_string_lossy().into_owned(),
            bytes: file.bytes,
            digest: file.digest.to_string(),
        }
    }

    pub(crate) fn message(&self) -> Option<proto::FrameFile> {
        let digest: Digest = self.digest.parse().ok()?;
        Some(proto::FrameFile {
            format: crate::grpc::format_message(format(&self.format)?).into(),
            name: self.name.clone(),
            bytes: self.bytes,
            digest: digest.0.to_vec(),
        })
    }
}

fn format(name: &str) -> Option<Format> {
    Format::ALL.into_iter().find(|format| format.name() == name)
}

/// What was counted while a block was rendered, in few bytes.
pub(crate) fn counters_bytes(counters: &[(String, u64)]) -> Vec<u8> {
    match counters.is_empty() {
        true => Vec::new(),
        false => {
            let sums: BTreeMap<&str, u64> = counters
                .iter()
                .map(|(name, value)| (name.as_str(), *value))
                .collect();
            serde_json::to_vec(&sums).expect("names and numbers are JSON")
        }
    }
}

/// The same, read back; nothing where that is not possible: they are statistics.
pub(crate) fn counters_of(bytes: &[u8]) -> Counters {
    serde_json::from_slice(bytes).unwrap_or_default()
}
