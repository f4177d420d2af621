//! What a scheduler of a later epoch must be told.

use std::collections::BTreeSet;

use model::{ImageRef, JobId};
use sched::{Command, Event, Submission};

use crate::{Recalled, RecalledBlock, RecalledImage, RecalledJob};

impl Recalled {
    /// The events that bring everything back, in order, each with when it happened by the coordinator's calendar,
    /// in milliseconds since 1970.
    ///
    /// Job by job: its number, its submission, its commands, its images that are over, its blocks, and that
    /// it was cancelled. The blocks of an image come in one event. Effects of these events are those of
    /// any others. The last event tells the largest job number.
    pub fn events(&self) -> impl Iterator<Item = (u64, Event)> {
        let kept: BTreeSet<JobId> = self.jobs.iter().map(|job| job.job).collect();
        let end = self.jobs.last().map_or(0, |job| job.unix_ms);
        let last = Event::JobsRecalled {
            last: self.last_job,
        };
        let of_jobs = self.jobs.iter().flat_map(move |job| job.events(&kept));
        of_jobs.chain(std::iter::once((end, last)))
    }
}

impl RecalledJob {
    fn events(&self, kept: &BTreeSet<JobId>) -> impl Iterator<Item = (u64, Event)> + use<'_> {
        let job = self.job;
        let before = Event::JobsRecalled {
            last: JobId(job.0.saturating_sub(1)),
        };
        let after = self.submission.after.iter().copied();
        let submit = Event::Submit(Submission {
            // One that is gone was finished: a job that others wait for is not forgotten.
            after: after.filter(|after| kept.contains(after)).collect(),
            ..self.submission.clone()
        });
        // Before the images, since a job that is over takes no such command. The submission stays as
        // it was, so that submitting it again is still submitting it once.
        let (submitted, pause) = (&self.submission, self.paused);
        let priority =
            (self.priority != submitted.priority).then_some(Command::Priority(self.priority));
        let share = (self.share != submitted.share).then_some(Command::Share(self.share));
        let pause = pause.then_some(Command::Pause);
        let focus = self.focus.map(|focus| Command::Focus(Some(focus)));
        let commands = [priority, share, pause, focus].into_iter().flatten();
        let told = move |command| (self.unix_ms, Event::Command { job, command });
        let cancel = self.cancelled_unix_ms.map(|unix_ms| {
            let command = Command::Cancel;
            (unix_ms, Event::Command { job, command })
        });
        [(self.unix_ms, before), (self.unix_ms, submit)]
            .into_iter()
            .chain(commands.map(told))
            .chain(self.images.iter().map(move |image| image.event(job)))
            .chain(
                self.blocks
                    .chunk_by(|a, b| a.image == b.image)
                    .filter_map(move |blocks| Some((self.unix_ms, blocks_event(job, blocks)?))),
            )
            .chain(cancel)
    }
}

impl RecalledImage {
    fn event(&self, job: JobId) -> (u64, Event) {
        let image = ImageRef {
            job,
            image: self.image(),
        };
        match self {
            Self::Encoded {
                unix_ms,
                film,
                blocks,
                render_time,
                ..
            } => {
                let (film, blocks, render_time) = (*film, *blocks, *render_time);
                let event = Event::ImageRecalled {
                    image,
                    film,
                    blocks,
                    render_time,
                };
                (*unix_ms, event)
            }
            Self::Failed {
                unix_ms, reason, ..
            } => {
                let reason = reason.clone();
                (*unix_ms, Event::ImageFailed { image, reason })
            }
        }
    }
}

/// The blocks of one image.
fn blocks_event(job: JobId, blocks: &[RecalledBlock]) -> Option<Event> {
    let image = blocks.first()?.image;
    let blocks = blocks.iter().map(|block| (block.rect, block.elapsed));
    Some(Event::BlocksRecalled {
        image: ImageRef { job, image },
        blocks: blocks.collect(),
    })
}
