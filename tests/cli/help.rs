//! Help, version, completions and manual pages.

use crate::place::Place;

const COMMANDS: [&str; 11] = [
    "demo",
    "render",
    "coordinator",
    "worker",
    "submit",
    "job",
    "scene",
    "image",
    "noise",
    "gallery",
    "bench",
];

#[test]
fn help_names_every_command_and_every_exit_code() {
    let place = Place::new();
    let (help, _) = place.ends(0, &["--help"]);
    for command in COMMANDS {
        assert!(help.contains(command), "{command}: {help}");
        let (page, _) = place.ends(0, &[command, "--help"]);
        assert!(
            page.contains("--output") && page.contains("--state"),
            "{page}"
        );
    }
    assert!(help.contains("Exit codes:"), "{help}");
    for code in [
        "  0  ", "  1  ", "  2  ", "  3  ", "  4  ", "  5  ", "130  ",
    ] {
        assert!(help.contains(code), "{code}: {help}");
    }
}

#[test]
fn the_version_is_the_package_s() {
    let (version, _) = Place::new().ends(0, &["--version"]);
    assert_eq!(version, format!("flyby {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn a_mistyped_command_or_option_is_a_usage_error_with_a_suggestion() {
    let place = Place::new();
    let (_, said) = place.ends(2, &["rendr"]);
    assert!(said.contains("render"), "{said}");
    let (_, said) = place.ends(2, &["render", "x.toml", "--thread", "2"]);
    assert!(said.contains("--threads"), "{said}");
    let (_, said) = place.ends(2, &["worker", "--threads", "0"]);
    assert!(said.contains("at least 1"), "{said}");
}

#[test]
fn completions_and_manual_pages() {
    let place = Place::new();
    for shell in ["bash", "zsh", "fish"] {
        let (script, _) = place.ends(0, &["completions", shell]);
        assert!(
            script.contains("flyby") && script.contains("coordinator"),
            "{shell}"
        );
    }
    place.ends(0, &["man", "pages"]);
    let page = std::fs::read_to_string(place.path("pages/flyby-render.1")).unwrap();
    assert!(page.contains("resolution"), "{page}");
}

#[test]
fn a_reader_that_leaves_is_no_error() {
    let place = Place::new();
    let script = format!(
        "{} scene schema | head -c 10; exit ${{PIPESTATUS[0]}}",
        env!("CARGO_BIN_EXE_flyby")
    );
    let output = std::process::Command::new("bash")
        .args(["-c", &script])
        .env("HOME", place.path("home"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(output.stderr.is_empty(), "{output:?}");
}
