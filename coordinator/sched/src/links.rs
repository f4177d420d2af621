//! What workers say of themselves, and what their silence means.

use alloc::format;
use alloc::vec::Vec;

use model::{AttemptId, Begun, Running, Span, WorkerId};

use crate::attempt::Phase;
use crate::needs::Comes;
use crate::roster::Place;
use crate::timers::Timer;
use crate::worker::{Counts, Worker};
use crate::{Effect, Link, LinkId, Offer, RevokeReason, Sched, WorkerRefusal};

impl Sched {
    pub(crate) fn worker_joined(
        &mut self,
        id: WorkerId,
        (link, offer): (LinkId, Offer),
        (held, begun): (&[AttemptId], &[Begun]),
        out: &mut Vec<Effect>,
    ) {
        let known = self.workers.place(id);
        if known.is_some_and(|place| link < self.workers[place].newest) {
            return;
        }
        if let Err(refusal) = self.admit_worker(id, &offer) {
            out.push(Effect::WorkerRefused {
                worker: id,
                refusal,
            });
            return;
        }
        let place = known.unwrap_or_else(|| {
            let worker = Worker::new(id, offer.clone(), link, self.now);
            self.workers.insert(worker)
        });
        let worker = &mut self.workers[place];
        if link > worker.newest {
            // The worker says anew what it wants, when it has read what is still its own.
            worker.credit = 0;
            worker.is_full = false;
        }
        worker.newest = link;
        worker.link = Link::Open;
        worker.kinds = self.kinds.served_by(&offer);
        worker.ends = offer.time_left.map(|left| self.now + left);
        worker.offer = offer;
        self.stands_for_queue(place);
        self.heard(id);
        self.stays_expelled(place);
        if known.is_some() {
            // It may serve less than before.
            self.look_at_all_checks();
        }
        let live: Vec<AttemptId> = held
            .iter()
            .copied()
            .filter(|&attempt| self.owned(id, attempt).is_some())
            .collect();
        self.keep_only(place, &live);
        let adopted = self.adopt(place, begun, out);
        let images = adopted.iter().map(|begun| (begun.attempt, begun.image));
        let live = live
            .into_iter()
            .chain(adopted.iter().map(|begun| begun.attempt));
        out.push(Effect::Welcome {
            worker: id,
            live: live.collect(),
        });
        out.extend(images.map(|(attempt, image)| Effect::Adopted {
            worker: id,
            attempt,
            image,
        }));
        self.worker_changed(place);
    }

    /// Notes whether a worker stands for a queue, and the images of which it holds tiles.
    fn stands_for_queue(&mut self, place: Place) {
        let worker = &mut self.workers[place];
        worker.images.clear();
        match worker.offer.queue {
            None => drop(self.queues.remove(&place)),
            Some(_) => {
                for number in worker.live.clone() {
                    worker.takes(self.attempts[number].image);
                }
                self.queues.insert(place);
            }
        }
    }

    fn admit_worker(&self, id: WorkerId, offer: &Offer) -> Result<(), WorkerRefusal> {
        let known = self.workers.by_id(id);
        let theirs = offer.revision;
        // A look at all jobs, where a worker is not like the others.
        let is_asked_for = || {
            let mut jobs = self.jobs.values();
            jobs.any(|job| !job.is_over() && job.spec.revision == theirs)
        };
        let wanted = self.config.revision;
        let wanted = wanted.filter(|&ours| ours == theirs || !is_asked_for());
        let wanted = wanted.or(known.map(|known| known.offer.revision));
        if let Some(wanted) = wanted.filter(|&wanted| wanted != theirs) {
            return Err(WorkerRefusal::WrongRevision { theirs, wanted });
        }
        if offer.threads == 0 {
            return Err(WorkerRefusal::NoThreads);
        }
        let limits = &self.config.limits;
        if !limits.allow_labels(&offer.labels) {
            return Err(WorkerRefusal::TooManyLabels {
                labels_max: limits.labels_max,
                bytes_max: limits.label_bytes_max,
            });
        }
        let max = limits.workers_max;
        if known.is_none() && self.workers.len() >= max as usize {
            return Err(WorkerRefusal::TooMany { max });
        }
        Ok(())
    }

    /// Ends a worker's attempts that it does not have (their lease was lost on the
    /// way), and takes up the others where they are.
    fn keep_only(&mut self, place: Place, held: &[AttemptId]) {
        let worker = self.workers[place].id;
        let held = held.iter().filter_map(|&id| self.owned(worker, id));
        let held: alloc::collections::BTreeSet<u64> = held.collect();
        for number in self.workers[place].live.clone() {
            if !held.contains(&number) {
                self.end_attempt(number);
            } else if let Some(attempt) = self.attempts.get(number) {
                let (image, tile) = (attempt.image, attempt.tile);
                if attempt.phase == Phase::Running && self.workers[place].offer.queue.is_some() {
                    self.progress(number);
                }
                self.reconsider(image, tile);
            }
        }
    }

    pub(crate) fn credit(&mut self, id: WorkerId, credit: u32) {
        if let Some(place) = self.heard(id) {
            let worker = &mut self.workers[place];
            worker.credit = credit.min(self.config.limits.credit_max);
            worker.is_full = false;
            self.worker_changed(place);
        }
    }

    pub(crate) fn heartbeat(&mut self, id: WorkerId, running: &[Running], out: &mut Vec<Effect>) {
        let Some(place) = self.heard(id) else {
            return;
        };
        if core::mem::take(&mut self.workers[place].is_full) {
            self.worker_changed(place);
        }
        for report in running {
            let Some(number) = self.owned(id, report.attempt) else {
                out.push(Effect::Revoke {
                    worker: id,
                    attempt: report.attempt,
                    reason: RevokeReason::NotLive,
                });
                continue;
            };
            let attempt = self.attempts.get_mut(number).expect("it is live");
            if attempt.reports(report.blocks) {
                self.progress(number);
            }
        }
    }

    /// A live attempt has begun, or has rendered or delivered a block.
    pub(crate) fn progress(&mut self, number: u64) {
        let Some(limit) = self.block_limit(number) else {
            return;
        };
        let attempt = self.attempts.get_mut(number).expect("it has a limit");
        let place = attempt.worker;
        let (before, after) = (attempt.phase, attempt.phase_now());
        attempt.phase = after;
        attempt.limit = limit;
        attempt.started.get_or_insert(self.now);
        let lag = self.workers[place]
            .offer
            .queue
            .map_or(Span(0), |queue| queue.lag);
        let due = (after == Phase::Running).then(|| self.now + limit + lag);
        self.timers
            .set(Timer::Stuck(number), &mut attempt.stuck, due);
        let worker = &mut self.workers[place];
        worker.idle += u32::from(after != Phase::Running);
        worker.idle -= u32::from(before != Phase::Running);
        worker.patience = limit;
        self.rearm_waiting(place);
    }

    /// How long a live attempt may take over its next block.
    fn block_limit(&self, number: u64) -> Option<Span> {
        let attempt = self.attempts.get(number)?;
        let job = self.jobs.get(&attempt.image.job)?;
        let work = job.work.get(&job.place(attempt.image.image)?)?;
        let failures = work.tiles.get(attempt.tile)?.trouble.failures;
        let cost = attempt.cost / u64::from(attempt.wanted().max(1));
        let speed = self.workers[attempt.worker].pace.speed();
        Some(job.block_limit(&self.config, (cost, speed), failures))
    }

    pub(crate) fn given_back(&mut self, id: WorkerId, attempts: &[AttemptId]) {
        let Some(place) = self.heard(id) else {
            return;
        };
        // Leased at once again, it would be given back again, as fast as the link is. A queue gives back what is to be cut anew.
        let worker = &mut self.workers[place];
        worker.is_full = worker.offer.queue.is_none();
        self.worker_changed(place);
        for &attempt in attempts {
            if let Some(number) = self.owned(id, attempt) {
                self.end_attempt(number);
            }
        }
    }

    pub(crate) fn link_closed(&mut self, id: WorkerId, link: LinkId) {
        let Some(place) = self.workers.place(id) else {
            return;
        };
        let worker = &mut self.workers[place];
        if worker.newest != link || worker.link == Link::Closed {
            return;
        }
        worker.link = Link::Closed;
        let live = worker.live.clone();
        if let Some(queue) = worker.offer.queue {
            let due = Some(self.now + queue.patience);
            self.timers.set(Timer::Lost(place), &mut worker.lost, due);
        }
        self.worker_changed(place);
        for number in live {
            self.is_out_of_sight(number);
            let attempt = &self.attempts[number];
            self.reconsider(attempt.image, attempt.tile);
        }
    }

    /// What a queue has begun goes on while nobody hears of it: it is not stuck for that.
    fn is_out_of_sight(&mut self, number: u64) {
        let Some(attempt) = self.attempts.get_mut(number) else {
            return;
        };
        let Some(queue) = self.workers[attempt.worker].offer.queue else {
            return;
        };
        if attempt.phase == Phase::Running {
            let due = Some(self.now + queue.patience + attempt.limit + queue.lag);
            self.timers
                .set(Timer::Stuck(number), &mut attempt.stuck, due);
        }
    }

    pub(crate) fn goodbye(&mut self, id: WorkerId, out: &mut Vec<Effect>) {
        if let Some(place) = self.workers.place(id) {
            for number in self.workers[place].live.clone() {
                self.end_attempt(number);
            }
            self.forget(place, out);
        }
    }

    /// Ends what is due.
    pub(crate) fn tick(&mut self, out: &mut Vec<Effect>) {
        while let Some(timer) = self.timers.first(self.now) {
            let alarm = match timer {
                Timer::Stuck(number) => {
                    let attempt = self.attempts.get_mut(number);
                    &mut attempt.expect("a timer ends with its attempt").stuck
                }
                Timer::Waiting(place) => &mut self.workers[place].waiting,
                Timer::LetBack(place) => &mut self.workers[place].aside.alarm,
                Timer::Lost(place) => &mut self.workers[place].lost,
                Timer::Unverified(job) => {
                    let job = self.jobs.get_mut(&job);
                    &mut job.expect("a timer ends with its job").unverified
                }
            };
            if !self.timers.goes_off(timer, alarm, self.now) {
                continue;
            }
            match timer {
                Timer::Stuck(number) => self.stuck(number, out),
                Timer::Waiting(place) => self.idle_for_long(place, out),
                Timer::LetBack(place) => self.let_back(place),
                Timer::Lost(place) => self.lost(place, out),
                Timer::Unverified(job) => self.checks_overdue(job, out),
            }
        }
    }

    fn stuck(&mut self, number: u64, out: &mut Vec<Effect>) {
        let Some(attempt) = self.attempts.get(number) else {
            return;
        };
        let seconds = attempt.limit.0 / 1_000_000;
        let worker = self.workers[attempt.worker].id;
        let reason = format!("no block for {seconds} s on worker {worker}");
        self.fail_and_revoke(number, reason, out);
    }

    /// Nothing of a worker moves, and it holds attempts that wait to be started or delivered.
    fn idle_for_long(&mut self, place: Place, out: &mut Vec<Effect>) {
        let id = self.workers[place].id;
        for number in self.workers[place].live.clone() {
            let Some(attempt) = self.attempts.get(number) else {
                continue;
            };
            if attempt.phase != Phase::Running {
                let doing = match attempt.phase {
                    Phase::Ahead => "started",
                    Phase::Running | Phase::Delivering => "delivered",
                };
                self.fail_and_revoke(number, format!("never {doing} by worker {id}"), out);
            }
        }
    }

    fn fail_and_revoke(
        &mut self,
        number: u64,
        reason: alloc::string::String,
        out: &mut Vec<Effect>,
    ) {
        let worker = self.workers[self.attempts[number].worker].id;
        out.push(Effect::Revoke {
            worker,
            attempt: self.attempt_id(number),
            reason: RevokeReason::NoProgress,
        });
        self.fail_attempt(number, reason, out);
    }

    fn lost(&mut self, place: Place, out: &mut Vec<Effect>) {
        for number in self.workers[place].live.clone() {
            match self.attempts[number].phase {
                Phase::Ahead => {
                    self.end_attempt(number);
                }
                Phase::Running | Phase::Delivering => self.lose_attempt(number, out),
            }
        }
        self.forget(place, out);
    }

    /// Removes a worker that holds nothing.
    fn forget(&mut self, place: Place, out: &mut Vec<Effect>) {
        let worker = &mut self.workers[place];
        worker.credit = 0;
        self.worker_changed(place);
        let Some(mut worker) = self.workers.remove(place) else {
            return;
        };
        self.queues.remove(&place);
        self.timers.remove(Timer::Lost(place), &mut worker.lost);
        self.timers
            .remove(Timer::Waiting(place), &mut worker.waiting);
        self.timers
            .remove(Timer::LetBack(place), &mut worker.aside.alarm);
        for job in worker.aside.jobs() {
            if let Some(job) = self.jobs.get_mut(&job) {
                job.aside -= 1;
            }
        }
        self.look_at_all_checks();
        out.push(Effect::Forget { worker: worker.id });
    }

    /// A worker gave a sign of life; says where it is, if it is known.
    pub(crate) fn heard(&mut self, id: WorkerId) -> Option<Place> {
        let place = self.workers.place(id)?;
        let worker = &mut self.workers[place];
        worker.heard = self.now;
        let due = Some(self.now + self.config.liveness_limit);
        self.timers.set(Timer::Lost(place), &mut worker.lost, due);
        Some(place)
    }

    /// Something of a worker moved: where it renders nothing, what it holds may wait
    /// for its patience again. While it renders, the limit of that holds.
    pub(crate) fn rearm_waiting(&mut self, place: Place) {
        let worker = &mut self.workers[place];
        // What waits in a queue waits for others, however long.
        let waits_here = worker.is_idle() && worker.offer.queue.is_none();
        let due = waits_here.then(|| self.now + worker.patience);
        self.timers
            .set(Timer::Waiting(place), &mut worker.waiting, due);
    }

    /// Sees that a worker stands where it belongs in the market, and counts for what it is worth.
    pub(crate) fn worker_changed(&mut self, place: Place) {
        let worker = &mut self.workers[place];
        let counts = worker.counts();
        if counts != worker.counted {
            let after = counts.clone();
            let before = core::mem::replace(&mut worker.counted, counts);
            self.count_anew(before, after);
        }
        let worker = &mut self.workers[place];
        let seat = worker.wants(place);
        self.market.place_worker(&mut worker.seat, seat);
    }

    /// A worker counts for something else than before.
    fn count_anew(&mut self, before: Option<Counts>, after: Option<Counts>) {
        let of = |counts: &Option<Counts>| {
            let counts = counts.as_ref();
            counts.map(|counts| (counts.kinds, counts.aside.clone()))
        };
        if of(&before) != of(&after) {
            if let Some(before) = &before {
                self.kinds.count_able(before.kinds, Comes::Out);
                self.count_aside(before, Comes::Out);
                // A tile that failed on all that are left may now go to one of them.
                self.market.touch(before.kinds);
            }
            if let Some(after) = &after {
                self.kinds.count_able(after.kinds, Comes::In);
                self.count_aside(after, Comes::In);
            }
        }
        let capacity = |counts: Option<Counts>| counts.map_or(0, |counts| counts.capacity);
        self.capacity -= capacity(before);
        self.capacity += capacity(after);
    }

    /// Counts a worker with the jobs that it is set aside for and would serve.
    fn count_aside(&mut self, counts: &Counts, comes: Comes) {
        for id in &counts.aside {
            if let Some(job) = self.jobs.get_mut(id)
                && counts.kinds.contains(job.kind)
            {
                match comes {
                    Comes::In => job.aside_able += 1,
                    Comes::Out => job.aside_able -= 1,
                }
            }
        }
    }
}
