//! How the images of a job are stored.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use image::{Formats, FrameMetadata, ScratchIdentity, ViewTransform};
use model::{ImageNumber, ImageRef, Rect};

use crate::about::JobAbout;
use crate::state::JobFolders;

/// How the images of one job are stored.
#[derive(Debug)]
pub(crate) struct Plan {
    pub(crate) folders: JobFolders,
    /// What file names begin with.
    pub(crate) stem: String,
    pub(crate) formats: Formats,
    /// The image's number in here is replaced by each image's own.
    pub(crate) identity: ScratchIdentity,
    pub(crate) window: Rect,
    /// The statistics in here are replaced by each image's own.
    pub(crate) metadata: FrameMetadata,
    pub(crate) view: ViewTransform,
    /// Set when nobody wants the job's images any more.
    pub(crate) cancelled: AtomicBool,
}

impl Plan {
    pub(crate) fn new(
        folders: JobFolders,
        submission: &sched::Submission,
        about: &JobAbout,
        formats: Formats,
    ) -> Self {
        Self {
            folders,
            stem: about.stem.clone(),
            formats,
            identity: ScratchIdentity {
                scene: submission.scene,
                revision: submission.revision.0,
                image: ImageNumber(0),
                resolution: about.resolution(),
            },
            window: submission.window,
            metadata: FrameMetadata {
                scene_digest: submission.scene,
                revision: submission.revision.0,
                settings: about.settings.clone(),
                statistics: String::new(),
                software: about.software.clone(),
                frames_per_second: about.frames_per_second,
                comments: String::new(),
            },
            view: ViewTransform {
                exposure_stops: about.exposure_stops,
            },
            cancelled: AtomicBool::new(false),
        }
    }

    /// Where an image's scratch file stands.
    pub(crate) fn scratch_path(&self, image: ImageRef) -> PathBuf {
        self.folders.scratch.join(image.image.to_string())
    }

    pub(crate) fn identity_of(&self, image: ImageRef) -> ScratchIdentity {
        ScratchIdentity {
            image: image.image,
            ..self.identity
        }
    }
}
