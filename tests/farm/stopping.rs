//! Ctrl-C ends a coordinator and a worker cleanly.

use crate::harness::scenes::{ENDLESS, FLYBY, slow};
use crate::harness::{Farm, Signal};

#[test]
fn an_idle_farm_ends_with_exit_code_0() {
    let mut farm = Farm::of_workers(1);
    farm.wait_connected(1);
    farm.workers[0].signal(Signal::Interrupt);
    assert_eq!(farm.workers[0].wait().code(), Some(0));
    farm.wait_connected(0);
    farm.coordinator.signal(Signal::Interrupt);
    assert_eq!(farm.coordinator.wait().code(), Some(0));
    assert!(!farm.place.state().join("coordinator.json").exists());
}

#[test]
fn a_busy_worker_gives_back_what_it_holds() {
    let mut farm = Farm::of_workers(1);
    let job = farm.submit(&slow().with(&[FLYBY, "--tile", "40x30"]));
    farm.wait_acknowledged(job, 5);
    farm.workers[0].signal(Signal::Interrupt);
    let code = farm.workers[0].wait().code();
    assert_eq!(code, Some(0), "{}", farm.workers[0].stderr());
    assert_eq!(farm.job(job).state(), "running");

    farm.worker(&["--threads", "1"]);
    let done = farm.wait_done(job);
    assert_eq!(done.film_digests(), slow().digests);
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
    assert_eq!(done.number("attempts_lost"), 0, "{done:?}");
}

#[test]
fn a_busy_coordinator_ends_and_its_worker_waits_for_the_next() {
    let mut farm = Farm::of_workers(1);
    let job = farm.submit(&ENDLESS);
    farm.wait_acknowledged(job, 5);
    farm.coordinator.signal(Signal::Interrupt);
    assert_eq!(farm.coordinator.wait().code(), Some(0));
    assert!(!farm.place.state().join("coordinator.json").exists());
    let ended = farm.workers[0].ended();
    assert!(ended.is_none(), "{}", farm.workers[0].stderr());
}
