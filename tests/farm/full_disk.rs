//! A full disk: the sentence says so, nothing half-written is taken for a frame, and with
//! space again the work goes on.

use crate::harness::scenes::{FLYBY, film_digests, rendered};
use crate::harness::{Farm, Place, need, wait};

/// Mounts a tmpfs of `$1` on `$2`, then becomes the rest of its words.
const ON_SMALL_DISK: &str =
    "mount -t tmpfs -o size=\"$1\" flyby-test \"$2\" && shift 2 && exec \"$@\"";

/// One image, whose pixels alone are larger than the disk.
const IMAGE: [&str; 6] = ["--frames", "0", "--resolution", "200x150", "--rays", "1"];

#[test]
fn render_says_so_and_goes_on_when_there_is_space() {
    let Some(mounting) = need::mounting() else {
        return;
    };
    let place = Place::new();
    let out = place.path("out");
    std::fs::create_dir(&out).unwrap();
    std::fs::create_dir(place.path("kept")).unwrap();
    // What lies on the small disk is gone with the command, so all of it is one script.
    let script = format!(
        "\"$@\" && echo no failure
         echo first: $?
         ls -A {out} | grep -v '^[.]' | grep 'exr$' && echo a frame on a full disk
         mount -o remount,size=64m {out}
         \"$@\" && echo again: $?
         cp {out}/*.exr {kept}",
        out = out.display(),
        kept = place.path("kept").display()
    );
    let wrapper = [
        mounting,
        &[
            "sh",
            "-c",
            ON_SMALL_DISK,
            "sh",
            "600k",
            out.to_str().unwrap(),
        ],
        &["sh", "-c", &script, "sh"],
    ]
    .concat();
    let arguments = [&["render", FLYBY, "--out", "out"], &IMAGE[..]].concat();
    let outcome = place.run(place.wrapped(&wrapper, arguments), wait::LIMIT);
    assert!(outcome.stdout.contains("first: 1\n"), "{outcome}");
    assert!(
        !outcome.stdout.contains("a frame on a full disk"),
        "{outcome}"
    );
    assert!(outcome.stdout.contains("again: 0\n"), "{outcome}");
    assert!(outcome.stderr.contains("no space left"), "{outcome}");
    let reference = rendered(&place, "reference", &IMAGE);
    assert_eq!(film_digests(&place, "kept"), reference);
}

/// The same, with more space as soon as the file `$3` is there.
const ON_GROWING_DISK: &str = "mount -t tmpfs -o size=\"$1\" flyby-test \"$2\" || exit
     (until [ -e \"$3\" ]; do sleep 0.1; done; mount -o remount,size=64m \"$2\") &
     shift 3; exec \"$@\"";

#[test]
fn a_coordinator_waits_says_so_and_goes_on_when_there_is_space() {
    let Some(mounting) = need::mounting() else {
        return;
    };
    let place = Place::new();
    let (jobs, room) = (place.state().join("jobs"), place.path("room"));
    std::fs::create_dir_all(&jobs).unwrap();
    let disk = [
        "sh",
        "-c",
        ON_GROWING_DISK,
        "sh",
        "600k",
        jobs.to_str().unwrap(),
        room.to_str().unwrap(),
    ];
    let mut farm = Farm::wrapped(place, &[mounting, &disk].concat(), &[]);
    farm.worker(&["--threads", "1"]);

    let job = farm.submit(&[&[FLYBY], &IMAGE[..]].concat());
    wait::until("somebody is told what the job waits for", || {
        let why = farm.flyby(["job", "why", &job.to_string()]).ok();
        why.contains("no space left").then_some(())
    });
    assert_eq!(farm.job(job).state(), "running");
    std::fs::write(&room, "").unwrap();
    let done = farm.wait_done(job);
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
    let reference = rendered(&farm.place, "reference", &IMAGE);
    assert_eq!(done.film_digests(), reference);
}
