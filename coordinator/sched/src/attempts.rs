//! How attempts begin, count and end.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use model::{AttemptId, ImageRef, JobId, Lease, Span, WorkerId};

use crate::attempt::{Attempt, Phase, Start, is_block_of};
use crate::timers::Timer;
use crate::{BlockRef, BlockRefusal, Effect, ImageState, Link, RevokeReason, Sched};

impl Sched {
    /// Leases tiles while a worker wants one that a job has.
    pub(crate) fn lease_all(&mut self, out: &mut Vec<Effect>) {
        while let Some((worker, job)) = self.market.next_match() {
            self.lease(worker, job, out);
        }
    }

    fn lease(&mut self, id: WorkerId, job_id: JobId, out: &mut Vec<Effect>) {
        let job = self
            .jobs
            .get_mut(&job_id)
            .expect("a job in the market is known");
        let (place, tile) = job
            .take_tile(&self.config)
            .expect("a job in the market has a tile");
        self.attempts_made += 1;
        let number = self.attempts_made;

        let image = job.image_ref(place);
        let work = job
            .work
            .get_mut(&place)
            .expect("a tile's image is in flight");
        let rect = work.rect(tile);
        let wanted = work.wanted(tile);
        let blocks = if wanted.is_empty() {
            rect.blocks().count()
        } else {
            wanted.len()
        };
        let missing = work.tiles[tile as usize].missing;
        let failures = work.tiles[tile as usize].failures;
        work.tiles[tile as usize].begins(number);
        work.live.insert(number);
        job.tally.attempts_live += 1;
        job.tally.started.get_or_insert(self.now);
        let limit = job.block_limit(&self.config, failures);
        let lease = Lease {
            attempt: AttemptId {
                epoch: self.config.epoch,
                number,
            },
            image,
            scene: job.spec.scene,
            tile: rect,
            wanted,
            expected: job.expected(missing).unwrap_or_default(),
        };
        let attempt = Attempt::new(Start {
            worker: id,
            image,
            tile,
            rect,
            leased: self.now,
            wanted: u32::try_from(blocks).unwrap_or(u32::MAX),
            limit,
        });
        self.attempts.insert(number, attempt);

        let worker = self
            .workers
            .get_mut(&id)
            .expect("a worker in the market is known");

        worker.live.insert(number);
        worker.idle += 1;
        worker.patience = limit;
        if worker.waiting.is_none() {
            self.rearm_waiting(id);
        }
        self.worker_changed(id);
        self.job_changed(job_id);
        out.push(Effect::Lease { worker: id, lease });
    }

    /// Removes a live attempt; its tile waits for another where nobody who can be reached renders it.
    pub(crate) fn end_attempt(&mut self, number: u64) -> Option<Attempt> {
        let mut attempt = self.attempts.remove(&number)?;
        self.timers
            .set(Timer::Stuck(number), &mut attempt.stuck, None);
        if let Some(worker) = self.workers.get_mut(&attempt.worker) {
            worker.live.remove(&number);
            worker.idle -= u32::from(attempt.phase != Phase::Running);
        }
        self.rearm_waiting(attempt.worker);
        self.worker_changed(attempt.worker);
        if let Some((job, place)) = self.job_and_place(attempt.image) {
            job.tally.attempts_live -= 1;
            if let Some(work) = job.work.get_mut(&place) {
                work.live.remove(&number);
                work.tiles[attempt.tile as usize].ends(number);
            }
        }
        self.reconsider(attempt.image, attempt.tile);
        Some(attempt)
    }

    /// Ends a live attempt and tells its worker.
    pub(crate) fn revoke(&mut self, number: u64, reason: RevokeReason, out: &mut Vec<Effect>) {
        let id = self.attempt_id(number);
        if let Some(attempt) = self.end_attempt(number) {
            out.push(Effect::Revoke {
                worker: attempt.worker,
                attempt: id,
                reason,
            });
        }
    }

    /// Sees whether a tile waits for a worker: it is not done, has room for an
    /// attempt, and nobody who can be reached renders it.
    pub(crate) fn reconsider(&mut self, image: ImageRef, tile: u32) {
        let Some(job) = self.jobs.get_mut(&image.job) else {
            return;
        };
        if let Some(work) = job
            .place(image.image)
            .and_then(|place| job.work.get_mut(&place))
        {
            let state = &work.tiles[tile as usize];
            let is_away = |number: &u64| {
                let attempt = &self.attempts[number];
                self.workers[&attempt.worker].link == Link::Closed
            };
            let live: Vec<u64> = state.attempts().collect();
            let open =
                state.missing > 0 && live.len() < crate::work::LIVE_MAX && live.iter().all(is_away);
            work.set_open(tile, open);
        }
        self.job_changed(image.job);
    }

    pub(crate) fn block_stored(
        &mut self,
        worker: WorkerId,
        block: BlockRef,
        elapsed: Span,
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
        let tile = match self.place_of_block(block) {
            Ok(Some(tile)) => tile,
            Ok(None) => return out.push(ack),
            Err(refusal) => {
                return out.push(Effect::RefuseBlock {
                    worker,
                    block,
                    refusal,
                });
            }
        };
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        let Some(work) = job.work.get_mut(&place) else {
            return;
        };
        let new = work.pixels.add(rect);
        let image_done = work.pixels.is_complete();
        let state = &mut work.tiles[tile as usize];
        state.missing -= new;
        let tile_done = state.missing == 0;
        if new > 0 {
            state.losses = 0;
        }
        job.tally.pixels_done += new;
        job.tally.blocks_done += u64::from(new > 0);
        out.push(ack);
        self.credit_attempt(worker, (block, tile), new, elapsed);
        if tile_done {
            self.tile_done(image, tile, out);
        }
        if image_done && let Some((job, place)) = self.job_and_place(image) {
            job.work.remove(&place);
            job.set_state(place, ImageState::Encoding);
            out.push(Effect::Encode { image });
        }
        self.job_changed(image.job);
    }

    /// The tile that a durable block belongs to; `None` where its image has all its pixels.
    fn place_of_block(&self, block: BlockRef) -> Result<Option<u32>, BlockRefusal> {
        let job = self.jobs.get(&block.image.job);
        let job = job.ok_or(BlockRefusal::AttemptDead)?;
        let place = job.place(block.image.image);
        let place = place.ok_or(BlockRefusal::OtherImage)?;
        let Some(work) = job.work.get(&place) else {
            let state = job.state(place);
            let durable = matches!(state, ImageState::Encoding | ImageState::Encoded { .. });
            let wanted = durable && !job.is_over();
            return wanted.then_some(None).ok_or(BlockRefusal::AttemptDead);
        };
        work.tile_of(block.rect)
            .filter(|&tile| is_block_of(work.rect(tile), block.rect))
            .map(Some)
            .ok_or(BlockRefusal::NotABlock)
    }

    /// Notes with its attempt and worker, where they are there, that a block arrived of
    /// which `new` pixels were not durable before. One that is sent again counts once.
    fn credit_attempt(
        &mut self,
        id: WorkerId,
        (block, tile): (BlockRef, u32),
        new: u64,
        elapsed: Span,
    ) {
        let BlockRef { image, rect, .. } = block;
        let Some(number) = self.owned(id, block.attempt) else {
            return;
        };
        let Some(attempt) = self.attempts.get_mut(&number) else {
            return;
        };
        let fits = attempt.image == image && attempt.tile == tile;
        if !fits || !attempt.arrives(rect) {
            return;
        }
        // A worker may claim any time; it cannot have taken longer than it had.
        let elapsed = elapsed.min(self.now - attempt.leased);
        if let Some((job, _)) = self.job_and_place(image) {
            job.tally.blocks_again += u64::from(new == 0);
            job.tally.pixels_again += rect.area() - new;
            job.time(rect.area(), elapsed);
        }
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.blocks += u64::from(new > 0);
            worker.pixels += new;
            worker.render_time = Span(worker.render_time.0.saturating_add(elapsed.0));
        }
        self.progress(number);
    }

    /// Ends the attempts at a tile of which every pixel is durable. One that has
    /// delivered all it was leased for knows; the others are told.
    fn tile_done(&mut self, image: ImageRef, tile: u32, out: &mut Vec<Effect>) {
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        let live: Vec<u64> = job
            .work
            .get(&place)
            .into_iter()
            .flat_map(|work| work.tiles[tile as usize].attempts())
            .collect();
        for number in live {
            if self
                .attempts
                .get(&number)
                .is_some_and(Attempt::is_delivered)
            {
                self.end_attempt(number);
            } else {
                self.revoke(number, RevokeReason::TileDone, out);
            }
        }
    }

    pub(crate) fn tile_failed(
        &mut self,
        worker: WorkerId,
        attempt: AttemptId,
        reason: String,
        out: &mut Vec<Effect>,
    ) {
        self.heard(worker);
        if let Some(attempt) = self
            .owned(worker, attempt)
            .and_then(|number| self.end_attempt(number))
        {
            self.charge_failure(&attempt, reason, out);
        }
    }

    /// Charges an ended attempt's failure to its tile.
    pub(crate) fn charge_failure(
        &mut self,
        attempt: &Attempt,
        reason: String,
        out: &mut Vec<Effect>,
    ) {
        let max = self.config.tile_failures_max;
        let Some((job, place)) = self.job_and_place(attempt.image) else {
            return;
        };
        job.tally.attempts_failed += 1;
        let Some(work) = job.work.get_mut(&place) else {
            return;
        };
        let tile = &mut work.tiles[attempt.tile as usize];
        tile.failures += 1;
        if tile.failures >= max {
            let failures = tile.failures;
            let reason = format!(
                "{}: failed {failures} times, last: {reason}",
                place_of(attempt)
            );
            self.fail_image(attempt.image, reason, out);
        }
        self.job_changed(attempt.image.job);
    }

    /// Charges to its tile that the worker of an ended attempt was lost while it ran.
    pub(crate) fn charge_loss(&mut self, attempt: &Attempt, out: &mut Vec<Effect>) {
        let max = self.config.tile_losses_max;
        let Some((job, place)) = self.job_and_place(attempt.image) else {
            return;
        };
        job.tally.attempts_lost += 1;
        let Some(work) = job.work.get_mut(&place) else {
            return;
        };
        let tile = &mut work.tiles[attempt.tile as usize];
        tile.losses += 1;
        if tile.losses >= max {
            let losses = tile.losses;
            let reason = format!(
                "{}: {losses} workers in a row were lost while rendering it, and no block arrived in between",
                place_of(attempt)
            );
            self.fail_image(attempt.image, reason, out);
        }
        self.job_changed(attempt.image.job);
    }
}

fn place_of(attempt: &Attempt) -> String {
    let model::Rect { x0, y0, .. } = attempt.rect;
    let (width, height) = (attempt.rect.width(), attempt.rect.height());
    format!("the tile of {width}x{height} pixels at column {x0}, row {y0}")
}
