//! Answers to questions.

use model::{Digest, ImageNumber, ImageRef, JobId};
use std::path::PathBuf;
use wire::Failure;
use wire::proto::{self, ErrorKind};

use super::{Shell, views};
use crate::clock::unix_ms;
use crate::input::{Query, Snapshot, Wanted};
use crate::job::IMAGES_PER_MESSAGE;

impl Shell {
    /// Answers one question; whoever asked may have left.
    pub(super) fn answer(&self, query: Query) {
        match query {
            Query::Jobs(reply) => {
                let jobs = self.sched.jobs();
                let jobs = jobs.filter_map(|view| self.summary(view.job));
                // All jobs must fit into one message.
                let short = |summary| proto::JobSummary {
                    counters: Vec::new(),
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
            Query::Why(job, image, reply) => {
                let _ = reply.send(self.why(job, image));
            }
            Query::Info(reply) => {
                let _ = reply.send(Ok(self.info()));
            }
        }
    }

    /// A job in one line.
    pub(super) fn summary(&self, id: JobId) -> Option<proto::JobSummary> {
        let view = self.sched.job(id)?;
        Some(views::summary(&view, self.jobs.get(id)?))
    }

    /// Why a job, or an image of it, is not finished.
    fn why(&self, job: JobId, image: Option<ImageNumber>) -> Result<proto::WhyReply, Failure> {
        let of_job = self.sched.why_job(job).ok_or_else(|| views::no_job(job))?;
        let sentence = match image {
            None => of_job.to_string(),
            Some(image) => {
                let why = self.sched.why_image(ImageRef { job, image });
                let no_image = || {
                    let sentence = format!("job {job} has no frame {image}");
                    Failure::new(ErrorKind::NotFound, sentence)
                };
                why.ok_or_else(no_image)?.to_string()
            }
        };
        // Nothing else matters while nothing can be kept.
        let sentence = match self.troubles.values().next() {
            Some(trouble) => format!("the coordinator waits for its disk: {trouble}"),
            None => sentence,
        };
        Ok(proto::WhyReply { sentence })
    }

    fn snapshot(&self, id: JobId) -> Result<Snapshot, Failure> {
        let (Some(summary), Some(job)) = (self.summary(id), self.jobs.get(id)) else {
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

    fn bytes(&self, digest: Digest, wanted: Wanted) -> Result<PathBuf, Failure> {
        let mut scenes = self.jobs.iter().map(|(_, job)| &job.scene);
        let path = scenes.find_map(|scene| match wanted {
            Wanted::Scene => scene.scene(digest),
            Wanted::Asset => scene.asset(digest),
        });
        let what = match wanted {
            Wanted::Scene => "scene",
            Wanted::Asset => "asset",
        };
        path.ok_or_else(|| not_found(format!("no job has the {what} {digest}")))
    }

    fn info(&self) -> proto::FarmInfo {
        let connected = self
            .workers
            .values()
            .filter(|worker| worker.control.is_some());
        let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        proto::FarmInfo {
            build: self.config.build.clone(),
            protocol_min: wire::version::PROTOCOL_MIN,
            protocol_max: wire::version::PROTOCOL_MAX,
            revision: self.config.revision.0,
            epoch: self.state.epoch().0,
            started_unix_ms: unix_ms(self.clock.started()),
            jobs: count(self.jobs.len()),
            workers_connected: count(connected.count()),
        }
    }
}

fn not_found(sentence: String) -> Failure {
    Failure::new(ErrorKind::NotFound, sentence)
}
