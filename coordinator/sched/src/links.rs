//! What workers say of themselves, and what their silence means.

use alloc::format;
use alloc::vec::Vec;

use model::{AttemptId, Revision, Running, Span, WorkerId};

use crate::attempt::Phase;
use crate::timers::Timer;
use crate::worker::Worker;
use crate::{Effect, Link, LinkId, RevokeReason, Sched, WorkerRefusal};

impl Sched {
    pub(crate) fn worker_joined(
        &mut self,
        id: WorkerId,
        (link, revision, threads): (LinkId, Revision, u32),
        held: &[AttemptId],
        out: &mut Vec<Effect>,
    ) {
        if self
            .workers
            .get(&id)
            .is_some_and(|known| link < known.newest)
        {
            return;
        }
        if let Err(refusal) = self.admit_worker(id, revision, threads) {
            out.push(Effect::WorkerRefused {
                worker: id,
                refusal,
            });
            return;
        }
        let now = self.now;
        let worker = self
            .workers
            .entry(id)
            .or_insert_with(|| Worker::new(revision, threads, link, now));
        if link > worker.newest {
            // The worker says anew what it wants, when it has read what is still its own.
            worker.credit = 0;
        }
        worker.newest = link;
        worker.link = Link::Open;
        worker.threads = threads;
        self.heard(id);
        let live: Vec<AttemptId> = held
            .iter()
            .copied()
            .filter(|&attempt| self.owned(id, attempt).is_some())
            .collect();
        self.keep_only(id, &live);
        out.push(Effect::Welcome { worker: id, live });
        self.worker_changed(id);
    }

    fn admit_worker(
        &self,
        id: WorkerId,
        theirs: Revision,
        threads: u32,
    ) -> Result<(), WorkerRefusal> {
        let known = self.workers.get(&id);
        let wanted = self.config.revision.or(known.map(|known| known.revision));
        if let Some(wanted) = wanted.filter(|&wanted| wanted != theirs) {
            return Err(WorkerRefusal::WrongRevision { theirs, wanted });
        }
        if threads == 0 {
            return Err(WorkerRefusal::NoThreads);
        }
        let max = self.config.limits.workers_max;
        if known.is_none() && self.workers.len() >= max as usize {
            return Err(WorkerRefusal::TooMany { max });
        }
        Ok(())
    }

    /// Ends a worker's attempts that it does not have (their lease was lost on the
    /// way), and takes up the others where they are.
    fn keep_only(&mut self, id: WorkerId, held: &[AttemptId]) {
        let held: alloc::collections::BTreeSet<u64> = held.iter().map(|id| id.number).collect();
        for number in self.attempts_of(id) {
            if !held.contains(&number) {
                self.end_attempt(number);
            } else if let Some(attempt) = self.attempts.get(&number) {
                self.reconsider(attempt.image, attempt.tile);
            }
        }
    }

    pub(crate) fn credit(&mut self, id: WorkerId, credit: u32) {
        self.heard(id);
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.credit = credit.min(self.config.limits.credit_max);
        }
        self.worker_changed(id);
    }

    pub(crate) fn heartbeat(&mut self, id: WorkerId, running: &[Running], out: &mut Vec<Effect>) {
        self.heard(id);
        if !self.workers.contains_key(&id) {
            return;
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
            let attempt = self.attempts.get_mut(&number).expect("it is live");
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
        let attempt = self.attempts.get_mut(&number).expect("it has a limit");
        let id = attempt.worker;
        let (before, after) = (attempt.phase, attempt.phase_now());
        attempt.phase = after;
        attempt.limit = limit;
        let due = (after == Phase::Running).then(|| self.now + limit);
        self.timers
            .set(Timer::Stuck(number), &mut attempt.stuck, due);
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.idle += u32::from(after != Phase::Running);
            worker.idle -= u32::from(before != Phase::Running);
            worker.patience = limit;
        }
        self.rearm_waiting(id);
    }

    /// How long a live attempt may take over its next block.
    fn block_limit(&self, number: u64) -> Option<Span> {
        let attempt = self.attempts.get(&number)?;
        let job = self.jobs.get(&attempt.image.job)?;
        let work = job.work.get(&job.place(attempt.image.image)?)?;
        let failures = work.tiles[attempt.tile as usize].failures;
        Some(job.block_limit(&self.config, failures))
    }

    pub(crate) fn given_back(&mut self, id: WorkerId, attempts: &[AttemptId]) {
        self.heard(id);
        for &attempt in attempts {
            if let Some(number) = self.owned(id, attempt) {
                self.end_attempt(number);
            }
        }
    }

    pub(crate) fn link_closed(&mut self, id: WorkerId, link: LinkId) {
        let Some(worker) = self.workers.get_mut(&id) else {
            return;
        };
        if worker.newest != link || worker.link == Link::Closed {
            return;
        }
        worker.link = Link::Closed;
        self.worker_changed(id);
        for number in self.attempts_of(id) {
            let attempt = &self.attempts[&number];
            self.reconsider(attempt.image, attempt.tile);
        }
    }

    pub(crate) fn goodbye(&mut self, id: WorkerId, out: &mut Vec<Effect>) {
        for number in self.attempts_of(id) {
            self.end_attempt(number);
        }
        self.forget(id, out);
    }

    /// Ends what is due.
    pub(crate) fn tick(&mut self, out: &mut Vec<Effect>) {
        while let Some(timer) = self.timers.due(self.now) {
            match timer {
                Timer::Stuck(number) => self.stuck(number, out),
                Timer::Waiting(id) => self.idle_for_long(id, out),
                Timer::Lost(id) => self.lost(id, out),
            }
        }
    }

    fn stuck(&mut self, number: u64, out: &mut Vec<Effect>) {
        let Some(attempt) = self.attempts.get(&number).cloned() else {
            return;
        };
        self.revoke(number, RevokeReason::NoProgress, out);
        let seconds = attempt.limit.0 / 1_000_000;
        let reason = format!("no block for {seconds} s on worker {}", attempt.worker);
        self.charge_failure(&attempt, reason, out);
    }

    /// Nothing of a worker moves, and it holds attempts that wait to be started or delivered.
    fn idle_for_long(&mut self, id: WorkerId, out: &mut Vec<Effect>) {
        for number in self.attempts_of(id) {
            let Some(attempt) = self.attempts.get(&number).cloned() else {
                continue;
            };
            if attempt.phase != Phase::Running {
                self.revoke(number, RevokeReason::NoProgress, out);
                let doing = match attempt.phase {
                    Phase::Ahead => "started",
                    Phase::Running | Phase::Delivering => "delivered",
                };
                self.charge_failure(&attempt, format!("never {doing} by worker {id}"), out);
            }
        }
    }

    fn lost(&mut self, id: WorkerId, out: &mut Vec<Effect>) {
        for number in self.attempts_of(id) {
            if let Some(attempt) = self.end_attempt(number)
                && attempt.phase != Phase::Ahead
            {
                self.charge_loss(&attempt, out);
            }
        }
        self.forget(id, out);
    }

    /// Removes a worker that holds nothing.
    fn forget(&mut self, id: WorkerId, out: &mut Vec<Effect>) {
        let Some(mut worker) = self.workers.remove(&id) else {
            return;
        };
        self.timers.set(Timer::Lost(id), &mut worker.lost, None);
        self.timers
            .set(Timer::Waiting(id), &mut worker.waiting, None);
        self.market
            .place_worker((worker.revision, id), &mut worker.load, None);
        out.push(Effect::Forget { worker: id });
    }

    /// A worker gave a sign of life.
    pub(crate) fn heard(&mut self, id: WorkerId) {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.heard = self.now;
            let due = Some(self.now + self.config.liveness_limit);
            self.timers.set(Timer::Lost(id), &mut worker.lost, due);
        }
    }

    /// Something of a worker moved: where it renders nothing, what it holds may wait
    /// for its patience again. While it renders, the limit of that holds.
    pub(crate) fn rearm_waiting(&mut self, id: WorkerId) {
        if let Some(worker) = self.workers.get_mut(&id) {
            let due = worker.is_idle().then(|| self.now + worker.patience);
            self.timers
                .set(Timer::Waiting(id), &mut worker.waiting, due);
        }
    }

    /// Sees that a worker stands where it belongs in the market.
    pub(crate) fn worker_changed(&mut self, id: WorkerId) {
        if let Some(worker) = self.workers.get_mut(&id) {
            let load = worker.wants();
            self.market
                .place_worker((worker.revision, id), &mut worker.load, load);
        }
    }

    fn attempts_of(&self, id: WorkerId) -> Vec<u64> {
        self.workers
            .get(&id)
            .into_iter()
            .flat_map(|worker| worker.live.iter().copied())
            .collect()
    }
}
