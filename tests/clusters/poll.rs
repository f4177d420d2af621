//! Poll mode: nothing at the site dials; images go in as arrays, and tiles come out.

use std::time::Duration;

use crate::engine::{Engine, Kind};
use crate::flight::{Flight, renders_the_same};
use crate::harness::scenes::{FLYBY, lasting, slow, small};
use crate::harness::{Place, wait};

/// A farm whose site is this machine, with two tasks at a time.
fn here(min_tile_pixels: u32, more: &str) -> Flight {
    let more =
        format!("mode = 'poll'\nmax_running = 2\nmin_tile_pixels = {min_tile_pixels}\n{more}");
    Flight::at("kind = 'local'\n", env!("CARGO_BIN_EXE_flyby"), &more)
}

/// Nothing of any job is at the site any more.
#[track_caller]
fn tidies_up(flight: &Flight) {
    let there = flight.farm.place.path("there");
    wait::until("arrays and scenes are removed", || {
        let files = flight.farm.place.files("there");
        let left = |part: &str| files.iter().any(|file| file.contains(part));
        (there.is_dir() && !left("/arrays/") && !left("/scenes/")).then_some(())
    });
}

#[test]
fn this_machine_polled_gives_the_frames_of_one_process() {
    let flight = here(5_000, "");
    let job = flight.farm.submit(&small().with(&[FLYBY]));
    let done = flight.farm.wait_done(job);
    assert_eq!(done.film_digests(), small().digests);
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
    tidies_up(&flight);
    flight.clean();
    flight.has_left_nothing();
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_coordinator_that_was_killed_takes_up_what_runs_there() {
    // An image is one tile, of which some blocks are here and some are not.
    let work = lasting(Duration::from_secs(20));
    let mut flight = here(30_000, "");
    let job = flight.farm.submit(&work.with(&[FLYBY]));
    let before = flight.farm.wait_acknowledged(job, 1);
    flight.farm.coordinator.kill();
    flight.farm.start_again();
    let done = flight.farm.wait_done(job);
    assert_eq!(done.film_digests(), work.digests);
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
    // What was durable is not fetched once more.
    let left = done.number("blocks_done") - before.number("blocks_done");
    assert!(flight.count("fetched_blocks") <= left, "{}", flight.site());
    tidies_up(&flight);

    // One that does not come back leaves what can be removed.
    let job = flight.farm.submit(&slow().with(&[FLYBY]));
    flight.farm.wait_acknowledged(job, 1);
    flight.farm.coordinator.kill();
    flight.clean();
    flight.has_left_nothing();
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_site_that_does_not_answer_leaves_its_tiles_to_others_and_comes_back() {
    let bin = Place::new();
    let program = bin.path("flyby");
    let there = || std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_flyby"), &program).unwrap();
    there();
    let more = "mode = 'poll'\nmax_running = 1\nmin_tile_pixels = 5000";
    let site = "kind = 'local'\n";
    let mut flight = Flight::at(site, program.to_str().unwrap(), more);
    let job = flight.farm.submit(&slow().with(&[FLYBY]));
    flight.farm.wait_acknowledged(job, 1);
    std::fs::remove_file(&program).unwrap();
    flight.wait_trouble(&["flyby"]);
    flight.farm.wait_connected(0);
    flight.farm.worker(&["--threads", "1"]);
    let done = flight.farm.wait_done(job);
    assert_eq!(done.film_digests(), slow().digests);
    there();
    flight.farm.wait_connected(2);
    tidies_up(&flight);
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_job_that_is_cancelled_leaves_no_array() {
    let flight = here(5_000, "");
    let job = flight.farm.submit(&slow().with(&[FLYBY]));
    flight.farm.wait_acknowledged(job, 1);
    flight.farm.flyby(["job", "cancel", &job.to_string()]).ok();
    tidies_up(&flight);
    assert_eq!((flight.count("running"), flight.count("waiting")), (0, 0));
}

#[test]
#[ignore = "long: tests/run --all"]
fn grid_engine_behind_a_firewall_gives_the_frames_of_one_process() {
    let Some(engine) = Engine::gridengine(2, &[]) else {
        return;
    };
    for host in ["ge1", "ge2"] {
        // The queue itself, which may connect anew at any time, is not kept from its hosts.
        engine.tool("firewall", &[host, "drop", "head"]);
    }
    let more = "mode = 'poll'\nmin_tile_pixels = 2500";
    let flight = Flight::new(&engine, Kind::GridEngine, more);
    renders_the_same(&flight);
    assert!(!engine.tool("qstat", &["-u", "*"]).contains("flyby-"));
}

#[test]
#[ignore = "long: tests/run --all"]
fn slurm_and_a_host_over_ssh_polled_give_the_frames_of_one_process() {
    let Some(mut engine) = Engine::slurm(2) else {
        return;
    };
    if !engine.add_ssh() {
        return;
    }
    for kind in [Kind::SlurmOverSsh, Kind::Ssh] {
        let more = "mode = 'poll'\nmin_tile_pixels = 5000\nmax_running = 2";
        renders_the_same(&Flight::new(&engine, kind, more));
    }
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_lockout_is_no_lockout() {
    // The thesis's (§C.4): every task is killed before its tile is done.
    let Some(engine) = Engine::gridengine(1, &[("GE_DEFAULT_H_RT", "0:0:5")]) else {
        return;
    };
    let long = lasting(Duration::from_secs(40));
    let more = "mode = 'poll'\nmin_tile_pixels = 30000\nmax_running = 1";
    let flight = Flight::new(&engine, Kind::GridEngine, more);
    let job = flight.farm.submit(&long.with(&[FLYBY]));
    let done = flight.farm.wait_done_within(wait::LONG_LIMIT, job);
    assert_eq!(done.film_digests(), long.digests);
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
    // It was killed indeed: there were more arrays than images.
    let logs = flight.farm.place.files("there");
    let logs = logs.iter().filter(|file| file.ends_with(".log")).count();
    assert!(logs > 2, "{logs} tasks ran");
}
