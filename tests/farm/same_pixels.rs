//! The same pixels from one process and from farms, whatever the tiles, threads and SIMD level.

use render::SimdLevel;

use crate::harness::Farm;
use crate::harness::Place;
use crate::harness::scenes::{FLYBY, SMALL, film_digests, rendered};

const TILES: [&str; 3] = ["64x64", "40x60", "200x25"];

/// Images 0 and 1, small, and `more`.
fn two_small_images<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SMALL[..], &["--frames", "0..2"], more].concat()
}

/// What everything below is compared with: tiles as they come, threads as they come.
fn reference(place: &Place) -> Vec<String> {
    let reference = rendered(place, "reference", &two_small_images(&[]));
    assert_eq!(reference.len(), 2);
    assert_ne!(reference[0], reference[1], "the camera moves");
    reference
}

#[test]
fn in_one_process_at_every_split_thread_count_and_simd_level() {
    let place = Place::new();
    let reference = reference(&place);
    for level in SimdLevel::all_available() {
        let level = level.to_string();
        for threads in ["1", "2"] {
            for tile in TILES {
                let how = ["--simd", &level, "--threads", threads, "--tile", tile];
                let digests = rendered(&place, &how.concat(), &two_small_images(&how));
                assert_eq!(digests, reference, "{how:?}");
            }
        }
    }
}

#[test]
fn on_farms_of_one_and_of_three_workers_at_every_split() {
    for workers in [1, 3] {
        let farm = Farm::of_workers(workers);
        let reference = reference(&farm.place);
        for tile in TILES {
            let arguments = [&[FLYBY, "--tile", tile], &two_small_images(&[])[..]].concat();
            let job = farm.submit(&arguments);
            let done = farm.wait_done(job);
            assert_eq!(
                done.film_digests(),
                reference,
                "{workers} workers, tiles {tile}"
            );
            assert_eq!(done.number("blocks_again"), 0, "{done:?}");

            let (job, out) = (job.to_string(), format!("fetched-{tile}"));
            farm.flyby(["job", "fetch", &job, "--out", &out]).ok();
            assert_eq!(
                film_digests(&farm.place, &out),
                reference,
                "the fetched files"
            );
        }
    }
}

#[test]
fn on_workers_of_different_threads_and_simd_levels_at_once() {
    let mut farm = Farm::new(&[]);
    let levels = SimdLevel::all_available();
    for (level, threads) in [(levels.first(), "1"), (levels.last(), "2")] {
        let level = level.unwrap().to_string();
        farm.worker(&["--simd", &level, "--threads", threads]);
    }
    farm.wait_connected(2);
    let arguments = [&[FLYBY, "--tile", "40x30"], &two_small_images(&[])[..]].concat();
    let done = farm.wait_done(farm.submit(&arguments));
    assert_eq!(done.film_digests(), reference(&farm.place));
}

#[test]
fn a_part_of_an_image_has_the_pixels_of_the_whole() {
    let place = Place::new();
    let image = [&SMALL[..], &["--frames", "3"]].concat();
    rendered(&place, "whole", &image);
    rendered(
        &place,
        "part",
        &[&image[..], &["--crop", "37,41,133,99"]].concat(),
    );
    let frame = |out| place.path(out).join(place.files(out).remove(0));
    // The film digest covers the window, so pixels are compared one by one.
    let (whole, part) = (frame("whole"), frame("part"));
    let arguments = [
        "image".as_ref(),
        "compare".as_ref(),
        whole.as_os_str(),
        part.as_os_str(),
    ];
    place.flyby(arguments).ok();
}

#[test]
#[ignore = "long: tests/run --all"]
fn at_full_settings_with_two_splits() {
    let farm = Farm::of_workers(2);
    let image = ["--frames", "120", "--tile"];
    let one = rendered(&farm.place, "one", &[&image[..], &["64x64"]].concat());
    let job = farm.submit(&[&[FLYBY], &image[..], &["200x25"]].concat());
    let limit = crate::harness::wait::LONG_LIMIT;
    let done = farm.wait_done_within(limit, job);
    assert_eq!(done.film_digests(), one);
}
