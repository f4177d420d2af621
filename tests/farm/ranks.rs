//! A job's place among others: what it asks of workers, whom it waits for, its share, what comes first.

use crate::harness::Farm;
use crate::harness::scenes::{FLYBY, TINY, slow};

fn submit(farm: &Farm, options: &[&str]) -> u64 {
    farm.submit(&[&[FLYBY, "--frames", "0"], &TINY[..], options].concat())
}

fn why(farm: &Farm, job: u64) -> String {
    farm.flyby(["job", "why", &job.to_string()]).ok()
}

#[test]
fn a_job_goes_to_workers_that_have_what_it_asks_for() {
    let mut farm = Farm::of_workers(1);
    farm.wait_connected(1);
    let picky = submit(&farm, &["--need-label", "big"]);
    let wide = submit(&farm, &["--need-threads", "2"]);
    farm.wait_done(submit(&farm, &[]));
    for job in [picky, wide] {
        let said = why(&farm, job);
        assert!(said.contains("none of the"), "{said}");
        assert_eq!(farm.job(job).number("blocks_done"), 0);
    }
    assert_eq!(farm.job(picky).0["need_labels"][0], "big");
    farm.worker(&["--threads", "2", "--label", "big", "--label", "other"]);
    farm.wait_done(picky);
    farm.wait_done(wide);
    let list = farm.flyby(["worker", "list", "--output", "json"]).json();
    let workers = list["workers"].as_array().unwrap();
    let big = workers
        .iter()
        .find(|worker| worker["threads"] == 2)
        .unwrap();
    assert_eq!(big["labels"], serde_json::json!(["big", "other"]));
    let refused = farm.flyby(["submit", FLYBY, "--need-label", "a b"]);
    refused.refused(2, &["`a b` is no label"]);
}

#[test]
fn a_job_begins_after_those_that_it_waits_for() {
    let mut farm = Farm::of_workers(0);
    let first = submit(&farm, &[]);
    let second = submit(&farm, &["--after", &first.to_string(), "--priority", "9"]);
    let said = why(&farm, second);
    assert!(said.contains(&format!("job {first}")), "{said}");
    let refused = farm.flyby(["submit", FLYBY, "--frames", "0", "--after", "77"]);
    refused.refused(2, &["there is no job 77"]);
    let refused = farm.flyby(["job", "remove", &first.to_string()]);
    refused.refused(2, &[&format!("job {second} waits for this one")]);
    farm.worker(&["--threads", "1"]);
    let (first, second) = (farm.wait_done(first), farm.wait_done(second));
    let (ended, began) = (
        first.number("finished_unix_ms"),
        second.number("started_unix_ms"),
    );
    assert!(ended <= began, "{first:?} {second:?}");
}

#[test]
fn share_and_focus_are_kept_and_shown() {
    let mut farm = Farm::of_workers(0);
    let job = submit(&farm, &["--share", "3", "--priority", "-2"]);
    let name = job.to_string();
    farm.flyby(["job", "share", &name, "5"]).ok();
    farm.flyby(["job", "focus", &name, "16x16+8+8"]).ok();
    let shown = farm.flyby(["job", "show", &name]).ok();
    assert!(
        shown.contains("priority -2; share 5; 8,8,24,24 of each frame first"),
        "{shown}"
    );
    farm.coordinator.kill();
    farm.start_again();
    let again = farm.flyby(["job", "show", &name]).ok();
    assert!(again.contains("priority -2; share 5; 8,8,24,24"), "{again}");
    farm.flyby(["job", "focus", &name, "--none"]).ok();
    assert!(farm.job(job).0["focus"].is_null());
    farm.flyby(["job", "share", &name, "0"]).refused(2, &["0"]);
    farm.flyby(["job", "focus", &name]).refused(2, &["RECT"]);
}

#[test]
fn tiles_are_verified_by_another_worker_and_their_pixels_are_the_same() {
    let mut farm = Farm::new(&["--verify", "100"]);
    farm.worker(&["--threads", "1"]);
    farm.worker(&["--threads", "1"]);
    farm.wait_connected(2);
    let job = farm.submit(&slow().with(&[FLYBY, "--tile", "100x75"]));
    let done = farm.wait_done(job);
    assert_eq!(done.film_digests(), slow().digests);
    // Every block came twice, but for tiles that both had a part in near the end.
    let (blocks, twice) = (done.number("blocks_done"), done.number("blocks_twice"));
    assert!(2 * twice >= blocks && twice <= 2 * blocks, "{done:?}");
    assert_eq!(done.number("incidents"), 0, "{done:?}");
}

#[test]
fn a_worker_leaves_before_its_time_is_up() {
    let mut farm = Farm::of_workers(0);
    farm.worker(&["--threads", "1", "--time-limit", "3 s"]);
    let ended = farm.workers[0].wait();
    assert_eq!(ended.code(), Some(0), "{}", farm.workers[0].stderr());
    let said = farm.workers[0].stderr();
    assert!(said.contains("the time limit is near"), "{said}");
}
