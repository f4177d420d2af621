//! Options that make no sense: each has its sentence, and nothing was begun.

use crate::harness::scenes::FLYBY;
use crate::harness::{Farm, Place};

const USAGE: i32 = 2;

#[test]
fn options_of_render_and_submit() {
    let place = Place::new();
    let bad: [(&[&str], &[&str]); 14] = [
        (&["--frames", "5..5"], &["frames"]),
        (&["--frames", "9..3"], &["frames"]),
        (&["--frames", "0..10:0"], &["step"]),
        (&["--frames", "some"], &["some"]),
        (&["--frames", "499..501"], &["500"]),
        (&["--resolution", "0x100"], &["each side"]),
        (&["--resolution", "800"], &["400x300"]),
        (&["--resolution", "70000x100"], &["65536"]),
        (&["--rays", "0"], &["rays"]),
        (&["--crop", "700,500,900,700"], &["800"]),
        (&["--crop", "9,9,3,3"], &["no pixel"]),
        (&["--tile", "0x0"], &["tile"]),
        (&["--set", "camera.altitud=3 m"], &["altitud"]),
        (&["--resolutoin", "800x600"], &["--resolution"]),
    ];
    for (options, phrases) in bad {
        for command in ["render", "submit"] {
            let words = [command, FLYBY].into_iter().chain(options.iter().copied());
            place.flyby(words).refused(USAGE, phrases);
        }
    }
    for options in [["--simd", "mmx"], ["--threads", "0"], ["--format", "gif"]] {
        place
            .flyby([&["render", FLYBY][..], &options].concat())
            .refused(USAGE, &[options[1]]);
    }
    let left: Vec<_> = std::fs::read_dir(place.folder())
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left, ["logs"]);
}

#[test]
fn jobs_and_frames_that_are_not_there() {
    let farm = Farm::new(&[]);
    for command in ["show", "watch", "log", "cancel", "fetch"] {
        farm.flyby(["job", command, "77"]).refused(USAGE, &["77"]);
        farm.flyby(["job", command, "all"]).refused(USAGE, &["all"]);
    }
}
