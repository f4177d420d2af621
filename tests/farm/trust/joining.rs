//! Workers join by a token's file, stay by a certificate, and are let go by revoking.

use std::fs;
use std::time::{Duration, SystemTime};

use crate::harness::scenes::{FLYBY, TINY, slow, small};
use crate::harness::{Farm, Place, Process, Signal, need, wait};

const UNREACHABLE: i32 = 3;

/// Starts a worker that knows nothing but a token's file.
fn worker(there: &Place, token: &str) -> Process {
    let command = ["worker", "--while-input-open", "--threads", "1"];
    there.start("worker", command.into_iter().chain(["--token-file", token]))
}

/// A worker's end by a refusal that says all this.
#[track_caller]
fn refused(mut worker: Process, phrases: &[&str]) {
    let ended = worker.wait();
    let said = worker.stderr();
    assert_eq!(ended.code(), Some(UNREACHABLE), "{said}");
    for phrase in phrases {
        assert!(said.contains(phrase), "`{phrase}` is not said: {said}");
    }
}

fn tiny(farm: &Farm) -> u64 {
    farm.submit(&[&[FLYBY, "--frames", "0"], &TINY[..]].concat())
}

#[test]
fn a_worker_with_a_tokens_file_needs_nothing_else() {
    let Some(address) = need::address() else {
        return;
    };
    let farm = Farm::reachable(address, &[]);
    let token = farm.token("w.token", &[]);
    let there = Place::new();
    let _worker = worker(&there, &token);
    farm.wait_connected(1);
    let job = farm.submit(&small().with(&[FLYBY]));
    assert_eq!(farm.wait_done(job).film_digests(), small().digests);
    let secret = fs::read_to_string(&token).unwrap();
    let secret: serde_json::Value = serde_json::from_str(&secret).unwrap();
    let secret = secret["secret"].as_str().unwrap();
    for said in [farm.coordinator.stderr(), _worker.stderr()] {
        assert!(!said.contains(secret), "a secret in a log");
    }
    for file in farm.place.files("state") {
        let bytes = fs::read(farm.place.state().join(&file)).unwrap();
        let holds = bytes.windows(64).any(|window| window == secret.as_bytes());
        assert!(!holds, "a secret in {file}");
    }
}

#[test]
fn certificates_are_renewed_while_a_job_is_rendered() {
    let Some(address) = need::address() else {
        return;
    };
    let farm = Farm::reachable(address, &["--certificate-life", "3 s"]);
    let (token, user) = (
        farm.token("w.token", &[]),
        farm.token("u.token", &["--role", "view"]),
    );
    let there = Place::new();
    let worker = worker(&there, &token);
    farm.wait_connected(1);
    let job = farm.submit(&slow().with(&[FLYBY]));
    wait::until("the worker has renewed its certificate three times", || {
        (worker.stderr().matches("is renewed").count() >= 3).then_some(())
    });
    assert_eq!(farm.wait_done(job).film_digests(), slow().digests);
    // Three renewals take longer than the certificates of the start counted, the coordinator's own among them.
    let list = there.flyby(["job", "list", "--token-file", &user, "--output", "quiet"]);
    assert_eq!(list.ok().trim(), job.to_string());
    assert_eq!(farm.connected(), 1);
    let said = worker.stderr();
    assert!(!said.contains("link to the coordinator is gone"), "{said}");
}

#[test]
fn a_worker_that_slept_past_its_certificate_gets_another() {
    let Some(address) = need::address() else {
        return;
    };
    // Its link outlives the sleep: nothing but the certificate is old.
    let farm = Farm::reachable(
        address,
        &["--certificate-life", "3 s", "--liveness", "100 s"],
    );
    let token = farm.token("w.token", &[]);
    let there = Place::new();
    let worker = worker(&there, &token);
    farm.wait_connected(1);
    worker.signal(Signal::Stop);
    let counts_no_more = SystemTime::now() + Duration::from_secs(5);
    wait::until("its certificate counts no more", || {
        (SystemTime::now() > counts_no_more).then_some(())
    });
    worker.signal(Signal::Continue);
    wait::until("the worker has another certificate", || {
        (worker.stderr().matches("has joined").count() == 2).then_some(())
    });
    let said = worker.stderr();
    assert!(!said.contains("link to the coordinator is gone"), "{said}");
}

#[test]
fn a_worker_that_is_started_again_needs_no_second_token() {
    let Some(address) = need::address() else {
        return;
    };
    let mut farm = Farm::reachable(address, &[]);
    let token = farm.token("w.token", &["--uses", "1"]);
    let there = Place::new();
    worker_comes_and_goes(&farm, &there, &token);
    worker_comes_and_goes(&farm, &there, &token);
    refused(worker(&Place::new(), &token), &["used up", "token create"]);
    // What was used up stays so.
    farm.coordinator.kill();
    farm.start_again();
    refused(worker(&Place::new(), &token), &["used up", "token create"]);
    worker_comes_and_goes(&farm, &there, &token);
}

fn worker_comes_and_goes(farm: &Farm, there: &Place, token: &str) {
    let mut worker = worker(there, token);
    farm.wait_done(tiny(farm));
    worker.kill();
}

#[test]
fn one_token_lets_several_workers_in() {
    let Some(address) = need::address() else {
        return;
    };
    let farm = Farm::reachable(address, &[]);
    let token = farm.token("w.token", &["--uses", "2"]);
    // They share a state folder, as processes of one user on one disk do.
    let there = Place::new();
    let _workers = [worker(&there, &token), worker(&there, &token)];
    farm.wait_connected(2);
    refused(worker(&there, &token), &["used up"]);
}

#[test]
fn revoking_a_token_ends_its_workers() {
    let Some(address) = need::address() else {
        return;
    };
    let mut farm = Farm::reachable(address, &[]);
    let (first, second) = (farm.token("1.token", &[]), farm.token("2.token", &[]));
    let (here, there) = (Place::new(), Place::new());
    let (gone, mut stays) = (worker(&here, &first), worker(&there, &second));
    farm.wait_connected(2);
    farm.flyby(["token", "revoke", "1"]).ok();
    refused(gone, &["was revoked at", "token create"]);
    refused(worker(&Place::new(), &first), &["was revoked at"]);
    assert!(stays.ended().is_none());
    farm.coordinator.kill();
    farm.start_again();
    refused(worker(&here, &first), &["was revoked at"]);
    farm.wait_done(tiny(&farm));
    let list = farm.flyby(["token", "list", "--output", "json"]).json();
    assert!(list["tokens"][0]["revoked_unix_ms"].is_number(), "{list}");
    assert!(list["tokens"][1]["revoked_unix_ms"].is_null(), "{list}");
}

#[test]
fn a_token_that_has_expired_says_when() {
    let Some(address) = need::address() else {
        return;
    };
    let farm = Farm::reachable(address, &[]);
    let token = farm.token("w.token", &["--expires", "1 s"]);
    wait::until("the token has expired", || {
        let list = farm.flyby(["token", "list"]).ok();
        list.contains("expired").then_some(())
    });
    refused(worker(&Place::new(), &token), &["expired at", "clock says"]);
}
