//! `flyby render`, interrupted, goes on where it was.

use serde_json::Value;

use crate::harness::scenes::{FLYBY, SLOW, film_digests, rendered};
use crate::harness::{Place, Process, Signal, wait};

const JOB: [&str; 4] = ["--frames", "0..2", "--tile", "40x30"];

fn arguments() -> Vec<&'static str> {
    [
        &[
            "render",
            FLYBY,
            "--out",
            "out",
            "--threads",
            "1",
            "--output",
            "json",
        ],
        &JOB[..],
        &SLOW,
    ]
    .concat()
}

/// Starts to render, and waits until some blocks are on the disk.
fn begun(place: &Place) -> Process {
    let mut render = place.start("render", arguments());
    wait::until("blocks are on the disk", || {
        assert!(render.ended().is_none(), "{}", render.stderr());
        let journal = place.path("out").exists().then(|| journal_bytes(place))?;
        (journal > 1_000).then_some(())
    });
    render
}

/// Bytes of the list of finished blocks beside the scratch file.
fn journal_bytes(place: &Place) -> u64 {
    let files = place.files("out");
    let journals = files.iter().filter(|file| file.ends_with(".journal"));
    journals
        .map(|file| {
            place
                .path("out")
                .join(file)
                .metadata()
                .map_or(0, |file| file.len())
        })
        .sum()
}

/// Runs the same command again, which must render less than all, and exactly what is missing.
fn goes_on(place: &Place) {
    let report: Value = place.flyby(arguments()).json();
    let (rendered_now, kept) = (
        report["blocks_rendered"].as_u64().unwrap(),
        report["blocks_kept"].as_u64().unwrap(),
    );
    assert!(kept > 0, "{report}");
    assert!(rendered_now > 0, "{report}");
    let reference = rendered(place, "reference", &[&JOB[..], &SLOW].concat());
    assert_eq!(film_digests(place, "out"), reference);
    let left = place.files("out");
    assert!(left.iter().all(|file| file.ends_with(".exr")), "{left:?}");
}

#[test]
fn after_ctrl_c() {
    let place = Place::new();
    let mut render = begun(&place);
    render.signal(Signal::Interrupt);
    assert_eq!(render.wait().code(), Some(130), "{}", render.stderr());
    goes_on(&place);
}

#[test]
fn after_kill_9() {
    let place = Place::new();
    begun(&place).kill();
    goes_on(&place);
}
