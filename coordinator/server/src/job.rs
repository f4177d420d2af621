//! What a user sees of a job beside what the scheduler knows: its log, its files, its watchers.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use image::Formats;
use model::{ImageNumber, ImageRef, JobId, Span, Timestamp};
use sched::Estimate;
use tokio::sync::broadcast;
use wire::proto;

use crate::scene_files::SceneFiles;
use crate::state::JobFolders;
use crate::storage::Plan;

/// Most names of counters of one job; workers that invent more are not counted.
const COUNTERS_MAX: usize = 64;

/// Changes that a watcher may be behind before it gets a fresh snapshot.
const WATCHER_BEHIND_MAX: usize = 64;

/// Most images in one message: even if each failed for a long reason, they fit.
pub(crate) const IMAGES_PER_MESSAGE: usize = 400;

/// Most new lines of a log in one message; older ones are only in the log itself.
const LINES_PER_MESSAGE: usize = 400;

/// Most bytes of one line of a log.
const LINE_BYTES_MAX: usize = 1_000;

/// Sums by name.
pub(crate) type Counters = BTreeMap<String, u64>;

/// What was done of an image.
#[derive(Clone, Debug, Default)]
pub(crate) struct Work {
    pub(crate) blocks: u32,
    pub(crate) render_time: Span,
    pub(crate) counters: Counters,
}

/// Whether something is counted, or taken back.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Sign {
    Plus,
    Minus,
}

/// What was expected of a job, and when.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foretold {
    pub(crate) at: Timestamp,
    pub(crate) left: Estimate,
}

/// One job.
#[derive(Debug)]
pub(crate) struct Job {
    /// How its images are stored.
    pub(crate) plan: Arc<Plan>,
    /// Its scene and assets on disk.
    pub(crate) scene: SceneFiles,
    /// Its files, by image.
    pub(crate) files: BTreeMap<ImageNumber, Vec<proto::FrameFile>>,
    /// Sums over all its blocks.
    pub(crate) counters: Counters,
    /// What was done of each image that is being rendered.
    work: BTreeMap<ImageNumber, Work>,
    log: Log,
    watchers: Option<broadcast::Sender<Arc<proto::JobUpdate>>>,
    changed: BTreeSet<ImageNumber>,
    /// Images of which a tile was leased.
    begun: BTreeSet<ImageNumber>,
    new_lines: Vec<proto::LogLine>,
    /// What was expected when a tenth of it was done.
    pub(crate) foretold: Option<Foretold>,
    /// Attempts lost and failed that its log already tells of.
    pub(crate) told: (u64, u64),
}

impl Job {
    pub(crate) fn new(plan: Arc<Plan>, scene: SceneFiles, lines: usize) -> Self {
        Self {
            plan,
            scene,
            files: BTreeMap::new(),
            counters: Counters::new(),
            work: BTreeMap::new(),
            log: Log::new(lines),
            watchers: Some(broadcast::Sender::new(WATCHER_BEHIND_MAX)),
            changed: BTreeSet::new(),
            begun: BTreeSet::new(),
            new_lines: Vec::new(),
            foretold: None,
            told: (0, 0),
        }
    }

    /// Goes on with the log of an earlier start.
    pub(crate) fn recall_log(&mut self, lines: &[(u64, String)], dropped: u64) {
        for (unix_ms, text) in lines {
            self.log.push(proto::LogLine {
                unix_ms: *unix_ms,
                text: text.clone(),
            });
        }
        self.log.dropped += dropped;
    }

    /// Goes on with the sums of an image that was finished before this start.
    pub(crate) fn recall_image(&mut self, counters: &Counters) {
        add(&mut self.counters, counters, Sign::Plus);
    }

    pub(crate) fn folders(&self) -> &JobFolders {
        &self.plan.folders
    }

    pub(crate) fn formats(&self) -> Formats {
        self.plan.formats
    }

    /// Adds what a block that is now durable took, or takes it back.
    pub(crate) fn count(
        &mut self,
        image: ImageNumber,
        elapsed: Span,
        counters: &[(String, u64)],
        sign: Sign,
    ) {
        let work = match sign {
            Sign::Plus => Some(self.work.entry(image).or_default()),
            Sign::Minus => self.work.get_mut(&image),
        };
        if let Some(work) = work {
            let (blocks, time) = (&mut work.blocks, &mut work.render_time.0);
            match sign {
                Sign::Plus => {
                    *blocks = blocks.saturating_add(1);
                    *time = time.saturating_add(elapsed.0);
                }
                Sign::Minus => {
                    *blocks = blocks.saturating_sub(1);
                    *time = time.saturating_sub(elapsed.0);
                }
            }
            add(&mut work.counters, pairs(counters), sign);
        }
        add(&mut self.counters, pairs(counters), sign);
    }

    /// What was done so far of an image that is being rendered.
    pub(crate) fn work(&self, image: ImageNumber) -> Work {
        self.work.get(&image).cloned().unwrap_or_default()
    }

    /// Notes that a tile of an image is leased; whether it is the first.
    pub(crate) fn begin(&mut self, image: ImageNumber) -> bool {
        self.begun.insert(image)
    }

    /// The same of one that is in its place or dropped; it is kept no longer.
    pub(crate) fn take_work(&mut self, image: ImageNumber) -> Work {
        self.work.remove(&image).unwrap_or_default()
    }

    /// Adds a line to its log; gives it as it stands there.
    pub(crate) fn say(&mut self, unix_ms: u64, text: &str) -> String {
        let text = wire::convert::sentence(text, LINE_BYTES_MAX);
        let said = text.clone();
        let line = proto::LogLine { unix_ms, text };
        if self.has_watchers() && self.new_lines.len() < LINES_PER_MESSAGE {
            self.new_lines.push(line.clone());
        }
        self.log.push(line);
        said
    }

    /// Its log as it stands.
    pub(crate) fn log(&self) -> proto::JobLogReply {
        proto::JobLogReply {
            lines: self.log.lines.iter().cloned().collect(),
            dropped: self.log.dropped,
        }
    }

    /// Notes that watchers should see an image anew.
    pub(crate) fn touch(&mut self, image: ImageNumber) {
        if self.has_watchers() {
            self.changed.insert(image);
        }
    }

    /// A watcher's end; `None` where no change will follow.
    pub(crate) fn watch(&self) -> Option<broadcast::Receiver<Arc<proto::JobUpdate>>> {
        self.watchers.as_ref().map(broadcast::Sender::subscribe)
    }

    /// Whether somebody watches.
    pub(crate) fn has_watchers(&self) -> bool {
        let count = self
            .watchers
            .as_ref()
            .map(broadcast::Sender::receiver_count);
        count.is_some_and(|count| count > 0)
    }

    /// Tells watchers what changed. `status` gives an image as it is now.
    pub(crate) fn tell_watchers(
        &mut self,
        summary: proto::JobSummary,
        status: impl Fn(&Self, ImageNumber) -> Option<proto::ImageStatus>,
    ) {
        let changed = std::mem::take(&mut self.changed);
        let mut lines = std::mem::take(&mut self.new_lines);
        let Some(watchers) = self.watchers.as_ref().filter(|_| self.has_watchers()) else {
            return;
        };
        let images: Vec<_> = changed
            .into_iter()
            .filter_map(|image| status(self, image))
            .collect();
        let mut batches: Vec<_> = images
            .chunks(IMAGES_PER_MESSAGE)
            .map(<[_]>::to_vec)
            .collect();
        if batches.is_empty() {
            batches.push(Vec::new());
        }
        for images in batches {
            let delta = proto::JobDelta {
                summary: Some(summary.clone()),
                images,
                lines: std::mem::take(&mut lines),
            };
            // An error says that the last watcher has just left.
            let _ = watchers.send(Arc::new(proto::JobUpdate {
                update: Some(proto::job_update::Update::Delta(delta)),
            }));
        }
    }

    /// Lets itself be watched again: it was over, and goes on.
    pub(crate) fn admit_watchers(&mut self) {
        self.watchers
            .get_or_insert_with(|| broadcast::Sender::new(WATCHER_BEHIND_MAX));
    }

    /// Ends all watching: nothing will change any more.
    pub(crate) fn dismiss_watchers(&mut self) {
        self.watchers = None;
    }
}

fn pairs(counters: &[(String, u64)]) -> impl Iterator<Item = (&String, &u64)> {
    counters.iter().map(|(name, value)| (name, value))
}

/// Adds counters to sums, or takes them back.
fn add<'a>(
    sums: &mut Counters,
    counters: impl IntoIterator<Item = (&'a String, &'a u64)>,
    sign: Sign,
) {
    for (name, &value) in counters {
        let full = sums.len() >= COUNTERS_MAX;
        match (sums.get_mut(name), sign) {
            (Some(sum), Sign::Plus) => *sum = sum.saturating_add(value),
            (Some(sum), Sign::Minus) => *sum = sum.saturating_sub(value),
            (None, Sign::Plus) if !full => {
                sums.insert(name.clone(), value);
            }
            (None, _) => {}
        }
    }
}

/// The latest lines, and how many came before.
#[derive(Debug)]
struct Log {
    lines: VecDeque<proto::LogLine>,
    lines_max: usize,
    dropped: u64,
}

impl Log {
    fn new(lines_max: usize) -> Self {
        Self {
            lines: VecDeque::new(),
            lines_max: lines_max.max(1),
            dropped: 0,
        }
    }

    fn push(&mut self, line: proto::LogLine) {
        if self.lines.len() == self.lines_max {
            self.lines.pop_front();
            self.dropped += 1;
        }
        self.lines.push_back(line);
    }
}

/// Jobs, by number.
#[derive(Debug, Default)]
pub(crate) struct Jobs {
    by_id: BTreeMap<JobId, Job>,
    /// Those of which watchers have not seen everything.
    dirty: BTreeSet<JobId>,
}

impl Jobs {
    pub(crate) fn get(&self, job: JobId) -> Option<&Job> {
        self.by_id.get(&job)
    }

    pub(crate) fn get_mut(&mut self, job: JobId) -> Option<&mut Job> {
        self.by_id.get_mut(&job)
    }

    pub(crate) fn insert(&mut self, id: JobId, job: Job) {
        self.by_id.insert(id, job);
    }

    pub(crate) fn remove(&mut self, job: JobId) -> Option<Job> {
        self.dirty.remove(&job);
        self.by_id.remove(&job)
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = (JobId, &Job)> {
        self.by_id.iter().map(|(id, job)| (*id, job))
    }

    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = (JobId, &mut Job)> {
        self.by_id.iter_mut().map(|(id, job)| (*id, job))
    }

    pub(crate) fn len(&self) -> usize {
        self.by_id.len()
    }

    /// Notes that something of a job changed.
    pub(crate) fn touch(&mut self, job: JobId) {
        if self.by_id.contains_key(&job) {
            self.dirty.insert(job);
        }
    }

    /// Notes that an image changed.
    pub(crate) fn touch_image(&mut self, image: ImageRef) {
        if let Some(job) = self.by_id.get_mut(&image.job) {
            job.touch(image.image);
            self.dirty.insert(image.job);
        }
    }

    pub(crate) fn has_dirty(&self) -> bool {
        !self.dirty.is_empty()
    }

    /// The jobs of which watchers have not seen everything; from now on none.
    pub(crate) fn take_dirty(&mut self) -> BTreeSet<JobId> {
        std::mem::take(&mut self.dirty)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_keeps_the_latest_lines() {
        let mut log = Log::new(3);
        for unix_ms in 0..5 {
            log.push(proto::LogLine {
                unix_ms,
                text: String::new(),
            });
        }
        assert_eq!(log.dropped, 2);
        let left: Vec<_> = log.lines.iter().map(|line| line.unix_ms).collect();
        assert_eq!(left, [2, 3, 4]);
    }
}
