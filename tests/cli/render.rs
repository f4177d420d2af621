//! `flyby render`: what it leaves, what it keeps, what it refuses.

use serde_json::Value;

use crate::place::Place;
use crate::scene::SPHERE;

fn ball() -> Place {
    let place = Place::new();
    place.write("ball.toml", SPHERE);
    place
}

fn files(place: &Place, folder: &str) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(place.path(folder))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn frames_lie_in_a_folder_of_the_scene_s_name() {
    let place = ball();
    let (out, said) = place.ends(
        0,
        &[
            "render",
            "ball.toml",
            "--frames",
            "1..3",
            "--format",
            "exr,ppm",
        ],
    );
    assert!(out.contains("2 rendered, 0 kept"), "{out}");
    assert!(said.is_empty(), "no bar where there is no terminal: {said}");
    let names = ["ball_0001.exr", "ball_0002.exr", "ball_1.ppm", "ball_2.ppm"];
    assert_eq!(files(&place, "ball"), names);
}

#[test]
fn statistics_say_counts_averages_and_times() {
    let place = ball();
    let command = ["render", "ball.toml", "--frames", "0", "--stats"];
    let (out, _) = place.ends(0, &[&command[..], &["--output", "json"]].concat());
    let report: Value = serde_json::from_str(&out).unwrap();
    let statistics = &report["statistics"];
    let number = |value: &Value| value.as_f64().unwrap();
    let rays = number(&statistics["rays"]) + number(&statistics["shadow_rays"]);
    for name in ["evaluations", "steps", "backtracks", "subdivisions"] {
        let average = number(&statistics["per_ray"][name]);
        assert!(
            (average * rays - number(&statistics[name])).abs() < 0.5,
            "{name}"
        );
    }
    for part in ["preparation", "bundles", "search", "sky", "encoding"] {
        assert!(number(&statistics["seconds"][part]) > 0.0, "{part}");
    }
    let (out, _) = place.ends(0, &[&command[..], &["--existing", "replace"]].concat());
    assert!(out.contains("per ray: ") && out.contains("part"), "{out}");
}

#[test]
fn a_second_run_keeps_replaces_or_stops() {
    let place = ball();
    let run = |code, more: &[&str]| {
        place.ends(
            code,
            &[&["render", "ball.toml", "--output", "json"], more].concat(),
        )
    };
    let report = |out: String| -> (u64, u64) {
        let report: Value = serde_json::from_str(&out).unwrap();
        let number = |name: &str| report[name].as_u64().unwrap();
        (number("frames_rendered"), number("frames_kept"))
    };
    assert_eq!(report(run(0, &["--frames", "0..2"]).0), (2, 0));
    let (out, said) = run(0, &[]);
    assert_eq!(report(out), (1, 2), "the third frame only");
    assert!(
        said.contains("already") && said.contains("--existing replace"),
        "{said}"
    );
    assert_eq!(report(run(0, &["--existing", "replace"]).0), (3, 0));
    let (_, said) = run(1, &["--existing", "fail"]);
    assert!(said.contains("is there already"), "{said}");
    let (_, said) = run(1, &["--rays", "2"]);
    assert!(said.contains("another scene, or other settings"), "{said}");
}

#[test]
fn pixels_do_not_depend_on_how_they_are_computed() {
    let place = ball();
    let digests = |out: &str, more: &[&str]| -> Vec<String> {
        let words = ["render", "ball.toml", "--output", "json", "-o", out];
        let (out, _) = place.ends(0, &[&words[..], more].concat());
        let report: Value = serde_json::from_str(&out).unwrap();
        let frames = report["frames"].as_array().unwrap().iter();
        frames
            .map(|frame| frame["film_digest"].as_str().unwrap().to_owned())
            .collect()
    };
    let reference = digests("a", &[]);
    assert_eq!(reference.len(), 3);
    assert_eq!(
        digests(
            "b",
            &["--threads", "1", "--tile", "7x5", "--simd", "scalar"]
        ),
        reference
    );
    assert_eq!(
        digests("c", &["--threads", "5", "--tile", "33x64"]),
        reference
    );
}

#[test]
fn what_makes_no_sense_is_refused_before_anything_is_made() {
    let place = ball();
    for (more, phrase) in [
        (["--frames", "0..9"], "there is no frame 3"),
        (["--frames", "2..2"], "no frame"),
        (["--resolution", "40"], "400x300"),
        (["--crop", "9,9,3,3"], "no pixel"),
        (["--simd", "mmx"], "mmx"),
        (["--format", "gif"], "gif"),
    ] {
        let (_, said) = place.ends(2, &[&["render", "ball.toml"], &more[..]].concat());
        assert!(said.contains(phrase), "{more:?}: {said}");
    }
    assert_eq!(files(&place, "."), ["ball.toml"]);
}

#[test]
fn without_a_coordinator_jobs_are_out_of_reach() {
    let place = ball();
    for command in [
        &["job", "list"][..],
        &["worker"],
        &["worker", "list"],
        &["submit", "ball.toml"],
    ] {
        let (_, said) = place.ends(3, command);
        assert!(said.contains("flyby coordinator"), "{command:?}: {said}");
    }
}
