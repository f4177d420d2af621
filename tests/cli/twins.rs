//! Every long option can be said in the environment and in the configuration file.

use crate::place::{Place, ends};

#[test]
fn a_flag_counts_before_the_environment_before_the_file() {
    let place = Place::new();
    place.write("c.toml", "output = 'json'\n");
    let listed = |environment: Option<&str>, flag: &[&str]| {
        let mut command = place.flyby(&["image", "digest", "nowhere.exr"]);
        command.env("FLYBY_CONFIG", place.path("c.toml")).args(flag);
        if let Some(value) = environment {
            command.env("FLYBY_OUTPUT", value);
        }
        command
    };
    // All the same to a frame that is not there: each is read and taken.
    for (environment, flag) in [
        (None, &[][..]),
        (Some("quiet"), &[]),
        (Some("quiet"), &["--output", "table"]),
    ] {
        let (_, said) = ends(listed(environment, flag), 1);
        assert!(said.contains("nowhere.exr"), "{said}");
    }
    let (_, said) = ends(listed(Some("loud"), &[]), 2);
    assert!(
        said.contains("FLYBY_OUTPUT") && said.contains("loud"),
        "{said}"
    );
}

#[test]
fn the_environment_decides_how_results_are_printed() {
    let place = Place::new();
    let scene = place.write("s.toml", crate::scene::SPHERE);
    let mut command = place.flyby(&["scene", "show"]);
    command.arg(&scene).env("FLYBY_OUTPUT", "json");
    let (shown, _) = ends(command, 0);
    let shown: serde_json::Value = serde_json::from_str(&shown).unwrap();
    assert_eq!(shown["resolution"], serde_json::json!([40, 30]));

    place.write("c.toml", "[scene.show]\nresolution = '64x48'\n");
    let mut command = place.flyby(&["scene", "show", "--output", "json"]);
    command
        .arg(&scene)
        .env("FLYBY_CONFIG", place.path("c.toml"));
    let (shown, _) = ends(command, 0);
    let shown: serde_json::Value = serde_json::from_str(&shown).unwrap();
    assert_eq!(shown["resolution"], serde_json::json!([64, 48]));
}

#[test]
fn mistakes_in_the_configuration_are_named() {
    let place = Place::new();
    let said = |text: &str| {
        place.write("c.toml", text);
        let mut command = place.flyby(&["scene", "schema"]);
        command.env("FLYBY_CONFIG", place.path("c.toml"));
        ends(command, 2).1
    };
    let unknown = said("[render]\nthread = 2\n");
    assert!(
        unknown.contains("thread") && unknown.contains("did you mean `threads`?"),
        "{unknown}"
    );
    assert!(said("[render]\nthreads = 'many'\n").contains("many"));
    assert!(said("[render\n").contains("is no TOML"));

    let mut command = place.flyby(&["scene", "schema"]);
    command.env("FLYBY_CONFIG", place.path("nowhere.toml"));
    let (_, missing) = ends(command, 2);
    assert!(missing.contains("nowhere.toml"), "{missing}");
}
