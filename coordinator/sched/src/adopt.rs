//! Tiles that workers had begun when another coordinator was there.
//!
//! A coordinator that is started over a store knows what is durable, and not who renders what. Workers that come back say
//! what they have begun; where nobody else renders it, they go on with it under the attempt's old name, and nothing of
//! it is rendered twice.

use alloc::vec::Vec;

use model::{Begun, ImageRef, Rect};

use crate::leasing::Purpose;
use crate::roster::Place;
use crate::{Effect, ImageState, RevokeReason, Sched};

impl Sched {
    /// Takes up what a worker has begun in earlier epochs, as far as that may be; the rest is dead.
    pub(crate) fn adopt(
        &mut self,
        place: Place,
        begun: &[Begun],
        out: &mut Vec<Effect>,
    ) -> Vec<Begun> {
        let is_taken_up = |&&begun: &&Begun| self.take_up(place, begun, out);
        begun.iter().filter(is_taken_up).copied().collect()
    }

    fn take_up(&mut self, place: Place, begun: Begun, out: &mut Vec<Effect>) -> bool {
        let Begun {
            attempt,
            image,
            tile,
        } = begun;
        let is_old = attempt.epoch < self.config.epoch && !self.adopted.contains_key(&attempt);
        if !is_old || !self.may_take_up(place, image) {
            return false;
        }
        let Some((job, index)) = self.job_and_place(image) else {
            return false;
        };
        if job.state(index) == ImageState::Waiting {
            job.begin(index);
        }
        let worker = &self.workers[place];
        if let Some(queue) = worker.offer.queue {
            let (id, window) = (worker.id, self.jobs[&image.job].spec.window);
            let grid = self.grid_for(queue, window);
            if let Some((job, index)) = self.job_and_place(image) {
                job.cut_for_queue(index, (id, grid));
            }
        }
        let Some((job, index)) = self.job_and_place(image) else {
            return false;
        };
        if !job
            .work
            .get(&index)
            .is_some_and(|work| work.may_claim(tile))
        {
            return false;
        }
        self.make_way(image, tile, out);
        let Some((job, index)) = self.job_and_place(image) else {
            return false;
        };
        let Some(work) = job.work.get_mut(&index) else {
            return false;
        };
        let Some(number) = work.claim(tile) else {
            return false;
        };
        let durable: Vec<Rect> = {
            let blocks = tile.blocks();
            blocks.filter(|&block| work.pixels.covers(block)).collect()
        };
        let submitted = job.tally.submitted;
        let lease = self.begin_attempt(place, (image, number), Purpose::First);
        let number = lease.attempt.number;
        let live = self.attempts.get_mut(number).expect("it was just begun");
        live.name = Some(attempt);
        // Nobody knows when that was; what it took is believed, within reason.
        live.leased = submitted;
        for block in durable {
            live.had_arrived(block);
        }
        self.adopted.insert(attempt, number);
        self.progress(number);
        true
    }

    /// Whether a worker may render an image of which it says that it has begun a tile.
    fn may_take_up(&self, place: Place, image: ImageRef) -> bool {
        let worker = &self.workers[place];
        let Some(job) = self.jobs.get(&image.job) else {
            return false;
        };
        let Some(index) = job.place(image.image) else {
            return false;
        };
        let is_open = match job.state(index) {
            ImageState::Waiting => job.may_begin(&self.config),
            ImageState::Rendering => true,
            _ => false,
        };
        is_open
            && !job.is_over()
            && job.after.is_empty()
            && worker.kinds.contains(job.kind)
            && (worker.offer.queue.is_some()
                || worker.live.len() < self.config.limits.credit_max as usize)
    }

    /// Calls back what was leased meanwhile of these pixels and is not begun.
    fn make_way(&mut self, image: ImageRef, tile: Rect, out: &mut Vec<Effect>) {
        let Some((job, index)) = self.job_and_place(image) else {
            return;
        };
        let work = job.work.get(&index);
        let inside = work.map_or_else(Vec::new, |work| work.attempts_in(tile));
        for number in inside {
            if self.is_ahead(number) {
                self.revoke(number, RevokeReason::CalledBack, out);
            }
        }
    }
}
