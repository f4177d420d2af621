//! A store that lives as long as its process: what the entries mean, in plain collections.

use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;

use model::{Digest, ImageNumber, ImageRef, JobId, Rect, Span};
use sched::{Command, Submission};

use crate::{
    Entry, LOG_LINES_MAX, Recalled, RecalledBlock, RecalledImage, RecalledJob, Store, StoreError,
};

/// A store in memory, for tests and simulations. It can be told to be full.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    /// The largest number that a job was ever given.
    last_job: u64,
    jobs: BTreeMap<JobId, Job>,
    refusals: u32,
}

#[derive(Clone, Debug)]
struct Job {
    unix_ms: u64,
    submission: Submission,
    about: String,
    priority: i32,
    share: u32,
    paused: bool,
    focus: Option<Rect>,
    cancelled_unix_ms: Option<u64>,
    images: BTreeMap<ImageNumber, RecalledImage>,
    blocks: BTreeMap<ImageNumber, BTreeMap<Place, Block>>,
    log: VecDeque<(u64, String)>,
    log_dropped: u64,
}

/// Where a block is: first row, first column, last row, last column.
type Place = (u32, u32, u32, u32);

#[derive(Clone, Debug)]
struct Block {
    elapsed: Span,
    pixels: Digest,
    about: Vec<u8>,
}

impl Memory {
    /// An empty store.
    pub fn new() -> Self {
        Self::default()
    }

    /// Refuses the next `commits`, as if the disk was full.
    pub fn refuse(&mut self, commits: u32) {
        self.refusals = commits;
    }

    /// What a process that is started after a crash of this one finds: all that was committed. No refusal is left.
    #[must_use]
    pub fn crash(self) -> Self {
        Self {
            refusals: 0,
            ..self
        }
    }

    fn take(&mut self, entry: &Entry) {
        match entry {
            Entry::Submitted {
                job,
                unix_ms,
                submission,
                about,
            } => {
                self.last_job = self.last_job.max(job.0);
                let mut submission = submission.clone();
                let is_finished =
                    |before: &JobId| self.jobs.get(before).is_some_and(Job::is_finished);
                submission.after.retain(|before| !is_finished(before));
                self.jobs
                    .entry(*job)
                    .or_insert_with(|| Job::new(*unix_ms, submission, about.clone()));
            }
            Entry::Block {
                image,
                rect,
                elapsed,
                pixels,
                about,
            } => {
                let is_wanted = |job: &&mut Job| {
                    job.cancelled_unix_ms.is_none() && !job.images.contains_key(&image.image)
                };
                if let Some(job) = self.jobs.get_mut(&image.job).filter(is_wanted) {
                    let blocks = job.blocks.entry(image.image).or_default();
                    blocks.entry(place(*rect)).or_insert_with(|| Block {
                        elapsed: *elapsed,
                        pixels: *pixels,
                        about: about.clone(),
                    });
                }
            }
            Entry::BlocksLost { image, rects } => {
                let job = self.jobs.get_mut(&image.job);
                if let Some(blocks) = job.and_then(|job| job.blocks.get_mut(&image.image)) {
                    for &rect in rects {
                        blocks.remove(&place(rect));
                    }
                }
            }
            Entry::ImageEncoded {
                image,
                unix_ms,
                film,
                blocks,
                render_time,
                about,
            } => self.image_over(
                *image,
                RecalledImage::Encoded {
                    image: image.image,
                    unix_ms: *unix_ms,
                    film: *film,
                    blocks: *blocks,
                    render_time: *render_time,
                    about: about.clone(),
                },
            ),
            Entry::ImageFailed {
                image,
                unix_ms,
                reason,
            } => self.image_over(
                *image,
                RecalledImage::Failed {
                    image: image.image,
                    unix_ms: *unix_ms,
                    reason: reason.clone(),
                },
            ),
            Entry::Command {
                job,
                command: Command::Remove,
                ..
            }
            | Entry::Forgotten { job } => {
                self.jobs.remove(job);
            }
            Entry::Command {
                job,
                unix_ms,
                command,
            } => {
                if let Some(job) = self.jobs.get_mut(job) {
                    job.command(*unix_ms, *command);
                }
            }
            Entry::Line { job, unix_ms, text } => {
                if let Some(job) = self.jobs.get_mut(job) {
                    job.log.push_back((*unix_ms, text.clone()));
                    if job.log.len() > LOG_LINES_MAX {
                        job.log.pop_front();
                        job.log_dropped += 1;
                    }
                }
            }
        }
    }

    fn image_over(&mut self, image: ImageRef, over: RecalledImage) {
        if let Some(job) = self.jobs.get_mut(&image.job) {
            job.images.entry(image.image).or_insert(over);
            job.blocks.remove(&image.image);
            if job.is_finished() {
                for waiting in self.jobs.values_mut() {
                    waiting
                        .submission
                        .after
                        .retain(|&before| before != image.job);
                }
            }
        }
    }
}

impl Store for Memory {
    fn commit(&mut self, entries: &[Entry]) -> Result<(), StoreError> {
        if self.refusals > 0 {
            self.refusals -= 1;
            let path = PathBuf::from("memory");
            return Err(StoreError::Full { path });
        }
        for entry in entries {
            self.take(entry);
        }
        Ok(())
    }

    fn recall(&mut self) -> Result<Recalled, StoreError> {
        Ok(Recalled {
            last_job: JobId(self.last_job),
            jobs: self
                .jobs
                .iter()
                .map(|(&id, job)| job.recalled(id))
                .collect(),
        })
    }
}

impl Job {
    fn new(unix_ms: u64, submission: Submission, about: String) -> Self {
        Self {
            unix_ms,
            priority: submission.priority,
            share: submission.share,
            submission,
            about,
            paused: false,
            focus: None,
            cancelled_unix_ms: None,
            images: BTreeMap::new(),
            blocks: BTreeMap::new(),
            log: VecDeque::new(),
            log_dropped: 0,
        }
    }

    fn command(&mut self, unix_ms: u64, command: Command) {
        if self.cancelled_unix_ms.is_some() {
            return;
        }
        match command {
            Command::Pause => self.paused = true,
            Command::Resume => self.paused = false,
            Command::Cancel if self.is_over() => {}
            Command::Cancel => {
                self.cancelled_unix_ms = Some(unix_ms);
                self.blocks.clear();
            }
            Command::Retry => self
                .images
                .retain(|_, image| matches!(image, RecalledImage::Encoded { .. })),
            Command::Again(image) => {
                self.images.remove(&image);
                self.blocks.remove(&image);
            }
            Command::Priority(priority) => self.priority = priority,
            Command::Share(share) => self.share = share,
            Command::Focus(focus) => self.focus = focus,
            // The whole job is gone already.
            Command::Remove => {}
        }
    }

    fn is_finished(&self) -> bool {
        let is_encoded = |image: &RecalledImage| matches!(image, RecalledImage::Encoded { .. });
        self.is_over() && self.images.values().all(is_encoded)
    }

    fn is_over(&self) -> bool {
        self.images.len() >= self.submission.frames.count() as usize
    }

    fn recalled(&self, job: JobId) -> RecalledJob {
        let of_image = |(&image, blocks): (&ImageNumber, &BTreeMap<Place, Block>)| {
            let recalled = |(&place, block): (&Place, &Block)| block.recalled(image, place);
            blocks.iter().map(recalled).collect::<Vec<_>>()
        };
        RecalledJob {
            job,
            unix_ms: self.unix_ms,
            submission: self.submission.clone(),
            about: self.about.clone(),
            priority: self.priority,
            share: self.share,
            paused: self.paused,
            focus: self.focus,
            cancelled_unix_ms: self.cancelled_unix_ms,
            images: self.images.values().cloned().collect(),
            blocks: self.blocks.iter().flat_map(of_image).collect(),
            log: self.log.iter().cloned().collect(),
            log_dropped: self.log_dropped,
        }
    }
}

impl Block {
    fn recalled(&self, image: ImageNumber, (y0, x0, y1, x1): Place) -> RecalledBlock {
        RecalledBlock {
            image,
            rect: Rect { x0, y0, x1, y1 },
            elapsed: self.elapsed,
            pixels: self.pixels,
            about: self.about.clone(),
        }
    }
}

fn place(rect: Rect) -> Place {
    (rect.y0, rect.x0, rect.y1, rect.x1)
}
