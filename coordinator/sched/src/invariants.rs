//! What always holds, in code.

use crate::attempt::Phase;
use crate::timers::Timer;
use crate::work::LIVE_MAX;
use crate::{ImageState, Link, Sched};

impl Sched {
    /// Looks at the whole state and asserts what must hold between two events.
    ///
    /// For tests: it costs as much as all tiles in flight together.
    ///
    /// # Panics
    ///
    /// Where something does not hold, which is a mistake in this crate.
    pub fn check_invariants(&self) {
        self.check_jobs();
        self.check_tiles();
        self.check_attempts();
        self.check_workers();
        assert!(self.changed.is_empty(), "every change was reported");
    }

    fn check_jobs(&self) {
        let over = self.jobs.values().filter(|job| job.is_over()).count();
        assert_eq!(
            over,
            self.over.len(),
            "each job that is over is in the list once"
        );
        assert_eq!(self.submissions.len(), self.jobs.len());
        for (&id, job) in &self.jobs {
            let counts = job.view().images;
            let total = counts.waiting + counts.rendering + counts.encoding;
            let ended = counts.encoded + counts.failed + counts.dropped;
            assert_eq!(total + ended, job.spec.frames.count());
            assert!(!job.is_over() || (total == 0 && job.work.is_empty()));
            assert!(counts.rendering + counts.encoding <= self.config.images_in_flight_max.max(1));
            assert_eq!(job.work.len(), counts.rendering as usize);
            assert_eq!(job.ends().is_some(), job.is_over() && counts.dropped == 0);
            assert!(job.tally.pixels_done <= job.view().pixels);
            let has_tiles = job.has_tiles(&self.config);
            assert_eq!(self.market.has_job(job.spec.revision, id), has_tiles);
            assert!(
                !self.market.is_open(job.spec.revision),
                "what can be leased is"
            );
        }
    }

    fn check_tiles(&self) {
        for job in self.jobs.values() {
            for (&place, work) in &job.work {
                assert_eq!(job.state(place), ImageState::Rendering);
                assert!(!work.pixels.is_complete(), "a complete image is encoded");
                let mut missing = 0;
                let mut live = 0;
                for (index, tile) in (0..).zip(&work.tiles) {
                    missing += tile.missing;
                    live += tile.attempts().count();
                    let rect = work.rect(index);
                    let blocks = rect.blocks().filter(|&block| !work.pixels.covers(block));
                    assert!((tile.missing == 0) == (blocks.count() == 0));
                    let away = tile.attempts().all(|number| {
                        self.workers[&self.attempts[&number].worker].link == Link::Closed
                    });
                    let open = tile.missing > 0 && tile.attempts().count() < LIVE_MAX && away;
                    assert_eq!(
                        work.is_open(index),
                        open,
                        "a tile waits where nobody renders it"
                    );
                }
                assert_eq!(missing + work.pixels.count(), job.spec.window.area());
                assert_eq!(live, work.live.len());
            }
        }
    }

    fn check_attempts(&self) {
        for (&number, attempt) in &self.attempts {
            let job = &self.jobs[&attempt.image.job];
            let place = job
                .place(attempt.image.image)
                .expect("its image is the job's");
            let work = &job.work[&place];
            assert!(work.live.contains(&number));
            let tile = &work.tiles[attempt.tile as usize];
            assert!(tile.missing > 0, "nobody renders a tile that is done");
            assert_eq!(tile.attempts().filter(|&live| live == number).count(), 1);
            let worker = &self.workers[&attempt.worker];
            assert!(worker.live.contains(&number));
            assert_eq!(
                worker.revision, job.spec.revision,
                "a lease goes to the pinned revision"
            );
            // Every lease ends: a limit is set for each.
            assert_eq!(attempt.phase == Phase::Running, attempt.stuck.is_some());
            if let Some(due) = attempt.stuck {
                assert!(self.timers.contains(due, Timer::Stuck(number)));
            }
        }
    }

    fn check_workers(&self) {
        let mut timers = self
            .attempts
            .values()
            .filter(|attempt| attempt.phase == Phase::Running)
            .count();
        let mut live = 0;
        for (&id, worker) in &self.workers {
            live += worker.live.len();
            let running = |number: &&u64| self.attempts[*number].phase == Phase::Running;
            let idle = worker.live.len() - worker.live.iter().filter(running).count();
            assert_eq!(idle, worker.idle as usize);
            assert_eq!(worker.waiting.is_some(), worker.is_idle());
            assert_eq!(worker.load, worker.wants());
            assert!(
                worker
                    .lost
                    .is_some_and(|due| self.timers.contains(due, Timer::Lost(id)))
            );
            timers += 1 + usize::from(worker.waiting.is_some());
        }
        assert_eq!(
            live,
            self.attempts.len(),
            "every live attempt is some worker's"
        );
        assert_eq!(timers, self.timers.len(), "no timer is left behind");
    }
}
