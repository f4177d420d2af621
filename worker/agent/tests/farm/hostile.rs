//! Whoever speaks nonsense is told so, and costs nobody else anything.

use agent::{Ask, ExitReason};
use model::{AttemptId, Epoch, ImageNumber, ImageRef, JobId, Rect};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;
use wire::auth::Token;
use wire::proto::{self, ErrorKind, control_up, deliver_down, deliver_up};
use wire::{BlockHeader, Failure};

use crate::harness::{Farm, Worker, film_digest, scene, soon, submit};
use crate::painter::{self, Ramp};

const WORKER: proto::WorkerIdentity = proto::WorkerIdentity {
    id: 5,
    incarnation: 6,
};

fn hello() -> proto::Hello {
    proto::Hello {
        protocol_min: 1,
        protocol_max: 1,
        revision: painter::REVISION.0,
        threads: 1,
        name: "raw".to_owned(),
        worker: Some(WORKER),
        ..proto::Hello::default()
    }
}

/// Says hello on a stream of its own; answers the coordinator's first words.
async fn said_to(farm: &Farm, hello: proto::Hello) -> Result<(), Failure> {
    let up = proto::ControlUp {
        message: Some(control_up::Message::Hello(hello)),
    };
    let mut client = farm.worker_client().await;
    let (_keep, receiver) = sender_with(up);
    let mut down = client.control(receiver).await?.into_inner();
    match down.message().await? {
        Some(_) => Ok(()),
        None => panic!("the stream ended without a word"),
    }
}

fn sender_with<T>(first: T) -> (mpsc::Sender<T>, ReceiverStream<T>) {
    let (sender, receiver) = mpsc::channel(16);
    assert!(sender.try_send(first).is_ok(), "there is room");
    (sender, ReceiverStream::new(receiver))
}

#[tokio::test]
async fn a_wrong_token_opens_nothing() {
    let farm = Farm::start().await;
    let wrong = Token::from_random([1; 32]);
    let mut client = wire::link::farm(&wire::way::Way::local(farm.address, wrong.clone()))
        .await
        .unwrap();
    let refused = client.info(proto::InfoRequest {}).await.unwrap_err();
    assert_eq!(Failure::from(refused).kind, ErrorKind::Unauthenticated);
    let worker = Worker::start(farm.address, &wrong, 1, Ramp::default());
    let ExitReason::Refused { reason } = worker.exit().await else {
        panic!("it must be refused");
    };
    assert!(reason.contains("token"), "{reason}");
}

#[tokio::test]
async fn foreign_versions_are_told_which_side_to_upgrade() {
    let farm = Farm::start().await;
    let newer = proto::Hello {
        protocol_min: 98,
        protocol_max: 99,
        ..hello()
    };
    let refused = said_to(&farm, newer).await.unwrap_err();
    assert_eq!(refused.kind, ErrorKind::WrongProtocol);
    assert!(refused.sentence.contains("protocol 98 to 99"), "{refused}");

    let painter = Ramp {
        foreign: true,
        ..Ramp::default()
    };
    let worker = Worker::start(farm.address, &farm.token, 1, painter);
    let ExitReason::Refused { reason } = worker.exit().await else {
        panic!("it must be refused");
    };
    assert!(
        reason.contains("revision 78") && reason.contains("revision 77"),
        "{reason}"
    );
}

#[tokio::test]
async fn a_hello_that_cannot_be_is_refused() {
    let farm = Farm::start().await;
    let refused = async |hello: proto::Hello| said_to(&farm, hello).await.unwrap_err().sentence;
    let nobody = refused(proto::Hello {
        worker: None,
        ..hello()
    })
    .await;
    assert!(nobody.contains("`hello.worker`"), "{nobody}");
    let idle = refused(proto::Hello {
        threads: 0,
        ..hello()
    })
    .await;
    assert!(idle.contains("`hello.threads` is 0"), "{idle}");
    let nameless = refused(proto::Hello {
        name: String::new(),
        ..hello()
    })
    .await;
    assert!(nameless.contains("`hello.name`"), "{nameless}");
    said_to(&farm, hello())
        .await
        .expect("a good one is welcome");
}

#[tokio::test]
async fn bad_blocks_cost_themselves() {
    let farm = Farm::start().await;
    let mut client = farm.worker_client().await;
    let deliver_hello = proto::DeliverUp {
        message: Some(deliver_up::Message::Hello(proto::DeliverHello {
            worker: Some(WORKER),
            epoch: 1,
        })),
    };
    let (_early, receiver) = sender_with(deliver_hello.clone());
    let early = client.deliver(receiver).await.unwrap_err();
    assert_eq!(Failure::from(early).kind, ErrorKind::NotReady);

    let (_control, receiver) = sender_with(proto::ControlUp {
        message: Some(control_up::Message::Hello(hello())),
    });
    let mut control = client.control(receiver).await.unwrap().into_inner();
    control.message().await.unwrap().expect("a welcome");
    let (delivery, receiver) = sender_with(deliver_hello);
    let mut down = client.deliver(receiver).await.unwrap().into_inner();
    down.message().await.unwrap().expect("a welcome");

    let header = BlockHeader {
        image: ImageRef {
            job: JobId(1),
            image: ImageNumber(0),
        },
        rect: Rect {
            x0: 0,
            y0: 0,
            x1: 1,
            y1: 1,
        },
        attempt: AttemptId {
            epoch: Epoch(1),
            number: 1,
        },
    };
    let record = header.record(&[0; 32]).unwrap();
    let mut flipped = record.clone();
    flipped[60] ^= 1;
    let long = [record.as_slice(), &[0]].concat();
    let cases = [
        (record[..record.len() - 1].to_vec(), ErrorKind::BadRequest),
        (Vec::new(), ErrorKind::BadRequest),
        (flipped, ErrorKind::DigestMismatch),
        (long, ErrorKind::BadRequest),
        (record, ErrorKind::AttemptDead),
    ];
    for (record, kind) in cases {
        let block = proto::Delivery {
            record: record.into(),
            ..proto::Delivery::default()
        };
        let message = proto::DeliverUp {
            message: Some(deliver_up::Message::Block(block)),
        };
        delivery.send(message).await.unwrap();
        let refused = refusal(&mut down).await;
        assert_eq!(refused.kind, kind, "{refused}");
    }

    // Nobody else noticed.
    let scene = scene("32x32", farm.folder.path()).description;
    let worker = Worker::start(farm.address, &farm.token, 1, Ramp::default());
    let job = submit(&farm, &scene, "0", (32, 32)).await;
    let done = farm.job_over(job).await;
    assert_eq!(done.images[0].film_digest, film_digest(&scene, 0).0);
    worker.leave(Ask::Stop).await;
}

async fn refusal(down: &mut Streaming<proto::DeliverDown>) -> Failure {
    let said = soon("the block is answered", down.message()).await.unwrap();
    match said.unwrap().message {
        Some(deliver_down::Message::Refused(refused)) => refused.error.unwrap().into(),
        other => panic!("{other:?}"),
    }
}
