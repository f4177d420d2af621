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

/// Malformed fields, each with what is said about it and where in the field, line and column from 1.
const MALFORMED: &[(&str, &str, (u64, u64))] = &[
    (
        "fn f(x) { f(x) + f(x) } f(1)",
        "call each other too deeply",
        (1, 25),
    ),
    ("p.z +\n  1/(2 - 2)", "this divides by zero", (2, 4)),
    ("p.z + p.x/0", "this divides by zero", (1, 10)),
    (
        "let f = p.x; for i in 0..10000000 { f = f*f + i } f",
        "nested more than 4096 operations deep",
        (1, 42),
    ),
    (
        "for i in 0..10000000 { let f = p.x*i; } p.z",
        "has more than 65536 operations",
        (1, 35),
    ),
    (
        "let i = 0;\nwhile true { i += 1 }",
        "takes too many steps",
        (2, 19),
    ),
    ("while true { }", "takes too many steps", (1, 12)),
    // Without a limit it would be three milliard numbers of eight bytes.
    (
        "let a = [1]; for i in 0..32 { a += a } a.len()",
        "an array in the expression grows too large",
        (1, 33),
    ),
    (
        "let n = 1e300*1e300;\nnoise((n - n)*p)",
        "`*` is given a number that is NaN",
        (2, 14),
    ),
    ("p.x - 2^3", "`^` is not a power", (1, 8)),
    (
        "if p.x == 0 { 1 } else { p.z }",
        "cannot be compared with `==`",
        (1, 8),
    ),
];

#[test]
fn malformed_fields_end_in_sentences_with_places_soon_and_in_little_memory() {
    let place = Place::new();
    let with = |field: &str| SPHERE.replace("\"length(p) - 1\"", &format!("'''\n{field}'''"));
    for (field, said, (line, column)) in MALFORMED {
        let text = with(field);
        place.write("malformed.toml", &text);
        let first = text
            .lines()
            .position(|line| line.starts_with("field"))
            .unwrap() as u64
            + 2;
        let mut command = within_a_gibibyte(
            &place,
            &["scene", "check", "malformed.toml", "--output", "json"],
        );
        command.timeout(std::time::Duration::from_secs(30));
        let (json, _) = crate::place::ends(command, 2);
        let json: Value = serde_json::from_str(&json).unwrap();
        let mistake = &json["mistakes"][0];
        let message = mistake["message"].as_str().unwrap();
        assert!(message.contains(said), "{field}: {message}");
        assert_eq!(
            (mistake["line"].as_u64(), mistake["column"].as_u64()),
            (Some(first + line - 1), Some(*column)),
            "{field}: {message}"
        );
    }
    // What only looks wrong is taken as it is on paper: thirds, and 2⁶⁴ of one thing.
    for field in ["seed - 1/3", "let x = seed; for i in 0..64 { x = x + x } x"] {
        place.write("good.toml", &with(field));
        let command = within_a_gibibyte(&place, &["scene", "check", "good.toml"]);
        crate::place::ends(command, 0);
    }
}

/// The command, with no more than a gibibyte of address space.
fn within_a_gibibyte(place: &Place, arguments: &[&str]) -> assert_cmd::Command {
    let flyby = place.flyby(arguments);
    let mut limited = assert_cmd::Command::new("sh");
    limited
        .args(["-c", "ulimit -v 1048576 && exec \"$@\"", "sh"])
        .arg(flyby.get_program())
        .args(flyby.get_args());
    for (name, value) in flyby.get_envs() {
        match value {
            Some(value) => limited.env(name, value),
            None => limited.env_remove(name),
        };
    }
    limited.current_dir(place.path(""));
    limited
}
