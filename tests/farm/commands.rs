//! What users want of jobs that are there: pause, resume, another priority, frames again, an explanation, to be forgotten.

use crate::harness::raw::{self, Raw};
use crate::harness::scenes::{FLYBY, TINY, slow};
use crate::harness::{Farm, wait};

fn tiny(farm: &Farm) -> u64 {
    farm.submit(&[&[FLYBY, "--frames", "0"], &TINY[..]].concat())
}

/// What `job why` says.
fn why(farm: &Farm, arguments: &[&str]) -> String {
    let command = ["job", "why", "--output", "json"];
    let answer = farm.flyby(command.into_iter().chain(arguments.iter().copied()));
    answer.json()["why"].as_str().unwrap().to_owned()
}

#[test]
fn a_paused_job_waits_while_others_go_on_and_says_why() {
    let mut farm = Farm::of_workers(0);
    let (paused, other) = (tiny(&farm), tiny(&farm));
    let name = paused.to_string();
    assert!(
        why(&farm, &[&name]).contains("no worker"),
        "{}",
        why(&farm, &[&name])
    );
    farm.flyby(["job", "pause", &name]).ok();
    assert_eq!(farm.job(paused).state(), "paused");
    let said = why(&farm, &[&name, "--frame", "0"]);
    assert!(said.contains("paused"), "{said}");

    farm.worker(&["--threads", "1"]);
    farm.wait_done(other);
    let job = farm.job(paused);
    assert_eq!((job.state(), job.number("blocks_done")), ("paused", 0));
    // Pausing again changes nothing.
    farm.flyby(["job", "pause", &name]).ok();
    farm.flyby(["job", "resume", &name]).ok();
    farm.wait_done(paused);
    let said = why(&farm, &[&name]);
    assert!(said.contains("finished") || said.contains("over"), "{said}");
    let log = farm.flyby(["job", "log", &name]).ok();
    for line in ["paused by its user", "resumed by its user"] {
        assert!(log.contains(line), "{log}");
    }
}

#[test]
fn a_job_of_higher_priority_is_served_first() {
    let mut farm = Farm::of_workers(0);
    let (first, second) = (tiny(&farm), tiny(&farm));
    let name = second.to_string();
    let changed = farm.flyby(["job", "priority", &name, "5", "--output", "json"]);
    assert_eq!(changed.json()["priority"], 5);
    farm.flyby(["job", "priority", &first.to_string(), "-5"])
        .ok();
    farm.worker(&["--threads", "1"]);
    let (first, second) = (farm.wait_done(first), farm.wait_done(second));
    let began = |job: &crate::harness::Job| job.number("started_unix_ms");
    assert!(began(&second) <= began(&first), "{first:?} {second:?}");
    assert!(second.number("finished_unix_ms") <= first.number("finished_unix_ms"));
}

#[test]
fn a_frame_that_failed_everywhere_is_rendered_when_its_user_retries() {
    let mut farm = Farm::of_workers(0);
    let job = farm.submit(&[&[FLYBY, "--frames", "0", "--tile", "80x60"], &TINY[..]].concat());
    let name = job.to_string();
    let refused = farm.flyby(["job", "retry", &name]);
    refused.refused(2, &["no frame of the job has failed"]);
    let token = std::fs::read_to_string(farm.place.state().join("token")).unwrap();
    let mut failing = Vec::new();
    for id in 1..=3 {
        let mut worker = Raw::connect(farm.address, &token);
        let mut control = worker.hello(raw::worker(id)).unwrap();
        let lease = worker.lease(&mut control, 1);
        worker.fail(&mut control, &lease);
        failing.push((worker, control));
    }
    let failed = farm.wait_until(job, "the job has failed", |job| job.state() == "failed");
    let reason = failed.images()[0]["error"].as_str().unwrap();
    assert!(reason.contains("a test has it fail"), "{reason}");
    drop(failing);

    farm.flyby(["job", "retry", &name]).ok();
    assert_eq!(farm.job(job).state(), "running");
    farm.worker(&["--threads", "1"]);
    let once = farm.wait_done(job).film_digests();

    // A finished frame is rendered again, and is the same.
    farm.flyby(["job", "again", &name, "0"]).ok();
    let again = farm.wait_done(job);
    assert_eq!(again.film_digests(), once);
    let log = farm.flyby(["job", "log", &name]).ok();
    for line in [
        "failed frames are rendered again",
        "frame 0 is rendered again",
    ] {
        assert!(log.contains(line), "{log}");
    }
    let refused = farm.flyby(["job", "again", &name, "7"]);
    refused.refused(2, &["the job has no frame 7"]);
}

#[test]
fn a_pixel_and_a_worker_are_asked_why() {
    let mut farm = Farm::of_workers(0);
    let job = tiny(&farm).to_string();
    let said = why(&farm, &[&job, "--frame", "0", "--pixel", "3,4"]);
    assert!(said.contains("no worker"), "{said}");
    let refused = farm.flyby(["job", "why", &job, "--frame", "0", "--pixel", "300,4"]);
    refused.refused(2, &["the pixel 300,4 is not rendered"]);
    farm.flyby(["job", "why", &job, "--pixel", "3,4"])
        .refused(2, &["--frame"]);
    farm.worker(&["--threads", "1", "--name", "left"]);
    farm.wait_done(job.parse().unwrap());
    let said = why(&farm, &[&job, "--frame", "0", "--pixel", "3,4"]);
    assert!(said.contains("durable"), "{said}");
    let said = farm.flyby(["worker", "why", "left"]).ok();
    assert!(said.contains("no tile waits"), "{said}");
    let refused = farm.flyby(["worker", "why", "right"]);
    refused.refused(2, &["there is no worker `right`"]);
}

#[test]
fn how_long_a_job_will_take_is_said_on_the_way_and_held_against_the_truth() {
    let farm = Farm::of_workers(1);
    let job = farm.submit(&slow().with(&[FLYBY, "--tile", "40x30"]));
    let shown = farm.wait_until(job, "somebody can say", |job| {
        !job.0["left_seconds"].is_null()
    });
    let left = |name: &str| shown.0[name].as_f64().unwrap();
    assert!(
        left("left_seconds_early") <= left("left_seconds"),
        "{shown:?}"
    );
    assert!(
        left("left_seconds") <= left("left_seconds_late"),
        "{shown:?}"
    );
    let text = farm.flyby(["job", "show", &job.to_string()]).ok();
    assert!(text.contains("  left    about "), "{text}");
    assert!(farm.wait_done(job).0["left_seconds"].is_null());
    let log = farm.flyby(["job", "log", &job.to_string()]).ok();
    assert!(log.contains("from its first tenth on it took"), "{log}");
}

#[test]
fn a_drained_worker_finishes_and_leaves() {
    let mut farm = Farm::of_workers(0);
    farm.worker(&["--threads", "1", "--name", "left"]);
    farm.worker(&["--threads", "1", "--name", "right"]);
    farm.wait_connected(2);
    let refused = farm.flyby(["worker", "drain", "left", "middle"]);
    refused.refused(2, &["there is no worker `middle`"]);
    let drained = farm.flyby(["worker", "drain", "left", "--output", "json"]);
    assert_eq!(drained.json()["workers"][0]["state"], "draining");
    assert_eq!(farm.workers[0].wait().code(), Some(0));
    farm.wait_connected(1);
    farm.wait_done(tiny(&farm));
    farm.flyby(["worker", "drain", "--all"]).ok();
    assert_eq!(farm.workers[1].wait().code(), Some(0));
}

#[test]
fn old_jobs_and_their_frames_are_cleaned_away() {
    let farm = Farm::of_workers(1);
    let (first, second) = (tiny(&farm), tiny(&farm));
    farm.wait_done(first);
    farm.wait_done(second);
    let frames = |job: u64| farm.place.state().join(format!("jobs/{job}/frames"));
    farm.flyby(["job", "remove", &first.to_string()]).ok();
    assert!(frames(first).exists());
    let clean = |options: &[&'static str]| {
        let command = ["farm", "clean", "--output", "json"];
        let cleaned = farm.flyby(command.into_iter().chain(options.iter().copied()));
        let cleaned = cleaned.json();
        let jobs = cleaned["jobs"].as_array().unwrap();
        jobs.iter()
            .map(|job| job["job"].as_u64().unwrap())
            .collect::<Vec<_>>()
    };
    assert_eq!(clean(&[]), [0_u64; 0], "nothing is over for 30 days");
    assert_eq!(clean(&["--older", "1 ms"]), [second]);
    assert!(frames(second).exists());
    assert_eq!(
        clean(&["--older", "1 ms", "--frames", "--dry-run"]),
        [first, second]
    );
    assert!(frames(first).exists() && frames(second).exists());
    assert_eq!(clean(&["--older", "1 ms", "--frames"]), [first, second]);
    assert!(!frames(first).exists() && !frames(second).exists());

    let third = tiny(&farm);
    farm.wait_done(third);
    farm.flyby(["job", "remove", "--frames", &third.to_string()])
        .ok();
    wait::until("the frames of a removed job are gone", || {
        (!frames(third).exists()).then_some(())
    });
}

#[test]
fn a_job_that_is_removed_is_forgotten() {
    let farm = Farm::of_workers(0);
    let job = tiny(&farm).to_string();
    farm.flyby(["job", "remove", &job]).ok();
    for command in ["show", "pause", "why", "remove"] {
        let refused = farm.flyby(["job", command, &job]);
        refused.refused(2, &[&format!("there is no job {job}")]);
    }
    let refused = farm.flyby(["job", "priority", &job, "many"]);
    refused.refused(2, &["many"]);
}
