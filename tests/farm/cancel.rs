//! A cancelled job ends, and leaves nothing behind but its finished frames.

use crate::harness::scenes::{ENDLESS, FLYBY, TINY};
use crate::harness::{Farm, wait};

#[test]
fn a_job_of_the_same_scene_as_a_cancelled_one_is_rendered() {
    let mut farm = Farm::of_workers(0);
    let submit = || farm.submit(&[&[FLYBY, "--frames", "0"], &TINY[..]].concat());
    let (cancelled, job) = (submit(), submit());
    farm.flyby(["job", "cancel", &cancelled.to_string()]).ok();
    let folder = farm.place.state().join(format!("jobs/{cancelled}"));
    wait::until("what the cancelled job had is gone", || {
        (!folder.join("scene").exists()).then_some(())
    });
    farm.worker(&["--threads", "1"]);
    let done = farm.wait_done(job);
    assert_eq!(done.number("attempts_failed"), 0, "{done:?}");
}

#[test]
fn nothing_half_done_is_left() {
    let farm = Farm::of_workers(1);
    let job = farm.submit(&ENDLESS);
    farm.wait_acknowledged(job, 5);
    assert!(
        !farm.place.files("state/jobs").is_empty(),
        "blocks are on the disk"
    );
    farm.flyby(["job", "cancel", &job.to_string()]).ok();
    let cancelled = farm.wait_until(job, "the job is over", |job| job.is_over());
    assert_eq!(cancelled.state(), "cancelled");
    let left = || {
        farm.place
            .files("state/jobs")
            .into_iter()
            .filter(|file| !file.ends_with(".exr"))
    };
    wait::until("its scratch files are gone", || {
        left().next().is_none().then_some(())
    });

    // Cancelling again changes nothing, and the worker is free for others.
    farm.flyby(["job", "cancel", &job.to_string()]).ok();
    let next = farm.submit(&[&[FLYBY, "--frames", "0"], &TINY[..]].concat());
    farm.wait_done(next);
}

#[test]
fn waiting_for_a_job_that_is_cancelled_is_told_by_the_exit_code() {
    let farm = Farm::of_workers(0);
    let job = farm
        .submit(&[&[FLYBY, "--frames", "0"], &TINY[..]].concat())
        .to_string();
    let mut watch = farm.place.start("watch", ["job", "watch", &job]);
    farm.flyby(["job", "cancel", &job]).ok();
    let status = watch.wait();
    assert_eq!(status.code(), Some(5), "{}", watch.stderr());
}
