//! Room on the disk: what a job may need, and what there is.

use std::path::Path;

use image::{Format, Formats};
use model::Epoch;
use model::film::PIXEL_BYTES;

/// Room on a disk, in bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Space {
    /// What this user may still write.
    pub(crate) free: u64,
    /// All of it.
    pub(crate) all: u64,
}

impl Space {
    /// The room on the disk that holds a folder; `None` where the system does not say.
    pub(crate) fn at(folder: &Path) -> Option<Self> {
        let said = rustix::fs::statvfs(folder).ok()?;
        Some(Self {
            free: said.f_bavail.saturating_mul(said.f_frsize),
            all: said.f_blocks.saturating_mul(said.f_frsize),
        })
    }
}

/// Bytes that a job may need at its end and on the way: its frames, as if nothing of them could be
/// compressed, and the scratch files of the images that are in flight at a time.
pub(crate) fn needed(submission: &sched::Submission, formats: Formats) -> u64 {
    let pixels = submission.window.area();
    let images = u64::from(submission.frames.count());
    let in_flight = sched::Config::new(Epoch(0)).images_in_flight(pixels);
    let frame: u64 = formats.iter().map(pixel_bytes).sum();
    let frames = images.saturating_mul(pixels).saturating_mul(frame);
    let scratch = u64::from(in_flight)
        .min(images)
        .saturating_mul(pixels)
        .saturating_mul(PIXEL_BYTES as u64);
    frames.saturating_add(scratch)
}

/// Bytes of a pixel in a file of which nothing is compressed.
fn pixel_bytes(format: Format) -> u64 {
    match format {
        // Seven channels of half, one of float.
        Format::Exr => 18,
        Format::Png8 => 4,
        Format::Png16 => 8,
        Format::Ppm => 3,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use model::{Digest, FrameRange, Rect, Revision, SubmissionId};

    #[test]
    fn the_disk_of_a_folder_has_some_room() {
        let folder = tempfile::tempdir().unwrap();
        let space = Space::at(folder.path()).unwrap();
        assert!(0 < space.all && space.free <= space.all, "{space:?}");
        assert_eq!(Space::at(&folder.path().join("none")), None);
    }

    #[test]
    fn a_job_needs_its_frames_and_what_is_in_flight() {
        let submission = |frames| sched::Submission {
            submission: SubmissionId(1),
            name: String::new(),
            scene: Digest([0; 32]),
            revision: Revision(1),
            frames: FrameRange::new(0, frames, 1).unwrap(),
            window: Rect {
                x0: 0,
                y0: 0,
                x1: 10,
                y1: 10,
            },
            tiles: sched::TileShape::Time { aim: None },
            priority: 0,
            share: 1,
            needs: sched::Needs::default(),
            after: Vec::new(),
        };
        let both = Formats::new([Format::Exr, Format::Png8]);
        assert_eq!(needed(&submission(1), both), 100 * (22 + 32));
        // Small images are in flight all at once.
        assert_eq!(needed(&submission(100), both), 100 * (100 * 22 + 100 * 32));
    }
}
