//! `flyby demo`: the first thing anyone runs.

use crate::harness::{Place, Signal, wait};

fn frames(place: &Place, ending: &str) -> Vec<String> {
    let mut files = place.files("out");
    files.retain(|file| file.ends_with(ending));
    files
}

#[test]
#[ignore = "long: tests/run --all"]
fn it_leaves_frames_and_a_second_run_says_what_it_does() {
    let place = Place::new();
    let demo = || place.run(place.command(["demo", "--out", "out"]), wait::LONG_LIMIT);
    let first = demo();
    assert!(first.status.success(), "{first}");
    let (exr, png) = (frames(&place, ".exr"), frames(&place, ".png"));
    assert!(exr.len() >= 24 && exr.len() == png.len(), "{exr:?} {png:?}");
    let info = place
        .flyby([
            "image",
            "info",
            &format!("out/{}", exr[0]),
            "--output",
            "json",
        ])
        .json();
    let parts = &info["parts"][0];
    assert!(
        parts["width"].as_u64() >= Some(480) && parts["height"].as_u64() >= Some(270),
        "{info}"
    );

    let before = place
        .path("out")
        .join(&exr[0])
        .metadata()
        .unwrap()
        .modified()
        .unwrap();
    let second = demo();
    assert!(second.status.success(), "{second}");
    assert!(second.stderr.contains("already"), "{second}");
    let after = place
        .path("out")
        .join(&exr[0])
        .metadata()
        .unwrap()
        .modified()
        .unwrap();
    assert_eq!(before, after, "a finished frame was rendered again");
}

#[test]
fn ctrl_c_ends_it_with_all_it_started() {
    let place = Place::new();
    let mut demo = place.start("demo", ["demo", "--out", "out"]);
    wait::until("a frame is there", || {
        assert!(demo.ended().is_none(), "{}", demo.stderr());
        let there = place.path("out").exists() && !frames(&place, ".exr").is_empty();
        there.then_some(())
    });
    demo.signal_group(Signal::Interrupt);
    assert_eq!(demo.wait().code(), Some(130), "{}", demo.stderr());
    wait::until("all its processes are gone", || {
        (!demo.group_lives()).then_some(())
    });
    let left = place.files("out");
    assert!(
        left.iter()
            .all(|file| file.ends_with(".exr") || file.ends_with(".png")),
        "{left:?}"
    );
}
