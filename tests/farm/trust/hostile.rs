//! What no client of ours would do to a port that other machines can reach.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;

use tokio::runtime::Builder;
use wire::proto::ErrorKind;
use wire::tls::token_file::TokenFile;
use wire::way::Way;

use crate::harness::scenes::FLYBY;
use crate::harness::{Farm, Place, need, raw, wait};

/// More than arrive at the same time.
const SILENT: usize = 400;

#[test]
fn callers_that_say_nothing_or_nonsense_cost_nobody_anything() {
    let Some(address) = need::address() else {
        return;
    };
    let mut farm = Farm::reachable(address, &[]);
    let token = farm.token("u.token", &["--role", "view"]);
    let there = Place::new();
    let connect = || TcpStream::connect(farm.outside()).unwrap();
    let silent: Vec<_> = (0..SILENT).map(|_| connect()).collect();
    // A record of TLS that announces 16 KiB and ends; a version that there is not; a greeting cut in its middle.
    let hello = [
        &[0x16, 3, 1, 0x40, 0][..],
        &[1, 0, 0x3f, 0xfc, 3, 3],
        &[0; 40],
    ]
    .concat();
    let mut open = Vec::new();
    for bytes in [
        &hello[..],
        &[0x16; 64],
        &[0x16, 3, 1, 0xff, 0xff],
        &[0],
        b"GET / HTTP/1.1\r\n\r\n",
    ] {
        let mut stream = connect();
        stream.write_all(bytes).unwrap();
        open.push(stream);
    }
    there.flyby(["job", "list", "--token-file", &token]).ok();
    farm.flyby(["job", "list"]).ok();
    // The first of too many callers had to go: its end is all that is heard.
    let mut first = silent.first().unwrap();
    let heard = first.read(&mut [0; 16]);
    assert!(matches!(heard, Ok(0) | Err(_)), "{heard:?}");
    assert!(farm.coordinator.ended().is_none());
}

#[test]
fn more_connections_than_there_is_room_for_are_told_so_and_cost_nobody_a_frame() {
    // 512 files leave room for 64 connections, beside those that are told.
    let few = ["sh", "-c", "ulimit -n 512 && exec \"$@\"", "--"];
    let small = [
        FLYBY,
        "--resolution",
        "64x48",
        "--rays",
        "1",
        "--frames",
        "0..1",
    ];
    let mut farm = Farm::wrapped(Place::new(), &few, &[]);
    farm.worker(&[]);
    let job = farm.submit(&small);
    farm.wait_done(job);
    let connect = || {
        let mut stream = TcpStream::connect(farm.address).unwrap();
        // What a client of HTTP/2 says first: it has arrived, and stays.
        stream
            .write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0")
            .unwrap();
        stream
    };
    let mut open: Vec<_> = (0..60).map(|_| connect()).collect();
    // The worker and 60 others: by and by all places are taken.
    wait::until("somebody is told that there is no room", || {
        open.push(connect());
        let asked = farm.flyby(["job", "list"]);
        (!asked.status.success()).then(|| asked.refused(3, &["as many connections", "ulimit -n"]))
    });
    drop(open);
    wait::until("there is room again", || {
        farm.flyby(["job", "list"]).status.success().then_some(())
    });
    let job = farm.submit(&small);
    farm.wait_done(job);
    assert!(farm.coordinator.ended().is_none());
}

#[test]
fn a_client_in_the_clear_is_told_of_tls() {
    let Some(address) = need::address() else {
        return;
    };
    let farm = Farm::reachable(address, &[]);
    let owner = std::fs::read_to_string(farm.place.state().join("token")).unwrap();
    // As a client of before TLS would come, with the right token.
    let status = raw::call(farm.outside(), &owner, "Farm/ListJobs", b"").unwrap_err();
    let said = wire::Failure::from(status);
    assert_eq!(said.kind, ErrorKind::Unauthenticated);
    assert!(said.sentence.contains("speaks TLS"), "{said}");
    assert!(said.sentence.contains("--token-file"), "{said}");
}

#[test]
fn what_speaks_no_tls_is_named() {
    let farm = Farm::new(&[]);
    let token = farm.token("u.token", &["--role", "view"]);
    let other = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = other.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        for stream in other.incoming().take(8).flatten() {
            // The settings of HTTP/2, as a coordinator in the clear begins.
            let _ = (&stream).write_all(&[0, 0, 0, 4, 0, 0, 0, 0, 0]);
            let _ = (&stream).read(&mut [0; 1024]);
        }
    });
    let command = [
        "job",
        "list",
        "--token-file",
        &token,
        "--coordinator",
        &address,
    ];
    farm.flyby(command).refused(3, &["speaks no TLS", &address]);
}

#[test]
fn loopback_speaks_tls_too_so_that_tunnels_lead_there() {
    let farm = Farm::new(&[]);
    let token = farm.token("u.token", &["--role", "view"]);
    let mode = std::fs::metadata(&token).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    Place::new()
        .flyby(["job", "list", "--token-file", &token])
        .ok();
    // A worker's call by a user's token, however large its role, and over TLS by that of the state folder.
    let file = TokenFile::read(Path::new(&token)).unwrap();
    let runtime = Builder::new_current_thread().enable_all().build().unwrap();
    let way = Way::by_token(&file, None).unwrap();
    let owner = std::fs::read_to_string(farm.place.state().join("token")).unwrap();
    for secret in [owner.trim(), file.secret.reveal()] {
        let status = raw::call_over(&runtime, &way, secret, "Workers/Control", b"");
        let said = wire::Failure::from(status.unwrap_err());
        assert_eq!(said.kind, ErrorKind::Unauthenticated, "{said}");
        assert!(
            said.sentence.contains("needs a worker's certificate"),
            "{said}"
        );
    }
}
