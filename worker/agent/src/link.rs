//! The link: two connections, a stream on each, and what passes on them.
//!
//! A link is one task. It reports what it hears to the loop under its number, and ends
//! when either stream does; dropping [`Link`] ends it from this side.

use std::sync::Arc;
use std::time::Duration;

use model::{Epoch, Span, WorkerId};
use session::Welcome;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;
use wire::convert;
use wire::proto::{self, ErrorKind, control_down, control_up, deliver_down, deliver_up};
use wire::{Failure, link};

use crate::admission::Access;
use crate::input::{Clients, Input, LinkNumber};

/// Messages of the control stream that wait to be sent.
const CONTROL_AHEAD: usize = 1_024;

/// Blocks that wait to be sent, beside those that the session may keep: it may send each
/// of them again once.
const DELIVERY_AHEAD: usize = 64;

/// How long a goodbye may take to arrive.
const GOODBYE_TIMEOUT: Duration = Duration::from_secs(2);

/// The loop's end of a link.
pub(crate) struct Link {
    pub(crate) number: LinkNumber,
    task: JoinHandle<()>,
    control: Option<mpsc::Sender<proto::ControlUp>>,
    delivery: Option<mpsc::Sender<proto::DeliverUp>>,
}

/// The stream is full or gone: the link is worth nothing any more.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Clogged;

impl Link {
    /// Opens both connections; the loop hears [`Input::Dialled`] or [`Input::Lost`].
    pub(crate) fn dial(
        number: LinkNumber,
        access: Arc<Access>,
        inputs: mpsc::Sender<Input>,
    ) -> Self {
        let task = tokio::spawn(async move {
            let input = match open(&access).await {
                Ok(clients) => Input::Dialled(number, Box::new(clients)),
                Err(failure) => Input::Lost(number, failure),
            };
            let _ = inputs.send(input).await;
        });
        Self {
            number,
            task,
            control: None,
            delivery: None,
        }
    }

    /// Says hello on the control stream and, once welcomed, on the delivery stream. The loop
    /// hears [`Input::Connected`] or [`Input::Lost`], and then whatever is said.
    pub(crate) fn greet(
        &mut self,
        clients: Clients,
        hello: proto::Hello,
        blocks_max: usize,
        inputs: mpsc::Sender<Input>,
    ) {
        let (control, control_up) = mpsc::channel(CONTROL_AHEAD);
        let (delivery, delivery_up) = mpsc::channel(blocks_max.saturating_add(DELIVERY_AHEAD));
        let number = self.number;
        let worker = hello.worker.unwrap_or_default().into();
        let first = control_up::Message::Hello(hello);
        self.control = Some(control);
        self.delivery = Some(delivery);
        // The channel is empty, so that it has room.
        let _ = self.say(first);
        let talk = Talk {
            number,
            worker,
            clients,
            inputs: inputs.clone(),
            delivery: self.delivery.clone(),
        };
        self.task = tokio::spawn(async move {
            let failure = talk.run(control_up, delivery_up).await;
            let _ = inputs.send(Input::Lost(number, failure)).await;
        });
    }

    /// Says something on the control stream.
    pub(crate) fn say(&self, message: control_up::Message) -> Result<(), Clogged> {
        let message = proto::ControlUp {
            message: Some(message),
        };
        let control = self.control.as_ref().ok_or(Clogged)?;
        control.try_send(message).map_err(|_| Clogged)
    }

    /// Sends a block.
    pub(crate) fn deliver(&self, block: proto::Delivery) -> Result<(), Clogged> {
        let message = proto::DeliverUp {
            message: Some(deliver_up::Message::Block(block)),
        };
        let delivery = self.delivery.as_ref().ok_or(Clogged)?;
        delivery.try_send(message).map_err(|_| Clogged)
    }

    /// Says goodbye, waits until it has left, and closes the link.
    pub(crate) async fn leave(mut self, reason: &str) {
        let goodbye = proto::Goodbye {
            reason: reason.to_owned(),
        };
        if self.say(control_up::Message::Goodbye(goodbye)).is_ok() {
            // The coordinator ends both streams when it has read the goodbye. The delivery stream
            // stays open until then: its end would end the link before the goodbye has left.
            self.control = None;
            let ended = tokio::time::timeout(GOODBYE_TIMEOUT, &mut self.task).await;
            if ended.is_err() {
                tracing::debug!("the goodbye may not have arrived");
            }
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.task.abort();
    }
}

/// What the link's task works with.
struct Talk {
    number: LinkNumber,
    worker: WorkerId,
    clients: Clients,
    inputs: mpsc::Sender<Input>,
    delivery: Option<mpsc::Sender<proto::DeliverUp>>,
}

impl Talk {
    /// Talks until either stream ends; answers why it did.
    async fn run(
        self,
        control_up: mpsc::Receiver<proto::ControlUp>,
        delivery_up: mpsc::Receiver<proto::DeliverUp>,
    ) -> Failure {
        match self.talk(control_up, delivery_up).await {
            Ok(()) => Failure::later(ErrorKind::Unspecified, "the coordinator ended the link"),
            Err(failure) => failure,
        }
    }

    async fn talk(
        self,
        control_up: mpsc::Receiver<proto::ControlUp>,
        delivery_up: mpsc::Receiver<proto::DeliverUp>,
    ) -> Result<(), Failure> {
        let Self {
            number,
            worker,
            clients,
            inputs,
            delivery,
        } = self;
        let Clients {
            control: mut control_client,
            delivery: mut delivery_client,
        } = clients;
        let control_up = ReceiverStream::new(control_up);
        let mut control_down = control_client.control(control_up).await?.into_inner();
        let welcome = welcome(&mut control_down).await?;

        let hello = proto::DeliverHello {
            worker: Some(worker.into()),
            epoch: welcome.epoch.0,
        };
        let hello = proto::DeliverUp {
            message: Some(deliver_up::Message::Hello(hello)),
        };
        if let Some(delivery) = delivery {
            // The channel is empty: nothing is sent before the loop is connected.
            let _ = delivery.send(hello).await;
        }
        let delivery_up = ReceiverStream::new(delivery_up);
        let mut delivery_down = delivery_client.deliver(delivery_up).await?.into_inner();
        match delivery_down.message().await?.and_then(|said| said.message) {
            Some(deliver_down::Message::Welcome(_)) => {}
            _ => return Err(strange("it did not welcome the delivery stream")),
        }

        let mut input = Some(Input::Connected(number, welcome));
        while let Some(said) = input.take() {
            if inputs.send(said).await.is_err() {
                return Ok(());
            }
            input = next(number, &mut control_down, &mut delivery_down).await?;
        }
        Ok(())
    }
}

/// What is said next on either stream; `None` once one has ended.
async fn next(
    number: LinkNumber,
    control: &mut Streaming<proto::ControlDown>,
    delivery: &mut Streaming<proto::DeliverDown>,
) -> Result<Option<Input>, Failure> {
    // What a newer coordinator says and this worker does not know is skipped.
    loop {
        tokio::select! {
            said = control.message() => match said? {
                None => return Ok(None),
                Some(proto::ControlDown { message: Some(message) }) => {
                    return Ok(Some(Input::Control(number, message)));
                }
                Some(proto::ControlDown { message: None }) => {}
            },
            said = delivery.message() => match said? {
                None => return Ok(None),
                Some(proto::DeliverDown { message: Some(message) }) => {
                    return Ok(Some(Input::Delivery(number, message)));
                }
                Some(proto::DeliverDown { message: None }) => {}
            },
        }
    }
}

async fn welcome(control: &mut Streaming<proto::ControlDown>) -> Result<Welcome, Failure> {
    let said = control.message().await?.and_then(|said| said.message);
    let Some(control_down::Message::Welcome(welcome)) = said else {
        return Err(strange("it did not answer the hello"));
    };
    if welcome.protocol < wire::version::PROTOCOL_MIN
        || welcome.protocol > wire::version::PROTOCOL_MAX
    {
        return Err(Failure::new(
            ErrorKind::WrongProtocol,
            format!(
                "the coordinator wants to speak protocol {}, which this worker does not know",
                welcome.protocol
            ),
        ));
    }
    let milliseconds = |number: u32| Span::from_millis(u64::from(number));
    Ok(Welcome {
        epoch: Epoch(welcome.epoch),
        heartbeat_interval: milliseconds(welcome.heartbeat_interval_ms),
        liveness_limit: milliseconds(welcome.liveness_limit_ms),
        live: convert::list(welcome.live, "welcome.live", 65_536)?,
    })
}

fn strange(what: &str) -> Failure {
    Failure::later(
        ErrorKind::Unspecified,
        format!("the coordinator behaves strangely: {what}"),
    )
}

async fn open(access: &Access) -> Result<Clients, Failure> {
    let way = access.way().await?;
    let (control, delivery) = tokio::try_join!(link::workers(&way), link::workers(&way))?;
    Ok(Clients { control, delivery })
}
