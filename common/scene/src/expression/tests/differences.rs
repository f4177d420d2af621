//! Slopes and curvatures of fields.

use field::{Interval, Place, Program};

use super::*;

/// The value of a field at a place.
fn value(text: &str, at: [f64; 3]) -> f64 {
    let fields = fields();
    let root = fields.field(text).unwrap();
    let program = Program::compile(&fields.into_graph(), &[root], Interval::point(0.0)).unwrap();
    program.at(&Place {
        at,
        footprint: 0.0,
        time: 0.0,
    })
}

#[test]
fn slopes_and_curvatures_are_those_of_the_field() {
    let at = [0.3, -0.7, 1.9];
    for (text, expected) in [
        ("slope(3*p.x - 4*p.z, 2)", 5.0),
        ("gradient(p.x*p.y, 0.5).x", -0.7),
        ("gradient(p.x*p.y, 0.5).y", 0.3),
        ("gradient(p.x*p.y, 0.5).z", 0.0),
        ("curvature(p.x*p.x - 3*p.y*p.y + p.z, 0.25)", -4.0),
        ("slope(7, 1)", 0.0),
        ("curvature(t, 1)", 0.0),
        // A crease is rounded off over the distance: (|x + h| − |x − h|) / 2h.
        ("slope(abs(p.x), 0.6)", 0.5),
    ] {
        let found = value(text, at);
        assert!((found - expected).abs() < 1e-12, "{text} is {found}");
    }
    let exact = value("length(gradient(p))", at);
    let over = value("slope(noise(p), 0.001)", at);
    assert!((exact - over).abs() < 1e-3 * exact, "{over}, not {exact}");
}

#[test]
fn what_lies_on_the_plane_does_not_rise_across_it() {
    assert_eq!(
        read("slope(noise(onto_plane(p)), 2)"),
        "length(vec(((noise((onto_plane(p) + vec(2, 0, 0))) - noise((onto_plane(p) + vec(-2, 0, 0))))*0.25), \
         ((noise((onto_plane(p) + vec(0, 2, 0))) - noise((onto_plane(p) + vec(0, -2, 0))))*0.25), 0))"
    );
}

#[test]
fn what_has_no_slope_is_refused() {
    for (text, said) in [
        ("slope(p, 1)", "wants a number here, not a vector"),
        ("slope(p.x, 0)", "distance from 1e-6 to 1e9 metres, not 0"),
        ("curvature(p.x, -1)", "not -1"),
        ("gradient(p.x, p.y).x", "constant number"),
        ("slope(p.x)", "slope(f, 5)"),
    ] {
        let Refusal { message, help, .. } = fields().field(text).unwrap_err();
        let all = format!("{message}; {}", help.unwrap_or_default());
        assert!(all.contains(said), "{text}: {all}");
    }
    // Each doubles what it is taken of more than once.
    let nested = format!("{}noise(p){}", "slope(".repeat(12), ", 1)".repeat(12));
    let refusal = fields().field(&nested).unwrap_err();
    assert!(
        refusal.message.contains("operations"),
        "{}",
        refusal.message
    );
}
