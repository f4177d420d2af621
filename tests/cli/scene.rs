//! `flyby scene`: mistakes with their places, contents, schema.

use serde_json::Value;

use crate::place::Place;

/// A unit sphere, small and quick.
pub(crate) const SPHERE: &str = r#"
name = "ball"

[film]
resolution = "40x30"
images = 3
fps = 25

[sampling]
rays = 1

[camera]
angle = "40 deg"

[camera.fixed]
eye = [4, 0, 0]
target = [0, 0, 0]

[surface.sphere]
radius = "1 m"

[surface]
field = "length(p) - 1"

[sun]
azimuth = "90 deg"
elevation = "40 deg"

[sky.plain]
radiance = [0.2, 0.3, 0.5]
ambient = [0.1, 0.1, 0.1]
"#;

#[test]
fn a_good_scene_is_named_by_its_digest() {
    let place = Place::new();
    place.write("ball.toml", SPHERE);
    let (out, _) = place.ends(0, &["scene", "check", "ball.toml"]);
    assert!(out.contains("no mistakes"), "{out}");
    let (digest, _) = place.ends(0, &["scene", "check", "ball.toml", "--output", "quiet"]);
    assert_eq!(digest.trim().len(), 64, "{digest}");
    let (other, _) = place.ends(
        0,
        &[
            "scene",
            "check",
            "ball.toml",
            "--rays",
            "2",
            "--output",
            "quiet",
        ],
    );
    assert_ne!(
        digest, other,
        "rays change pixels, so they change the digest"
    );
}

#[test]
fn every_mistake_is_shown_with_its_place() {
    let place = Place::new();
    let broken = SPHERE.replace("resolution", "resolutoin").replace(
        "\"40 deg\"\n\n[camera.fixed]",
        "\"40 km\"\n\n[camera.fixed]",
    );
    place.write("broken.toml", &broken);
    let line = |text: &str| broken.lines().position(|line| line.contains(text)).unwrap() + 1;
    let (out, said) = place.ends(2, &["scene", "check", "broken.toml"]);
    assert!(out.is_empty(), "{out}");
    assert!(said.contains("resolution"), "the suggestion: {said}");
    for text in ["resolutoin", "40 km"] {
        assert!(
            said.contains(&format!("broken.toml:{}:", line(text))),
            "{text}: {said}"
        );
    }

    let (json, _) = place.ends(2, &["scene", "check", "broken.toml", "--output", "json"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["valid"], false);
    let lines: Vec<u64> = json["mistakes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|mistake| mistake["line"].as_u64().unwrap())
        .collect();
    assert!(lines.contains(&(line("resolutoin") as u64)), "{lines:?}");
    assert!(lines.contains(&(line("40 km") as u64)), "{lines:?}");
}

#[test]
fn a_scene_that_cannot_be_read_is_a_failure() {
    let place = Place::new();
    let (_, said) = place.ends(1, &["scene", "check", "nowhere.toml"]);
    assert!(
        said.contains("nowhere.toml") && said.contains("No such file"),
        "{said}"
    );
    let (_, said) = place.ends(2, &["scene", "show", "."]);
    assert!(said.contains("not an ordinary file"), "{said}");
}

#[test]
fn the_schema_is_json() {
    let (schema, _) = Place::new().ends(0, &["scene", "schema"]);
    let schema: Value = serde_json::from_str(&schema).unwrap();
    assert!(schema["properties"]["film"].is_object(), "{schema}");
}
