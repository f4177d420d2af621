//! Users on other machines, and mistakes of theirs.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt as _;

use crate::harness::scenes::{FLYBY, film_digests, small};
use crate::harness::{Farm, Place, need};

const USAGE: i32 = 2;
const UNREACHABLE: i32 = 3;

#[test]
fn a_user_elsewhere_submits_and_fetches() {
    let Some(address) = need::address() else {
        return;
    };
    let mut farm = Farm::reachable(address, &[]);
    farm.worker(&["--threads", "1"]);
    let token = farm.token("u.token", &["--role", "submit"]);
    let there = Place::new();
    let submit = [
        "--token-file",
        &token,
        "submit",
        FLYBY,
        "--watch",
        "--format",
        "exr",
        "--out",
        "out",
    ];
    let command = there.command(submit.into_iter().chain(small().with(&[])));
    there.run(command, crate::harness::wait::LIMIT).ok();
    assert_eq!(film_digests(&there, "out"), small().digests);
    // The environment's twin.
    let mut command = there.command(["job", "list", "--output", "quiet"]);
    command.env("FLYBY_TOKEN_FILE", &token);
    let list = there.run(command, crate::harness::wait::LIMIT).ok();
    assert_eq!(list.trim(), "1");
}

#[test]
fn what_is_wrong_with_a_token_is_said() {
    let Some(address) = need::address() else {
        return;
    };
    let farm = Farm::reachable(address, &[]);
    let there = Place::new();
    let list = |token: &str| there.flyby(["job", "list", "--token-file", token]);

    let open = farm.token("open.token", &["--role", "view"]);
    fs::set_permissions(&open, Permissions::from_mode(0o644)).unwrap();
    list(&open).refused(USAGE, &["mode 644", "chmod 600"]);
    fs::set_permissions(&open, Permissions::from_mode(0o600)).unwrap();
    list(&open).ok();
    let there_already = farm.flyby(["token", "create", "--out", &open]);
    there_already.refused(1, &["open.token", "exists"]);
    farm.flyby(["token", "revoke", "1"]).ok();
    list(&open).refused(UNREACHABLE, &["was revoked at", "token create"]);

    let cut = there.write("cut.token", "{\"flyby_token\":1");
    fs::set_permissions(&cut, Permissions::from_mode(0o600)).unwrap();
    list(cut.to_str().unwrap()).refused(USAGE, &["is no token file", "token create"]);
    list("nowhere.token").refused(USAGE, &["cannot read the token file nowhere.token"]);

    let small = farm.token("small.token", &["--role", "view"]);
    let cancel = ["job", "cancel", "1", "--token-file", &small];
    there
        .flyby(cancel)
        .refused(UNREACHABLE, &["`view`", "--role submit"]);
    let work = ["worker", "--token-file", &small];
    there
        .flyby(work)
        .refused(USAGE, &["role `view`", "--role worker"]);
    let join = farm.token("w.token", &[]);
    list(&join).refused(UNREACHABLE, &["`worker`", "--role view"]);

    let uses = ["token", "create", "--role", "view", "--uses", "2"];
    farm.flyby(uses)
        .refused(USAGE, &["only tokens for workers"]);
    farm.flyby(["token", "revoke", "77"])
        .refused(USAGE, &["there is no token 77"]);
}

#[test]
fn another_coordinators_authority_is_not_told_the_secret() {
    let Some(address) = need::address() else {
        return;
    };
    let (farm, other) = (Farm::reachable(address, &[]), Farm::reachable(address, &[]));
    let there = Place::new();
    for (name, role) in [("u.token", "view"), ("w.token", "worker")] {
        let token = farm.token(name, &["--role", role]);
        let address = other.outside().to_string();
        let command = match role {
            "worker" => ["worker", "--threads=1"],
            _ => ["job", "list"],
        };
        let wrong = ["--token-file", &token, "--coordinator", &address];
        let outcome = there.flyby(command.into_iter().chain(wrong));
        outcome.refused(UNREACHABLE, &["another authority", "token create"]);
    }
}

#[test]
fn an_address_of_another_machine_needs_a_token() {
    let place = Place::new();
    let list = place.flyby(["job", "list", "--coordinator", "203.0.113.1:7359"]);
    list.refused(USAGE, &["a token is needed", "--token-file"]);
}

#[test]
fn the_doctor_looks_at_certificates_and_their_keys() {
    let Some(address) = need::address() else {
        return;
    };
    let farm = Farm::reachable(address, &[]);
    let (user, token) = (
        farm.token("u.token", &["--role", "view"]),
        farm.token("w.token", &[]),
    );
    let there = Place::new();
    let worker = [
        "worker",
        "--while-input-open",
        "--threads",
        "1",
        "--token-file",
        &token,
    ];
    let _worker = there.start("worker", worker);
    farm.wait_connected(1);
    let look = |place: &Place, more: &[&str]| {
        let command = ["farm", "doctor", "--output", "json"].into_iter();
        let outcome = place.flyby(command.chain(more.iter().copied()));
        let said: serde_json::Value = serde_json::from_str(&outcome.stdout).unwrap();
        said
    };
    let verdict = |said: &serde_json::Value, part: &str| {
        let findings = said["findings"].as_array().unwrap();
        let found = findings.iter().find(|finding| finding["part"] == part);
        let found = found.unwrap_or_else(|| panic!("no {part}: {said}"));
        found["verdict"].as_str().unwrap().to_owned()
    };
    let abroad = ["--token-file", user.as_str()];
    let said = look(&there, &abroad);
    for part in ["token", "joined", "coordinator", "clock", "certificate"] {
        assert_eq!(verdict(&said, part), "fine", "{said}");
    }
    assert_eq!(verdict(&look(&farm.place, &[]), "authority"), "fine");
    let keys = there.files("state/joined");
    let key = keys.iter().find(|file| file.ends_with("key.pem")).unwrap();
    let key = there.state().join("joined").join(key);
    for open in [key, farm.place.state().join("authority.pem")] {
        fs::set_permissions(open, Permissions::from_mode(0o644)).unwrap();
    }
    assert_eq!(verdict(&look(&there, &abroad), "joined"), "bad");
    assert_eq!(verdict(&look(&farm.place, &[]), "authority"), "bad");
}
