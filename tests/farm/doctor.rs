//! How a farm stands, and what is wrong with it.

use std::os::unix::fs::PermissionsExt as _;

use serde_json::Value;

use crate::harness::scenes::{FLYBY, TINY};
use crate::harness::{Farm, Place};

/// What the doctor says of each part, and whether the exit code fits it.
fn look(place: &Place) -> Value {
    let outcome = place.flyby(["farm", "doctor", "--output", "json"]);
    let said: Value = serde_json::from_str(&outcome.stdout).unwrap_or_else(|_| panic!("{outcome}"));
    assert_eq!(
        outcome.status.code() == Some(1),
        said["verdict"] == "bad",
        "{outcome}"
    );
    said
}

fn finding<'a>(said: &'a Value, part: &str) -> &'a Value {
    let findings = said["findings"].as_array().unwrap();
    let mut found = findings.iter().filter(|finding| finding["part"] == part);
    found
        .next()
        .unwrap_or_else(|| panic!("nothing of {part}: {said}"))
}

#[test]
fn a_farm_that_is_well_is_said_to_be() {
    let farm = Farm::of_workers(1);
    farm.wait_connected(1);
    let said = look(&farm.place);
    for part in [
        "state",
        "token",
        "store",
        "coordinator",
        "versions",
        "clock",
        "workers",
        "pixels",
    ] {
        assert_eq!(finding(&said, part)["verdict"], "fine", "{said}");
    }
    let status = farm.flyby(["farm", "status", "--output", "json"]).json();
    assert_eq!(status["workers_connected"], 1);
    assert_eq!(status["threads"], 1);
    assert!(status["disk_free_bytes"].as_u64().unwrap() > 0);
}

#[test]
fn what_is_wrong_is_named_with_what_to_do() {
    let mut farm = Farm::of_workers(0);
    farm.submit(&[&[FLYBY, "--frames", "0"], &TINY[..]].concat());
    let said = look(&farm.place);
    let workers = finding(&said, "workers");
    assert_eq!(workers["verdict"], "bad");
    assert!(
        workers["next"].as_str().unwrap().contains("flyby worker"),
        "{said}"
    );

    farm.coordinator.kill();
    let said = look(&farm.place);
    let coordinator = finding(&said, "coordinator");
    assert_eq!(coordinator["verdict"], "bad");
    assert!(
        coordinator["next"].as_str().unwrap().contains("start"),
        "{said}"
    );
    let store = finding(&said, "store");
    assert!(store["found"].as_str().unwrap().contains("whole"), "{said}");

    let state = farm.place.state();
    std::fs::set_permissions(state.join("token"), std::fs::Permissions::from_mode(0o644)).unwrap();
    let store = state.join("farm.sqlite");
    let mut bytes = std::fs::read(&store).unwrap();
    let half = bytes.len() / 2;
    bytes[half..].fill(0x5a);
    std::fs::write(&store, bytes).unwrap();
    let said = look(&farm.place);
    assert!(
        finding(&said, "token")["next"]
            .as_str()
            .unwrap()
            .contains("chmod 600"),
        "{said}"
    );
    assert_eq!(finding(&said, "store")["verdict"], "bad", "{said}");
}
