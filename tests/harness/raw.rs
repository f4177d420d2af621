//! A client that says to a coordinator what no worker of ours would say.

use std::net::SocketAddr;

use prost::bytes::{Buf as _, BufMut as _};
use tokio::runtime::{Builder, Runtime};
use tokio::sync::mpsc::{self, UnboundedSender};
use tokio_stream::wrappers::UnboundedReceiverStream;
use tonic::codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder};
use tonic::service::Interceptor as _;
use tonic::{Request, Status, Streaming};
use wire::auth::Token;
use wire::proto::control_up::Message as Up;
use wire::proto::deliver_up::Message as Deliver;
use wire::proto::{
    ControlDown, ControlUp, Credit, DeliverDown, DeliverHello, DeliverUp, Hello, TileFailed,
    WorkerIdentity, control_down, deliver_down,
};
use wire::version::{PROTOCOL_MAX, PROTOCOL_MIN};
use wire::way::Way;
use wire::{Failure, link};

use super::wait;

/// Two connections to a coordinator, as a worker has them.
pub(crate) struct Raw {
    runtime: Runtime,
    control: link::Workers,
    delivery: link::Workers,
}

/// A control stream that was welcomed.
pub(crate) struct Control {
    up: UnboundedSender<ControlUp>,
    down: Streaming<ControlDown>,
    hello: Hello,
    epoch: u64,
}

/// A delivery stream that was welcomed.
pub(crate) struct Delivery {
    up: UnboundedSender<DeliverUp>,
    down: Streaming<DeliverDown>,
}

impl Raw {
    /// Connects; `token` is sent with every call.
    pub(crate) fn connect(coordinator: SocketAddr, token: &str) -> Self {
        let runtime = Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .unwrap();
        let token: Token = token.parse().unwrap();
        let open = || {
            let way = Way::local(coordinator, token.clone());
            runtime.block_on(link::workers(&way)).unwrap()
        };
        let (control, delivery) = (open(), open());
        Self {
            runtime,
            control,
            delivery,
        }
    }

    /// Says hello, and answers what the coordinator makes of it.
    pub(crate) fn hello(&mut self, hello: Hello) -> Result<Control, Failure> {
        let (up, mut down) = self.control(Up::Hello(hello.clone()))?;
        let welcome = self.runtime.block_on(next(&mut down))?;
        let Some(control_down::Message::Welcome(welcome)) = welcome.message else {
            panic!("a hello was answered with {welcome:?}");
        };
        Ok(Control {
            up,
            down,
            hello,
            epoch: welcome.epoch,
        })
    }

    /// Opens a control stream with any first message; answers its first error, if it is refused.
    pub(crate) fn open_with(&mut self, first: Up) -> Result<ControlDown, Failure> {
        let (_up, mut down) = self.control(first)?;
        self.runtime.block_on(next(&mut down))
    }

    fn control(
        &mut self,
        first: Up,
    ) -> Result<(UnboundedSender<ControlUp>, Streaming<ControlDown>), Failure> {
        let (up, messages) = channel();
        let message = Some(first);
        up.send(ControlUp { message }).unwrap();
        let answer = self.control.control(messages);
        let answer = self.runtime.block_on(timely(answer))?;
        Ok((up, answer.into_inner()))
    }

    /// Wants to hold so many tiles, and waits for the first lease.
    pub(crate) fn lease(&self, control: &mut Control, credit: u32) -> wire::proto::Lease {
        let message = Some(Up::Credit(Credit { tiles: credit }));
        control.up.send(ControlUp { message }).unwrap();
        loop {
            let down = self.runtime.block_on(next(&mut control.down)).unwrap();
            if let Some(control_down::Message::Lease(lease)) = down.message {
                return lease;
            }
        }
    }

    /// Says that the tile of a lease cannot be rendered, and wants no other.
    pub(crate) fn fail(&self, control: &mut Control, lease: &wire::proto::Lease) {
        let failed = TileFailed {
            attempt: lease.attempt,
            reason: "a test has it fail".into(),
        };
        for message in [Up::Credit(Credit { tiles: 0 }), Up::Failed(failed)] {
            let message = Some(message);
            control.up.send(ControlUp { message }).unwrap();
        }
    }

    /// Opens the delivery stream that belongs to a control stream.
    pub(crate) fn deliver(&mut self, control: &Control) -> Delivery {
        let (up, messages) = channel();
        let hello = DeliverHello {
            worker: control.hello.worker,
            epoch: control.epoch,
        };
        let message = Some(Deliver::Hello(hello));
        up.send(DeliverUp { message }).unwrap();
        let answer = self
            .runtime
            .block_on(timely(self.delivery.deliver(messages)));
        let mut down = answer.unwrap().into_inner();
        let welcome = self.runtime.block_on(next(&mut down)).unwrap().message;
        assert!(
            matches!(welcome, Some(deliver_down::Message::Welcome(_))),
            "{welcome:?}"
        );
        Delivery { up, down }
    }

    /// Delivers a record; answers what the coordinator says to it.
    pub(crate) fn block(&self, delivery: &mut Delivery, record: Vec<u8>) -> deliver_down::Message {
        let block = wire::proto::Delivery {
            record: record.into(),
            render_us: 1_000,
            counters: Vec::new(),
        };
        let message = Some(Deliver::Block(block));
        delivery.up.send(DeliverUp { message }).unwrap();
        let answer = self.runtime.block_on(next(&mut delivery.down)).unwrap();
        answer.message.expect("an answer that we know")
    }
}

/// Calls a method with one message of any bytes; answers how the call ended.
pub(crate) fn call(
    coordinator: SocketAddr,
    token: &str,
    method: &str,
    message: &'static [u8],
) -> Result<(), Status> {
    let runtime = Builder::new_current_thread().enable_all().build().unwrap();
    let way = Way::local(coordinator, token.parse().unwrap());
    call_over(&runtime, &way, token, method, message)
}

/// [`call`] over any way; `token` is sent with it.
pub(crate) fn call_over(
    runtime: &Runtime,
    way: &Way,
    token: &str,
    method: &str,
    message: &'static [u8],
) -> Result<(), Status> {
    let mut token: Token = token.parse().unwrap();
    runtime.block_on(async {
        let channel = way.open().await.unwrap();
        let mut client = tonic::client::Grpc::new(channel);
        client.ready().await.unwrap();
        let request = token.call(Request::new(())).unwrap();
        let request = request.map(|()| tokio_stream::once(message));
        let path = format!("/flyby.v1.{method}").parse().unwrap();
        let answer = client.streaming(request, path, Bytes);
        let mut answers = timely(answer).await?.into_inner();
        while timely(answers.message()).await?.is_some() {}
        Ok(())
    })
}

/// Sends bytes as they are, and takes no notice of those that come.
struct Bytes;

impl Codec for Bytes {
    type Encode = &'static [u8];
    type Decode = ();
    type Encoder = Self;
    type Decoder = Self;

    fn encoder(&mut self) -> Self {
        Self
    }

    fn decoder(&mut self) -> Self {
        Self
    }
}

impl Encoder for Bytes {
    type Item = &'static [u8];
    type Error = Status;

    fn encode(&mut self, item: Self::Item, out: &mut EncodeBuf<'_>) -> Result<(), Status> {
        out.put_slice(item);
        Ok(())
    }
}

impl Decoder for Bytes {
    type Item = ();
    type Error = Status;

    fn decode(&mut self, bytes: &mut DecodeBuf<'_>) -> Result<Option<()>, Status> {
        bytes.advance(bytes.remaining());
        Ok(Some(()))
    }
}

/// The introduction of a worker that a coordinator takes.
pub(crate) fn worker(id: u64) -> Hello {
    Hello {
        protocol_min: PROTOCOL_MIN,
        protocol_max: PROTOCOL_MAX,
        revision: render::REVISION,
        build: "test".into(),
        simd_level: "scalar".into(),
        threads: 1,
        name: format!("raw{id}"),
        worker: Some(WorkerIdentity { id, incarnation: 1 }),
        ..Hello::default()
    }
}

fn channel<T>() -> (UnboundedSender<T>, UnboundedReceiverStream<T>) {
    let (sender, receiver) = mpsc::unbounded_channel();
    (sender, receiver.into())
}

async fn next<T>(stream: &mut Streaming<T>) -> Result<T, Failure> {
    let message = timely(stream.message()).await?;
    Ok(message.expect("the stream goes on"))
}

async fn timely<T>(call: impl Future<Output = Result<T, Status>>) -> Result<T, Status> {
    let answer = tokio::time::timeout(wait::LIMIT, call).await;
    answer.expect("the coordinator answers in time")
}
