//! `flyby image`: digests, contents, differences.

use serde_json::Value;

use crate::place::Place;
use crate::scene::SPHERE;

/// Frames 0 and 1 of the ball, and frame 0 again elsewhere with more rays.
fn frames() -> Place {
    let place = Place::new();
    place.write("ball.toml", SPHERE);
    place.ends(0, &["render", "ball.toml", "--frames", "0..2", "-o", "a"]);
    place.ends(0, &["render", "ball.toml", "--frames", "0", "-o", "b"]);
    place.ends(
        0,
        &[
            "render",
            "ball.toml",
            "--frames",
            "0",
            "--rays",
            "2",
            "-o",
            "c",
        ],
    );
    place
}

#[test]
fn equal_frames_are_equal_and_others_differ_with_code_4() {
    let place = frames();
    let digest = |file: &str| {
        let (line, _) = place.ends(0, &["image", "digest", file]);
        let (digest, path) = line.trim_end().split_once("  ").unwrap();
        assert_eq!((digest.len(), path), (64, file), "hex first, then the path");
        digest.to_owned()
    };
    assert_eq!(digest("a/ball_0000.exr"), digest("b/ball_0000.exr"));
    assert_eq!(digest("a/ball_0000.png"), digest("b/ball_0000.png"));
    assert_ne!(digest("a/ball_0000.exr"), digest("c/ball_0000.exr"));

    let (same, _) = place.ends(
        0,
        &["image", "compare", "a/ball_0000.exr", "b/ball_0000.exr"],
    );
    assert!(same.contains("equal"), "{same}");
    let arguments = ["image", "compare", "a/ball_0000.exr", "c/ball_0000.exr"];
    let (other, _) = place.ends(4, &arguments);
    assert!(
        other.contains("different") && other.contains("column"),
        "{other}"
    );
    let (json, _) = place.ends(4, &[&arguments[..], &["--output", "json"]].concat());
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["equal"], false);
    assert!(json["differing_pixels"].as_u64() > Some(0), "{json}");
    place.ends(
        4,
        &["image", "compare", "a/ball_0000.exr", "a/ball_0000.png"],
    );
}

#[test]
fn a_frame_says_what_it_shows() {
    let place = frames();
    let (json, _) = place.ends(0, &["image", "info", "a/ball_0001.exr", "--output", "json"]);
    let info: Value = serde_json::from_str(&json).unwrap();
    let (digest, _) = place.ends(0, &["scene", "check", "ball.toml", "--output", "quiet"]);
    assert_eq!(info["scene_digest"], digest.trim());
    assert_eq!(info["film_digest"].as_str().map(str::len), Some(64));
    assert_eq!(
        (&info["parts"][0]["width"], &info["parts"][0]["height"]),
        (&40.into(), &30.into())
    );
    let told = |name: &str| -> Value {
        serde_json::from_str(info["metadata"][name].as_str().unwrap()).unwrap()
    };
    let mut statistics = told("flyby:statistics");
    assert_eq!(statistics["pixels"], 40 * 30);
    let method = statistics.as_object_mut().unwrap().remove("method");
    assert!(method.is_some_and(|method| method.is_string()));
    let counts = statistics.as_object().unwrap().values();
    assert!(
        counts.into_iter().all(Value::is_u64),
        "counts, and no times"
    );
    let guarantee = told("flyby:settings")["guarantee"].to_string();
    assert!(guarantee.contains("proven"), "{guarantee}");
    let (table, _) = place.ends(0, &["image", "info", "a/ball_0001.exr"]);
    assert!(
        table.contains("N.X") && table.contains("flyby:sceneDigest"),
        "{table}"
    );
}

#[test]
fn what_is_no_frame_is_a_failure() {
    let place = Place::new();
    place.write("text.exr", "no image");
    for command in ["digest", "info"] {
        let (_, said) = place.ends(1, &["image", command, "text.exr"]);
        assert!(said.contains("text.exr"), "{said}");
    }
    place.ends(1, &["image", "compare", "text.exr", "text.exr"]);
}
