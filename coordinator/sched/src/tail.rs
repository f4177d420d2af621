//! The end of a job: nobody idles while somebody else has too much.
//!
//! When a worker has a free thread and nothing waits for it, it takes over from the attempt that is
//! expected to be done last: a lease that was not started is called back and leased to it; a
//! tile that runs is leased to it a second time, from its other end, so that the two
//! attempts meet. First result wins. A check is helped as a tile is, by whoever could have done all that is left of it.
//!
//! Attempts are kept in the order in which they are expected to end, as of their lease. Only what
//! this looks at is estimated anew: the last few, and those that should have ended already.

use alloc::vec::Vec;
use core::ops::Add;

use model::{ImageRef, JobId, Rect, Span, Timestamp};

use crate::attempt::Phase;
use crate::costs::scale;
use crate::leasing::Purpose;
use crate::market::Stage;
use crate::needs::KindSet;
use crate::pace::time_of;
use crate::roster::Place;
use crate::{Effect, RevokeReason, Sched};

/// Workers, jobs and attempts that are looked at per event, each at most.
const WORKERS_LOOKED_AT: usize = 4;
const JOBS_LOOKED_AT: usize = 4;
const ATTEMPTS_LOOKED_AT: usize = 8;

/// After how long it is worth looking again where nobody came.
const LOOK_AGAIN: Span = Span::from_millis(50);

/// Of what is left to wait for, the part that help must gain.
const GAIN_PART: u64 = 8;

/// What can be done about an attempt.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Help {
    CallBack,
    Second,
}

impl Sched {
    /// Gives one idle worker something to do for a job of which every tile is leased; says whether it did.
    pub(crate) fn help_to_end(&mut self, out: &mut Vec<Effect>) -> bool {
        let is_worth_it = self.market.take_came() || self.help_next <= self.now;
        if !is_worth_it || !self.market.has(Stage::Ending) {
            return false;
        }
        self.help_next = self.now + LOOK_AGAIN;
        let mut idle: Vec<(KindSet, Place)> = Vec::new();
        for (kinds, seats) in self.market.groups() {
            let seats = seats.iter().take_while(|seat| seat.has_free_thread());
            idle.extend(
                seats
                    .filter(|seat| self.workers[seat.worker].offer.queue.is_none())
                    .map(|seat| (kinds, seat.worker))
                    .take(WORKERS_LOOKED_AT),
            );
        }
        idle.truncate(WORKERS_LOOKED_AT);
        idle.into_iter().any(|(kinds, worker)| {
            let mut jobs: Vec<_> = kinds
                .iter()
                .flat_map(|kind| self.market.jobs(Stage::Ending, kind).take(JOBS_LOOKED_AT))
                .collect();
            jobs.sort_unstable();
            let mut jobs = jobs.into_iter().take(JOBS_LOOKED_AT);
            jobs.any(|rank| self.help(worker, rank.job, out))
        })
    }

    fn help(&mut self, place: Place, id: JobId, out: &mut Vec<Effect>) -> bool {
        if self.workers[place].aside.job(id).is_some() {
            return false;
        }
        self.look_at_overdue(id);
        let Some((number, help)) = self.find_last(place, id) else {
            return false;
        };
        let attempt = &self.attempts[number];
        let (image, tile) = (attempt.image, attempt.tile);
        match help {
            Help::CallBack => {
                self.revoke(number, RevokeReason::CalledBack, out);
                if let Some(job) = self.jobs.get_mut(&id) {
                    job.tally.called_back += 1;
                }
                // Whom it was called back for begins it: who had it before, or another, would hold it as it was held.
                if let Some(ask) = self.may_take(place, id) {
                    self.lease(place, id, &ask, out);
                }
            }
            Help::Second => self.lease_tile(place, (image, tile), Purpose::Second, out),
        }
        self.settle_job(id);
        self.help_next = self.now;
        true
    }

    /// The attempt whose end a worker would bring forward, of those that are expected to end last.
    fn find_last(&mut self, place: Place, id: JobId) -> Option<(u64, Help)> {
        let mut passed = 0;
        for _ in 0..ATTEMPTS_LOOKED_AT {
            let last = self.jobs.get(&id)?.ending.iter().rev().nth(passed);
            let &(key, number) = last?;
            self.cost_all_anew(self.attempts[number].worker);
            let finish = self.estimate(number);
            if finish < key {
                self.expect(number, finish);
                continue;
            }
            passed += 1;
            if let Some(help) = self.gains(place, number, finish) {
                return Some((number, help));
            }
        }
        None
    }

    /// What a worker could do about an attempt that is expected to end at `finish`, if it gains enough.
    fn gains(&self, place: Place, number: u64, finish: Timestamp) -> Option<Help> {
        let attempt = &self.attempts[number];
        let helper = &self.workers[place];
        if attempt.worker == place {
            return None;
        }
        let (missing, blocks, suits) = self.left_of(attempt.image, attempt.tile, place)?;
        let alone = time_of(missing, helper.pace.speed());
        let has_time = helper.ends.is_none_or(|ends| self.now + alone < ends);
        if !suits || !has_time {
            return None;
        }
        let left = finish - self.now;
        let margin = |least: Span| least.max(Span(left.0 / GAIN_PART));
        if self.is_ahead(number) {
            if !self.fits_whole(attempt.image, attempt.tile, place) {
                return None;
            }
            let least = margin(self.config.tail_gain.call_back?);
            return (alone + least < left).then_some(Help::CallBack);
        }
        let least = margin(self.config.tail_gain.second?);
        // From both ends, where there is more than one block to be had; the last block of each is its own.
        let speeds = [helper, &self.workers[attempt.worker]].map(|worker| worker.pace.speed());
        let together = match blocks {
            0 | 1 => alone,
            _ => {
                let both = Span(scale(alone.0, left.0, alone.0.saturating_add(left.0)));
                let block = time_of(missing / blocks, speeds[0].min(speeds[1]));
                both.max(Span(alone.0 / blocks)) + Span(block.0 / 2)
            }
        };
        (together + least < left).then_some(Help::Second)
    }

    /// What is missing of a tile, as cost and in blocks, and whether a worker suits it.
    fn left_of(&self, image: ImageRef, tile: u32, place: Place) -> Option<(u64, u64, bool)> {
        let job = self.jobs.get(&image.job)?;
        let work = job.work.get(&job.place(image.image)?)?;
        let tile = work.tiles.get(tile).filter(|_| !work.given_up)?;
        let worker = self.workers[place].id;
        let missing: Vec<Rect> = match &tile.check {
            Some(check) => check.blocks().collect(),
            None => {
                let is_missing = |block: &Rect| !work.pixels.covers(*block);
                tile.rect.blocks().filter(is_missing).collect()
            }
        };
        let blocks = missing.len() as u64;
        let cost = job.costs.of_blocks(missing.into_iter())?;
        let able = self.able_beside_queues(job);
        let suits = match &tile.check {
            Some(check) => check.suits_whole(worker),
            None => tile.trouble.suits(worker, able),
        };
        Some((cost, blocks, suits))
    }

    /// Whether a worker would be leased all of a tile, were it not leased.
    fn fits_whole(&self, image: ImageRef, tile: u32, place: Place) -> bool {
        let Some(job) = self.jobs.get(&image.job) else {
            return false;
        };
        let work = job
            .place(image.image)
            .and_then(|place| job.work.get(&place));
        let tile = work.and_then(|work| Some((work, work.tiles.get(tile)?)));
        let ask = self.ask(&self.workers[place], job);
        tile.zip(ask)
            .is_some_and(|((work, tile), ask)| work.fits(tile.region, &ask))
    }

    /// Expects anew of attempts that should have ended by now, a few at a time.
    fn look_at_overdue(&mut self, id: JobId) {
        for _ in 0..ATTEMPTS_LOOKED_AT {
            let first = self.jobs.get(&id).and_then(|job| job.ending.first());
            let Some(&(_, number)) = first.filter(|&&(key, _)| key <= self.now) else {
                return;
            };
            let finish = self.estimate(number);
            self.expect(number, finish);
        }
    }

    /// Learns the cost of what a worker holds and was leased before anything was measured.
    fn cost_all_anew(&mut self, place: Place) {
        for index in 0..self.workers[place].live.len() {
            self.cost_anew(self.workers[place].live[index]);
        }
    }

    fn cost_anew(&mut self, number: u64) {
        let attempt = &self.attempts[number];
        let job = &self.jobs[&attempt.image.job];
        let cost = job.costs.of_blocks(attempt.rect.blocks());
        if let Some(cost) = cost.filter(|_| attempt.cost == 0) {
            let worker = &mut self.workers[attempt.worker];
            worker.backlog = worker.backlog.saturating_add(cost);
            self.attempts.get_mut(number).expect("it is live").cost = cost;
        }
    }

    /// When a live attempt is expected to end, by how far it is; later than now.
    fn estimate(&self, number: u64) -> Timestamp {
        let attempt = &self.attempts[number];
        if attempt.cost == 0 {
            return Timestamp(u64::MAX);
        }
        let worker = &self.workers[attempt.worker];
        let total = time_of(attempt.cost, worker.pace.speed());
        if self.is_ahead(number) {
            return self.begins(number) + total;
        }
        let started = attempt.started.unwrap_or(attempt.leased);
        let spent = self.now - started;
        let (wanted, done) = (u64::from(attempt.wanted()), u64::from(attempt.done()));
        let seen = spent.0 / (done + 1);
        let expected = total.0 / wanted.max(1);
        if seen > expected {
            // Later than expected: the next block takes as long again as it has, the others as long as those before.
            return self.now + Span(seen.saturating_mul(wanted - done.min(wanted)).max(1));
        }
        (started + total).max(self.now + Span(1))
    }

    /// When a live attempt that is held ahead is expected to begin: after those that were leased before it.
    fn begins(&self, number: u64) -> Timestamp {
        let worker = &self.workers[self.attempts[number].worker];
        let before = worker.live.iter().take_while(|&&live| live != number);
        let left = before.map(|&live| match self.is_ahead(live) {
            true => time_of(self.attempts[live].cost, worker.pace.speed()),
            false if self.attempts[live].cost == 0 => Span(0),
            false => self.estimate(live) - self.now,
        });
        let left = left.fold(Span(0), Span::add);
        self.now + Span(left.0 / u64::from(worker.offer.threads.max(1)))
    }

    /// Moves an attempt to where it is now expected to end.
    fn expect(&mut self, number: u64, finish: Timestamp) {
        let attempt = self.attempts.get_mut(number).expect("it is listed");
        attempt.finish = finish;
        if let Some(old) = attempt.enlisted.replace(finish)
            && let Some(job) = self.jobs.get_mut(&attempt.image.job)
        {
            job.ending.remove(&(old, number));
            job.ending.insert((finish, number));
        }
    }

    /// Whether its worker cannot have started a live attempt yet, as far as is known here.
    pub(crate) fn is_ahead(&self, number: u64) -> bool {
        let attempt = &self.attempts[number];
        let is_rendered = |live: u64| self.attempts[live].phase == Phase::Delivering;
        attempt.phase == Phase::Ahead
            && self.workers[attempt.worker].holds_ahead(number, is_rendered)
    }
}
