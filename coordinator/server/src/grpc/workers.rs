//! The workers' calls.

use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};
use wire::convert;
use wire::proto;
use wire::proto::workers_server::Workers;

use super::bytes::{Chunks, send_file};
use super::{Door, control, delivery, who};
use crate::input::{Input, Query, Wanted};

#[tonic::async_trait]
impl Workers for Door {
    type ControlStream = Chunks<proto::ControlDown>;

    async fn control(
        &self,
        request: Request<Streaming<proto::ControlUp>>,
    ) -> Result<Response<Self::ControlStream>, Status> {
        let (down, messages) = mpsc::channel(self.config.limits.worker_messages_max);
        let who = who(&request);
        control::open(self, who, request.into_inner(), down).await?;
        Ok(Response::new(ReceiverStream::new(messages)))
    }

    type DeliverStream = Chunks<proto::DeliverDown>;

    async fn deliver(
        &self,
        request: Request<Streaming<proto::DeliverUp>>,
    ) -> Result<Response<Self::DeliverStream>, Status> {
        let (down, messages) = mpsc::channel(self.config.limits.worker_messages_max);
        let who = who(&request);
        delivery::open(self, who, request.into_inner(), down).await?;
        Ok(Response::new(ReceiverStream::new(messages)))
    }

    type FetchSceneStream = Chunks<proto::FetchChunk>;

    async fn fetch_scene(
        &self,
        request: Request<proto::FetchRequest>,
    ) -> Result<Response<Self::FetchSceneStream>, Status> {
        fetch(self, request, Wanted::Scene).await
    }

    type FetchAssetStream = Chunks<proto::FetchChunk>;

    async fn fetch_asset(
        &self,
        request: Request<proto::FetchRequest>,
    ) -> Result<Response<Self::FetchAssetStream>, Status> {
        fetch(self, request, Wanted::Asset).await
    }
}

async fn fetch(
    door: &Door,
    request: Request<proto::FetchRequest>,
    wanted: Wanted,
) -> Result<Response<Chunks<proto::FetchChunk>>, Status> {
    let digest = convert::digest(&request.get_ref().digest, "digest")?;
    let paths = door
        .ask(|reply| Input::Ask(Query::Bytes(digest, wanted, reply)))
        .await?;
    let chunks = send_file(paths, |bytes, _, data| proto::FetchChunk {
        bytes,
        data: data.into(),
    });
    Ok(Response::new(chunks.await?))
}
