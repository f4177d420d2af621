//! The operator's program that is run when a job is over.

use std::os::unix::fs::PermissionsExt as _;

use crate::harness::scenes::{FLYBY, TINY};
use crate::harness::{Farm, Place, wait};

#[test]
fn it_is_told_of_every_job_that_ends() {
    let place = Place::new();
    let (hook, told) = (place.path("hook"), place.path("told"));
    let script = format!(
        "#!/bin/sh\necho \"$FLYBY_JOB $FLYBY_JOB_NAME $FLYBY_JOB_STATE $FLYBY_JOB_FRAMES_DONE\" >> {told}\nls \"$FLYBY_JOB_FOLDER\" >> {told} || true\n",
        told = told.display()
    );
    std::fs::write(&hook, script).unwrap();
    let options = ["--on-job-end", hook.to_str().unwrap()];
    let refused = place.flyby([&["coordinator", "--listen", "127.0.0.1:0"], &options[..]].concat());
    refused.refused(2, &["it is not a program"]);
    std::fs::set_permissions(&hook, std::fs::Permissions::from_mode(0o700)).unwrap();

    let mut farm = Farm::wrapped(place, &[], &options);
    let submit = |farm: &Farm| {
        farm.submit(&[&[FLYBY, "--frames", "0", "--name", "short"], &TINY[..]].concat())
    };
    let cancelled = submit(&farm);
    farm.flyby(["job", "cancel", &cancelled.to_string()]).ok();
    let removed = submit(&farm);
    farm.flyby(["job", "remove", &removed.to_string()]).ok();
    farm.worker(&["--threads", "1"]);
    let done = submit(&farm);
    farm.wait_done(done);
    let expected = format!(
        "{cancelled} short cancelled 0\n{removed} short cancelled 0\n{done} short done 1\nshort_0000.exr\n"
    );
    wait::until("the hook has heard of both jobs", || {
        (std::fs::read_to_string(&told).ok()? == expected).then_some(())
    });
}
