//! Scenes with mistakes, and scripts that mean harm: each is refused with its place and its
//! sentence, in a moment and in little memory.

use crate::harness::{Outcome, Place, wait};

/// Most memory that a refusal may take, KiB; the worst of the scripts below would take 24 GiB.
const MEMORY_KIB: &str = "2000000";

const GOOD: &str = r#"
[film]
resolution = "32x24"
fps = 25
shutter = "20 ms"

[camera.fixed]
eye = [0, -4, 0]
target = [0, 0, 0]

[surface]
field = "length(p) - 1 + 0.3*noise(4*p)"

[surface.sphere]
radius = "1 m"

[sun]
elevation = "30 deg"
"#;

fn check(place: &Place, scene: &str) -> Outcome {
    place.write("scene.toml", scene);
    let limit = format!("ulimit -v {MEMORY_KIB}; exec \"$@\"");
    let command = place.wrapped(
        &["sh", "-c", &limit, "sh"],
        ["scene", "check", "scene.toml"],
    );
    place.run(command, wait::LIMIT)
}

/// [`GOOD`] with one of its lines, that begins so, written otherwise.
fn with(line: &str, other: &str) -> String {
    let start = GOOD.find(&format!("\n{line}")).unwrap() + 1;
    let end = start + GOOD[start..].find('\n').unwrap();
    format!("{}{other}{}", &GOOD[..start], &GOOD[end..])
}

#[test]
fn one_without_mistakes_is_taken() {
    check(&Place::new(), GOOD).ok();
}

#[test]
fn mistakes_in_the_file() {
    let place = Place::new();
    let bad: [(&str, &str, &[&str]); 16] = [
        (
            "resolution",
            "resoluton = \"32x24\"",
            &["scene.toml:3:1", "resoluton", "did you mean `resolution`?"],
        ),
        ("radius", "radius = \"1 kg\"", &["scene.toml:15:", "kg"]),
        (
            "radius",
            "radius = \"1 deg\"",
            &["scene.toml:15:", "deg", "length"],
        ),
        (
            "elevation",
            "elevation = \"30 m\"",
            &["scene.toml:18:", "angle"],
        ),
        ("radius", "radius = nan", &["scene.toml:15:"]),
        ("radius", "radius = \"inf m\"", &["scene.toml:15:"]),
        ("radius", "radius = \"-1 m\"", &["scene.toml:15:", "radius"]),
        (
            "resolution",
            "resolution = \"0x24\"",
            &["scene.toml:3:", "each side has 1 to 65536 pixels"],
        ),
        (
            "resolution",
            "resolution = \"32 24\"",
            &["scene.toml:3:", "is no resolution"],
        ),
        (
            "shutter",
            "shutter = \"50 ms\"",
            &["scene.toml:5:", "0.05 s", "0.04 s"],
        ),
        (
            "field",
            "field = \"length(p) - 1\"\nbound.shell = [\"3 m\", \"2 m\"]",
            &["scene.toml:13:", "the range is empty"],
        ),
        (
            "target",
            "target = [0, -4, 0]",
            &["scene.toml:9:", "its view has no direction"],
        ),
        ("target", "", &["target"]),
        ("eye", "eye = [0, -4, 0", &["scene.toml"]),
        ("fps", "fps = 25\nfps = 30", &["scene.toml:5:", "fps"]),
        (
            "[camera.fixed]",
            "[camera.orbit]",
            &["scene.toml:7:", "orbit"],
        ),
    ];
    for (line, other, phrases) in bad {
        check(&place, &with(line, other)).refused(2, phrases);
    }
}

#[test]
fn every_mistake_is_said_at_once() {
    let scene = with("radius", "radius = \"1 kg\"").replace("fps = 25", "fsp = 25");
    check(&Place::new(), &scene).refused(2, &["scene.toml:4:", "fsp", "scene.toml:15:", "kg"]);
}

#[test]
fn surfaces_without_bounds() {
    let place = Place::new();
    for field in ["noise(4*p)", "1 - length(p)", "p.z - noise(p)"] {
        let scene = with("field", &format!("field = \"{field}\""));
        check(&place, &scene).refused(2, &["scene.toml:12:", "bound"]);
    }
}

#[test]
fn files_that_are_not_there() {
    let place = Place::new();
    let ramp = |file: &str| {
        format!(
            "{GOOD}\n[[material.layer]]\nramp = {{ file = \"{file}\", low = \"0 m\", high = \"1 m\" }}\n"
        )
    };
    place.write("text.png", "a text");
    check(&place, &ramp("nowhere.png")).refused(2, &["scene.toml:21:", "nowhere.png"]);
    check(&place, &ramp("../../../etc/hostname")).refused(2, &["scene.toml:21:", "etc/hostname"]);
    check(&place, &ramp("/etc/hostname")).refused(2, &["scene.toml:21:", "/etc/hostname"]);
    check(&place, &ramp("text.png")).refused(2, &["scene.toml:21:", "text.png"]);
}

#[test]
fn scripts_that_mean_harm() {
    let place = Place::new();
    let hostile = [
        "loop { }",
        "let x = 0; loop { x += 1 } x",
        // 24 GiB in a moment, where only operations are counted.
        "let a = [0]; loop { a += a } 1",
        "let a = []; loop { a.push([0, 0, 0, 0]) } 1",
        "let s = \"x\"; loop { s += s } 1",
        "let m = #{}; let i = 0; loop { m[`k${i}`] = [0]; i += 1 } 1",
        "fn f(x) { f(x + 1) } f(0)",
        "let f = length(p); for i in 0..1000000000 { f += noise(i*p) } f",
        "let f = noise(p); loop { f = f*f } f",
        "eval(\"1\")",
        "import \"os\" as os; 1",
        "print(\"x\"); length(p) - 1",
    ];
    for script in hostile {
        let scene = with("field", &format!("field = '''{script}'''"));
        check(&place, &scene).refused(2, &["scene.toml:12:"]);
    }
    let deep = format!("{}p.x{}", "abs(".repeat(100_000), ")".repeat(100_000));
    check(&place, &with("field", &format!("field = '{deep}'"))).refused(2, &["scene.toml:12:"]);
}

#[test]
fn expressions_that_do_not_mean_what_they_say() {
    let place = Place::new();
    let bad: [(&str, &[&str]); 5] = [
        ("length(p) - 2^0", &["**"]),
        ("if p.x == 0 { 1 } else { length(p) - 1 }", &["select"]),
        ("length(p) - nois(p)", &["nois"]),
        ("length(p) - q", &["q"]),
        ("length(p) -", &["scene.toml:12:"]),
    ];
    for (field, phrases) in bad {
        check(&place, &with("field", &format!("field = \"{field}\""))).refused(2, phrases);
    }
}

#[test]
fn a_file_without_end() {
    let place = Place::new();
    check(&place, &"# a long comment\n".repeat(1 << 17))
        .refused(2, &["scene.toml", "larger than 1 MiB"]);
}
