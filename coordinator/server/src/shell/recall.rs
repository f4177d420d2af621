//! What an earlier start left.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::thread;

use image::{ImageError, Scratch};
use model::{ImageNumber, ImageRef, JobId, Rect, Timestamp};
use sched::Effect;
use store::{Entry, Recalled, RecalledBlock, RecalledImage, RecalledJob, Sqlite, Store as _};

use super::Shell;
use crate::about::{FileAbout, ImageAbout, JobAbout, counters_of};
use crate::job::{Job, Sign};
use crate::scene_files::SceneFiles;
use crate::start::StartError;
use crate::state::State;
use crate::storage::{Open, Plan, chain};

/// What was kept, and the files that belong to it.
#[derive(Debug)]
pub(crate) struct Kept {
    recalled: Recalled,
    jobs: BTreeMap<JobId, (Arc<Plan>, SceneFiles)>,
}

impl Kept {
    /// Reads the store, and opens the scratch files of images that were being rendered. Blocks whose
    /// pixels are not there any more are forgotten, and rendered again.
    pub(crate) fn read(state: &State, store: &mut Sqlite) -> Result<(Self, Open), StartError> {
        let mut recalled = store.recall()?;
        let mut jobs = BTreeMap::new();
        let mut open = Open::new();
        for job in &mut recalled.jobs {
            let (plan, scene) = plan(state, job)?;
            if !job.blocks.is_empty() {
                plan.folders.make()?;
            }
            // The store gives them image by image.
            let images = job.blocks.chunk_by(|a, b| a.image == b.image);
            let mut gone = BTreeSet::new();
            for (number, reopened) in reopen_all(&plan, job.job, images.collect()) {
                let image = ImageRef {
                    job: job.job,
                    image: number,
                };
                let (scratch, lost) = reopened.map_err(StartError::Scratch)?;
                open.insert(image, Arc::new(scratch));
                if !lost.is_empty() {
                    tracing::error!(job = %image.job, image = %number, blocks = lost.len(), "blocks are not on the disk as they were written; they are rendered again");
                    gone.extend(lost.iter().map(|rect| (number, corners(rect))));
                    store.commit(&[Entry::BlocksLost { image, rects: lost }])?;
                }
            }
            if !gone.is_empty() {
                job.blocks
                    .retain(|block| !gone.contains(&(block.image, corners(&block.rect))));
            }
            jobs.insert(job.job, (Arc::new(plan), scene));
        }
        let known = jobs.keys().copied().collect();
        state.clean(&known, &open.keys().copied().collect())?;
        // Where the store was moved away, numbers do not begin again over the frames that are left.
        recalled.last_job = recalled.last_job.max(state.last_job_folder());
        Ok((Self { recalled, jobs }, open))
    }

    /// How many jobs there are.
    pub(crate) fn len(&self) -> usize {
        self.jobs.len()
    }
}

type Reopened = Result<(Scratch, Vec<Rect>), ImageError>;

/// Opens the scratch files of images of a job and reads back what was noted of them, several at a time: every
/// byte of them is looked at.
fn reopen_all(
    plan: &Plan,
    job: JobId,
    images: Vec<&[RecalledBlock]>,
) -> Vec<(ImageNumber, Reopened)> {
    let threads = thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let reopen = |blocks: &[RecalledBlock]| {
        let number = blocks.first()?.image;
        let image = ImageRef { job, image: number };
        let noted = blocks.iter().map(|block| (block.rect, block.pixels));
        let path = plan.scratch_path(image);
        let identity = plan.identity_of(image);
        let reopened = Scratch::reopen_bare(path, identity, plan.window, noted);
        Some((number, reopened))
    };
    thread::scope(|scope| {
        let share = images.len().div_ceil(threads).max(1);
        let parts: Vec<_> = images
            .chunks(share)
            .map(|part| {
                let reopen = &reopen;
                scope.spawn(move || part.iter().filter_map(|blocks| reopen(blocks)).collect())
            })
            .collect();
        let joined = parts.into_iter().flat_map(|part| {
            let part: Vec<_> = part.join().expect("opening a file does not panic");
            part
        });
        joined.collect()
    })
}

type Corners = [u32; 4];

fn corners(rect: &Rect) -> Corners {
    [rect.x0, rect.y0, rect.x1, rect.y1]
}

/// How a job's images are stored, and where its scene is.
fn plan(state: &State, job: &RecalledJob) -> Result<(Plan, SceneFiles), StartError> {
    let damaged = |what: &str| StartError::Job {
        job: job.job,
        what: what.to_owned(),
    };
    let about: JobAbout =
        serde_json::from_str(&job.about).map_err(|error| damaged(&chain(&error)))?;
    let formats = about
        .formats()
        .ok_or_else(|| damaged("a format of its frames is not known here"))?;
    let assets = about
        .assets()
        .ok_or_else(|| damaged("the digest of an asset is none"))?;
    let folders = state.job(job.job);
    let scene = SceneFiles {
        root: folders.scene.clone(),
        description: job.submission.scene,
        assets,
    };
    Ok((Plan::new(folders, &job.submission, &about, formats), scene))
}

impl Shell {
    /// Goes on where the last start ended.
    pub(crate) fn recall(&mut self, kept: Kept) {
        let Kept { recalled, mut jobs } = kept;
        for job in &recalled.jobs {
            if let Some((plan, scene)) = jobs.remove(&job.job) {
                let job_of_ours = self.job_of(job, plan, scene);
                self.jobs.insert(job.job, job_of_ours);
            }
        }
        // Nothing of it happened later than now, whatever the calendar says.
        let latest = self.clock.started();
        let still_wanted = |effect: &Effect| {
            matches!(
                effect,
                Effect::Encode { .. } | Effect::ForgetJob { .. } | Effect::GiveUp { .. }
            )
        };
        let (mut effects, mut wanted) = (Vec::new(), Vec::new());
        for (unix_ms, event) in recalled.events() {
            let then = Timestamp(unix_ms.saturating_mul(1_000)).min(latest);
            self.sched.handle(then, event, &mut effects);
            // Every block is acknowledged, to nobody: a million of those are not kept until the end.
            wanted.extend(effects.drain(..).filter(still_wanted));
        }
        for effect in wanted {
            self.perform(effect);
        }
        for (id, job) in self.jobs.iter_mut() {
            let state = self.sched.job(id).map(|view| view.state);
            if state != Some(sched::JobState::Running) {
                job.dismiss_watchers();
            }
        }
        let running: Vec<_> = self
            .sched
            .jobs()
            .filter(|job| job.state == sched::JobState::Running)
            .map(|job| (job.job, job.images.encoded, job.frames.count()))
            .collect();
        for (job, done, of) in running {
            self.say(
                job,
                format!("the coordinator was started again: {done} of {of} frames are finished"),
            );
        }
    }

    fn job_of(&self, recalled: &RecalledJob, plan: Arc<Plan>, scene: SceneFiles) -> Job {
        let lines = self.config.limits.log_lines_max;
        let mut job = Job::new(plan, scene, lines);
        job.recall_log(&recalled.log, recalled.log_dropped);
        for image in &recalled.images {
            let RecalledImage::Encoded { image, about, .. } = image else {
                continue;
            };
            // A frame whose description cannot be read is there, and cannot be fetched.
            let Ok(about) = serde_json::from_str::<ImageAbout>(about) else {
                tracing::error!(job = %recalled.job, image = %image, "what the store says of a frame's files cannot be read");
                continue;
            };
            job.recall_image(&about.counters);
            let files = about.files.iter().filter_map(FileAbout::message).collect();
            job.files.insert(*image, files);
        }
        for block in &recalled.blocks {
            let counters: Vec<_> = counters_of(&block.about).into_iter().collect();
            job.count(block.image, block.elapsed, &counters, Sign::Plus);
        }
        job
    }
}
