//! Answers to questions.

use model::{Digest, ImageNumber, ImageRef, JobId};
use sched::WhyJob;
use std::path::PathBuf;
use wire::Failure;
use wire::proto::{self, ErrorKind};

use super::{Shell, views};
use crate::clock::unix_ms;
use crate::input::{Query, Snapshot, Wanted, WhyOf};
use crate::job::IMAGES_PER_MESSAGE;

/// Most jobs that are running where all of them are asked how long they will take: each is looked at for each.
const ESTIMATES_MAX: usize = 64;

impl Shell {
    /// Answers one question; whoever asked may have left.
    pub(super) fn answer(&self, query: Query) {
        match query {
            Query::Jobs(reply) => {
                let jobs = self.sched.jobs();
                let running = jobs.filter(|job| job.state == sched::JobState::Running);
                let are_few = running.count() <= ESTIMATES_MAX;
                let jobs = self.sched.jobs();
                let jobs = jobs.filter_map(|view| match are_few {
                    true => self.summary_with_estimate(view.job),
                    false => self.summary(view.job),
                });
                // All jobs must fit into one message.
                let short = |summary| proto::JobSummary {
                    counters: Vec::new(),
                    needs: None,
                    ..summary
                };
                let jobs = jobs.map(short).collect();
                let _ = reply.send(Ok(proto::JobList { jobs }));
            }
            Query::Job(job, reply) => {
                let _ = reply.send(self.snapshot(job));
            }
            Query::Log(job, reply) => {
                let log = self.jobs.get(job).map(crate::job::Job::log);
                let _ = reply.send(log.ok_or_else(|| views::no_job(job)));
            }
            Query::Frame(job, image, format, reply) => {
                let _ = reply.send(self.frame(job, image, format));
            }
            Query::Bytes(digest, wanted, reply) => {
                let _ = reply.send(self.bytes(digest, wanted));
            }
            Query::Workers(reply) => {
                let workers = self.sched.workers();
                let workers = workers
                    .map(|view| views::worker_status(&view, self.workers.get(&view.worker)))
                    .collect();
                let _ = reply.send(Ok(proto::WorkerList { workers }));
            }
            Query::Why(of, reply) => {
                let _ = reply.send(self.why(&of));
            }
            Query::Info(reply) => {
                let _ = reply.send(Ok(self.info()));
            }
            Query::Missing(worker, attempts, reply) => {
                let missing = attempts.into_iter();
                let missing = missing
                    .filter_map(|attempt| Some((attempt, self.sched.missing(worker, attempt)?)));
                let _ = reply.send(Ok(missing.collect()));
            }
            Query::Wanted(offer, label, reply) => {
                let _ = reply.send(Ok(self.wanted(&offer, &label)));
            }
        }
    }

    /// A job in one line.
    pub(super) fn summary(&self, id: JobId) -> Option<proto::JobSummary> {
        let view = self.sched.job(id)?;
        let ended = match view.state {
            sched::JobState::Over(outcome) if !self.held.is_ending(id) => {
                Some((outcome, view.ended))
            }
            _ => None,
        };
        Some(views::summary(&view, ended, self.jobs.get(id)?))
    }

    /// The same, with how long it will still take.
    pub(super) fn summary_with_estimate(&self, id: JobId) -> Option<proto::JobSummary> {
        Some(proto::JobSummary {
            left: self.sched.time_left(id).map(views::estimate),
            ..self.summary(id)?
        })
    }

    /// Why something is not finished, or has nothing to do.
    fn why(&self, of: &WhyOf) -> Result<proto::WhyReply, Failure> {
        let sentence = match of {
            WhyOf::Job(job) => {
                let why = self.sched.why_job(*job);
                let why = why.ok_or_else(|| views::no_job(*job))?;
                let waits_for_workers = matches!(
                    why,
                    WhyJob::NoWorkers | WhyJob::NobodyServes { .. } | WhyJob::NobodyTakes { .. }
                );
                let sites = match waits_for_workers {
                    true => self.sites.board().sentences(),
                    false => String::new(),
                };
                format!("{why}{sites}")
            }
            WhyOf::Image(image) => self.why_image(*image)?.to_string(),
            WhyOf::Pixel(image, x, y) => self.why_pixel(*image, *x, *y)?,
            WhyOf::Worker(name) => {
                let called = self.workers_called(name);
                let why = called.first().and_then(|id| self.sched.why_worker(*id));
                why.ok_or_else(|| views::no_worker(name))?.to_string()
            }
        };
        // Nothing else matters while nothing can be kept.
        let sentence = match self.troubles.values().next() {
            Some(trouble) => format!("the coordinator waits for its disk: {trouble}"),
            None => sentence,
        };
        Ok(proto::WhyReply { sentence })
    }

    /// What workers of a site could do, and who else is there for it.
    fn wanted(&self, offer: &sched::Offer, label: &str) -> cluster::pilot::Wanted {
        let demand = self.sched.demand(offer);
        let others = self.sched.workers().filter(|view| {
            let worker = self.workers.get(&view.worker);
            let is_of_site = worker.is_some_and(|worker| worker.about.labels.contains(label));
            view.link == sched::Link::Open && view.aside.is_none() && !is_of_site
        });
        cluster::pilot::Wanted {
            squares: demand.squares,
            unmeasured: demand.unmeasured,
            time: demand.time,
            dearest: demand.dearest,
            others: others.map(|view| u64::from(view.threads)).sum(),
        }
    }

    fn why_image(&self, image: ImageRef) -> Result<sched::WhyImage, Failure> {
        let known = self.sched.job(image.job);
        known.ok_or_else(|| views::no_job(image.job))?;
        let why = self.sched.why_image(image);
        why.ok_or_else(|| not_found(format!("job {} has no frame {}", image.job, image.image)))
    }

    fn why_pixel(&self, image: ImageRef, x: u32, y: u32) -> Result<String, Failure> {
        self.why_image(image)?;
        let pixel = model::Rect {
            x0: x,
            y0: y,
            x1: x.saturating_add(1),
            y1: y.saturating_add(1),
        };
        let why = self.sched.why_tile(image, pixel);
        let why = why.ok_or_else(|| {
            not_found(format!(
                "the pixel {x},{y} is not rendered in job {}",
                image.job
            ))
        })?;
        // People know workers by their names.
        Ok(match why {
            sched::WhyTile::Leased {
                worker,
                second: None,
            } => format!("worker {} renders it", self.worker_name(worker)),
            sched::WhyTile::Leased {
                worker,
                second: Some(second),
            } => format!(
                "workers {} and {} render it, the first result wins",
                self.worker_name(worker),
                self.worker_name(second)
            ),
            why => why.to_string(),
        })
    }

    fn snapshot(&self, id: JobId) -> Result<Snapshot, Failure> {
        let (Some(summary), Some(job)) = (self.summary_with_estimate(id), self.jobs.get(id)) else {
            return Err(views::no_job(id));
        };
        let mut parts: Vec<proto::JobSnapshot> = Vec::new();
        let mut images = self.sched.images(id).peekable();
        let reasons = views::Reasons::of(self.sched.failures(id));
        loop {
            let part: Vec<_> = images
                .by_ref()
                .take(IMAGES_PER_MESSAGE)
                .map(|view| views::status(&view, job, views::is_over(&summary), &reasons))
                .collect();
            parts.push(proto::JobSnapshot {
                first: parts.is_empty(),
                last: images.peek().is_none(),
                summary: Some(summary.clone()),
                images: part,
            });
            if images.peek().is_none() {
                break;
            }
        }
        Ok(Snapshot {
            parts: parts
                .into_iter()
                .map(|part| proto::JobUpdate {
                    update: Some(proto::job_update::Update::Snapshot(part)),
                })
                .collect(),
            changes: job.watch(),
        })
    }

    fn frame(
        &self,
        id: JobId,
        image: ImageNumber,
        format: image::Format,
    ) -> Result<(PathBuf, proto::FrameFile), Failure> {
        let job = self.jobs.get(id).ok_or_else(|| views::no_job(id))?;
        let range = self.sched.job(id).map(|view| view.frames);
        if range.is_none_or(|range| range.index_of(image).is_none()) {
            return Err(not_found(format!("job {id} has no frame {image}")));
        }
        if !job.formats().contains(format) {
            return Err(not_found(format!(
                "job {id} makes no {format} of its frames, only {}",
                job.formats()
            )));
        }
        let file = job.files.get(&image).and_then(|files| {
            let mut files = files.iter();
            files.find(|file| crate::grpc::format(file.format()) == format)
        });
        match file {
            Some(file) => Ok((job.folders().frames.join(&file.name), file.clone())),
            None => Err(Failure::later(
                ErrorKind::NotReady,
                format!("frame {image} of job {id} is not finished"),
            )),
        }
    }

    /// Where bytes are, once for each job that has them: those of a cancelled job are on their way out.
    fn bytes(&self, digest: Digest, wanted: Wanted) -> Result<Vec<PathBuf>, Failure> {
        let scenes = self.jobs.iter().map(|(_, job)| &job.scene);
        let paths: Vec<_> = scenes
            .filter_map(|scene| match wanted {
                Wanted::Scene => scene.scene(digest),
                Wanted::Asset => scene.asset(digest),
            })
            .collect();
        let what = match wanted {
            Wanted::Scene => "scene",
            Wanted::Asset => "asset",
        };
        match paths.is_empty() {
            true => Err(not_found(format!("no job has the {what} {digest}"))),
            false => Ok(paths),
        }
    }

    fn info(&self) -> proto::FarmInfo {
        let views = || self.sched.workers();
        let connected = || views().filter(|view| view.link == sched::Link::Open);
        let running = self.sched.jobs();
        let running = running.filter(|job| job.state == sched::JobState::Running);
        let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        proto::FarmInfo {
            build: self.config.build.clone(),
            protocol_min: wire::version::PROTOCOL_MIN,
            protocol_max: wire::version::PROTOCOL_MAX,
            revision: self.config.revision.0,
            epoch: self.state.epoch().0,
            started_unix_ms: unix_ms(self.clock.started()),
            jobs: count(self.jobs.len()),
            workers_connected: count(connected().count()),
            jobs_running: count(running.count()),
            threads: connected().map(|view| view.threads).sum(),
            attempts_live: views().map(|view| view.attempts).sum(),
            workers_aside: count(connected().filter(|view| view.aside.is_some()).count()),
            incidents: self.sched.jobs().map(|job| job.incidents).sum(),
            undecided: self.sched.jobs().map(|job| job.undecided).sum(),
            now_unix_ms: self.unix_ms_now(),
            state: self.state.root().display().to_string(),
            // These are asked for by who has the time.
            disk_free_bytes: None,
            disk_bytes: None,
            certificate_until_unix_ms: 0,
            trouble: self.troubles.values().next().cloned().unwrap_or_default(),
        }
    }
}

fn not_found(sentence: String) -> Failure {
    Failure::new(ErrorKind::NotFound, sentence)
}
