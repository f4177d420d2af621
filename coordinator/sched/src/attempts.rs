//! How attempts end, and what that means for their tile.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use model::{AttemptId, ImageRef, WorkerId};

use crate::attempt::{Attempt, Phase};
use crate::roster::Place;
use crate::timers::Timer;
use crate::work::Reopened;
use crate::{Effect, Link, RevokeReason, Sched};

impl Sched {
    /// Removes a live attempt; its tile waits for another where nobody who can be reached renders it. Says whose it was.
    pub(crate) fn end_attempt(&mut self, number: u64) -> Option<Place> {
        let mut attempt = self.attempts.remove(number)?;
        self.timers.remove(Timer::Stuck(number), &mut attempt.stuck);
        if let Some(name) = attempt.name {
            self.adopted.remove(&name);
        }
        let worker = &mut self.workers[attempt.worker];
        if let Ok(index) = worker.live.binary_search(&number) {
            worker.live.remove(index);
        }
        worker.lets_go(attempt.image);
        worker.idle -= u32::from(attempt.phase != Phase::Running);
        worker.backlog = worker.backlog.saturating_sub(attempt.cost);
        worker.moved = self.now;
        self.rearm_waiting(attempt.worker);
        self.worker_changed(attempt.worker);
        if let Some((job, place)) = self.job_and_place(attempt.image) {
            job.tally.attempts_live -= 1;
            if let Some(key) = attempt.enlisted {
                job.ending.remove(&(key, number));
            }
            let work = job.work.get_mut(&place);
            if let Some(tile) = work.and_then(|work| work.tiles.get_mut(attempt.tile)) {
                tile.ends(number);
            }
        }
        self.reconsider(attempt.image, attempt.tile);
        Some(attempt.worker)
    }

    /// Ends a live attempt and tells its worker.
    pub(crate) fn revoke(&mut self, number: u64, reason: RevokeReason, out: &mut Vec<Effect>) {
        let attempt = self.attempt_id(number);
        if matches!(reason, RevokeReason::CalledBack | RevokeReason::Paused) {
            self.ends_on_purpose(number);
        }
        if let Some(place) = self.end_attempt(number) {
            let worker = self.workers[place].id;
            out.push(Effect::Revoke {
                worker,
                attempt,
                reason,
            });
        }
    }

    /// Ends live attempts at a tile of which nothing is left to render. One that has delivered all it was leased for knows;
    /// the others are told.
    pub(crate) fn end_all(&mut self, live: impl Iterator<Item = u64>, out: &mut Vec<Effect>) {
        for number in live {
            let attempt = self.attempts.get(number);
            if attempt.is_some_and(Attempt::is_delivered) {
                self.end_attempt(number);
            } else {
                self.revoke(number, RevokeReason::TileDone, out);
            }
        }
    }

    /// Its worker may have begun it after all, and what it sends may come too late.
    fn ends_on_purpose(&mut self, number: u64) {
        let Some(attempt) = self.attempts.get(number) else {
            return;
        };
        let (image, tile) = (attempt.image, attempt.tile);
        if let Some((job, place)) = self.job_and_place(image)
            && let Some(work) = job.work.get_mut(&place)
            && let Some(tile) = work.tiles.get_mut(tile)
        {
            tile.trouble.on_purpose = true;
        }
    }

    /// Sees what becomes of a tile now that an attempt at it began or ended, or that its worker went
    /// or came: whether it waits for a worker, and whether one could help.
    pub(crate) fn reconsider(&mut self, image: ImageRef, number: u32) {
        let Some(job) = self.jobs.get_mut(&image.job) else {
            return;
        };
        let place = job.place(image.image);
        let Some(work) = place.and_then(|place| job.work.get_mut(&place)) else {
            return;
        };
        let Some(tile) = work.tiles.get(number) else {
            return;
        };
        let live: [Option<u64>; 2] = {
            let mut attempts = tile.attempts();
            [attempts.next(), attempts.next()]
        };
        let mut only = None;
        let mut reopened = Reopened::Plain;
        match live {
            [None, _] => reopened = work.reopen(number, self.now),
            [Some(one), None] => {
                let away = self.workers[self.attempts[one].worker].link == Link::Closed;
                work.share(number, away);
                only = Some(one).filter(|_| !away);
            }
            [Some(_), Some(_)] => work.share(number, false),
        }
        for attempt in live.into_iter().flatten() {
            let state = self.attempts.get_mut(attempt).expect("it is live");
            let key = (only == Some(attempt)).then_some(state.finish);
            if key != state.enlisted {
                if let Some(old) = state.enlisted {
                    job.ending.remove(&(old, attempt));
                }
                if let Some(new) = key {
                    job.ending.insert((new, attempt));
                }
                state.enlisted = key;
            }
        }
        if reopened == Reopened::Checks {
            self.check_waits(image);
        }
        self.job_changed(image.job);
    }

    pub(crate) fn tile_failed(
        &mut self,
        worker: WorkerId,
        attempt: AttemptId,
        reason: String,
        out: &mut Vec<Effect>,
    ) {
        self.heard(worker);
        if let Some(number) = self.owned(worker, attempt) {
            self.fail_attempt(number, reason, out);
        }
    }

    /// Ends an attempt that failed, and charges it to its tile.
    pub(crate) fn fail_attempt(&mut self, number: u64, reason: String, out: &mut Vec<Effect>) {
        let max = self.config.tile_failures_max;
        let Some(attempt) = self.attempts.get(number) else {
            return;
        };
        let (image, tile, rect) = (attempt.image, attempt.tile, attempt.rect);
        let worker = self.workers[attempt.worker].id;
        if self.lets_check_be(number, out) {
            return;
        }
        let mut failures = 0;
        if let Some((job, place)) = self.job_and_place(image) {
            job.tally.attempts_failed += 1;
            let work = job.work.get_mut(&place);
            if let Some(tile) = work.and_then(|work| work.tiles.get_mut(tile)) {
                tile.trouble.fails(worker);
                failures = tile.trouble.failures;
            }
        }
        self.end_attempt(number);
        if failures >= max {
            let place = place_of(rect);
            let reason = format!("{place}: failed {failures} times, last: {reason}");
            self.give_up(image, reason, out);
        }
    }

    /// Ends an attempt whose worker was lost while it ran, and charges that to its tile.
    pub(crate) fn lose_attempt(&mut self, number: u64, out: &mut Vec<Effect>) {
        let max = self.config.tile_losses_max;
        let Some(attempt) = self.attempts.get(number) else {
            return;
        };
        let (image, tile, rect) = (attempt.image, attempt.tile, attempt.rect);
        if self.lets_check_be(number, out) {
            return;
        }
        let mut losses = 0;
        if let Some((job, place)) = self.job_and_place(image) {
            job.tally.attempts_lost += 1;
            let work = job.work.get_mut(&place);
            if let Some(tile) = work.and_then(|work| work.tiles.get_mut(tile)) {
                tile.trouble.losses += 1;
                losses = tile.trouble.losses;
            }
        }
        self.end_attempt(number);
        if losses >= max {
            let place = place_of(rect);
            let reason = format!(
                "{place}: {losses} workers in a row were lost while rendering it, and no block arrived in between"
            );
            self.give_up(image, reason, out);
        }
    }
}

fn place_of(rect: model::Rect) -> String {
    let model::Rect { x0, y0, .. } = rect;
    let (width, height) = (rect.width(), rect.height());
    format!("the tile of {width}x{height} pixels at column {x0}, row {y0}")
}
