//! How images begin and end.

use alloc::string::String;
use alloc::vec::Vec;

use model::{Digest, ImageRef};

use crate::{Effect, ImageState, RevokeReason, Sched};

impl Sched {
    pub(crate) fn image_encoded(&mut self, image: ImageRef, film: Digest, out: &mut Vec<Effect>) {
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        if job.state(place) != ImageState::Encoding {
            return;
        }
        job.set_state(place, ImageState::Encoded { film });
        if job.is_over() {
            // Its pixels were given up with the job; it was in its place before that was known.
            job.tally.pixels_done += job.spec.window.area();
        }
        self.job_changed(image.job);
        self.end_job_if_done(image.job, out);
    }

    /// An image in flight is given up; the job goes on with the others.
    pub(crate) fn image_failed(&mut self, image: ImageRef, reason: String, out: &mut Vec<Effect>) {
        let config = &self.config;
        let Some(job) = self.jobs.get_mut(&image.job).filter(|job| !job.is_over()) else {
            return;
        };
        let Some(place) = job.place(image.image) else {
            return;
        };
        // One that waits was in flight in an epoch of which nothing else is left.
        if !matches!(
            job.state(place),
            ImageState::Waiting | ImageState::Rendering | ImageState::Encoding
        ) {
            return;
        }
        job.blame(place, reason, config);
        self.drop_work(image, RevokeReason::ImageFailed, out);
        if let Some(job) = self.jobs.get_mut(&image.job) {
            job.set_state(place, ImageState::Failed);
        }
        self.job_changed(image.job);
        self.end_job_if_done(image.job, out);
    }

    /// Says once that an image cannot be rendered; nothing more of it is leased.
    pub(crate) fn give_up(&mut self, image: ImageRef, reason: String, out: &mut Vec<Effect>) {
        if let Some((job, place)) = self.job_and_place(image)
            && let Some(work) = job.work.get_mut(&place)
            && !core::mem::replace(&mut work.given_up, true)
        {
            out.push(Effect::GiveUp { image, reason });
        }
        self.job_changed(image.job);
    }

    /// Ends all attempts at an image in flight, and lets the shell forget its pixels.
    pub(crate) fn drop_work(
        &mut self,
        image: ImageRef,
        reason: RevokeReason,
        out: &mut Vec<Effect>,
    ) {
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        let mut live: Vec<u64> = job.live_of(place).collect();
        live.sort_unstable();
        for number in live {
            self.revoke(number, reason, out);
        }
        if let Some(job) = self.jobs.get_mut(&image.job) {
            job.drop_pixels(place);
        }
        out.push(Effect::DropScratch { image });
    }
}
