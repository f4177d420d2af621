//! Why something waits: an answer for any job, image, tile and worker, as a value and as a sentence.

use core::fmt;

use model::{ImageNumber, ImageRef, JobId, Rect, Timestamp, WorkerId};

use crate::view::Paused;
use crate::worker::Worker;
use crate::{ImageState, JobOutcome, Link, Sched};

/// Why a job is not over, or that it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum WhyJob {
    /// It is over.
    Over(JobOutcome),
    /// Its user paused it.
    Paused,
    /// It begins when another job is finished.
    After {
        /// Which.
        job: JobId,
        /// How that one ended, if it did without being finished: then it waits until that is retried.
        ended: Option<JobOutcome>,
    },
    /// It has tiles, and there is no worker.
    NoWorkers,
    /// It has tiles, and none of the workers has its revision and all that it asks for.
    NobodyServes {
        /// How many workers there are.
        workers: u32,
    },
    /// It has tiles, and none of the workers that could render them takes any: they are away, leave, or are set aside.
    NobodyTakes {
        /// How many there are that could.
        workers: u32,
        /// How many of those are set aside for this job or for the farm.
        aside: u32,
    },
    /// It has tiles, and the workers that could render them are given those of a job that comes first.
    Outranked {
        /// Which.
        by: JobId,
    },
    /// It has tiles, and every worker that could render them holds as many as it wants.
    WorkersBusy {
        /// How many such workers there are.
        workers: u32,
        /// Tiles of this job that they hold.
        attempts: u32,
    },
    /// All its tiles are with workers or done, and some that are done wait to be rendered once more, to be verified.
    Verifying {
        /// How many.
        checks: u32,
    },
    /// All its tiles are with workers, or done.
    Rendering {
        /// How many are with workers.
        attempts: u32,
    },
    /// All its pixels are durable, and its last images are being encoded.
    Encoding {
        /// How many.
        images: u32,
    },
}

/// Why an image is not in its place, or that it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum WhyImage {
    /// It is in its place.
    Done,
    /// It failed; [`Sched::failures`] says why.
    Failed,
    /// Its job was cancelled.
    Dropped,
    /// It is being encoded.
    Encoding,
    /// It is being rendered.
    Rendering {
        /// Tiles of it that are with workers.
        attempts: u32,
        /// Pixels that wait for one.
        pixels_waiting: u64,
    },
    /// All its pixels are durable, and some are rendered once more, to be verified.
    Verifying {
        /// Tiles of it that are with workers.
        attempts: u32,
        /// Tiles that wait for one.
        checks: u32,
    },
    /// Images of its job that come before it are not all with workers yet.
    Behind {
        /// The first of those.
        image: ImageNumber,
    },
    /// Its job waits.
    Job(WhyJob),
}

/// Why a part of an image is not done, or that it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum WhyTile {
    /// It is durable.
    Done,
    /// Workers render it.
    Leased {
        /// The first.
        worker: WorkerId,
        /// The second, where it is leased twice.
        second: Option<WorkerId>,
    },
    /// It waits for a worker after others failed at it.
    Failed {
        /// Attempts that failed.
        failures: u32,
        /// Workers that were lost while they rendered it.
        losses: u32,
    },
    /// Its image waits.
    Image(WhyImage),
}

/// Why a worker has nothing to do, or that it has.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum WhyWorker {
    /// Its link is closed; it is given up after its liveness limit.
    Away,
    /// It wants no tile: it leaves, or has just come.
    WantsNone,
    /// It is set aside for the farm: it failed where others succeeded.
    Aside {
        /// Until when.
        until: Timestamp,
    },
    /// It is set aside for long: its pixels were wrong.
    Expelled {
        /// Until when.
        until: Timestamp,
    },
    /// It holds as many tiles as it wants.
    Full {
        /// How many.
        attempts: u32,
    },
    /// No job has a tile that waits.
    NoTiles,
    /// Jobs have tiles, and none of them may go to this worker.
    NoneServed,
    /// It has too little time left for any tile that it could have.
    NearItsEnd {
        /// When it must be gone.
        ends: Timestamp,
    },
    /// It is set aside for a job that has tiles, and no other has.
    AsideForJob {
        /// Which.
        job: JobId,
        /// Until when.
        until: Timestamp,
    },
    /// What waits failed on it before, and waits for another worker.
    FailedBefore,
    /// What waits is to be verified, and is its own work or failed on it.
    OwnWork,
}

impl Sched {
    /// Why a job is not over; `None` for one that is not known. Costs a look at every worker.
    pub fn why_job(&self, id: JobId) -> Option<WhyJob> {
        let job = self.jobs.get(&id)?;
        let attempts = job.tally.attempts_live;
        Some(if let Some(outcome) = job.outcome {
            WhyJob::Over(outcome)
        } else if job.paused == Paused::Yes {
            WhyJob::Paused
        } else if let Some(&before) = job.after.first() {
            let ended = self.jobs.get(&before).and_then(|before| before.outcome);
            WhyJob::After { job: before, ended }
        } else if job.has_missing(&self.config) {
            self.why_no_worker(id)
        } else if job.has_checks() {
            let checks = job.work.values().map(|work| work.checks.len()).sum();
            WhyJob::Verifying {
                checks: count_of(checks),
            }
        } else if attempts > 0 {
            WhyJob::Rendering { attempts }
        } else {
            let images = job.view().images.encoding;
            WhyJob::Encoding { images }
        })
    }

    /// Why no worker takes a tile of a job that has some.
    fn why_no_worker(&self, id: JobId) -> WhyJob {
        let job = &self.jobs[&id];
        let count = |of: &dyn Fn(&Worker) -> bool| {
            let workers = self.workers.iter().map(|(_, worker)| worker);
            let count = workers.filter(|worker| of(worker)).count();
            u32::try_from(count).unwrap_or(u32::MAX)
        };
        let is_aside =
            |worker: &Worker| worker.aside.farm().is_some() || worker.aside.job(id).is_some();
        let serves = |worker: &Worker| worker.kinds.contains(job.kind);
        let known = count(&|_| true);
        let workers = count(&serves);
        let able = count(&|worker| serves(worker) && worker.is_able() && !is_aside(worker));
        if known == 0 {
            WhyJob::NoWorkers
        } else if workers == 0 {
            WhyJob::NobodyServes { workers: known }
        } else if able == 0 {
            let aside = count(&|worker| serves(worker) && is_aside(worker));
            WhyJob::NobodyTakes { workers, aside }
        } else if let Some(by) = self.outranked(id) {
            WhyJob::Outranked { by }
        } else {
            WhyJob::WorkersBusy {
                workers: able,
                attempts: job.tally.attempts_live,
            }
        }
    }

    /// The job that comes before one that holds nothing.
    fn outranked(&self, id: JobId) -> Option<JobId> {
        let job = &self.jobs[&id];
        if job.tally.attempts_live > 0 {
            return None;
        }
        let holds = self.jobs.values().filter(|other| other.id != id);
        let holds = holds.filter(|other| other.tally.attempts_live > 0);
        let first = holds.max_by_key(|other| (other.priority, core::cmp::Reverse(other.id)));
        first.map(|other| other.id)
    }

    /// Why an image is not in its place; `None` for one that is not known.
    pub fn why_image(&self, image: ImageRef) -> Option<WhyImage> {
        let job = self.jobs.get(&image.job)?;
        let place = job.place(image.image)?;
        Some(match job.image_view(place).state {
            ImageState::Encoded { .. } => WhyImage::Done,
            ImageState::Failed => WhyImage::Failed,
            ImageState::Dropped => WhyImage::Dropped,
            ImageState::Encoding => WhyImage::Encoding,
            ImageState::Rendering => {
                let attempts = job.live_of(place).count();
                let work = job.work.get(&place);
                if let Some(work) = work.filter(|work| work.pixels.is_complete()) {
                    return Some(WhyImage::Verifying {
                        attempts: count_of(attempts),
                        checks: count_of(work.checks.len()),
                    });
                }
                WhyImage::Rendering {
                    attempts: u32::try_from(attempts).unwrap_or(u32::MAX),
                    pixels_waiting: work.map_or(0, |work| work.open().pixels),
                }
            }
            ImageState::Waiting => match self.why_job(image.job)? {
                WhyJob::WorkersBusy { .. }
                | WhyJob::Verifying { .. }
                | WhyJob::Rendering { .. }
                | WhyJob::Encoding { .. } => {
                    let before = job.in_flight().into_iter().min();
                    let before = before.or(job.first_waiting()).unwrap_or(place);
                    let image = job.image_ref(before).image;
                    WhyImage::Behind { image }
                }
                why => WhyImage::Job(why),
            },
        })
    }

    /// Why a block of an image is not durable; `None` for an image that is not known, or a place outside its window.
    pub fn why_tile(&self, image: ImageRef, block: Rect) -> Option<WhyTile> {
        let why = self.why_image(image)?;
        let job = self.jobs.get(&image.job)?;
        let is_block = block.is_block() && job.spec.window.contains(block);
        let place = job.place(image.image).filter(|_| is_block)?;
        let Some(work) = job.work.get(&place) else {
            let is_done = matches!(why, WhyImage::Done | WhyImage::Encoding);
            return Some(if is_done {
                WhyTile::Done
            } else {
                WhyTile::Image(why)
            });
        };
        if work.pixels.covers(block) {
            return Some(WhyTile::Done);
        }
        let tile = work.tile_of(block).and_then(|tile| work.tiles.get(tile));
        if let Some(tile) = tile {
            let worker = |number| self.workers[self.attempts[number].worker].id;
            let mut attempts = tile.attempts().map(worker);
            return Some(WhyTile::Leased {
                worker: attempts.next()?,
                second: attempts.next(),
            });
        }
        let trouble = work.trouble_at(block);
        let trouble = trouble.filter(|trouble| trouble.failures + trouble.losses > 0);
        Some(match trouble {
            Some(trouble) => WhyTile::Failed {
                failures: trouble.failures,
                losses: trouble.losses,
            },
            None => WhyTile::Image(why),
        })
    }

    /// Why a worker gets no tile; `None` for one that is not known.
    pub fn why_worker(&self, id: WorkerId) -> Option<WhyWorker> {
        let worker = self.workers.by_id(id)?;
        let waits = || {
            self.jobs
                .values()
                .filter(|job| job.goes_on() && job.has_tiles(&self.config))
        };
        let served = || waits().filter(|job| worker.kinds.contains(job.kind));
        Some(if worker.link == Link::Closed {
            WhyWorker::Away
        } else if let Some(until) = worker.aside.expelled() {
            WhyWorker::Expelled { until }
        } else if let Some(until) = worker.aside.farm() {
            WhyWorker::Aside { until }
        } else if worker.credit == 0 {
            WhyWorker::WantsNone
        } else if !worker.has_room() {
            let attempts = u32::try_from(worker.live.len()).unwrap_or(u32::MAX);
            WhyWorker::Full { attempts }
        } else if waits().next().is_none() {
            WhyWorker::NoTiles
        } else if served().next().is_none() {
            WhyWorker::NoneServed
        } else if let Some(ends) = worker.ends {
            WhyWorker::NearItsEnd { ends }
        } else {
            let aside = |job: &crate::job::Job| Some((job.id, worker.aside.job(job.id)?));
            match served().find_map(aside) {
                Some((job, until)) => WhyWorker::AsideForJob { job, until },
                None if served().any(|job| job.has_missing(&self.config)) => {
                    WhyWorker::FailedBefore
                }
                None => WhyWorker::OwnWork,
            }
        })
    }
}

fn count_of(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

impl fmt::Display for WhyJob {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Over(JobOutcome::Finished) => f.write_str("the job is finished"),
            Self::Over(JobOutcome::Failed) => f.write_str("the job is over; some frames failed"),
            Self::Over(JobOutcome::Cancelled) => f.write_str("the job was cancelled"),
            Self::Paused => f.write_str("the job is paused: resume it"),
            Self::After { job, ended: None } => {
                write!(f, "the job begins when job {job} is finished")
            }
            Self::After {
                job,
                ended: Some(_),
            } => write!(
                f,
                "the job begins when job {job} is finished, which ended without that: retry that one, or cancel this one"
            ),
            Self::NoWorkers => f.write_str("there is no worker: start one"),
            Self::NobodyServes { workers } => write!(
                f,
                "none of the {workers} workers has the renderer's revision, the labels, the threads and the memory that the job asks for"
            ),
            Self::NobodyTakes { workers, aside } => write!(
                f,
                "none of the {workers} workers that could render it takes tiles: {aside} are set aside because they failed where others succeeded, the others are away or leave"
            ),
            Self::Outranked { by } => {
                write!(f, "the workers are busy with job {by}, which comes first")
            }
            Self::WorkersBusy { workers, attempts } => write!(
                f,
                "the {workers} workers that could render more of it hold as many tiles as they want, {attempts} of them this job's"
            ),
            Self::Verifying { checks } => write!(
                f,
                "{checks} of its tiles are rendered and wait for another worker to render them once more, to be compared; where none can, the frame is finished without that after a while"
            ),
            Self::Rendering { attempts } => {
                write!(f, "its last {attempts} tiles are with workers")
            }
            Self::Encoding { images } => write!(f, "its last {images} frames are being encoded"),
        }
    }
}

impl fmt::Display for WhyImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Done => f.write_str("the frame is in its place"),
            Self::Failed => f.write_str("the frame failed: retry it"),
            Self::Dropped => f.write_str("the job was cancelled before the frame was finished"),
            Self::Encoding => f.write_str("the frame is rendered and being encoded"),
            Self::Rendering {
                attempts,
                pixels_waiting,
            } => write!(
                f,
                "the frame is being rendered: {attempts} tiles are with workers, {pixels_waiting} pixels wait for one"
            ),
            Self::Verifying { attempts, checks } => write!(
                f,
                "the frame is rendered and being verified: {attempts} tiles are with other workers, {checks} wait for one"
            ),
            Self::Behind { image } => {
                write!(f, "frame {image} and those that follow it come first")
            }
            Self::Job(why) => why.fmt(f),
        }
    }
}

impl fmt::Display for WhyTile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Done => f.write_str("its pixels are durable"),
            Self::Leased {
                worker,
                second: None,
            } => write!(f, "worker {worker} renders it"),
            Self::Leased {
                worker,
                second: Some(second),
            } => write!(
                f,
                "workers {worker} and {second} render it, the first result wins"
            ),
            Self::Failed { failures, losses } => write!(
                f,
                "it waits for another worker: {failures} attempts at it failed, {losses} workers were lost while rendering it"
            ),
            Self::Image(why) => why.fmt(f),
        }
    }
}

impl fmt::Display for WhyWorker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Away => f.write_str("its link is closed"),
            Self::WantsNone => f.write_str("it wants no tile: it leaves, or has just come"),
            Self::Aside { .. } => f.write_str(
                "it failed tiles of several jobs that others rendered, and is set aside for a while",
            ),
            Self::Expelled { .. } => f.write_str(
                "its pixels were wrong where two others agreed: it gets no tiles for an hour, or until the coordinator is started again",
            ),
            Self::Full { attempts } => write!(f, "it holds the {attempts} tiles that it wants"),
            Self::NoTiles => f.write_str("no tile waits for a worker"),
            Self::NoneServed => f.write_str(
                "the tiles that wait ask for another revision of the renderer, or for labels, threads or memory that it does not have",
            ),
            Self::NearItsEnd { .. } => {
                f.write_str("it has too little time left for any tile that waits")
            }
            Self::AsideForJob { job, .. } => write!(
                f,
                "it failed tiles of job {job} that others rendered, and gets no more of that job for a while"
            ),
            Self::FailedBefore => {
                f.write_str("the tiles that wait failed on it, and wait for another worker")
            }
            Self::OwnWork => f.write_str(
                "the tiles that wait are to be verified by another worker, since it rendered them itself",
            ),
        }
    }
}
