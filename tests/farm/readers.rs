//! Other programs read our frames: layers, metadata and pixels.

use std::path::PathBuf;
use std::process::Command;

use serde_json::Value;

use crate::harness::scenes::{image_info, rendered};
use crate::harness::{Outcome, Place, need, wait};

/// The channels of a frame; those of the colours need no layer's name.
const CHANNELS: [&str; 8] = ["R", "G", "B", "A", "Z", "N.X", "N.Y", "N.Z"];

/// What every frame says about itself.
const METADATA: [&str; 6] = [
    "flyby:sceneDigest",
    "flyby:filmDigest",
    "flyby:settings",
    "flyby:revision",
    "flyby:software",
    "flyby:statistics",
];

/// A frame whose sides are no multiples of a tile's, and what our own reader says of it.
fn frame(place: &Place) -> (PathBuf, Value) {
    let image = ["--resolution", "97x65", "--rays", "1", "--frames", "4"];
    rendered(place, "out", &image);
    let frame = place.path("out").join("flyby_0004.exr");
    let info = image_info(place, &frame);
    (frame, info)
}

/// What another program says of a frame.
fn ask(place: &Place, words: &[&str], frame: &PathBuf) -> Outcome {
    let mut command = Command::new(words[0]);
    command.args(&words[1..]).arg(frame);
    place.run(command, wait::LIMIT)
}

/// All metadata stands in `said` as our own reader reads it.
#[track_caller]
fn has_metadata(said: &str, info: &Value) {
    for name in METADATA {
        let value = info["metadata"][name].as_str().unwrap();
        assert!(!value.is_empty(), "{name}");
        assert!(said.contains(name), "{name} is missing: {said}");
        assert!(said.contains(value), "{name} is not {value}: {said}");
    }
}

#[test]
fn exrheader() {
    if !need::tool("exrheader") {
        return;
    }
    let place = Place::new();
    let (frame, info) = frame(&place);
    let said = ask(&place, &["exrheader"], &frame).ok();
    for channel in CHANNELS {
        let bits = if channel == "Z" { 32 } else { 16 };
        let line = format!("{channel}, {bits}-bit floating-point");
        assert!(said.contains(&line), "no {line}: {said}");
    }
    has_metadata(&said, &info);
}

#[test]
fn exrinfo() {
    if !need::tool("exrinfo") {
        return;
    }
    let place = Place::new();
    let (frame, info) = frame(&place);
    // Its exit code is not initialised (OpenEXR 3.1.5), whatever the file; mistakes are on standard error.
    let outcome = ask(&place, &["exrinfo", "--strict", "--all-metadata"], &frame);
    assert!(outcome.stderr.is_empty(), "{outcome}");
    let said = outcome.stdout;
    for channel in CHANNELS {
        let kind = if channel == "Z" { "float" } else { "half" };
        let line = format!("'{channel}': {kind}");
        assert!(said.contains(&line), "no {line}: {said}");
    }
    assert!(said.contains("tiledesc size 32 x 32"), "{said}");
    has_metadata(&said, &info);
}

#[test]
fn oiiotool_reads_the_same_pixels() {
    if !need::tool("oiiotool") {
        return;
    }
    let place = Place::new();
    let (frame, info) = frame(&place);
    let said = ask(&place, &["oiiotool", "--info", "-v", "--stats"], &frame).ok();
    has_metadata(&said, &info);
    let line = |name: &str| {
        let lines = said.lines().map(str::trim);
        let mut found = lines.filter_map(|line| line.strip_prefix(name));
        found.next().unwrap_or_else(|| panic!("no {name} {said}"))
    };
    let names: Vec<&str> = line("channel list:")
        .split(',')
        .filter_map(|channel| channel.split_whitespace().next())
        .collect();
    assert_eq!(names, CHANNELS);
    for (theirs, ours) in [("Min", "min"), ("Max", "max"), ("Avg", "mean")] {
        let values = line(&format!("Stats {theirs}:")).split_whitespace();
        for (channel, value) in names.iter().zip(values) {
            let channels = info["parts"][0]["channels"].as_array().unwrap();
            let known = channels.iter().find(|known| known["name"] == *channel);
            let known = known.unwrap()[ours].as_f64().unwrap();
            let value: f64 = value.parse().unwrap();
            // They add in single precision and print six decimals.
            let close = (value - known).abs() <= 1e-6 + 1e-5 * known.abs();
            assert!(close, "{channel}: {theirs} {value}, {ours} {known}");
        }
    }
    assert_eq!(line("Stats NanCount:").trim(), "0 0 0 0 0 0 0 0");
    assert_eq!(line("Stats InfCount:").trim(), "0 0 0 0 0 0 0 0");
}
