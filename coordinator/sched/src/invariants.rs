//! What always holds, in code.

use alloc::vec::Vec;

use crate::attempt::Phase;
use crate::tile::LIVE_MAX;
use crate::timers::Timer;
use crate::{ImageState, JobOutcome, Link, Sched};

impl Sched {
    /// Looks at the whole state and asserts what must hold between two events.
    ///
    /// For tests: it costs as much as all that waits in flight together, and as all workers and jobs
    /// multiplied with each other.
    ///
    /// # Panics
    ///
    /// Where something does not hold, which is a mistake in this crate.
    pub fn check_invariants(&self) {
        self.check_jobs();
        self.check_waiting();
        self.check_tiles();
        self.check_attempts();
        self.check_workers();
        self.check_market();
        assert!(self.changed.is_empty(), "every change was reported");
        assert!(self.unlooked.is_empty(), "every check was looked at");
        assert!(self.wrong.count() <= self.images as usize);
        assert!(self.expelled.len() <= self.config.limits.expelled_max);
    }

    fn check_jobs(&self) {
        let over = self.jobs.values().filter(|job| job.is_over()).count();
        assert_eq!(
            over,
            self.over.len(),
            "each job that is over is in the list once"
        );
        assert_eq!(self.submissions.len(), self.jobs.len());
        let images = self.jobs.values().map(|job| job.spec.frames.count());
        assert_eq!(images.sum::<u32>(), self.images);
        for (&id, job) in &self.jobs {
            let counts = job.view().images;
            let total = counts.waiting + counts.rendering + counts.encoding;
            let ended = counts.encoded + counts.failed + counts.dropped;
            assert_eq!(total + ended, job.spec.frames.count());
            assert!(!job.is_over() || (total == 0 && job.work.is_empty()));
            assert_eq!(job.work.len(), counts.rendering as usize);
            assert_eq!(job.ends().is_some(), job.is_over() && counts.dropped == 0);
            assert_eq!(job.tally.attempts_live as usize, job.live().count());
            let waits = (0..job.spec.frames.count()).filter(|&place| job.waits(place));
            assert!(
                waits
                    .clone()
                    .all(|place| job.state(place) == ImageState::Waiting),
                "what is next has not begun"
            );
            if job.outcome != Some(JobOutcome::Cancelled) {
                assert_eq!(waits.count(), counts.waiting as usize);
            }
            let pixels: u64 = job.work.values().map(|work| work.pixels.count()).sum();
            let whole = u64::from(counts.encoding + counts.encoded) * job.spec.window.area();
            assert_eq!(
                job.tally.pixels_done,
                pixels + whole,
                "no pixel is counted twice"
            );
            assert_eq!(
                job.stands,
                job.belongs(&self.config),
                "job {id} stands where it belongs"
            );
        }
    }

    /// Whoever waits for a job is known to it, and waits for one that is not finished.
    fn check_waiting(&self) {
        for (before, by) in &self.waited_for {
            assert!(!by.is_empty());
            let before_outcome = self.jobs[before].outcome;
            assert_ne!(before_outcome, Some(JobOutcome::Finished));
            assert!(by.iter().all(|next| self.jobs[next].after.contains(before)));
        }
        for (id, job) in &self.jobs {
            let knows = |before| self.waited_for[before].contains(id);
            assert!(job.after.iter().all(knows));
        }
    }

    fn check_tiles(&self) {
        for job in self.jobs.values() {
            for (&place, work) in &job.work {
                assert_eq!(job.state(place), ImageState::Rendering);
                work.check();
                for (number, tile) in work.tiles.iter() {
                    assert!(tile.live_count() <= LIVE_MAX);
                    let is_away =
                        |number| self.workers[self.attempts[number].worker].link == Link::Closed;
                    let away = tile.attempts().all(is_away);
                    assert_eq!(
                        work.is_shared(number),
                        away && tile.live_count() < LIVE_MAX && tile.check.is_none(),
                        "a tile is open where nobody who can be reached renders it"
                    );
                    for attempt in tile.attempts() {
                        let enlisted = self.attempts[attempt].enlisted;
                        let alone = tile.live_count() == 1 && !work.is_shared(number);
                        assert!(
                            enlisted.is_none() || alone,
                            "only one that is alone is helped"
                        );
                    }
                }
            }
            for &(key, number) in &job.ending {
                assert_eq!(self.attempts[number].enlisted, Some(key));
            }
        }
        let listed = self.jobs.values().map(|job| job.ending.len());
        let enlisted = self.attempts.iter();
        let enlisted = enlisted.filter(|(_, attempt)| attempt.enlisted.is_some());
        assert_eq!(listed.sum::<usize>(), enlisted.count());
    }

    fn check_attempts(&self) {
        for (number, attempt) in self.attempts.iter() {
            let job = &self.jobs[&attempt.image.job];
            let place = job
                .place(attempt.image.image)
                .expect("its image is the job's");
            let tile = job.work[&place].tiles.get(attempt.tile);
            let tile = tile.expect("its tile is there");
            assert_eq!(tile.rect, attempt.rect);
            assert_eq!(tile.attempts().filter(|&live| live == number).count(), 1);
            let worker = &self.workers[attempt.worker];
            assert!(worker.live.contains(&number));
            assert_eq!(
                worker.offer.revision, job.spec.revision,
                "a lease goes to the pinned revision"
            );
            // Every lease ends: a limit is set for each.
            let runs = attempt.phase == Phase::Running;
            assert_eq!(runs, attempt.stuck.due().is_some());
        }
    }

    fn check_workers(&self) {
        let stuck = self.attempts.iter();
        let mut timers: usize = stuck
            .map(|(number, attempt)| self.timers.check(Timer::Stuck(number), attempt.stuck))
            .sum();
        let mut live = 0;
        let mut capacity = 0;
        for (place, worker) in self.workers.iter() {
            live += worker.live.len();
            assert!(worker.live.is_sorted());
            let running = |number: &&u64| self.attempts[**number].phase == Phase::Running;
            let idle = worker.live.len() - worker.live.iter().filter(running).count();
            assert_eq!(idle, worker.idle as usize);
            let costs = worker.live.iter().map(|number| self.attempts[*number].cost);
            assert_eq!(costs.sum::<u64>(), worker.backlog);
            assert_eq!(worker.kinds, self.kinds.served_by(&worker.offer));
            let is_queue = worker.offer.queue.is_some();
            assert_eq!(self.queues.contains(&place), is_queue);
            let may_be_late = worker.is_idle() && !is_queue;
            assert_eq!(worker.waiting.due().is_some(), may_be_late);
            let tiles: u32 = worker.images.values().sum();
            let counted = if is_queue { worker.live.len() } else { 0 };
            assert_eq!(tiles as usize, counted);
            assert_eq!(worker.seat, worker.wants(place));
            assert_eq!(worker.counted, worker.counts());
            capacity += worker.counted.as_ref().map_or(0, |counts| counts.capacity);
            assert!(worker.lost.due().is_some());
            let is_aside = worker.aside.farm().is_some() || !worker.aside.jobs().is_empty();
            assert_eq!(worker.aside.alarm.due().is_some(), is_aside);
            timers += self.timers.check(Timer::Lost(place), worker.lost);
            timers += self.timers.check(Timer::Waiting(place), worker.waiting);
            timers += self.timers.check(Timer::LetBack(place), worker.aside.alarm);
        }
        for (&id, job) in &self.jobs {
            timers += self.timers.check(Timer::Unverified(id), job.unverified);
            let checks = job.work.values().flat_map(|work| &work.checks);
            let wait = self.config.verify_wait;
            let in_time = |since| {
                let due = job.unverified.due();
                due.is_some_and(|due| due <= since + wait)
            };
            for waiting in checks {
                assert!(in_time(waiting.since), "no check waits for ever");
            }
        }
        for (&name, &number) in &self.adopted {
            assert!(name.epoch < self.config.epoch);
            assert_eq!(self.attempts[number].name, Some(name));
        }
        let named = self.attempts.iter().filter(|(_, live)| live.name.is_some());
        assert_eq!(named.count(), self.adopted.len());
        assert_eq!(capacity, self.capacity);
        assert_eq!(
            live,
            self.attempts.len(),
            "every live attempt is some worker's"
        );
        assert_eq!(timers, self.timers.len(), "no timer is left behind");
    }

    /// What can be leased is.
    fn check_market(&self) {
        for (id, job) in &self.jobs {
            let able = self.workers.iter();
            let able =
                able.filter(|(_, worker)| worker.is_able() && worker.kinds.contains(job.kind));
            assert_eq!(able.count(), self.kinds.able(job.kind) as usize);
            let aside = self.workers.iter();
            let aside = aside.filter(|(_, worker)| worker.aside.job(*id).is_some());
            let aside: Vec<_> = aside.map(|(_, worker)| worker).collect();
            assert_eq!(aside.len(), job.aside as usize);
            let serves = aside
                .iter()
                .filter(|worker| worker.is_able() && worker.kinds.contains(job.kind));
            assert_eq!(serves.count(), job.aside_able as usize);
            if job.stands.open.is_none() {
                continue;
            }
            for (place, worker) in self.workers.iter() {
                // Of those whose time is limited only the first few are looked at.
                let is_limited = worker.ends.is_some();
                let wants = worker.seat.is_some() && worker.kinds.contains(job.kind) && !is_limited;
                assert!(
                    !wants || self.may_take(place, *id).is_none(),
                    "what can be leased is"
                );
            }
        }
        let used: alloc::collections::BTreeSet<_> =
            self.jobs.values().map(|job| job.kind).collect();
        assert_eq!(used.len(), self.kinds.len(), "no kind is left behind");
    }
}
