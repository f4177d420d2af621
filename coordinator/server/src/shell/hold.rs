//! Effects wait until what they follow from is durable.

use std::collections::VecDeque;

use image::FinishedFile;
use model::{ImageRef, JobId};
use sched::{Command, Effect, Event, ImageState};
use store::Entry;

use super::Shell;
use crate::about::{FileAbout, ImageAbout};
use crate::clock::unix_ms;
use crate::storage::{Era, Ticket};

/// Most effects that wait, but for those of one more input.
const HELD_MAX: usize = 16_384;

/// Effects, and the records that they wait for, in order.
#[derive(Debug, Default)]
pub(super) struct Held {
    queue: VecDeque<Waiting>,
    records: Ticket,
    committed: Ticket,
    /// Jobs whose end waits for a record, in the order of these.
    ending: VecDeque<(Ticket, JobId)>,
    is_performing: bool,
}

#[derive(Debug)]
enum Waiting {
    Effect(Effect),
    /// An image of an era is to be encoded.
    Encode(ImageRef, Era),
    /// What follows waits for this record.
    Until(Ticket),
}

impl Held {
    /// Whether so much waits that nobody may add to it.
    pub(super) fn is_full(&self) -> bool {
        self.queue.len() >= HELD_MAX
    }

    /// Whether a job's end is decided and not durable: for whoever asks it is not over yet, and its log does not say so.
    pub(super) fn is_ending(&self, job: JobId) -> bool {
        self.ending.iter().any(|&(_, ending)| ending == job)
    }

    /// A job's end was decided, by what is recorded up to now.
    fn ends(&mut self, job: JobId) {
        if self.records > self.committed {
            self.ending.push_back((self.records, job));
        }
    }

    /// Every record up to this one is durable.
    fn commit(&mut self, ticket: Ticket) {
        self.committed = ticket;
        while self
            .ending
            .pop_front_if(|&mut (waits, _)| waits <= ticket)
            .is_some()
        {}
    }
}

impl Shell {
    /// Lets the scheduler decide; what it decided is performed as soon as it may be.
    pub(super) fn feed(&mut self, event: Event) {
        self.feed_with(event, &[]);
    }

    /// The same; `files` are those of an image that the event says is encoded.
    pub(super) fn feed_with(&mut self, event: Event, files: &[FinishedFile]) {
        tracing::debug!(?event, "event");
        let now = self.now();
        let mut effects = Vec::new();
        let told = is_recorded(&event).then(|| event.clone());
        self.sched.handle(now, event, &mut effects);
        for effect in &effects {
            if let Effect::DropScratch { image } = effect {
                self.end_era(*image);
            }
        }
        if let Some(entry) = told.and_then(|event| self.entry(unix_ms(now), event, files, &effects))
        {
            self.held.records += 1;
            let ticket = self.held.records;
            let placed = match &entry {
                Entry::ImageEncoded { image, .. } => Some(*image),
                _ => None,
            };
            self.held.queue.push_back(Waiting::Until(ticket));
            self.storage.record(entry, Some(ticket));
            if let Some(image) = placed {
                // Its pixels are in the frame; the order stands behind the record.
                self.storage.drop_scratch(image);
            }
        }
        for effect in effects {
            if let Effect::JobDone { job, .. } = effect {
                self.held.ends(job);
            }
            self.held.queue.push_back(match effect {
                Effect::Encode { image } => Waiting::Encode(image, self.era(image)),
                effect => Waiting::Effect(effect),
            });
        }
        self.flush();
    }

    /// Every record up to this one is durable.
    pub(super) fn committed(&mut self, ticket: Ticket) {
        self.held.commit(ticket);
        self.flush();
    }

    /// Performs what waits for nothing, in order.
    fn flush(&mut self) {
        if std::mem::replace(&mut self.held.is_performing, true) {
            return;
        }
        while let Some(next) = self.held.queue.pop_front() {
            match next {
                Waiting::Until(ticket) if ticket > self.held.committed => {
                    self.held.queue.push_front(Waiting::Until(ticket));
                    break;
                }
                Waiting::Until(_) => {}
                Waiting::Effect(effect) => {
                    tracing::debug!(?effect, "effect");
                    self.perform(effect);
                }
                Waiting::Encode(image, era) if era == self.era(image) => self.encode(image, era),
                Waiting::Encode(..) => {}
            }
        }
        self.held.is_performing = false;
    }

    pub(super) fn era(&self, image: ImageRef) -> Era {
        self.eras.get(&image).copied().unwrap_or(0)
    }

    /// What there was of an image counts no more.
    fn end_era(&mut self, image: ImageRef) {
        *self.eras.entry(image).or_default() += 1;
    }

    /// What is to be committed of an event that the scheduler was told at a time, if it changed anything.
    fn entry(
        &mut self,
        unix_ms: u64,
        event: Event,
        files: &[FinishedFile],
        effects: &[Effect],
    ) -> Option<Entry> {
        match event {
            Event::Submit(submission) => self.begin_job(unix_ms, submission),
            Event::Command { job, command } => {
                let is_refused = |effect: &Effect| matches!(effect, Effect::CommandRefused { .. });
                if effects.iter().any(is_refused) {
                    return None;
                }
                if let Command::Again(image) = command {
                    self.end_era(ImageRef { job, image });
                }
                Some(Entry::Command {
                    job,
                    unix_ms,
                    command,
                })
            }
            Event::ImageEncoded { image, film } => {
                let state = self.sched.image(image)?.state;
                if state != (ImageState::Encoded { film }) {
                    return None;
                }
                self.end_era(image);
                let work = self.jobs.get_mut(image.job)?.take_work(image.image);
                let about = ImageAbout {
                    files: files.iter().map(FileAbout::of).collect(),
                    counters: work.counters,
                };
                Some(Entry::ImageEncoded {
                    image,
                    unix_ms,
                    film,
                    blocks: work.blocks,
                    render_time: work.render_time,
                    about: serde_json::to_string(&about).expect("it is JSON"),
                })
            }
            Event::ImageFailed { image, reason } => {
                let is_failed = self.sched.image(image)?.state == ImageState::Failed;
                is_failed.then_some(Entry::ImageFailed {
                    image,
                    unix_ms,
                    reason,
                })
            }
            _ => None,
        }
    }
}

/// Whether an event is committed after the scheduler heard of it; blocks are before.
fn is_recorded(event: &Event) -> bool {
    event.is_durable() && !matches!(event, Event::BlockStored { .. })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_is_not_over_before_its_end_is_durable() {
        let mut held = Held::default();
        held.ends(JobId(1));
        assert!(!held.is_ending(JobId(1)), "it waits for nothing");
        held.records = 2;
        held.ends(JobId(2));
        held.records = 3;
        held.ends(JobId(3));
        held.commit(1);
        let are_ending = |held: &Held| [1, 2, 3].map(|job| held.is_ending(JobId(job)));
        assert_eq!(are_ending(&held), [false, true, true]);
        held.commit(2);
        assert_eq!(are_ending(&held), [false, false, true]);
        held.commit(3);
        assert_eq!(are_ending(&held), [false; 3]);
    }
}
