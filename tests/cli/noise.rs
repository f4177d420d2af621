//! `flyby noise`: measurements as numbers and plots.

use serde_json::Value;

use crate::place::Place;

const QUICK: [&str; 8] = [
    "--realisations",
    "10",
    "--cells",
    "16",
    "--samples",
    "4",
    "--line-samples",
    "8",
];

#[test]
fn a_noise_is_measured_and_plotted() {
    let place = Place::new();
    let mut args = vec!["noise", "measure", "gradient", "white", "-o", "plots"];
    args.extend(QUICK);
    args.extend(["--output", "json"]);
    let (json, _) = place.ends(0, &args);
    let json: Value = serde_json::from_str(&json).unwrap();
    let noises = json["noises"].as_array().unwrap();
    assert_eq!(noises.len(), 2);
    let peak = noises[0]["summary"]["peak"].as_f64().unwrap();
    assert!((0.3..0.7).contains(&peak), "{peak}");
    let plots = json["plots"].as_array().unwrap();
    assert_eq!(
        plots.len(),
        9,
        "two maps and a sum of copies each, three charts of both"
    );
    for plot in plots {
        let svg = std::fs::read_to_string(place.path(plot.as_str().unwrap())).unwrap();
        assert!(svg.starts_with("<svg"), "{plot}");
        assert!(svg.contains("cell"), "{plot}: an axis without its unit");
    }
}

#[test]
fn every_noise_of_chapter_4_has_a_name() {
    let place = Place::new();
    let names = [
        "value",
        "value-gradient",
        "simplex",
        "sparse",
        "sparse3",
        "sparse-linear",
        "sparse-disc",
        "spot",
        "cellular",
        "cellular2",
        "wavelet",
    ];
    let mut args = vec!["noise", "measure", "-o", "plots", "--output", "json"];
    args.extend(names);
    args.extend(QUICK);
    let (json, _) = place.ends(0, &args);
    let json: Value = serde_json::from_str(&json).unwrap();
    for (noise, name) in json["noises"].as_array().unwrap().iter().zip(names) {
        assert_eq!(noise["name"], name);
        assert_eq!(noise["varied"], "by_key", "{name}");
        assert!(
            noise["values"]["variance"].as_f64().unwrap() > 1e-4,
            "{name}"
        );
    }
    let stages = std::fs::read_to_string(place.path("plots/wavelet_stages.svg")).unwrap();
    assert!(stages.contains("lattice cells"));
}

#[test]
fn any_expression_can_be_measured() {
    let place = Place::new();
    let mut args = vec!["noise", "measure", "--field", "abs(noise(p * 2))"];
    args.extend(QUICK);
    let (table, _) = place.ends(0, &args);
    assert!(table.contains("abs(noise(p * 2))"), "{table}");
    assert!(!table.contains("gradient"), "{table}");
}

#[test]
fn mistakes_say_what_to_do() {
    let place = Place::new();
    let (_, said) = place.ends(2, &["noise", "measure", "gradiant"]);
    assert!(said.contains("gradient"), "{said}");
    let (_, said) = place.ends(2, &["noise", "measure", "--field", "noise(p"]);
    assert!(said.contains("missing"), "{said}");
    let (_, said) = place.ends(2, &["noise", "measure", "--cells", "30"]);
    assert!(said.contains("power of two"), "{said}");
    let (_, said) = place.ends(
        2,
        &["noise", "measure", "--cells", "1024", "--samples", "16"],
    );
    assert!(said.contains("too many"), "{said}");
}
