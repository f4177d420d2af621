//! A coordinator that ends, however it ends, goes on at its next start where it was.

use crate::harness::scenes::{ENDLESS, FLYBY, TINY, film_digests, slow};
use crate::harness::{Farm, Job, Signal};

/// A farm in the middle of the slow job.
fn at_work() -> (Farm, u64) {
    let mut farm = Farm::of_workers(1);
    farm.worker(&["--threads", "1"]);
    let job = farm.submit(&slow().with(&[FLYBY, "--tile", "40x30"]));
    farm.wait_acknowledged(job, 8);
    (farm, job)
}

/// The job goes on by itself and ends as if nothing had happened.
fn goes_on(farm: &Farm, job: u64, done_before: u64) {
    let again = farm.job(job);
    assert!(again.number("blocks_done") >= done_before, "{again:?}");
    let done = farm.wait_done(job);
    assert_eq!(done.film_digests(), slow().digests);
    assert_eq!(done.number("pixels_done"), done.number("pixels"));
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
    farm.flyby(["job", "fetch", &job.to_string(), "--out", "fetched"])
        .ok();
    assert_eq!(film_digests(&farm.place, "fetched"), slow().digests);
    let log = farm.flyby(["job", "log", &job.to_string()]).ok();
    for said in [
        "submitted: frames",
        "was started again",
        "the job is finished",
    ] {
        assert!(log.contains(said), "{log}");
    }
}

#[test]
fn after_kill_9() {
    let (mut farm, job) = at_work();
    farm.coordinator.kill();
    // Nobody can ask it any more; what it had acknowledged is at least this.
    farm.start_again();
    goes_on(&farm, job, 8);
}

#[test]
fn after_ctrl_c() {
    let (mut farm, job) = at_work();
    farm.coordinator.signal(Signal::Interrupt);
    assert_eq!(farm.coordinator.wait().code(), Some(0));
    farm.start_again();
    goes_on(&farm, job, 8);
}

#[test]
fn a_worker_keeps_the_tile_that_it_had_begun() {
    let mut farm = Farm::of_workers(1);
    // Each image is one tile.
    let job = farm.submit(&slow().with(&[FLYBY, "--tile", "200x150"]));
    farm.wait_acknowledged(job, 3);
    farm.coordinator.kill();
    farm.start_again();
    goes_on(&farm, job, 3);
    let log = farm.flyby(["job", "log", &job.to_string()]).ok();
    assert!(log.contains("goes on with a tile"), "{log}");
    // It was not leased anew.
    assert_eq!(log.matches("frame 0 is begun").count(), 1, "{log}");
}

#[test]
fn killed_again_and_again() {
    let (mut farm, job) = at_work();
    let mut done = 0;
    for _ in 0..5 {
        farm.coordinator.kill();
        farm.start_again();
        let now = farm.job(job).number("blocks_done");
        assert!(now >= done, "{now} blocks of {done} are there");
        let more = |job: &Job| job.is_over() || job.number("blocks_done") > now;
        done = farm
            .wait_until(job, "it goes on", more)
            .number("blocks_done");
    }
    goes_on(&farm, job, done);
}

#[test]
fn finished_paused_and_cancelled_jobs_stay_what_they_are() {
    let mut farm = Farm::of_workers(1);
    let finished = farm.submit(&[&[FLYBY, "--frames", "0"], &TINY[..]].concat());
    let done = farm.wait_done(finished);
    let (paused, cancelled) = (farm.submit(&ENDLESS), farm.submit(&ENDLESS));
    let removed = farm.submit(&ENDLESS);
    for (verb, job) in [
        ("pause", paused),
        ("cancel", cancelled),
        ("remove", removed),
    ] {
        farm.flyby(["job", verb, &job.to_string()]).ok();
    }
    farm.flyby(["job", "priority", &paused.to_string(), "7"])
        .ok();
    farm.coordinator.kill();
    farm.start_again();

    let again = farm.job(finished);
    assert_eq!(again.film_digests(), done.film_digests());
    // Who watches it is told that it is over, and waits for nothing.
    farm.flyby(["job", "watch", &finished.to_string()]).ok();
    for number in ["pixels_done", "blocks_done", "submitted_unix_ms"] {
        assert_eq!(again.number(number), done.number(number), "{number}");
    }
    assert_eq!(farm.job(paused).state(), "paused");
    assert_eq!(farm.job(paused).0["priority"], 7);
    assert_eq!(farm.job(cancelled).state(), "cancelled");
    farm.flyby(["job", "show", &removed.to_string()])
        .refused(2, &["there is no job"]);
    let fresh = farm.submit(&[&[FLYBY, "--frames", "0"], &TINY[..]].concat());
    assert!(fresh > removed, "no number is given twice");
    farm.wait_done(fresh);
}

#[test]
fn a_block_that_is_damaged_meanwhile_is_rendered_again() {
    let (mut farm, job) = at_work();
    farm.flyby(["job", "pause", &job.to_string()]).ok();
    farm.coordinator.kill();
    let scratch = farm.place.state().join(format!("jobs/{job}/scratch"));
    let file = std::fs::read_dir(&scratch)
        .unwrap()
        .next()
        .unwrap()
        .unwrap();
    let mut bytes = std::fs::read(file.path()).unwrap();
    for byte in bytes.iter_mut().skip(4_096) {
        *byte ^= 1;
    }
    std::fs::write(file.path(), bytes).unwrap();
    farm.start_again();
    farm.flyby(["job", "resume", &job.to_string()]).ok();
    let done = farm.wait_done(job);
    assert_eq!(done.film_digests(), slow().digests);
}

#[test]
fn a_store_that_is_damaged_is_refused_with_a_sentence() {
    let (mut farm, _) = at_work();
    farm.coordinator.kill();
    std::fs::write(farm.place.state().join("farm.sqlite"), "no database").unwrap();
    let _ = std::fs::remove_file(farm.place.state().join("farm.sqlite-wal"));
    farm.flyby(["coordinator", "--listen", "127.0.0.1:0"])
        .refused(1, &["farm.sqlite", "is damaged"]);
}
