//! What no worker and no client of ours would say to a coordinator: it is answered with a
//! sentence, costs that request alone, and the farm goes on.

use std::io::Write as _;
use std::net::TcpStream;

use model::{AttemptId, ImageNumber, ImageRef, JobId, Rect};
use wire::proto::control_up::Message as Up;
use wire::proto::deliver_down::Message as Answer;
use wire::proto::{ErrorKind, Heartbeat, Hello, Lease};
use wire::version::PROTOCOL_MAX;
use wire::{BlockHeader, Failure};

use crate::harness::Farm;
use crate::harness::raw::{self, Raw};
use crate::harness::scenes::{FLYBY, TINY};

fn token(farm: &Farm) -> String {
    std::fs::read_to_string(farm.place.state().join("token")).unwrap()
}

fn connect(farm: &Farm) -> Raw {
    Raw::connect(farm.address, &token(farm))
}

/// Submits a job of one small image.
fn submit(farm: &Farm) -> u64 {
    farm.submit(&[&[FLYBY, "--frames", "0", "--tile", "40x30"], &TINY[..]].concat())
}

/// After all that was said, a job still gets done.
fn goes_on(farm: &mut Farm) {
    farm.worker(&["--threads", "1"]);
    farm.wait_done(submit(farm));
}

#[track_caller]
fn refused(answer: Result<impl Sized, Failure>, kind: ErrorKind, phrases: &[&str]) {
    let Err(failure) = answer else {
        panic!("{kind:?} is expected, but it was taken");
    };
    assert_eq!(failure.kind, kind, "{failure:?}");
    for phrase in phrases {
        assert!(
            failure.sentence.contains(phrase),
            "`{phrase}` is not said: {failure:?}"
        );
    }
}

#[test]
fn workers_that_cannot_work_here_are_told_why() {
    let mut farm = Farm::new(&[]);
    let newer = Hello {
        protocol_min: PROTOCOL_MAX + 1,
        protocol_max: PROTOCOL_MAX + 3,
        ..raw::worker(1)
    };
    let said = format!("{}", PROTOCOL_MAX + 1);
    refused(
        connect(&farm).hello(newer),
        ErrorKind::WrongProtocol,
        &["protocol", &said],
    );

    let other = Hello {
        revision: render::REVISION + 1,
        ..raw::worker(1)
    };
    let said = format!("{}", render::REVISION + 1);
    refused(
        connect(&farm).hello(other),
        ErrorKind::WrongRevision,
        &["revision", &said],
    );

    let nobody = Hello {
        worker: None,
        ..raw::worker(1)
    };
    refused(
        connect(&farm).hello(nobody),
        ErrorKind::BadRequest,
        &["worker"],
    );
    let idle = Hello {
        threads: 0,
        ..raw::worker(1)
    };
    refused(
        connect(&farm).hello(idle),
        ErrorKind::BadRequest,
        &["threads"],
    );
    let shy = Up::Heartbeat(Heartbeat::default());
    refused(
        connect(&farm).open_with(shy),
        ErrorKind::BadRequest,
        &["hello"],
    );

    let mut stranger = Raw::connect(farm.address, &"5a".repeat(32));
    let answer = stranger.hello(raw::worker(1));
    refused(
        answer,
        ErrorKind::Unauthenticated,
        &["token is not this coordinator's"],
    );
    goes_on(&mut farm);
}

#[test]
fn blocks_that_were_changed_on_their_way_are_refused() {
    let mut farm = Farm::new(&[]);
    let job = submit(&farm);
    let mut raw = connect(&farm);
    let mut control = raw.hello(raw::worker(7)).unwrap();
    let mut delivery = raw.deliver(&control);
    let lease = raw.lease(&mut control, 1);
    let good = record(job, &lease);

    let mut flipped = good.clone();
    flipped[100] ^= 1;
    let cut = good[..good.len() - 1].to_vec();
    let empty = Vec::new();
    let mut endless = good.clone();
    endless[8..12].fill(0xff);
    let mut longer = good.clone();
    longer.push(0);
    let bad = [
        (flipped, "checksum"),
        (cut, "cut off"),
        (empty, "cut off"),
        (endless, "bytes of pixels"),
        (b"GIF89a".repeat(30), "not a block record"),
        (longer, "bytes of pixels"),
    ];
    for (record, phrase) in bad {
        let Answer::Refused(refused) = raw.block(&mut delivery, record) else {
            panic!("a record was taken where `{phrase}` is expected");
        };
        let sentence = refused.error.unwrap().sentence;
        assert!(
            sentence.contains(phrase),
            "`{phrase}` is not said: {sentence}"
        );
    }
    assert_eq!(farm.job(job).number("blocks_done"), 0);
    let answer = raw.block(&mut delivery, good);
    assert!(matches!(answer, Answer::Acknowledged(_)), "{answer:?}");
    assert_eq!(farm.job(job).number("blocks_done"), 1);
    drop((control, delivery, raw));
    goes_on(&mut farm);
}

#[test]
fn blocks_of_a_dead_attempt_count_for_nothing() {
    let farm = Farm::new(&[]);
    let job = submit(&farm);
    let mut raw = connect(&farm);
    let mut control = raw.hello(raw::worker(7)).unwrap();
    let mut delivery = raw.deliver(&control);
    let mut lease = raw.lease(&mut control, 1);
    lease.attempt.as_mut().unwrap().number += 1_000;
    let answer = raw.block(&mut delivery, record(job, &lease));
    assert!(matches!(answer, Answer::Refused(_)), "{answer:?}");
    assert_eq!(farm.job(job).number("blocks_done"), 0);
}

#[test]
fn bytes_that_are_no_messages_cost_their_connection_alone() {
    let mut farm = Farm::new(&[]);
    let preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
    // A frame header that announces 16 MiB, and one cut in its middle.
    let endless = [&preface[..], &[0xff; 9]].concat();
    let cut = [&preface[..], &[0, 0, 6, 4]].concat();
    for bytes in [
        b"GET / HTTP/1.1\r\n\r\n".to_vec(),
        vec![0; 100_000],
        endless,
        cut,
    ] {
        let mut stream = TcpStream::connect(farm.address).unwrap();
        // The coordinator may close while this is still being sent.
        let _ = stream.write_all(&bytes);
    }
    let methods = [
        "Farm/ShowJob",
        "Farm/Submit",
        "Farm/FetchFrame",
        "Workers/Control",
        "Workers/FetchScene",
    ];
    // The start of a field of 127 bytes, none of which follows; a tag that no field has; a number without end.
    for truncated in [&[0x0a, 0x7f][..], &[0x00], &[0x08, 0xff, 0xff]] {
        for method in methods {
            let status = raw::call(farm.address, &token(&farm), method, truncated);
            let status = status.expect_err("truncated messages are no messages");
            assert!(!status.message().is_empty(), "{method}: {status:?}");
        }
    }
    assert!(farm.coordinator.ended().is_none());
    goes_on(&mut farm);
}

/// A black block: the first of a lease.
fn record(job: u64, lease: &Lease) -> Vec<u8> {
    let tile = Rect::try_from(lease.tile.unwrap()).unwrap();
    let block = tile.blocks().next().unwrap();
    let header = BlockHeader {
        image: ImageRef {
            job: JobId(job),
            image: ImageNumber(lease.image),
        },
        rect: block,
        attempt: AttemptId::try_from(lease.attempt.unwrap()).unwrap(),
    };
    let bytes = usize::try_from(block.area()).unwrap() * model::film::PIXEL_BYTES;
    header.record(&vec![0; bytes]).unwrap()
}
