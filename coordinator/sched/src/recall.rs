//! What a store tells a new epoch instead of the events that it no longer keeps.

use model::{AttemptId, Digest, Epoch, ImageRef, JobId, Rect, Span, WorkerId};

use crate::job::Job;
use crate::pace::{SPEED_USUAL, cost_of};
use crate::{BlockRef, Effect, ImageState, Sched};

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

    /// Blocks are durable of which nobody knows any more who rendered them.
    pub(crate) fn blocks_recalled(
        &mut self,
        image: ImageRef,
        blocks: &[(Rect, Span)],
        out: &mut Vec<Effect>,
    ) {
        let now = self.now;
        let mut done = Vec::new();
        for &(rect, elapsed) in blocks {
            let block = BlockRef {
                attempt: LONG_AGO,
                image,
                rect,
            };
            let Ok(Some(place)) = self.place_of_block(block) else {
                continue;
            };
            let Some(job) = self.jobs.get_mut(&image.job) else {
                return;
            };
            let Some(added) = job.add_durable(place, rect, now) else {
                continue;
            };
            if added.new > 0 {
                job.recall_block(place, rect, elapsed);
            }
            done.extend(added.done_tiles());
        }
        for tile in done {
            self.tile_done(image, tile, NOBODY, out);
        }
        self.finish_image(image, out);
        self.job_changed(image.job);
    }
}

/// Whose recalled blocks are: nobody's that is known any more.
const NOBODY: WorkerId = WorkerId {
    id: 0,
    incarnation: 0,
};

/// The attempt of recalled blocks, which is of no epoch that there was.
const LONG_AGO: AttemptId = AttemptId {
    epoch: Epoch(0),
    number: 0,
};

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
