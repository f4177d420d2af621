//! `flyby bench`: tables beside the thesis's.

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
