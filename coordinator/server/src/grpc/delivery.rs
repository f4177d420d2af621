//! A worker's delivery stream.

use std::sync::Arc;

use bytes::Bytes;
use model::{Digest, Span, WorkerId};
use sched::{BlockRef, LinkId};
use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio::time::timeout;
use tonic::{Status, Streaming};
use wire::block::{BlockHeader, BlockRecord};
use wire::proto::deliver_up::Message;
use wire::proto::{self, ErrorKind, deliver_down};
use wire::{Failure, convert};

use super::{Door, HELLO_TIMEOUT};
use crate::input::{Arrived, Input, Link};
use crate::trust::gate::Who;

/// Most counters beside one block.
const COUNTERS_MAX: usize = 32;

type Down = mpsc::Sender<Result<proto::DeliverDown, Status>>;

/// Hears whose stream it is, ties it to the worker, and takes its blocks from then on.
pub(super) async fn open(
    door: &Door,
    who: Who,
    mut up: Streaming<proto::DeliverUp>,
    down: Down,
) -> Result<(), Failure> {
    let first = timeout(HELLO_TIMEOUT, up.message()).await;
    let first = first.map_err(|_| {
        Failure::later(
            ErrorKind::BadRequest,
            "the worker opened a delivery stream and did not say hello",
        )
    })??;
    let Some(proto::DeliverUp {
        message: Some(Message::Hello(hello)),
    }) = first
    else {
        return Err(Failure::new(
            ErrorKind::BadRequest,
            "a delivery stream begins with hello",
        ));
    };
    let worker: WorkerId = convert::require(hello.worker, "hello.worker")?.into();
    let (alive, dead) = oneshot::channel();
    let id = door.gates.next_link();
    let link = Link {
        id,
        down: down.clone(),
        _alive: alive,
    };
    door.ask(|reply| Input::Delivering {
        worker,
        epoch: hello.epoch,
        link,
        reply,
    })
    .await?;
    let listener = Listener {
        worker,
        link: id,
        inputs: door.inputs.clone(),
        blocks: door.gates.blocks.clone(),
        // Only a weak end: the stream must end when the loop drops its own.
        down: down.downgrade(),
    };
    let trust = door.trust.clone();
    tokio::spawn(async move {
        tokio::select! {
            () = listener.listen(up, dead) => {}
            () = trust.revoked(who) => {}
        }
        let closed = Input::DeliveryClosed {
            worker: listener.worker,
            link: listener.link,
        };
        let _ = listener.inputs.send(closed).await;
    });
    Ok(())
}

struct Listener {
    worker: WorkerId,
    link: LinkId,
    inputs: mpsc::Sender<Input>,
    blocks: Arc<Semaphore>,
    down: mpsc::WeakSender<Result<proto::DeliverDown, Status>>,
}

impl Listener {
    async fn listen(&self, mut up: Streaming<proto::DeliverUp>, mut dead: oneshot::Receiver<()>) {
        loop {
            let said = tokio::select! {
                said = up.message() => said,
                _ = &mut dead => break,
            };
            let message = match said {
                Ok(Some(said)) => said.message,
                Ok(None) | Err(_) => break,
            };
            let goes_on = match message {
                Some(Message::Block(delivery)) => self.take(delivery).await.is_ok(),
                // A message of no known kind is ignored: a newer worker may say more.
                None => true,
                Some(Message::Hello(_)) => false,
            };
            if !goes_on {
                break;
            }
        }
    }

    /// Hands a block to the loop, or answers what is wrong with it. An error says that
    /// nobody listens any more.
    async fn take(&self, delivery: proto::Delivery) -> Result<(), ()> {
        let refused = match read(&delivery) {
            Ok((header, payload, counters)) => {
                // Waiting here stops reading, and so in the end the worker's sending.
                let permit = self.blocks.clone().acquire_owned().await.map_err(drop)?;
                let pixels = Digest(blake3::hash(&payload).into());
                let arrived = Arrived {
                    worker: self.worker,
                    block: BlockRef {
                        attempt: header.attempt,
                        image: header.image,
                        rect: header.rect,
                    },
                    payload,
                    pixels,
                    elapsed: Span(delivery.render_us),
                    counters,
                    _permit: permit,
                };
                return self
                    .inputs
                    .send(Input::Block(Box::new(arrived)))
                    .await
                    .map_err(drop);
            }
            Err(failure) => failure,
        };
        tracing::warn!(worker = %self.worker, %refused, "a block could not be read");
        let refused = proto::Refused {
            attempt: None,
            block: None,
            error: Some(refused.detail()),
        };
        let down = self.down.upgrade().ok_or(())?;
        let message = proto::DeliverDown {
            message: Some(deliver_down::Message::Refused(refused)),
        };
        down.send(Ok(message)).await.map_err(drop)
    }
}

/// What a delivery brings: whose block, its pixels, what was counted.
type Read = (BlockHeader, Bytes, Vec<(String, u64)>);

/// A delivery, checked.
pub(crate) fn read(delivery: &proto::Delivery) -> Result<Read, Failure> {
    let record = BlockRecord::only(&delivery.record)?;
    if delivery.counters.len() > COUNTERS_MAX {
        return Err(Failure::new(
            ErrorKind::BadRequest,
            format!("a block has more than {COUNTERS_MAX} counters"),
        ));
    }
    let counters = delivery.counters.iter().cloned().map(convert::counter);
    let counters = counters.collect::<Result<_, _>>()?;
    let payload = delivery.record.slice_ref(record.payload);
    Ok((record.header, payload, counters))
}
