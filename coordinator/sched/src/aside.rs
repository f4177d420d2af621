//! Workers that fail where others succeed are set aside, and let back after a while.
//!
//! A failure alone blames nobody: the tile may be at fault. It is when another worker
//! has done the tile that the one that failed is known to be. A tile that it does itself
//! clears it: only faults in a row tell a broken worker from bad luck. At most half of the
//! workers are set aside for a job: where more fail, they are not what is broken.

use alloc::collections::{BTreeMap, VecDeque};
use alloc::vec::Vec;

use model::{JobId, Timestamp, WorkerId};

use crate::roster::Place;
use crate::timers::{Alarm, Timer};
use crate::{Config, Effect, RevokeReason, Sched};

/// Most jobs of which a worker's faults are remembered; the oldest are forgotten.
const JOBS_REMEMBERED: usize = 16;

/// A worker whose pixels were wrong is set aside for so many times as long as one that fails.
const EXPELLED_FOR: u64 = 12;

/// What a worker is set aside for, and why.
#[derive(Clone, Debug, Default)]
pub(crate) struct Aside {
    /// Tiles of a job that it failed and others did, since it did one itself.
    faults: Vec<(JobId, u32)>,
    /// Jobs of which it gets no tile, and until when.
    jobs: BTreeMap<JobId, Timestamp>,
    /// Until when it gets no tile at all, since it failed.
    farm: Option<Timestamp>,
    /// Until when it gets no tile at all, since its pixels were wrong.
    expelled: Option<Timestamp>,
    /// When the first of these is over.
    pub(crate) alarm: Alarm,
}

/// What another fault of a worker means for it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Verdict {
    Nothing,
    AsideForJob,
}

impl Aside {
    /// Until when the worker gets no tile at all.
    pub(crate) fn farm(&self) -> Option<Timestamp> {
        self.farm.max(self.expelled)
    }

    /// The same, where that is for wrong pixels.
    pub(crate) fn expelled(&self) -> Option<Timestamp> {
        self.expelled
    }

    /// Until when it gets no tile of a job.
    pub(crate) fn job(&self, job: JobId) -> Option<Timestamp> {
        self.jobs.get(&job).copied()
    }

    /// The jobs of which it gets no tile, in order.
    pub(crate) fn jobs(&self) -> Vec<JobId> {
        // Mostly there are none, and this is asked at every event.
        match self.jobs.is_empty() {
            true => Vec::new(),
            false => self.jobs.keys().copied().collect(),
        }
    }

    fn fails(&mut self, job: JobId, now: Timestamp, config: &Config) -> Verdict {
        let known = self.faults.iter_mut().find(|(of, _)| *of == job);
        let faults = match known {
            Some((_, faults)) => faults,
            None => {
                if self.faults.len() >= JOBS_REMEMBERED {
                    self.faults.remove(0);
                }
                self.faults.push((job, 0));
                let (_, faults) = self.faults.last_mut().expect("it was just added");
                faults
            }
        };
        *faults += 1;
        if *faults < config.faults_max || self.job(job).is_some() {
            return Verdict::Nothing;
        }
        self.faults.retain(|&(of, _)| of != job);
        let until = now + config.aside;
        self.jobs.insert(job, until);
        if self.jobs.len() >= config.jobs_aside_max as usize {
            self.farm = Some(until);
        }
        Verdict::AsideForJob
    }

    /// Gets no tile of a job until then, whatever else; whether that is news.
    fn suspend(&mut self, job: JobId, until: Timestamp) -> bool {
        let is_new = self.job(job).is_none();
        if is_new {
            self.jobs.insert(job, until);
        }
        is_new
    }

    /// The worker did a tile of a job.
    fn succeeds(&mut self, job: JobId) {
        self.faults.retain(|&(of, _)| of != job);
    }

    /// Lets the worker back to what its time is over for; says which jobs those are.
    fn let_back(&mut self, now: Timestamp) -> Vec<JobId> {
        let is_over = |until: Timestamp| until <= now;
        self.farm = self.farm.filter(|&until| !is_over(until));
        self.expelled = self.expelled.filter(|&until| !is_over(until));
        let back = self.jobs.iter().filter(|&(_, &until)| is_over(until));
        let back = back.map(|(&job, _)| job).collect();
        self.jobs.retain(|_, &mut until| !is_over(until));
        back
    }

    fn next(&self) -> Option<Timestamp> {
        let jobs = self.jobs.values().copied();
        jobs.chain(self.farm).chain(self.expelled).min()
    }
}

/// Workers whose pixels were wrong, whatever became of their links, in the order in which they were expelled.
#[derive(Clone, Debug, Default)]
pub(crate) struct Expelled(VecDeque<(u64, Timestamp)>);

impl Expelled {
    /// Remembers a worker by what stays the same when its process is started again; forgets those whose time is over, and the
    /// first where there are more than `max`.
    fn add(&mut self, worker: WorkerId, (now, until): (Timestamp, Timestamp), max: usize) {
        self.0.retain(|&(id, until)| id != worker.id && until > now);
        self.0.push_back((worker.id, until));
        while self.0.len() > max {
            self.0.pop_front();
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    fn until(&self, worker: WorkerId, now: Timestamp) -> Option<Timestamp> {
        let entry = self.0.iter().find(|&&(id, _)| id == worker.id);
        entry.map(|&(_, until)| until).filter(|&until| until > now)
    }
}

impl Sched {
    /// A tile is done at which these workers had failed, by whom that may be.
    pub(crate) fn blame(
        &mut self,
        job: JobId,
        failed_on: &[WorkerId],
        done_by: WorkerId,
        out: &mut Vec<Effect>,
    ) {
        let guilty = failed_on.iter().filter(|&&id| id != done_by);
        let guilty: Vec<Place> = guilty.filter_map(|&id| self.workers.place(id)).collect();
        for place in guilty {
            self.charge_fault(place, job, out);
        }
    }

    /// A worker did a tile.
    pub(crate) fn clear(&mut self, id: WorkerId, job: JobId) {
        if let Some(place) = self.workers.place(id) {
            self.workers[place].aside.succeeds(job);
        }
    }

    /// A worker did something wrong for a job that is not the job's fault.
    pub(crate) fn charge_fault(&mut self, place: Place, job: JobId, out: &mut Vec<Effect>) {
        // Where most workers fail it is not their fault.
        let aside = self.jobs.get(&job).map_or(0, |job| job.aside);
        if (aside as usize + 1) * 2 > self.workers.len() {
            return;
        }
        let worker = &mut self.workers[place];
        if worker.aside.fails(job, self.now, &self.config) == Verdict::Nothing {
            return;
        }
        self.set_aside(place, job, out);
    }

    /// A worker gets no more tiles of a job for a while.
    fn set_aside(&mut self, place: Place, job: JobId, out: &mut Vec<Effect>) {
        let worker = &mut self.workers[place];
        let next = worker.aside.next();
        self.timers
            .set(Timer::LetBack(place), &mut worker.aside.alarm, next);
        if let Some(job) = self.jobs.get_mut(&job) {
            job.aside += 1;
        }
        self.call_back_ahead(place, Some(job), RevokeReason::CalledBack, out);
        self.worker_changed(place);
        self.market.touch(self.workers[place].kinds);
    }

    /// Nobody knows yet whether a worker's pixels are right: it gets no more of the job until that is decided, or for a while.
    pub(crate) fn doubt(&mut self, id: WorkerId, job: JobId, out: &mut Vec<Effect>) {
        let until = self.now + self.config.aside;
        if let Some(place) = self.workers.place(id)
            && self.workers[place].aside.suspend(job, until)
        {
            self.set_aside(place, job, out);
        }
    }

    /// A worker's pixels were right.
    pub(crate) fn acquit(&mut self, id: WorkerId, job: JobId) {
        let Some(place) = self.workers.place(id) else {
            return;
        };
        let aside = &mut self.workers[place].aside;
        if aside.job(job).is_some() {
            aside.jobs.remove(&job);
            let next = aside.next();
            self.timers.set(
                Timer::LetBack(place),
                &mut self.workers[place].aside.alarm,
                next,
            );
            if let Some(job) = self.jobs.get_mut(&job) {
                job.aside -= 1;
            }
            self.worker_changed(place);
            self.market.touch(self.workers[place].kinds);
        }
    }

    /// A worker's pixels were wrong: it gets no tile of anything for long, whenever it comes back.
    pub(crate) fn expel(&mut self, id: WorkerId, out: &mut Vec<Effect>) {
        let until = self.now + self.config.aside.times(EXPELLED_FOR);
        let max = self.config.limits.expelled_max;
        self.expelled.add(id, (self.now, until), max);
        if let Some(place) = self.workers.place(id) {
            self.stays_expelled(place);
            self.call_back_ahead(place, None, RevokeReason::Differs, out);
            self.worker_changed(place);
            self.market.touch(self.workers[place].kinds);
        }
    }

    /// Whether a worker's pixels were wrong, and its time is not over.
    pub(crate) fn is_expelled(&self, worker: WorkerId) -> bool {
        self.expelled.until(worker, self.now).is_some()
    }

    /// Sees that a worker that was expelled, under this or an earlier incarnation, gets no tile.
    pub(crate) fn stays_expelled(&mut self, place: Place) {
        let worker = &mut self.workers[place];
        let Some(until) = self.expelled.until(worker.id, self.now) else {
            return;
        };
        worker.aside.expelled = Some(until);
        let next = worker.aside.next();
        self.timers
            .set(Timer::LetBack(place), &mut worker.aside.alarm, next);
        self.look_at_all_checks();
    }

    /// The time of a worker that was set aside is over.
    pub(crate) fn let_back(&mut self, place: Place) {
        let worker = &mut self.workers[place];
        let back = worker.aside.let_back(self.now);
        let next = worker.aside.next();
        self.timers
            .set(Timer::LetBack(place), &mut worker.aside.alarm, next);
        for job in back {
            if let Some(job) = self.jobs.get_mut(&job) {
                job.aside -= 1;
            }
        }
        self.worker_changed(place);
        self.market.touch(self.workers[place].kinds);
    }

    /// Calls back what a worker holds and cannot have started, of one job or of all.
    pub(crate) fn call_back_ahead(
        &mut self,
        place: Place,
        job: Option<JobId>,
        reason: RevokeReason,
        out: &mut Vec<Effect>,
    ) {
        let live = self.workers[place].live.clone();
        let of_job = |number: &u64| job.is_none_or(|job| self.attempts[*number].image.job == job);
        let ahead: Vec<u64> = live
            .into_iter()
            .filter(|number| of_job(number) && self.is_ahead(*number))
            .collect();
        for number in ahead {
            self.revoke(number, reason, out);
        }
    }
}
