//! The line of a polled site to the loop: what a worker says and hears on its two streams, without a socket.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use model::{AttemptId, Begun, Digest, Rect, Revision, Running, Span, WorkerId};
use sched::{BlockRef, Event, LinkId, Queue};
use tokio::runtime::Handle;
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;
use tonic::Status;
use wire::proto::{self, Delivery, control_down, deliver_down};
use wire::version::PROTOCOL_MAX;

use crate::grpc::read_delivery;
use crate::input::{AboutWorker, Arrived, Gates, Greeting, Input, Link};

/// Messages that wait to be heard: all tiles of a stock of large images.
const CONTROL_MAX: usize = 1 << 20;

/// Answers that wait to be heard: more than the blocks of one call.
const ANSWERS_MAX: usize = 1 << 14;

/// Why a line can be used no more.
#[derive(Debug)]
pub(super) enum Cut {
    /// The coordinator stops.
    Stopping,
    /// The loop has ended the line, for this reason.
    Ended(String),
}

/// What a site says of itself.
pub(super) struct Hello {
    pub(super) worker: WorkerId,
    pub(super) revision: Revision,
    pub(super) threads: u32,
    pub(super) queue: Queue,
    pub(super) about: AboutWorker,
    pub(super) held: Vec<AttemptId>,
    pub(super) begun: Vec<Begun>,
}

/// An open line. Its heart beats until it is closed or dropped.
pub(super) struct Line {
    worker: WorkerId,
    id: LinkId,
    inputs: mpsc::Sender<Input>,
    gates: Gates,
    runtime: Handle,
    control: mpsc::Receiver<Result<proto::ControlDown, Status>>,
    answers: mpsc::Receiver<Result<proto::DeliverDown, Status>>,
    running: Arc<Mutex<Vec<Running>>>,
    beat: JoinHandle<()>,
}

/// What became of a block.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Became {
    /// It is durable.
    Durable,
    /// It counts for nothing.
    Refused,
}

impl Line {
    /// Opens it; answers which of the tiles that the site holds are still its own.
    pub(super) fn open(
        hello: Hello,
        inputs: mpsc::Sender<Input>,
        gates: Gates,
        runtime: Handle,
    ) -> Result<(Self, Vec<AttemptId>), Cut> {
        let (down, mut control) = mpsc::channel(CONTROL_MAX);
        let (answer, answers) = mpsc::channel(ANSWERS_MAX);
        let link = |id, down| Link {
            id,
            down,
            // Nobody reads the other direction from a socket.
            _alive: oneshot::channel().0,
        };
        let (worker, id) = (hello.worker, gates.next_link());
        let greeting = Greeting {
            worker,
            link: Link {
                id,
                down,
                _alive: oneshot::channel().0,
            },
            protocol: PROTOCOL_MAX,
            revision: hello.revision,
            threads: hello.threads,
            queue: Some(hello.queue),
            held: hello.held,
            begun: hello.begun,
            about: hello.about,
        };
        send(&inputs, Input::Hello(Box::new(greeting)))?;
        let welcome = match control.blocking_recv() {
            Some(Ok(proto::ControlDown {
                message: Some(control_down::Message::Welcome(welcome)),
            })) => welcome,
            Some(Err(status)) => return Err(Cut::Ended(status.message().to_owned())),
            _ => return Err(Cut::Ended("the loop said no welcome".to_owned())),
        };
        let (reply, may) = oneshot::channel();
        let delivering = Input::Delivering {
            worker,
            epoch: welcome.epoch,
            link: link(gates.next_link(), answer),
            reply,
        };
        send(&inputs, delivering)?;
        match may.blocking_recv() {
            Ok(Ok(())) => {}
            Ok(Err(failure)) => return Err(Cut::Ended(failure.to_string())),
            Err(_) => return Err(Cut::Stopping),
        }
        let running = Arc::<Mutex<Vec<Running>>>::default();
        let every = Duration::from_millis(u64::from(welcome.heartbeat_interval_ms.max(1)));
        let beat = runtime.spawn(beat(inputs.clone(), (worker, id), every, running.clone()));
        let live = welcome.live.into_iter().map(AttemptId::try_from);
        let line = Self {
            worker,
            id,
            inputs,
            gates,
            runtime,
            control,
            answers,
            running,
            beat,
        };
        Ok((line, live.filter_map(Result::ok).collect()))
    }

    pub(super) fn worker(&self) -> WorkerId {
        self.worker
    }

    /// Says something on the control stream.
    pub(super) fn say(&self, event: Event) -> Result<(), Cut> {
        let said = Input::Said {
            worker: self.worker,
            link: self.id,
            event,
        };
        send(&self.inputs, said)
    }

    /// Says from now on with each heartbeat that these tiles run.
    pub(super) fn runs(&self, running: Vec<Running>) {
        *self.running.lock().unwrap_or_else(PoisonError::into_inner) = running;
    }

    /// What has been said meanwhile on the control stream, one message; `None` where there is none.
    pub(super) fn heard(&mut self) -> Result<Option<control_down::Message>, Cut> {
        match self.control.try_recv() {
            Err(mpsc::error::TryRecvError::Empty) => Ok(None),
            Err(mpsc::error::TryRecvError::Disconnected) => Err(ended()),
            Ok(said) => message(said),
        }
    }

    /// Waits for the next message.
    pub(super) async fn hear(&mut self) -> Result<Option<control_down::Message>, Cut> {
        match self.control.recv().await {
            None => Err(ended()),
            Some(said) => message(said),
        }
    }

    /// Hands blocks over, and waits until each is durable or refused. What cannot be read is as if refused.
    pub(super) fn deliver(
        &mut self,
        deliveries: &[Delivery],
    ) -> Result<Vec<(AttemptId, Rect, Span, Became)>, Cut> {
        let mut open = BTreeSet::new();
        let mut became = Vec::new();
        let mut took = std::collections::BTreeMap::new();
        for delivery in deliveries {
            let Ok((header, payload, counters)) = read_delivery(delivery) else {
                continue;
            };
            let permit = self.gates.blocks.clone().acquire_owned();
            let permit = self.runtime.block_on(permit).map_err(|_| Cut::Stopping)?;
            let elapsed = Span(delivery.render_us);
            let key = (header.attempt, header.rect);
            took.insert(key, elapsed);
            open.insert(key);
            let arrived = Arrived {
                worker: self.worker,
                block: BlockRef {
                    attempt: header.attempt,
                    image: header.image,
                    rect: header.rect,
                },
                pixels: Digest(blake3::hash(&payload).into()),
                payload,
                elapsed,
                counters,
                _permit: permit,
            };
            send(&self.inputs, Input::Block(Box::new(arrived)))?;
        }
        while !open.is_empty() {
            let Some(Ok(answer)) = self.answers.blocking_recv() else {
                return Err(ended());
            };
            let Some((key, how)) = answered(answer) else {
                continue;
            };
            if open.remove(&key) {
                let took = took.get(&key).copied().unwrap_or_default();
                became.push((key.0, key.1, took, how));
            }
        }
        Ok(became)
    }

    /// Closes it: the loop may lease the site's tiles to others.
    pub(super) fn close(self) {
        let closed = Event::LinkClosed {
            worker: self.worker,
            link: self.id,
        };
        // Where the loop has ended nobody holds anything.
        let _ = self.say(closed);
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.beat.abort();
    }
}

fn ended() -> Cut {
    Cut::Ended("the loop has ended the line".to_owned())
}

fn send(inputs: &mpsc::Sender<Input>, input: Input) -> Result<(), Cut> {
    inputs.blocking_send(input).map_err(|_| Cut::Stopping)
}

fn message(said: Result<proto::ControlDown, Status>) -> Result<Option<control_down::Message>, Cut> {
    match said {
        Ok(said) => Ok(said.message),
        Err(status) => Err(Cut::Ended(status.message().to_owned())),
    }
}

fn answered(answer: proto::DeliverDown) -> Option<((AttemptId, Rect), Became)> {
    let (attempt, block, how) = match answer.message? {
        deliver_down::Message::Acknowledged(it) => (it.attempt, it.block, Became::Durable),
        deliver_down::Message::Refused(it) => (it.attempt, it.block, Became::Refused),
        deliver_down::Message::Welcome(_) => return None,
    };
    let attempt = AttemptId::try_from(attempt?).ok()?;
    Some(((attempt, Rect::try_from(block?).ok()?), how))
}

/// Says that the site lives, for as long as the loop listens.
async fn beat(
    inputs: mpsc::Sender<Input>,
    (worker, link): (WorkerId, LinkId),
    every: Duration,
    running: Arc<Mutex<Vec<Running>>>,
) {
    loop {
        let now = running
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        let event = Event::Heartbeat {
            worker,
            running: now,
        };
        let said = Input::Said {
            worker,
            link,
            event,
        };
        if inputs.send(said).await.is_err() {
            return;
        }
        tokio::time::sleep(every).await;
    }
}
