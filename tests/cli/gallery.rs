//! `flyby gallery`: a page with pictures, rendered once.

use std::fs;

use serde_json::Value;

use crate::place::Place;
use crate::scene::SPHERE;

const INDEX: &str = r#"
[[figure]]
name = "ball"
number = "1.1a"
scene = "ball.toml"
caption = "A ball."

[[figure]]
name = "small"
number = "1.1b"
scene = "ball.toml"
set = ["film.resolution=\"8x6\""]
frame = 1
caption = "A small one."
"#;

fn scenes() -> Place {
    let place = Place::new();
    fs::create_dir_all(place.path("scenes/figures")).unwrap();
    place.write("scenes/ball.toml", SPHERE);
    place.write("scenes/figures/gallery.toml", INDEX);
    place
}

fn report(place: &Place, more: &[&str]) -> Value {
    let (out, _) = place.ends(0, &[&["gallery", "--output", "json"], more].concat());
    serde_json::from_str(&out).unwrap()
}

#[test]
fn a_second_run_renders_only_what_has_changed() {
    let place = scenes();
    let first = report(&place, &["--only", "1.1b"]);
    assert_eq!(
        (&first["rendered"], &first["missing"]),
        (&1.into(), &1.into())
    );
    let second = report(&place, &[]);
    assert_eq!(
        (&second["rendered"], &second["kept"]),
        (&1.into(), &1.into())
    );
    let page = fs::read_to_string(place.path("gallery/index.html")).unwrap();
    assert_eq!(page.matches("data:image/png;base64,").count(), 2);
    assert!(page.contains("A small one.") && page.contains("evaluations/ray"));
    // Another caption is another page, but the same pictures; another setting is another picture.
    place.write(
        "scenes/figures/gallery.toml",
        &INDEX.replace("8x6", "9x6").replace("A ball.", "The ball."),
    );
    let third = report(&place, &[]);
    assert_eq!((&third["rendered"], &third["kept"]), (&1.into(), &1.into()));
    let page = fs::read_to_string(place.path("gallery/index.html")).unwrap();
    assert!(page.contains("The ball."));
}

#[test]
fn unknown_figures_and_missing_lists_are_told() {
    let place = scenes();
    let (_, said) = place.ends(2, &["gallery", "--only", "9.9"]);
    assert!(
        said.contains("no figure `9.9`") && said.contains("small (1.1b)"),
        "{said}"
    );
    let (_, said) = place.ends(1, &["gallery", "nowhere"]);
    assert!(
        said.contains("gallery.toml") && said.contains("flyby gallery"),
        "{said}"
    );
}

#[test]
fn pictures_are_small_unless_asked_for_in_full_and_a_log_gets_lines() {
    let place = scenes();
    place.write(
        "scenes/figures/gallery.toml",
        &INDEX
            .replace("8x6", "600x20")
            .replace("frame = 1", "frame = 2"),
    );
    let size = || {
        let png = fs::read(place.path("gallery/small_0002.png")).unwrap();
        [&png[16..20], &png[20..24]].map(|side| u32::from_be_bytes(side.try_into().unwrap()))
    };
    let (_, said) = place.ends(0, &["gallery"]);
    assert_eq!(size(), [360, 12]);
    for line in ["1 of 2: ball (1.1a): ", "2 of 2: small (1.1b): "] {
        assert!(said.contains(line), "{said}");
    }
    let (_, said) = place.ends(0, &["gallery", "--full", "--output", "quiet"]);
    assert_eq!(size(), [600, 20]);
    assert_eq!(said, "");
}

#[test]
fn a_picture_that_fails_names_its_figure_and_scene() {
    let place = scenes();
    place.write(
        "scenes/figures/gallery.toml",
        &INDEX.replace("frame = 1", "frame = 9"),
    );
    let (_, said) = place.ends(2, &["gallery"]);
    assert!(said.contains("figure 1.1b (`ball.toml`): "), "{said}");
}
