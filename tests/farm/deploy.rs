//! The files of `deploy/` that start the program by themselves give it words that it knows.

use std::path::Path;

use crate::harness::Place;

const DEPLOY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy");

fn read(path: &str) -> String {
    std::fs::read_to_string(Path::new(DEPLOY).join(path)).unwrap()
}

/// A command with `--help` behind it is understood up to there, or refused with what is wrong.
#[track_caller]
fn is_understood(words: &[String]) {
    Place::new()
        .flyby(words.iter().map(String::as_str).chain(["--help"]))
        .ok();
}

#[test]
fn units_start_what_is_there() {
    for unit in ["flyby-coordinator.service", "flyby-worker.service"] {
        let text = read(&format!("systemd/{unit}"));
        let line = text
            .lines()
            .find_map(|line| line.strip_prefix("ExecStart=/usr/local/bin/flyby "));
        let words = line.unwrap().split_whitespace().map(str::to_owned);
        is_understood(&words.collect::<Vec<_>>());
    }
}

#[test]
fn containers_start_what_is_there() {
    for manifest in ["coordinator.yaml", "workers.yaml", "worker-job.yaml"] {
        let text = read(&format!("kubernetes/{manifest}"));
        // Lists are written as JSON has them.
        let list = text
            .lines()
            .find_map(|line| line.trim().strip_prefix("args: "));
        let words: Vec<String> = serde_json::from_str(list.unwrap()).unwrap();
        is_understood(&words);
        assert!(!text.contains('\t'), "{manifest}: YAML has no tabs");
    }
}

#[test]
#[should_panic(expected = "--no-such-option")]
fn a_word_that_is_not_known_would_be_seen() {
    is_understood(&["worker".into(), "--no-such-option".into()]);
}
