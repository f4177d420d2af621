//! How a history ends: in silence, with another coordinator, and by work.

use model::{Epoch, ImageRef, JobId, Span, Timestamp};
use sched::{Command, Config, Event, ImageState, JobOutcome, JobState, Sched};

use crate::acts::begun;
use crate::history::{History, config};
use crate::situation::{EPOCH, film, worker};

impl History {
    /// Everybody falls silent: every lease ends by a limit.
    pub(crate) fn fall_silent(&mut self) {
        self.wait(Span::from_secs(4));
        assert!(
            self.seen
                .leases
                .keys()
                .all(|&id| self.sched.attempt(id).is_none())
        );
        assert_eq!(self.sched.workers().count(), 0);
        assert_eq!(self.sched.next_deadline(), None);
    }

    /// The coordinator dies; another one is told what was committed.
    pub(crate) fn begin_anew(&mut self) {
        let mut sched = Sched::new(Config {
            epoch: Epoch(EPOCH.0 + 1),
            ..config()
        });
        for (event, _) in self.told.iter().filter(|(event, _)| event.is_durable()) {
            sched.handle(Timestamp(1), event.clone(), &mut Vec::new());
            sched.check_invariants();
        }
        assert_eq!(sched.jobs().count(), self.sched.jobs().count());
        for (before, after) in self.sched.jobs().zip(sched.jobs()) {
            assert_eq!(after.job, before.job);
            assert_eq!(after.state, before.state, "{before:?} {after:?}");
            assert_eq!(after.pixels_done, before.pixels_done);
            let rank = |job: &sched::JobView<'_>| (job.priority, job.share, job.paused);
            assert_eq!(rank(&after), rank(&before));
            assert_eq!(after.after, before.after);
            for (before, after) in self.sched.images(before.job).zip(sched.images(after.job)) {
                assert_eq!(after.pixels_done, before.pixels_done);
                let begun = |view: sched::ImageView| match view.state {
                    // What was still to be verified is forgotten.
                    ImageState::Rendering if view.pixels_done == view.pixels => {
                        ImageState::Encoding
                    }
                    ImageState::Rendering => ImageState::Waiting,
                    state => state,
                };
                assert_eq!(begun(after), begun(before));
            }
            assert_eq!(sched.failures(before.job), self.sched.failures(before.job));
        }
        self.sched = sched;
        self.now = Timestamp(1);
        let leases = std::mem::take(&mut self.seen.leases).into_values();
        self.begun = leases
            .map(|(worker, lease)| (worker, begun(&lease)))
            .collect();
        // What was being encoded is encoded anew.
        let jobs: Vec<JobId> = self.sched.jobs().map(|job| job.job).collect();
        for job in jobs {
            for view in self.sched.images(job) {
                let image = ImageRef {
                    job,
                    image: view.image,
                };
                if view.state == ImageState::Encoding {
                    self.seen.encoding.insert(image);
                }
            }
        }
    }

    /// Diligent workers of both revisions, and a diligent user, finish what is left.
    pub(crate) fn finish(&mut self) {
        let jobs: Vec<JobId> = self.sched.jobs().map(|job| job.job).collect();
        for &job in &jobs {
            let command = Command::Resume;
            self.tell(Event::Command { job, command });
        }
        for id in [0, 2, 3] {
            // They go on with what they had begun, as far as that may be.
            self.join(id, u64::MAX);
            self.tell(Event::Credit {
                worker: worker(id),
                credit: 2,
            });
        }
        for _ in 0..10_000 {
            let live = self
                .seen
                .leases
                .keys()
                .find(|&&attempt| self.sched.attempt(attempt).is_some());
            if let Some(&attempt) = live {
                let lease = self.seen.leases[&attempt].1.clone();
                for rect in lease.blocks() {
                    self.block(attempt, &lease, (rect, 1));
                }
            } else if let Some(image) = self.seen.encoding.pop_first() {
                self.tell(Event::ImageEncoded {
                    image,
                    film: film(1),
                });
            } else if let Some(job) = self.waits_in_vain() {
                let command = Command::Cancel;
                self.tell(Event::Command { job, command });
            } else {
                break;
            }
        }
        for job in self.sched.jobs() {
            assert_ne!(job.state, JobState::Running, "{job:?}");
            assert_eq!(job.attempts_live, 0);
        }
    }

    /// A job that waits for one that is over and not finished.
    fn waits_in_vain(&self) -> Option<JobId> {
        let is_over = |job: &JobId| {
            let state = self.sched.job(*job).map(|job| job.state);
            matches!(
                state,
                Some(JobState::Over(JobOutcome::Failed | JobOutcome::Cancelled))
            )
        };
        let mut jobs = self.sched.jobs();
        let vain = jobs.find(|job| job.after.iter().any(is_over));
        vain.map(|job| job.job)
    }
}
