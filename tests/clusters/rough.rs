//! Poll mode over a bad network: every block is fetched once, whatever happens to a transfer, and what a site rendered while
//! nobody could reach it counts.

use std::fs;

use crate::engine::{Engine, Kind};
use crate::flight::{Flight, processes_with};
use crate::harness::Job;
use crate::harness::scenes::{FLYBY, Reference, lasting, small};
use crate::harness::{frames, wait};

const POLLED: &str = "mode = 'poll'\nmin_tile_pixels = 5000\nmax_running = 2";

/// Loses one packet in twenty, is 40 ms long, and so narrow that a transfer takes a while.
const BAD: [&str; 4] = ["node1", "loss=5", "delay=40", "rate=2"];

/// Blocks are on their way here: the login node's end of a transfer is at work.
fn wait_transfer(flight: &Flight) {
    let there = flight.farm.place.path("there").display().to_string();
    let transfers = || {
        let lines = processes_with(&there);
        lines.iter().any(|line| line.contains("site-agent get"))
    };
    wait::until("blocks are on their way", || {
        let place = &flight.farm.place;
        let has_some = place.path("there").is_dir()
            && place
                .files("there")
                .iter()
                .any(|file| file.ends_with(".blocks"));
        (has_some && transfers()).then_some(())
    });
}

#[track_caller]
fn is_right(flight: &Flight, number: u64, job: &Job, reference: &Reference) {
    frames::are_same(&flight.farm.frames(number), &reference.frames);
    assert_eq!(job.number("blocks_again"), 0, "{job:?}");
    assert_eq!(flight.count("fetched_again"), 0, "{}", flight.site());
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_transfer_that_is_cut_or_outlives_its_coordinator_brings_nothing_twice() {
    let Some(engine) = Engine::hosts(1) else {
        return;
    };
    let mut flight = Flight::new(&engine, Kind::Ssh, POLLED);
    engine.tool("link", &BAD);
    let number = flight.farm.submit(&small().with(&[FLYBY]));
    wait_transfer(&flight);
    engine.tool("link", &["node1", "loss=100"]);
    flight.wait_trouble(&["by ssh"]);
    engine.tool("link", &BAD);
    let job = flight.farm.wait_done(number);
    is_right(&flight, number, &job, small());
    assert_eq!(flight.count("fetched_blocks"), job.number("blocks_done"));

    let number = flight.farm.submit(&small().with(&[FLYBY]));
    wait_transfer(&flight);
    flight.farm.coordinator.kill();
    flight.farm.start_again();
    let job = flight.farm.wait_done(number);
    is_right(&flight, number, &job, small());
    engine.tool("link", &["node1"]);
    flight.clean();
    flight.has_left_nothing();
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_site_out_of_reach_and_of_trust_goes_on_and_what_it_did_counts() {
    let Some(engine) = Engine::hosts(1) else {
        return;
    };
    let work = lasting(std::time::Duration::from_secs(30));
    let flight = Flight::new(&engine, Kind::Ssh, POLLED);
    let number = flight.farm.submit(&work.with(&[FLYBY]));
    flight.farm.wait_acknowledged(number, 1);
    let before = flight.farm.place.files("there/").len();

    // Out of reach for more looks than are waited for before others may have its tiles.
    engine.tool("link", &["node1", "loss=100"]);
    flight.wait_trouble(&["cannot be reached by ssh", "try `ssh ADDRESS true`"]);
    flight.farm.wait_connected(0);

    // It is another, as far as its key tells.
    let keys = engine.folder.join("ssh/known_hosts");
    let right = fs::read_to_string(&keys).unwrap();
    let wrong = right.lines().map(|line| {
        let name = line.split(' ').next().unwrap();
        format!("{name} ssh-ed25519 {OTHER_KEY}\n")
    });
    fs::write(&keys, wrong.collect::<String>()).unwrap();
    engine.tool("link", &["node1"]);
    flight.wait_trouble(&["does not trust the host key", "ssh-keygen -R"]);
    fs::write(&keys, right).unwrap();

    let job = flight.farm.wait_done(number);
    is_right(&flight, number, &job, &work);
    assert_eq!(job.number("attempts_lost"), 0, "{job:?}");
    assert_eq!(job.number("attempts_failed"), 0, "{job:?}");
    assert!(before > 0);
    flight.clean();
    flight.has_left_nothing();
}

/// Nobody's.
const OTHER_KEY: &str = "AAAAC3NzaC1lZDI1NTE5AAAAIMxnzEROllnxODrJE06vN/Qnbmlg+bjMjh8SNOh27w2m";
