//! What users want of jobs that are there: pause, resume, another priority, an explanation, to be forgotten.

use crate::harness::Farm;
use crate::harness::scenes::{FLYBY, TINY};

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
