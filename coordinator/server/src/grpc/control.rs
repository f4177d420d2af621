//! A worker's control stream.

use std::collections::BTreeSet;

use model::{Revision, Span, WorkerId};
use sched::{Event, LinkId};
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;
use tonic::{Status, Streaming};
use wire::proto::control_up::Message;
use wire::proto::{self, ErrorKind};
use wire::version::{PROTOCOL_MAX, PROTOCOL_MIN, agree};
use wire::{BadMessage, Failure, convert};

use super::{Door, HELLO_TIMEOUT, labels};
use crate::input::{AboutWorker, Greeting, Input, Link};
use crate::trust::gate::Who;

/// Most attempts that one message may name.
const ATTEMPTS_MAX: usize = 65_536;

/// Most tiles that a worker may say it renders.
const RUNNING_MAX: usize = 4_096;

/// Most bytes of a worker's labels together.
const LABELS_BYTES_MAX: u64 = 256;

/// Most bytes of a sentence that a worker says.
const SENTENCE_BYTES_MAX: usize = 2_000;

/// Hears a worker's hello, hands it to the loop, and from then on what else it says.
///
/// The loop answers on `down`: a welcome, or why not.
pub(super) async fn open(
    door: &Door,
    who: Who,
    mut up: Streaming<proto::ControlUp>,
    down: mpsc::Sender<Result<proto::ControlDown, Status>>,
) -> Result<(), Failure> {
    let first = timeout(HELLO_TIMEOUT, up.message()).await;
    let first = first.map_err(|_| {
        Failure::later(
            ErrorKind::BadRequest,
            "the worker opened a control stream and did not say hello",
        )
    })??;
    let Some(proto::ControlUp {
        message: Some(Message::Hello(hello)),
    }) = first
    else {
        return Err(Failure::new(
            ErrorKind::BadRequest,
            "a control stream begins with hello",
        ));
    };
    let (alive, dead) = oneshot::channel();
    let link = Link {
        id: door.gates.next_link(),
        down,
        _alive: alive,
    };
    let (id, greeting) = (link.id, greeting(hello, link)?);
    let worker = greeting.worker;
    door.feed(Input::Hello(Box::new(greeting))).await?;
    let (inputs, trust) = (door.inputs.clone(), door.trust.clone());
    tokio::spawn(async move {
        tokio::select! {
            () = listen(&inputs, worker, id, up, dead) => {}
            () = trust.revoked(who) => {
                tracing::info!(%worker, "its token is revoked: the worker's link is ended");
            }
        }
        let closed = Event::LinkClosed { worker, link: id };
        let closed = Input::Said {
            worker,
            link: id,
            event: closed,
        };
        let _ = inputs.send(closed).await;
    });
    Ok(())
}

/// Hands everything that a worker says to the loop, until its stream ends.
async fn listen(
    inputs: &mpsc::Sender<Input>,
    worker: WorkerId,
    link: LinkId,
    mut up: Streaming<proto::ControlUp>,
    mut dead: oneshot::Receiver<()>,
) {
    let say = |event| Input::Said {
        worker,
        link,
        event,
    };
    loop {
        let said = tokio::select! {
            said = up.message() => said,
            _ = &mut dead => break,
        };
        let message = match said {
            Ok(Some(said)) => said.message,
            Ok(None) | Err(_) => break,
        };
        // A message of no known kind is ignored: a newer worker may say more.
        let Some(message) = message else { continue };
        let goodbye = matches!(message, Message::Goodbye(_));
        match event(worker, message) {
            Ok(event) => {
                if inputs.send(say(event)).await.is_err() || goodbye {
                    break;
                }
            }
            Err(bad) => {
                tracing::warn!(%worker, %bad, "a worker said something that cannot be read");
                break;
            }
        }
    }
}

/// A hello, checked.
fn greeting(hello: proto::Hello, link: Link<proto::ControlDown>) -> Result<Greeting, Failure> {
    let (min, max) = (hello.protocol_min, hello.protocol_max);
    let protocol = agree(min..=max).ok_or_else(|| wrong_protocol(min, max))?;
    let worker = convert::require(hello.worker, "hello.worker")?;
    Ok(Greeting {
        worker: worker.into(),
        link,
        protocol,
        revision: Revision(hello.revision),
        threads: convert::number(hello.threads, "hello.threads", 1..=4_096)?,
        queue: None,
        held: convert::list(hello.held, "hello.held", ATTEMPTS_MAX)?,
        begun: convert::list(hello.begun, "hello.begun", RUNNING_MAX)?,
        about: AboutWorker {
            name: convert::text(hello.name, "hello.name", 1..=200)?,
            build: convert::text(hello.build, "hello.build", 0..=200)?,
            simd_level: convert::text(hello.simd_level, "hello.simd_level", 0..=200)?,
            memory_bytes: hello.memory_bytes,
            labels: few_labels(hello.labels)?,
            time_left: hello.time_left_ms.map(span),
        },
    })
}

/// All workers with their labels must fit into one message.
fn few_labels(all: Vec<String>) -> Result<BTreeSet<String>, BadMessage> {
    let bytes = all.iter().map(String::len).sum::<usize>() as u64;
    convert::number(bytes, "bytes of hello.labels", 0..=LABELS_BYTES_MAX)?;
    labels(all, "hello.labels")
}

fn span(milliseconds: u64) -> Span {
    Span(milliseconds.saturating_mul(1_000))
}

fn wrong_protocol(min: u32, max: u32) -> Failure {
    let older = if max < PROTOCOL_MIN {
        "the worker is too old: upgrade it to the coordinator's version"
    } else if min > PROTOCOL_MAX {
        "the coordinator is too old: upgrade it to the worker's version"
    } else {
        "the worker's range is empty: install it anew"
    };
    Failure::new(
        ErrorKind::WrongProtocol,
        format!(
            "the worker speaks protocol {min} to {max}, this coordinator {PROTOCOL_MIN} to \
             {PROTOCOL_MAX}: {older}"
        ),
    )
}

/// What a worker said, as the scheduler's event.
fn event(worker: WorkerId, message: Message) -> Result<Event, BadMessage> {
    Ok(match message {
        Message::Hello(_) => return Err(BadMessage::Missing("anything but a second hello")),
        Message::Heartbeat(heartbeat) => Event::Heartbeat {
            worker,
            running: convert::list(heartbeat.running, "heartbeat.running", RUNNING_MAX)?,
        },
        Message::Credit(credit) => Event::Credit {
            worker,
            credit: credit.tiles,
        },
        Message::Failed(failed) => Event::TileFailed {
            worker,
            attempt: convert::require(failed.attempt, "failed.attempt")?.try_into()?,
            reason: convert::sentence(&failed.reason, SENTENCE_BYTES_MAX),
        },
        Message::GiveBack(back) => Event::GivenBack {
            worker,
            attempts: convert::list(back.attempts, "give_back.attempts", ATTEMPTS_MAX)?,
        },
        Message::Goodbye(goodbye) => {
            let reason = convert::sentence(&goodbye.reason, SENTENCE_BYTES_MAX);
            tracing::info!(%worker, reason, "a worker says goodbye");
            Event::Goodbye { worker }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_foreign_protocol_is_told_which_side_to_upgrade() {
        let said = |min, max| wrong_protocol(min, max).sentence;
        assert!(said(0, 0).contains("upgrade it to the coordinator's version"));
        assert!(said(PROTOCOL_MAX + 1, PROTOCOL_MAX + 2).contains("upgrade it to the worker's"));
        assert!(said(3, 2).contains("protocol 3 to 2") || said(3, 2).contains("install"));
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let worker = WorkerId {
            id: 1,
            incarnation: 1,
        };
        let failed = Message::Failed(proto::TileFailed::default());
        let bad = event(worker, failed).unwrap_err();
        assert_eq!(bad, BadMessage::Missing("failed.attempt"));
    }
}
