//! The same pixels from one process and from farms, whatever the tiles, threads and SIMD level:
//! so no seam can show where tiles meet.

use std::process::Command;

use render::SimdLevel;

use crate::harness::scenes::{FLYBY, TINY, rendered, small};
use crate::harness::{Farm, Place, frames, need, wait};

const TILES: [&str; 3] = ["64x64", "40x60", "200x25"];

/// Renders [`small`]'s images and compares.
#[track_caller]
fn renders_the_same(place: &Place, level: SimdLevel, threads: &str, tile: &str) {
    let level = level.to_string();
    let how = ["--simd", &level, "--threads", threads, "--tile", tile];
    let out = format!("{level}-{threads}-{tile}");
    let digests = rendered(place, &out, &small().with(&how));
    assert_eq!(digests, small().digests, "{how:?}");
}

#[test]
fn the_camera_moves() {
    let digests = &small().digests;
    assert_eq!(digests.len(), 2);
    assert_ne!(digests[0], digests[1]);
}

#[test]
fn in_one_process_at_each_split_thread_count_and_simd_level() {
    let place = Place::new();
    let splits = TILES.iter().flat_map(|tile| [("1", tile), ("2", tile)]);
    let levels = SimdLevel::all_available();
    for (level, (threads, tile)) in levels.iter().cycle().zip(splits) {
        renders_the_same(&place, *level, threads, tile);
    }
}

#[test]
#[ignore = "long: tests/run --all"]
fn in_one_process_at_every_combination_of_them() {
    let place = Place::new();
    for level in SimdLevel::all_available() {
        for threads in ["1", "2"] {
            for tile in TILES {
                renders_the_same(&place, level, threads, tile);
            }
        }
    }
}

#[test]
fn on_a_farm_of_one_worker_at_each_split() {
    on_a_farm(1);
}

#[test]
fn on_a_farm_of_three_workers_at_each_split() {
    on_a_farm(3);
}

fn on_a_farm(workers: usize) {
    let farm = Farm::of_workers(workers);
    farm.wait_connected(workers);
    for tile in TILES {
        let job = farm.submit(&small().with(&[FLYBY, "--tile", tile]));
        let done = farm.wait_done(job);
        assert_eq!(done.film_digests(), small().digests, "tiles {tile}");
        assert_eq!(done.number("blocks_again"), 0, "{done:?}");

        frames::are_same(&farm.frames(job), &small().frames);
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
    let job = farm.submit(&small().with(&[FLYBY, "--tile", "40x30"]));
    assert_eq!(farm.wait_done(job).film_digests(), small().digests);
}

#[test]
fn a_part_of_an_image_has_the_pixels_of_the_whole() {
    if !need::tool("oiiotool") {
        return;
    }
    let place = Place::new();
    let image = [&TINY[..], &["--frames", "3"]].concat();
    rendered(&place, "whole", &image);
    let part = [&image[..], &["--crop", "17,11,73,49"]].concat();
    rendered(&place, "part", &part);
    let other = [&image[..], &["--crop", "16,11,72,49"]].concat();
    rendered(&place, "other", &other);
    // It stores all as float: so both sides go through it.
    for [from, into] in [["whole", "cut"], ["part", "same"], ["other", "else"]] {
        let mut crop = Command::new("oiiotool");
        crop.current_dir(place.folder())
            .arg(format!("{from}/flyby_0003.exr"))
            .args(["--crop", "56x38+17+11", "-d", "float", "-o"])
            .arg(format!("{into}.exr"));
        place.run(crop, wait::LIMIT).ok();
    }
    let compare = |other| place.flyby(["image", "compare", "cut.exr", other]);
    compare("same.exr").ok();
    let different = compare("else.exr");
    assert_eq!(different.status.code(), Some(4), "{different}");
}

#[test]
#[ignore = "long: tests/run --all"]
fn at_full_settings_with_two_splits() {
    let farm = Farm::of_workers(2);
    let image = ["--frames", "120", "--tile"];
    let one = rendered(&farm.place, "one", &[&image[..], &["64x64"]].concat());
    let job = farm.submit(&[&[FLYBY], &image[..], &["200x25"]].concat());
    let done = farm.wait_done_within(wait::LONG_LIMIT, job);
    assert_eq!(done.film_digests(), one);
}
