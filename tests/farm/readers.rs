//! Other programs read our frames: layers, metadata and pixels.

use std::path::PathBuf;
use std::process::Command;

use crate::harness::scenes::{film_digest, rendered};
use crate::harness::{Place, need, wait};

fn frame(place: &Place) -> PathBuf {
    let image = ["--resolution", "97x65", "--rays", "1", "--frames", "4"];
    rendered(place, "out", &image);
    place.path("out").join("flyby_0004.exr")
}

/// What a program says about a frame.
fn say(place: &Place, words: &[&str], frame: &PathBuf) -> String {
    let mut command = Command::new(words[0]);
    command.args(&words[1..]).arg(frame);
    place.run(command, wait::LIMIT).ok()
}

const CHANNELS: [&str; 8] = ["R", "G", "B", "A", "Z", "N.X", "N.Y", "N.Z"];

/// Attributes that every frame must have.
const METADATA: [&str; 6] = [
    "flyby:sceneDigest",
    "flyby:filmDigest",
    "flyby:settings",
    "flyby:revision",
    "flyby:software",
    "flyby:statistics",
];

#[test]
fn openexr_sees_layers_and_metadata() {
    if !need::tool("exrheader") || !need::tool("exrinfo") {
        return;
    }
    let place = Place::new();
    let frame = frame(&place);
    let header = say(&place, &["exrheader"], &frame);
    for (name, kind) in CHANNELS.map(|name| {
        (
            name,
            if name == "Z" {
                "32-bit floating-point"
            } else {
                "16-bit floating-point"
            },
        )
    }) {
        assert!(
            header.contains(&format!("{name}, {kind}")),
            "{name}: {header}"
        );
    }
    for name in METADATA {
        assert!(header.contains(name), "{name}: {header}");
    }
    assert!(header.contains(&film_digest(&place, &frame)), "{header}");
    let info = say(&place, &["exrinfo", "--strict", "--all-metadata"], &frame);
    assert!(info.contains("97") && info.contains("tiled"), "{info}");
}

#[test]
fn openimageio_reads_the_same_pixels() {
    if !need::tool("oiiotool") {
        return;
    }
    let place = Place::new();
    let frame = frame(&place);
    let info = say(&place, &["oiiotool", "--info", "-v", "--stats"], &frame);
    for name in CHANNELS {
        assert!(info.contains(name), "{name}: {info}");
    }
    for name in METADATA {
        assert!(info.contains(name), "{name}: {info}");
    }
    assert!(
        info.contains("97 x   65") || info.contains("97 x 65"),
        "{info}"
    );
    assert!(
        !info.contains("NanCount: 1") && info.contains("Stats"),
        "{info}"
    );
}
