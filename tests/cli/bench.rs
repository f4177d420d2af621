//! `flyby bench`: tables beside the thesis's, beside other programs, beside itself.

use serde_json::Value;

use crate::place::Place;

#[test]
fn the_thesis_s_tables_are_printed_with_its_numbers() {
    let place = Place::new();
    let args = [
        "bench",
        "thesis",
        "--side",
        "8",
        "--noise",
        "gradient,cellular",
    ];
    let (text, _) = place.ends(0, &args);
    for word in [
        "Table 5.1",
        "78.19",
        "Tables 5.2 to 5.4",
        "116.57",
        "Table 5.5",
        "reduced AA",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let (json, _) = place.ends(0, &[&args[..], &["--output", "json"]].concat());
    let json: Value = serde_json::from_str(&json).unwrap();
    let gradient = &json["noises"][0];
    let evaluations = |list: &str, i: usize| gradient[list][i]["evaluations"].as_f64().unwrap();
    // Correlation is worth evaluations, and so is eq. (5.27); a true bound costs steps.
    assert!(evaluations("casting", 0) > 1.3 * evaluations("casting", 2));
    assert!(evaluations("casting", 2) > evaluations("casting", 3));
    assert!(evaluations("tracing", 0) > 1.3 * evaluations("tracing", 1));
    assert!(evaluations("tracing", 2) > evaluations("tracing", 0));
    let hits = |list: &str, i: usize| gradient[list][i]["hits"].as_u64().unwrap();
    assert_eq!(hits("casting", 0), hits("casting", 3));
    assert!(hits("casting", 0) > 10);
    // Eq. (5.27) needs correlation, which other noises have too; the cellular's minima lose nothing by being reduced.
    let cellular = &json["noises"][1];
    assert_eq!(cellular["noise"], "cellular");
    let casting = |i: usize| cellular["casting"][i]["evaluations"].as_f64().unwrap();
    assert!(casting(1) > 0.9 * casting(2) && casting(2) > 1.2 * casting(3));
    assert!(casting(0) > 1.2 * casting(3));
    assert_eq!(json["noises"].as_array().map(Vec::len), Some(2));
    assert!(text.contains("fixed beforehand"), "{text}");
}

#[test]
fn settings_out_of_range_are_refused_with_the_range() {
    let place = Place::new();
    let (_, said) = place.ends(2, &["bench", "thesis", "--epsilon", "0"]);
    assert!(said.contains("between 1e-9 and 0.1"), "{said}");
    let (_, said) = place.ends(2, &["bench", "thesis", "--side", "1"]);
    assert!(said.contains("2..=800"), "{said}");
}

#[test]
fn rows_beside_ourselves_have_ratios_and_those_without_a_peer_are_left_out_by_name() {
    let place = Place::new();
    let args = ["bench", "peers", "--runs", "1", "--side", "16"];
    let rows = [
        "tracer-gradient",
        "reduced-affine",
        "gradient-1",
        "noise-fastnoise2",
    ];
    let json = ["--output", "json"];
    let (out, _) = place.ends(0, &[&args[..], &rows[..], &json[..]].concat());
    let report: Value = serde_json::from_str(&out).unwrap();
    let measured = report["rows"].as_array().unwrap();
    let names: Vec<&str> = measured
        .iter()
        .map(|row| row["row"].as_str().unwrap())
        .collect();
    // In the order of the table, not of the command line.
    assert_eq!(names, ["gradient-1", "tracer-gradient", "reduced-affine"]);
    for row in measured {
        let number = |value: &Value| value.as_f64().unwrap();
        let (ratio, budget) = (number(&row["ratio"]), number(&row["budget"]));
        let (ours, theirs) = (&row["ours"]["median"], &row["theirs"]["median"]);
        assert!((ratio - number(ours) / number(theirs)).abs() < 1e-9 * ratio);
        assert_eq!(row["wanted"], "at_most");
        assert_eq!(row["reached"], ratio <= budget);
    }
    assert_eq!(report["skipped"][0]["row"], "noise-fastnoise2");
    let (_, said) = place.ends(2, &["bench", "peers", "--only", "nothing"]);
    assert!(said.contains("sphere-3-proven"), "{said}");
}

#[test]
fn threads_are_measured_beside_processes() {
    let place = Place::new();
    place.write("ball.toml", crate::scene::SPHERE);
    let args = ["bench", "threads", "ball.toml", "--runs", "1"];
    let (out, _) = place.ends(0, &[&args[..], &["--output", "json"]].concat());
    let report: Value = serde_json::from_str(&out).unwrap();
    let ball = &report["scenes"][0];
    assert_eq!(
        (ball["scene"].as_str(), report["threads"].as_u64()),
        (Some("ball"), Some(2))
    );
    assert!(ball["ratio"][0].as_f64().unwrap() > 0.0);
    assert!(ball["reached"].is_null(), "too short to be judged: {ball}");
    let (_, said) = place.ends(2, &["bench", "threads", "ball.toml", "--threads", "1"]);
    assert!(said.contains("2..=256"), "{said}");
    place.write("wrong.toml", "name = 3");
    let (_, said) = place.ends(1, &["bench", "threads", "wrong.toml", "--runs", "1"]);
    assert!(said.contains("wrong.toml"), "{said}");
}

#[test]
fn techniques_of_the_tracer_gain_work_and_change_no_pixel() {
    let place = Place::new();
    let args = ["bench", "techniques", "sphere-3", "flight", "--side", "64"];
    let (out, _) = place.ends(
        0,
        &[&args[..], &["--rays", "2", "--output", "json"]].concat(),
    );
    let report: Value = serde_json::from_str(&out).unwrap();
    // Over ground whose cells lead, bundles and their levels by value gain nothing any more.
    for (number, gains) in [(0, "tangents"), (1, "clear ground")] {
        let without = report["scenes"][number]["without"].as_array().unwrap();
        assert!(without.len() >= 8 && without.iter().all(|one| one["is_equal"] == true));
        let one = without.iter().find(|one| one["name"] == gains).unwrap();
        assert!(one["evaluations"].as_f64().unwrap() > 1.2, "{one}");
        let by = report["scenes"][number]["by"].as_array().unwrap();
        assert!(by.len() == 6 && by.iter().all(|one| one["is_equal"] == true));
    }
}

#[test]
fn the_farm_s_own_costs_have_a_row_each() {
    let place = Place::new();
    let folder = place.path("measured");
    std::fs::create_dir(&folder).unwrap();
    let args = [
        "bench", "farm", "--tiles", "1000", "--folder", "measured", "--output", "json",
    ];
    let (out, _) = place.ends(0, &args);
    let report: Value = serde_json::from_str(&out).unwrap();
    let rows = report["rows"].as_array().unwrap();
    let names: Vec<&str> = rows
        .iter()
        .map(|row| row["row"].as_str().unwrap())
        .collect();
    let expected = [
        "scheduler",
        "disk-syncs",
        "submit",
        "one-worker",
        "one-worker-cpu",
        "sixteen-workers",
        "sixteen-workers-cpu",
        "killed",
        "restart",
        "memory",
        "disk-write",
        "blocks",
        "blocks-share",
    ];
    assert_eq!(names, expected);
    for row in rows {
        assert!(row["value"].as_f64().unwrap() >= 0.0, "{row}");
    }
    let killed = rows.iter().find(|row| row["row"] == "killed").unwrap();
    assert_eq!(
        (&killed["value"], &killed["reached"]),
        (&0.0.into(), &true.into())
    );
    // Budgets of a million tiles are not judged by a thousand.
    let memory = rows.iter().find(|row| row["row"] == "memory").unwrap();
    assert!(memory["reached"].is_null(), "{memory}");
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
    let (_, said) = place.ends(2, &["bench", "farm", "nothing"]);
    assert!(said.contains("sixteen-workers-cpu"), "{said}");
}

#[test]
fn no_other_coordinator_takes_the_pixels_of_a_measurement() {
    let place = Place::new();
    let (_, said) = place.ends(2, &["coordinator", "--null-renderer", "--state", "."]);
    assert!(
        said.contains("no state folder of `flyby bench farm`"),
        "{said}"
    );
}
