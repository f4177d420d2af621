//! What a store tells a new epoch instead of the events that it no longer keeps.

use model::{Digest, ImageRef, JobId, Rect, Span};

use crate::job::Job;
use crate::pace::{SPEED_USUAL, cost_of};
use crate::{Effect, ImageState, Sched};

use alloc::vec::Vec;

impl Sched {
    /// Jobs are numbered after `last` from now on; numbers never go back.
    pub(crate) fn jobs_recalled(&mut self, last: JobId) {
        self.jobs_made = self.jobs_made.max(last.0);
    }

    /// An image is in its place, whose blocks nobody tells of any more.
    pub(crate) fn image_recalled(
        &mut self,
        image: ImageRef,
        film: Digest,
        (blocks, render_time): (u32, Span),
        out: &mut Vec<Effect>,
    ) {
        let now = self.now;
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        if job.is_over() || job.state(place) != ImageState::Waiting {
            return;
        }
        job.set_state(place, ImageState::Encoded { film });
        let tally = &mut job.tally;
        tally.pixels_done += job.spec.window.area();
        tally.blocks_done += u64::from(blocks);
        tally.render_time = Span(tally.render_time.0.saturating_add(render_time.0));
        tally.started.get_or_insert(now);
        job.spread.note(cost_of(render_time, SPEED_USUAL));
        self.job_changed(image.job);
        self.end_job_if_done(image.job, out);
    }
}

impl Job {
    /// Notes what a block of an earlier epoch took. Whose it was is forgotten, so it counts as of usual speed.
    pub(crate) fn recall_block(&mut self, place: u32, block: Rect, elapsed: Span) {
        let cost = cost_of(elapsed, SPEED_USUAL);
        self.costs.note(block, cost);
        if let Some(work) = self.work.get_mut(&place) {
            work.spent = work.spent.saturating_add(cost);
        }
        let render_time = &mut self.tally.render_time;
        *render_time = Span(render_time.0.saturating_add(elapsed.0));
    }
}
