//! `flyby render`, interrupted, goes on where it was.

use serde_json::Value;

use crate::harness::scenes::{FLYBY, film_digests, slow};
use crate::harness::{Place, Process, Signal, wait};

fn arguments() -> Vec<&'static str> {
    let render = [
        "render", FLYBY, "--out", "out", "--format", "exr", "--output", "json",
    ];
    let work = slow().with(&["--threads", "1", "--tile", "40x30"]);
    [&render[..], &work].concat()
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

/// Runs the same command again, which renders exactly what is missing.
fn goes_on(place: &Place) {
    let report: Value = place.flyby(arguments()).json();
    let number = |name: &str| report[name].as_u64().unwrap();
    assert!(number("pixels_kept") > 0, "{report}");
    assert!(number("pixels_rendered") > 0, "{report}");
    // What is kept are frames that were finished, and blocks of those that were not.
    let of_frames = number("frames_kept") * 200 * 150;
    let pixels = of_frames + number("pixels_kept") + number("pixels_rendered");
    assert_eq!(pixels, 2 * 200 * 150, "{report}");
    assert_eq!(film_digests(place, "out"), slow().digests);
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
