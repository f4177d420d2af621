//! The thread that makes frames of complete images.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;

use image::{FrameMetadata, FrameRequest, ImageError, Scratch};
use model::ImageRef;

use super::disk::Disk;
use super::{Encoded, Era, Plan, chain};
use crate::input::News;
use crate::job::Counters;

/// An image on its way to the encoder.
pub(super) struct Encoding {
    pub(super) plan: Arc<Plan>,
    pub(super) image: ImageRef,
    pub(super) counters: Counters,
    pub(super) era: Era,
    pub(super) scratch: Arc<Scratch>,
}

/// Encodes what comes until nothing more does; where the coordinator stops, images are left for the next start.
pub(super) fn encode_all(work: &Receiver<Encoding>, disk: &Disk) {
    while let Ok(encoding) = work.recv() {
        if !disk.is_stopping()
            && let Some(encoded) = encoding.perform(disk)
        {
            disk.say(News::Encoded(encoded));
        }
    }
}

impl Encoding {
    /// Encodes the image. Its scratch file stays until the store knows.
    fn perform(self, disk: &Disk) -> Option<Encoded> {
        let Self {
            plan,
            image,
            counters,
            era,
            scratch,
        } = self;
        let is_wanted = || !plan.cancelled.load(Ordering::Relaxed);
        let request = FrameRequest {
            folder: plan.folders.frames.clone(),
            stem: plan.stem.clone(),
            number: image.image,
            formats: plan.formats,
            metadata: FrameMetadata {
                statistics: serde_json::to_string(&counters).expect("names and numbers are JSON"),
                ..plan.metadata.clone()
            },
            view: plan.view,
            threads: 1,
        };
        let finish = || match image::finish(&scratch, &request) {
            Ok(frame) => Ok(Ok(frame)),
            Err(error @ (ImageError::Io { .. } | ImageError::DiskFull { .. })) => {
                Err(chain(&error))
            }
            Err(error) => Ok(Err(chain(&error))),
        };
        let cancelled = || Err("its job was cancelled".to_owned());
        let result = match is_wanted() {
            false => cancelled(),
            true => match disk.insist(is_wanted, finish) {
                Some(result) => result,
                None if is_wanted() => return None,
                None => cancelled(),
            },
        };
        Some(Encoded { image, era, result })
    }
}
