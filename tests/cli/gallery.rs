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
