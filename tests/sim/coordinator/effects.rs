//! What the scheduler wants: done in order, after what it waits for is committed.

use model::{Epoch, ImageRef, Span, Timestamp};
use sched::{BlockRef, Command, Effect, Event, ImageState, JobOutcome, JobState};
use session::{BlockVerdict, Retry, Welcome};

use super::writer::Order;
use super::{Coordinator, Later, Wish};
use crate::disk::{Pixels, flaws};
use crate::message::Down;
use crate::plan::Bug;

#[derive(Debug)]
pub(super) enum Held {
    /// An effect; where it is about pixels of an image, also that and its era.
    Effect(Effect, Option<(ImageRef, u32)>),
    /// What follows waits for this record, which may be that of an image that is encoded.
    Until(u64, Option<ImageRef>),
}

impl Coordinator {
    /// Performs what waits for nothing, in order.
    pub(super) fn flush(&mut self, now: Timestamp) {
        if std::mem::replace(&mut self.is_performing, true) {
            return;
        }
        while let Some(held) = self.held.pop_front() {
            match held {
                Held::Until(record, image) if !self.committed.remove(&record) => {
                    self.held.push_front(Held::Until(record, image));
                    break;
                }
                Held::Until(_, image) => {
                    image.into_iter().for_each(|image| self.is_in_place(image))
                }
                Held::Effect(effect, about) => self.perform(now, effect, about),
            }
        }
        self.is_performing = false;
    }

    fn perform(&mut self, now: Timestamp, effect: Effect, about: Option<(ImageRef, u32)>) {
        let (worker, down) = match effect {
            Effect::Welcome { worker, live } => {
                let welcome = Welcome {
                    epoch: Epoch(self.epoch),
                    heartbeat_interval: Span::from_secs(1),
                    liveness_limit: Span::from_secs(4),
                    live,
                };
                (worker, Down::Welcome(welcome))
            }
            Effect::WorkerRefused { worker, refusal } => {
                (worker, Down::Refused(refusal.to_string(), Retry::Later))
            }
            Effect::Lease { worker, lease } => {
                self.witness.leases(worker, &lease);
                (worker, Down::Lease(lease))
            }
            Effect::Adopted {
                worker,
                attempt,
                image,
            } => return self.witness.adopts(worker, attempt, image),
            Effect::Revoke {
                worker, attempt, ..
            } => (worker, Down::Revoke(attempt)),
            Effect::Ack {
                worker,
                attempt,
                rect,
            } => {
                if let Some((image, _)) = about.filter(|&(image, era)| era == self.era(image)) {
                    let block = BlockRef {
                        attempt,
                        image,
                        rect,
                    };
                    self.witness.acknowledges(worker, block);
                }
                (worker, Down::Ack(attempt, rect))
            }
            Effect::RefuseBlock { worker, block, .. } => {
                return self.refuse(worker, block, BlockVerdict::AttemptDead);
            }
            Effect::Encode { image } => {
                // Where it was dropped while this waited, nobody wants it any more.
                let era = about.map_or(0, |(_, era)| era);
                if era != self.era(image) {
                    return;
                }
                let later = Later::Encoded(image, era);
                let took = Span::from_millis(40);
                if self.plan.bug == Some(Bug::DoubleCommit) {
                    self.wishes.push(Wish::Disk(later.clone(), took));
                }
                return self.wishes.push(Wish::Disk(later, took));
            }
            Effect::Forget { worker } => return self.wishes.push(Wish::Close(worker)),
            Effect::GiveUp { image, reason } => {
                return self.tell(now, Event::ImageFailed { image, reason });
            }
            Effect::RenderAgain { image, .. } => {
                self.witness.convicted += 1;
                return self.tell(
                    now,
                    Event::Command {
                        job: image.job,
                        command: Command::Again(image.image),
                    },
                );
            }
            Effect::DropScratch { image } => return self.order(Order::Remove(image)),
            Effect::Submitted { submission, job } => {
                self.witness.jobs.insert(job);
                return self.wishes.push(Wish::Tell(submission.0, job));
            }
            Effect::Commanded { job } => {
                let state = self.sched.job(job).map(|job| job.state);
                if state == Some(JobState::Over(JobOutcome::Cancelled)) {
                    self.witness.cancelled.insert(job);
                }
                return;
            }
            Effect::Incident { .. } => return self.witness.incidents += 1,
            Effect::JobChanged { .. }
            | Effect::Unverified { .. }
            | Effect::JobDone { .. }
            | Effect::DropJob { .. }
            | Effect::ForgetJob { .. }
            | Effect::CommandRefused { .. }
            | Effect::SubmitRefused { .. } => return,
        };
        self.wishes.push(Wish::Send(worker, down));
    }

    pub(super) fn encoded(&mut self, now: Timestamp, image: ImageRef, era: u32) {
        self.witness.places(self.epoch, image, era);
        if era != self.era(image) {
            return;
        }
        if self.disk.is_full {
            let later = Later::Encoded(image, era);
            self.witness.places_not(self.epoch, image, era);
            return self.wishes.push(Wish::Disk(later, Span::from_millis(500)));
        }
        let frame = self.disk.read(image);
        let (missing, wrong) = flaws(image, &frame);
        assert_eq!(missing, 0, "all pixels of {image:?} are there");
        assert!(wrong == 0 || self.plan.troubles.liars > 0, "they are right");
        self.disk.frames.insert(image, frame);
        let film = Pixels::Right.digest();
        self.tell(now, Event::ImageEncoded { image, film });
    }

    /// An image is certainly encoded: its scratch file is needed no more.
    fn is_in_place(&mut self, image: ImageRef) {
        self.order(Order::Remove(image));
        let state = self.sched.image(image).map(|view| view.state);
        if matches!(state, Some(ImageState::Encoded { .. })) {
            self.witness.encoded.insert(image);
        }
    }
}
