//! The user's calls.

use std::sync::Arc;

use model::{ImageNumber, ImageRef, JobId, Rect};
use sched::Command;
use tokio::sync::{OwnedSemaphorePermit, broadcast, mpsc};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};
use wire::Failure;
use wire::proto::farm_server::Farm;
use wire::proto::{self, ErrorKind};

use super::Door;
use super::bytes::{Chunks, send_file};
use crate::input::{Frames, Input, Query, Snapshot, Wanderers, WhyOf, Wish};
use crate::space;

/// Updates that wait for one watcher; what follows waits in the job's own channel.
const UPDATES_AHEAD: usize = 4;

type Answer<T> = Result<Response<T>, Status>;

#[tonic::async_trait]
impl Farm for Door {
    async fn submit(
        &self,
        request: Request<Streaming<proto::SubmitPart>>,
    ) -> Answer<proto::Submitted> {
        let _permit = self.submissions.try_acquire().map_err(|_| {
            Failure::later(
                ErrorKind::Limit,
                "as many submissions as may are arriving already; try again in a moment",
            )
        })?;
        let mut parts = request.into_inner();
        let new = self.inbox.receive(self.config.revision, &mut parts).await?;
        let needed = space::needed(&new.submission, new.formats);
        let submitted = self
            .ask(|reply| Input::Submit(Box::new(new), reply))
            .await?;
        let space = self.space().await;
        Ok(Response::new(proto::Submitted {
            disk_needed_bytes: needed,
            disk_free_bytes: space.map(|space| space.free),
            ..submitted
        }))
    }

    async fn list_jobs(&self, _: Request<proto::ListJobsRequest>) -> Answer<proto::JobList> {
        let jobs = self.ask(|reply| Input::Ask(Query::Jobs(reply))).await?;
        Ok(Response::new(jobs))
    }

    type ShowJobStream = Chunks<proto::JobUpdate>;

    async fn show_job(&self, request: Request<proto::JobRequest>) -> Answer<Self::ShowJobStream> {
        let job = JobId(request.get_ref().job);
        let snapshot = self.ask(|reply| Input::Ask(Query::Job(job, reply))).await?;
        let (sender, updates) = mpsc::channel(UPDATES_AHEAD);
        tokio::spawn(async move {
            let _ = send_parts(&sender, snapshot.parts).await;
        });
        Ok(Response::new(ReceiverStream::new(updates)))
    }

    type WatchJobStream = Chunks<proto::JobUpdate>;

    async fn watch_job(&self, request: Request<proto::JobRequest>) -> Answer<Self::WatchJobStream> {
        let job = JobId(request.get_ref().job);
        let permit = self.watchers.clone().try_acquire_owned().map_err(|_| {
            Failure::later(
                ErrorKind::Limit,
                "as many watchers as may are watching already",
            )
        })?;
        let snapshot = self.ask(|reply| Input::Ask(Query::Job(job, reply))).await?;
        let (sender, updates) = mpsc::channel(UPDATES_AHEAD);
        let inputs = self.inputs.clone();
        tokio::spawn(watch(job, snapshot, inputs, sender, permit));
        Ok(Response::new(ReceiverStream::new(updates)))
    }

    async fn job_log(&self, request: Request<proto::JobRequest>) -> Answer<proto::JobLogReply> {
        let job = JobId(request.get_ref().job);
        let log = self.ask(|reply| Input::Ask(Query::Log(job, reply))).await?;
        Ok(Response::new(log))
    }

    async fn cancel_job(&self, request: Request<proto::JobRequest>) -> Answer<proto::JobSummary> {
        let job = JobId(request.get_ref().job);
        let wish = Wish {
            command: Command::Cancel,
            frames: Frames::Stay,
            if_over_since: None,
        };
        let summary = self.ask(|reply| Input::Command(job, wish, reply)).await?;
        Ok(Response::new(summary))
    }

    async fn command_job(&self, request: Request<proto::JobCommand>) -> Answer<proto::JobSummary> {
        use proto::job_command::Command as Wanted;
        let request = request.get_ref();
        let job = JobId(request.job);
        let mut frames = Frames::Stay;
        let command = match &request.command {
            Some(Wanted::Pause(_)) => Command::Pause,
            Some(Wanted::Resume(_)) => Command::Resume,
            Some(Wanted::Priority(wanted)) => Command::Priority(wanted.priority),
            Some(Wanted::Remove(wanted)) => {
                if wanted.frames {
                    frames = Frames::Go;
                }
                Command::Remove
            }
            Some(Wanted::Retry(_)) => Command::Retry,
            Some(Wanted::Again(wanted)) => Command::Again(ImageNumber(wanted.image)),
            Some(Wanted::Share(wanted)) => Command::Share(wanted.share),
            Some(Wanted::Focus(wanted)) => {
                let region = wanted.region.map(Rect::try_from).transpose();
                Command::Focus(region.map_err(Failure::from)?)
            }
            None => {
                let sentence = "the command is of no kind that this coordinator knows";
                return Err(Failure::new(ErrorKind::BadRequest, sentence).into());
            }
        };
        let wish = Wish {
            command,
            frames,
            if_over_since: None,
        };
        let summary = self.ask(|reply| Input::Command(job, wish, reply)).await?;
        Ok(Response::new(summary))
    }

    async fn clean(&self, request: Request<proto::CleanRequest>) -> Answer<proto::CleanReply> {
        Ok(Response::new(
            super::clean::clean(self, request.into_inner()).await?,
        ))
    }

    async fn drain_workers(
        &self,
        request: Request<proto::DrainRequest>,
    ) -> Answer<proto::WorkerList> {
        let proto::DrainRequest { workers, all } = request.into_inner();
        let whom = match all {
            true => Wanderers::All,
            false => Wanderers::Named(workers),
        };
        let workers = self.ask(|reply| Input::Drain(whom, reply)).await?;
        Ok(Response::new(workers))
    }

    async fn why(&self, request: Request<proto::WhyRequest>) -> Answer<proto::WhyReply> {
        let request = request.get_ref();
        let job = JobId(request.job);
        let image = request.image.map(|image| ImageRef {
            job,
            image: ImageNumber(image),
        });
        let of = match (&request.worker, image, request.pixel) {
            (Some(worker), _, _) => WhyOf::Worker(worker.clone()),
            (None, None, _) => WhyOf::Job(job),
            (None, Some(image), None) => WhyOf::Image(image),
            (None, Some(image), Some(pixel)) => WhyOf::Pixel(image, pixel.x, pixel.y),
        };
        let why = self.ask(|reply| Input::Ask(Query::Why(of, reply))).await?;
        Ok(Response::new(why))
    }

    type FetchFrameStream = Chunks<proto::FrameChunk>;

    async fn fetch_frame(
        &self,
        request: Request<proto::FetchFrameRequest>,
    ) -> Answer<Self::FetchFrameStream> {
        let request = request.get_ref();
        let (job, image) = (JobId(request.job), ImageNumber(request.image));
        let format = proto::FrameFormat::try_from(request.format).map_err(|_| {
            Failure::new(
                ErrorKind::BadRequest,
                format!("frame format {} is not known here", request.format),
            )
        })?;
        let format = super::format(format);
        let (path, file) = self
            .ask(|reply| Input::Ask(Query::Frame(job, image, format, reply)))
            .await?;
        let chunks = send_file(vec![path], move |_, place, data| proto::FrameChunk {
            file: (place == 0).then(|| file.clone()),
            data,
        });
        Ok(Response::new(chunks.await?))
    }

    async fn list_workers(
        &self,
        _: Request<proto::ListWorkersRequest>,
    ) -> Answer<proto::WorkerList> {
        let workers = self.ask(|reply| Input::Ask(Query::Workers(reply))).await?;
        Ok(Response::new(workers))
    }

    async fn list_sites(&self, _: Request<proto::ListSitesRequest>) -> Answer<proto::SiteList> {
        let sites = self.sites.all();
        Ok(Response::new(proto::SiteList { sites }))
    }

    async fn look_back(
        &self,
        request: Request<proto::LookBackRequest>,
    ) -> Answer<proto::SiteLooks> {
        let name = request.into_inner().site;
        let looks = self.sites.looks(&name).ok_or_else(|| {
            let said = format!("there is no site {:?}", wire::convert::sentence(&name, 64));
            Failure::new(ErrorKind::NotFound, said)
        })?;
        Ok(Response::new(looks))
    }

    async fn info(&self, _: Request<proto::InfoRequest>) -> Answer<proto::FarmInfo> {
        let info = self.ask(|reply| Input::Ask(Query::Info(reply))).await?;
        let space = self.space().await;
        let until = self.trust.authority.own_until();
        Ok(Response::new(proto::FarmInfo {
            certificate_until_unix_ms: until.saturating_mul(1_000),
            disk_free_bytes: space.map(|space| space.free),
            disk_bytes: space.map(|space| space.all),
            ..info
        }))
    }

    async fn create_token(
        &self,
        request: Request<proto::CreateTokenRequest>,
    ) -> Answer<proto::CreatedToken> {
        let created = super::tokens::create(self, request.into_inner()).await?;
        Ok(Response::new(created))
    }

    async fn list_tokens(&self, _: Request<proto::ListTokensRequest>) -> Answer<proto::TokenList> {
        let tokens = self.trust.tokens.all();
        Ok(Response::new(proto::TokenList { tokens }))
    }

    async fn revoke_token(
        &self,
        request: Request<proto::RevokeTokenRequest>,
    ) -> Answer<proto::Token> {
        let revoked = super::tokens::revoke(self, request.get_ref().id).await?;
        Ok(Response::new(revoked))
    }
}

/// Sends a snapshot and what follows it, until the job is over or the watcher leaves. A watcher
/// that fell behind gets a fresh snapshot.
async fn watch(
    job: JobId,
    mut snapshot: Snapshot,
    inputs: mpsc::Sender<Input>,
    sender: mpsc::Sender<Result<proto::JobUpdate, Status>>,
    _permit: OwnedSemaphorePermit,
) {
    loop {
        if send_parts(&sender, snapshot.parts).await.is_err() {
            return;
        }
        let Some(changes) = snapshot.changes else {
            return;
        };
        match follow(changes, &sender).await {
            Followed::ToItsEnd => return,
            Followed::FellBehind => {}
        }
        let (reply, answer) = tokio::sync::oneshot::channel();
        let asked = inputs.send(Input::Ask(Query::Job(job, reply))).await;
        snapshot = match (asked, answer.await) {
            (Ok(()), Ok(Ok(snapshot))) => snapshot,
            (Ok(()), Ok(Err(failure))) => {
                let _ = sender.send(Err(failure.into())).await;
                return;
            }
            _ => return,
        };
    }
}

/// How following a job's changes ended.
enum Followed {
    /// The job is over, or the watcher left.
    ToItsEnd,
    /// Changes were dropped.
    FellBehind,
}

async fn follow(
    mut changes: broadcast::Receiver<Arc<proto::JobUpdate>>,
    sender: &mpsc::Sender<Result<proto::JobUpdate, Status>>,
) -> Followed {
    let mut over = false;
    loop {
        let change = tokio::select! {
            change = changes.recv() => change,
            () = sender.closed() => return Followed::ToItsEnd,
        };
        match change {
            Ok(update) => {
                over = is_over(&update);
                if sender.send(Ok((*update).clone())).await.is_err() {
                    return Followed::ToItsEnd;
                }
            }
            Err(broadcast::error::RecvError::Lagged(_)) => return Followed::FellBehind,
            Err(broadcast::error::RecvError::Closed) => {
                if !over {
                    let _ = sender.send(Err(super::stopping().into())).await;
                }
                return Followed::ToItsEnd;
            }
        }
    }
}

/// Whether an update says that the job is over.
fn is_over(update: &proto::JobUpdate) -> bool {
    use proto::JobState::{Cancelled, Done, Failed};
    let summary = match &update.update {
        Some(proto::job_update::Update::Delta(delta)) => delta.summary.as_ref(),
        _ => None,
    };
    summary.is_some_and(|summary| matches!(summary.state(), Done | Failed | Cancelled))
}

async fn send_parts(
    sender: &mpsc::Sender<Result<proto::JobUpdate, Status>>,
    parts: Vec<proto::JobUpdate>,
) -> Result<(), mpsc::error::SendError<Result<proto::JobUpdate, Status>>> {
    for part in parts {
        sender.send(Ok(part)).await?;
    }
    Ok(())
}
