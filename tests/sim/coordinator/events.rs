//! What the scheduler is told, and what of it is durable.

use model::{ImageRef, Span, Timestamp};
use sched::{Command, Effect, Event, ImageState, JobOutcome, Sched};
use store::Entry;

use super::Coordinator;
use super::effects::Held;
use super::writer::Order;
use crate::plan::Bug;

/// Effects that wait for a commit.
const HELD_MAX: usize = 4_000;

/// The whole state is looked at after so many events; sched's own histories look after each.
const CHECK_EVERY: u64 = 64;

impl Coordinator {
    /// Tells the scheduler; where the event is durable, what it wants waits for the commit.
    pub(crate) fn tell(&mut self, now: Timestamp, mut event: Event) {
        self.events += 1;
        let told = event.clone();
        if let Event::Submit(submission) = &mut event
            && self.plan.bug == Some(Bug::NoPatience)
        {
            submission.after.clear();
        }
        let mut effects = Vec::new();
        let is_known = |sched: &Sched, event: &Event| match event {
            Event::Submit(spec) => sched.submitted(spec.submission).is_some(),
            _ => false,
        };
        let was_known = is_known(&self.sched, &told);
        self.sched
            .handle(Timestamp(now.0 + self.skew), event, &mut effects);
        if self.events.is_multiple_of(CHECK_EVERY) {
            self.sched.check_invariants();
        }
        if !was_known
            && let Event::Submit(submission) = &told
            && let Some(job) = self.sched.submitted(submission.submission)
        {
            self.witness.waits(job, &submission.after);
        }
        for effect in &effects {
            match effect {
                Effect::DropScratch { image } => self.end_era(*image),
                Effect::ForgetJob { job } => self.witness.forget_job(*job),
                Effect::JobDone {
                    job,
                    outcome: JobOutcome::Finished,
                } => self.witness.finishes(*job),
                Effect::Lease { lease, .. } => self.witness.check_begun(lease.image.job),
                _ => {}
            }
        }
        if !was_known && let Some(entry) = self.record(now, told, &effects) {
            self.records += 1;
            let image = match &entry {
                Entry::ImageEncoded { image, .. } => Some(*image),
                _ => None,
            };
            self.held.push_back(Held::Until(self.records, image));
            self.order(Order::Record(Box::new(entry), Some(self.records)));
        }
        for effect in effects {
            if let Effect::ForgetJob { job } = effect {
                self.order(Order::Record(Box::new(Entry::Forgotten { job }), None));
            }
            let about = self.about(&effect);
            self.held.push_back(Held::Effect(effect, about));
        }
        assert!(self.held.len() <= HELD_MAX, "effects that wait are bounded");
        self.flush(now);
    }

    pub(super) fn about(&self, effect: &Effect) -> Option<(ImageRef, u32)> {
        let image = match effect {
            Effect::Ack { attempt, .. } => self.witness.image_of(*attempt)?,
            Effect::Encode { image } => *image,
            _ => return None,
        };
        Some((image, self.era(image)))
    }

    /// What is to be committed of an event, if it changed anything.
    fn record(&mut self, now: Timestamp, event: Event, effects: &[Effect]) -> Option<Entry> {
        // The calendar may say anything.
        let unix_ms = now.0.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 20;
        match event {
            Event::Submit(submission) => {
                let job = self.sched.submitted(submission.submission)?;
                Some(Entry::Submitted {
                    job,
                    unix_ms,
                    submission,
                    about: String::new(),
                })
            }
            Event::Command { job, command } => {
                let is_refused = |effect: &Effect| matches!(effect, Effect::CommandRefused { .. });
                if effects.iter().any(is_refused) {
                    return None;
                }
                match command {
                    Command::Again(image) => self.end_era(ImageRef { job, image }),
                    Command::Remove => self.witness.forget_job(job),
                    _ => {}
                }
                if let Command::Again(image) = command {
                    self.witness.encoded.remove(&ImageRef { job, image });
                }
                Some(Entry::Command {
                    job,
                    unix_ms,
                    command,
                })
            }
            Event::ImageEncoded { image, film } => {
                let view = self.sched.image(image)?;
                if view.state != (ImageState::Encoded { film }) {
                    return None;
                }
                self.end_era(image);
                Some(Entry::ImageEncoded {
                    image,
                    unix_ms,
                    film,
                    blocks: 1,
                    render_time: Span(1),
                    about: String::new(),
                })
            }
            Event::ImageFailed { image, reason } => {
                let view = self.sched.image(image)?;
                (view.state == ImageState::Failed).then_some(Entry::ImageFailed {
                    image,
                    unix_ms,
                    reason,
                })
            }
            _ => None,
        }
    }
}
