//! `flyby site` on real engines.

use serde_json::Value;

use crate::engine::{Engine, Kind};
use crate::harness::{Outcome, Place};

fn finding<'a>(site: &'a Value, part: &str) -> &'a Value {
    let findings = site["findings"].as_array().unwrap();
    let found = findings.iter().find(|finding| finding["part"] == part);
    found.unwrap_or_else(|| panic!("nothing of {part}: {site}"))
}

/// Checks the sites of a file; answers how each stands.
fn check(place: &Place, options: &[&str]) -> (Outcome, Vec<Value>) {
    let command = ["site", "check", "--sites", "sites.toml", "--output", "json"];
    let outcome = place.flyby(command.iter().chain(options));
    let said: Value = serde_json::from_str(&outcome.stdout).unwrap_or_else(|_| panic!("{outcome}"));
    let is_bad = said["verdict"] == "bad";
    assert_eq!(outcome.status.code(), Some(i32::from(is_bad)), "{outcome}");
    let sites = said["sites"].as_array().unwrap().clone();
    (outcome, sites)
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_host_is_checked_and_gets_the_program() {
    let Some(engine) = Engine::ssh() else {
        return;
    };
    let place = Place::new();
    let there = place.path("there");
    let site = engine.site(Kind::Ssh);
    let text = format!("[site.host]\n{site}folder = '{}'\n", there.display());
    place.write("sites.toml", &text);

    let (_, before) = check(&place, &[]);
    assert_eq!(finding(&before[0], "login")["verdict"], "fine");
    let program = finding(&before[0], "program");
    assert_eq!(program["verdict"], "bad");
    assert_eq!(program["next"], "`flyby site install host`");

    let install = ["site", "install", "host", "--sites", "sites.toml"];
    place.flyby(install).ok();
    let (_, after) = check(&place, &[]);
    assert_eq!(
        finding(&after[0], "program")["verdict"],
        "fine",
        "{after:?}"
    );
    assert_eq!(place.files("there/bin"), ["flyby"]);

    // What does not run there leaves the one that does.
    place.write(
        "broken",
        "#!/bin/sh\necho \"libc.so.6: version \\`GLIBC_2.99' not found\" >&2; exit 1\n",
    );
    let broken = place.flyby(install.iter().copied().chain(["--program", "broken"]));
    broken.refused(1, &["GLIBC_2.99", "x86_64-unknown-linux-musl"]);
    let (_, kept) = check(&place, &[]);
    assert_eq!(finding(&kept[0], "program")["verdict"], "fine", "{kept:?}");
    assert_eq!(place.files("there/bin"), ["flyby"]);

    // Nobody listens at the coordinator's address.
    let (_, deaf) = check(&place, &["--coordinator", "127.0.0.1:9"]);
    assert_eq!(deaf[0]["dials"], false);
    assert_eq!(deaf[0]["mode"], "poll");

    // A task on the host itself says the same.
    let (_, node) = check(&place, &["--node", "--coordinator", "127.0.0.1:9"]);
    assert_eq!(finding(&node[0], "node")["verdict"], "doubtful", "{node:?}");
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let (_, node) = check(&place, &["--node", "--coordinator", &address]);
    assert_eq!(finding(&node[0], "node")["verdict"], "fine", "{node:?}");
    assert_eq!(node[0]["mode"], "pilot");
    place
        .flyby(["site", "clean", "host", "--sites", "sites.toml"])
        .ok();
    assert_eq!(place.files("there"), ["bin/flyby"]);

    // A host key that is not the one that is known.
    let known = engine.folder.join("ssh/known_hosts");
    let keys = std::fs::read_to_string(&known).unwrap();
    let other = engine.folder.join("ssh/id.pub");
    let other = std::fs::read_to_string(other).unwrap();
    let other = other.split_whitespace().nth(1).unwrap().to_owned();
    let changed: Vec<String> = keys
        .lines()
        .map(|line| {
            let mut words = line.split(' ');
            format!(
                "{} {} {other}",
                words.next().unwrap(),
                words.next().unwrap()
            )
        })
        .collect();
    std::fs::write(&known, changed.join("\n") + "\n").unwrap();
    // A state folder of its own: connections that are open already are not checked again.
    let fresh = ["site", "check", "--sites", "sites.toml", "--state", "other"];
    let outcome = place.flyby(fresh);
    assert!(
        outcome.stdout.contains("does not trust the host key"),
        "{outcome}"
    );
    assert!(outcome.stdout.contains("ssh-keygen -R"), "{outcome}");
}
