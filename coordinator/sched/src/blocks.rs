//! Blocks: what is durable counts, once.

use alloc::vec::Vec;

use model::{Digest, ImageRef, Rect, Span, Timestamp, WorkerId};

use crate::check::Made;
use crate::job::Job;
use crate::leasing::Purpose;
use crate::pace::cost_of;
use crate::verify::to_check;
use crate::{BlockRef, BlockRefusal, Effect, ImageState, JobOutcome, Sched};

/// A block that arrived, and what was found about it.
struct Arrival {
    block: BlockRef,
    /// Its tile, while that is leased.
    tile: Option<u32>,
    /// Pixels that were not durable before.
    new: u64,
    /// Why a block that was durable before was rendered again.
    purpose: Purpose,
    elapsed: Span,
}

/// What a durable block added to its image.
#[derive(Clone, Debug)]
pub(crate) struct Added {
    /// Pixels that were not durable before.
    pub(crate) new: u64,
    /// Its tile, while that is leased.
    tile: Option<u32>,
    tile_is_done: bool,
    /// Tiles that are done where it is part of none: its image was cut anew while it was written.
    others_done: Vec<u32>,
    purpose: Purpose,
}

impl Added {
    /// Tiles that are leased and of which nothing is left to render.
    pub(crate) fn done_tiles(self) -> impl Iterator<Item = u32> {
        let tile = self.tile.filter(|_| self.tile_is_done);
        tile.into_iter().chain(self.others_done)
    }
}

impl Job {
    /// Counts the pixels of a durable block of an image that is not over.
    pub(crate) fn add_durable(&mut self, place: u32, rect: Rect, now: Timestamp) -> Option<Added> {
        let work = match self.state(place) {
            // Nobody had begun it: its beginning was in another epoch.
            ImageState::Waiting => self.begin(place),
            _ => self.work.get_mut(&place)?,
        };
        let new = work.pixels.add(rect);
        let mut added = Added {
            new,
            tile: work.tile_of(rect),
            tile_is_done: false,
            others_done: Vec::new(),
            purpose: Purpose::First,
        };
        if !work.is_in_a_cell(rect) && new > 0 {
            added.others_done = work.count_anew(rect);
        }
        if let Some(tile) = added.tile.and_then(|tile| work.tiles.get_mut(tile)) {
            tile.missing -= new;
            added.tile_is_done = tile.missing == 0 && tile.check.is_none();
            if tile.trouble.on_purpose {
                added.purpose = Purpose::Second;
            }
            if new > 0 {
                tile.trouble.losses = 0;
            }
        }
        let tally = &mut self.tally;
        tally.pixels_done += new;
        tally.blocks_done += u64::from(new > 0);
        tally.started.get_or_insert(now);
        Some(added)
    }
}

/// Whose pixels of a block are durable.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Durable {
    /// Those that have just arrived, all of them.
    ByThis,
    /// Some that arrived before.
    Before,
}

impl Sched {
    pub(crate) fn block_stored(
        &mut self,
        worker: WorkerId,
        block: BlockRef,
        (elapsed, pixels): (Span, Digest),
        out: &mut Vec<Effect>,
    ) {
        self.heard(worker);
        let BlockRef {
            attempt,
            image,
            rect,
        } = block;
        let ack = Effect::Ack {
            worker,
            attempt,
            rect,
        };
        let place = match self.place_of_block(block) {
            Ok(Some(place)) => place,
            Ok(None) => {
                self.has_part(worker, None, image);
                return out.push(ack);
            }
            Err(refusal) => {
                return out.push(Effect::RefuseBlock {
                    worker,
                    block,
                    refusal,
                });
            }
        };
        let Some(job) = self.jobs.get_mut(&image.job) else {
            return;
        };
        let Some(added) = job.add_durable(place, rect, self.now) else {
            return;
        };
        let (new, tile, purpose) = (added.new, added.tile, added.purpose);
        // What an attempt delivered that nobody knows any more counts all the same.
        let is_recalled =
            attempt.epoch != self.config.epoch && !self.adopted.contains_key(&attempt);
        if is_recalled && new > 0 {
            job.recall_block(place, rect, elapsed);
        }
        out.push(ack);
        let arrival = Arrival {
            block,
            tile,
            new,
            purpose,
            elapsed,
        };
        let made = Made {
            rect,
            pixels,
            by: worker,
        };
        let durable = match new == rect.area() {
            true => Durable::ByThis,
            false => Durable::Before,
        };
        let live = self.owned(worker, attempt);
        self.has_part(worker, live, image);
        let counts = match live {
            Some(number) => self.credit_attempt(number, &arrival),
            // Its attempt ended while it was written: what was let in counts for all that it would have counted for.
            None => !is_recalled,
        };
        if counts {
            self.hold_against_others(live, block, (made, durable), out);
        }
        for tile in added.done_tiles() {
            self.tile_done(image, tile, worker, out);
        }
        self.finish_image(image, out);
        self.job_changed(image.job);
    }

    /// Has an image encoded of which nothing is left to render.
    pub(crate) fn finish_image(&mut self, image: ImageRef, out: &mut Vec<Effect>) {
        if let Some((job, place)) = self.job_and_place(image)
            && let Some(work) = job.work.get(&place).filter(|work| work.is_finished())
        {
            if work.unverified > 0 {
                let tiles = work.unverified;
                out.push(Effect::Unverified { image, tiles });
            }
            job.finish_rendering(place);
            out.push(Effect::Encode { image });
        }
    }

    /// The place of the image that a durable block belongs to; `None` where that has all its pixels.
    pub(crate) fn place_of_block(&self, block: BlockRef) -> Result<Option<u32>, BlockRefusal> {
        let job = self.jobs.get(&block.image.job);
        let job = job.ok_or(BlockRefusal::AttemptDead)?;
        let place = job.place(block.image.image);
        let place = place.ok_or(BlockRefusal::OtherImage)?;
        if job.outcome == Some(JobOutcome::Cancelled) {
            return Err(BlockRefusal::AttemptDead);
        }
        match job.state(place) {
            ImageState::Waiting | ImageState::Rendering => {
                let fits = block.rect.is_block() && job.spec.window.contains(block.rect);
                fits.then_some(Some(place)).ok_or(BlockRefusal::NotABlock)
            }
            ImageState::Encoding | ImageState::Encoded { .. } if !job.is_over() => Ok(None),
            _ => Err(BlockRefusal::AttemptDead),
        }
    }

    /// Notes with its attempt and worker that a block arrived, and says whether that is for the first time.
    /// One that is sent again counts once.
    fn credit_attempt(&mut self, number: u64, arrival: &Arrival) -> bool {
        let BlockRef { image, rect, .. } = arrival.block;
        let Some(attempt) = self.attempts.get_mut(number) else {
            return false;
        };
        let fits = attempt.image == image && Some(attempt.tile) == arrival.tile;
        if !fits || !attempt.arrives(rect) {
            return false;
        }
        // A worker may claim any time; it cannot have taken longer than it had.
        let elapsed = arrival.elapsed.min(self.now - attempt.leased);
        let place = attempt.worker;
        let is_last = attempt.is_delivered();
        let worker = &mut self.workers[place];
        worker.blocks += u64::from(arrival.new > 0);
        worker.pixels += arrival.new;
        worker.render_time = Span(worker.render_time.0.saturating_add(elapsed.0));
        let job = self
            .jobs
            .get_mut(&image.job)
            .expect("a live attempt's job is known");
        if let Some(expected) = job.costs.of_block(rect) {
            worker.pace.note(expected, elapsed);
        }
        let cost = cost_of(elapsed, worker.pace.speed());
        job.costs.note(rect, cost);
        if arrival.new > 0
            && let Some(index) = job.place(image.image)
            && let Some(work) = job.work.get_mut(&index)
        {
            work.spent = work.spent.saturating_add(cost);
        }
        let tally = &mut job.tally;
        tally.render_time = Span(tally.render_time.0.saturating_add(elapsed.0));
        if arrival.new == 0 {
            match arrival.purpose {
                Purpose::First => tally.blocks_again += 1,
                Purpose::Second => tally.blocks_twice += 1,
            }
        }
        tally.pixels_again += rect.area() - arrival.new;
        self.worker_changed(place);
        if !is_last {
            self.progress(number);
        }
        true
    }

    /// Ends the attempts at a tile of which every pixel is durable.
    pub(crate) fn tile_done(
        &mut self,
        image: ImageRef,
        tile: u32,
        by: WorkerId,
        out: &mut Vec<Effect>,
    ) {
        let verify = self.config.verify;
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        let Some(work) = job.work.get_mut(&place) else {
            return;
        };
        let Some(done) = work.tiles.get_mut(tile) else {
            return;
        };
        let failed_on = core::mem::take(&mut done.trouble.failed_on);
        done.check = to_check(verify, image, (done.region, done.rect), &mut done.evidence);
        let live = done.attempts();
        self.end_all(live, out);
        self.clear(by, image.job);
        if !failed_on.is_empty() {
            self.blame(image.job, &failed_on, by, out);
        }
    }
}
