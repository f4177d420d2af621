//! What an earlier start left.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread;

use image::Scratch;
use model::{ImageRef, JobId, Rect, Timestamp};
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
        let mut recalled = store.recall_jobs()?;
        let mut jobs = BTreeMap::new();
        for job in &recalled.jobs {
            let (plan, scene) = plan(state, job)?;
            jobs.insert(job.job, (Arc::new(plan), scene));
        }
        let mut open = Open::new();
        let reopened = reopen_all(store, |image| Some(jobs.get(&image.job)?.0.clone()))?;
        let mut of_job = recalled.jobs.iter_mut().peekable();
        for (image, (mut blocks, reopened)) in reopened {
            let (scratch, lost) = reopened?;
            open.insert(image, Arc::new(scratch));
            if !lost.is_empty() {
                tracing::error!(job = %image.job, image = %image.image, blocks = lost.len(), "blocks are not on the disk as they were written; they are rendered again");
                let gone: BTreeSet<_> = lost.iter().map(corners).collect();
                blocks.retain(|block| !gone.contains(&corners(&block.rect)));
                store.commit(&[Entry::BlocksLost { image, rects: lost }])?;
            }
            // Both are in order.
            while of_job.next_if(|job| job.job < image.job).is_some() {}
            if let Some(job) = of_job.peek_mut() {
                job.blocks.append(&mut blocks);
            }
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

/// What was noted of an image, its scratch file, and which of its blocks that does not hold.
type Reopened = (Vec<RecalledBlock>, Result<(Scratch, Vec<Rect>), StartError>);

/// Reads the durable blocks of all images, and meanwhile opens the scratch files of those that are read, several at a
/// time: every byte of them is looked at.
fn reopen_all(
    store: &mut Sqlite,
    plan_of: impl Fn(ImageRef) -> Option<Arc<Plan>> + Sync,
) -> Result<BTreeMap<ImageRef, Reopened>, StartError> {
    let threads = thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let (noted, images) = mpsc::sync_channel::<(ImageRef, Vec<RecalledBlock>)>(threads);
    let images = Mutex::new(images);
    let next = || images.lock().unwrap_or_else(PoisonError::into_inner).recv();
    let reopen_some = || {
        let mut reopened = Vec::new();
        while let Ok((image, blocks)) = next() {
            if let Some(plan) = plan_of(image) {
                let scratch = reopen(&plan, image, &blocks);
                reopened.push((image, (blocks, scratch)));
            }
        }
        reopened
    };
    thread::scope(|scope| {
        let openers: Vec<_> = (0..threads).map(|_| scope.spawn(reopen_some)).collect();
        let read = store.recall_blocks(|image, blocks| {
            noted
                .send((image, blocks))
                .expect("they take all that there is");
        });
        drop(noted);
        let opened = openers.into_iter().flat_map(|opener| {
            let some: Vec<_> = opener.join().expect("opening a file does not panic");
            some
        });
        let opened = opened.collect();
        read?;
        Ok(opened)
    })
}

fn reopen(
    plan: &Plan,
    image: ImageRef,
    blocks: &[RecalledBlock],
) -> Result<(Scratch, Vec<Rect>), StartError> {
    let noted = blocks.iter().map(|block| (block.rect, block.pixels));
    plan.folders.make()?;
    let (path, identity) = (plan.scratch_path(image), plan.identity_of(image));
    Scratch::reopen_bare(path, identity, plan.window, noted).map_err(StartError::Scratch)
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
