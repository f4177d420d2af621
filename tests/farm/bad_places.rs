//! Ports, addresses, folders and files that cannot be used: each has its sentence.

use std::fs::{self, Permissions};
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt as _;
use std::process::Command;

use crate::harness::scenes::{FLYBY, TINY, rendered};
use crate::harness::{Farm, Outcome, Place, free_address};

const USAGE: i32 = 2;
const FAILED: i32 = 1;
const UNREACHABLE: i32 = 3;

fn coordinator(place: &Place, listen: &str) -> Outcome {
    place.flyby(["coordinator", "--listen", listen])
}

#[test]
fn a_port_in_use() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    coordinator(&Place::new(), &address)
        .refused(FAILED, &[&address, "another program listens there"]);
}

#[test]
fn a_port_where_nobody_listens() {
    let farm = Farm::new(&[]);
    let nobody = free_address().to_string();
    let at_nobody = ["job", "list", "--coordinator", &nobody];
    farm.flyby(at_nobody)
        .refused(UNREACHABLE, &["no coordinator answers at", &nobody]);
}

#[test]
fn a_port_that_is_none() {
    for listen in ["127.0.0.1:70000", "127.0.0.1", "somewhere:1"] {
        coordinator(&Place::new(), listen).refused(USAGE, &["invalid value", listen]);
    }
}

#[test]
fn a_port_where_something_else_listens() {
    let farm = Farm::new(&[]);
    // It takes connections and closes them.
    let other = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = other.local_addr().unwrap().to_string();
    std::thread::spawn(move || other.incoming().take(100).for_each(drop));
    let at_other = ["job", "list", "--coordinator", &address];
    farm.flyby(at_other).refused(UNREACHABLE, &[]);
}

#[test]
fn an_address_of_another_machine() {
    coordinator(&Place::new(), "203.0.113.1:7359").refused(FAILED, &["203.0.113.1:7359"]);
}

#[test]
fn no_coordinator_at_all() {
    let place = Place::new();
    place
        .flyby(["job", "list"])
        .refused(UNREACHABLE, &["flyby coordinator"]);
    place
        .flyby(["submit", FLYBY])
        .refused(UNREACHABLE, &["flyby coordinator"]);
}

#[test]
fn a_state_folder_that_another_coordinator_holds() {
    let farm = Farm::new(&[]);
    let second = coordinator(&farm.place, "127.0.0.1:0");
    second.refused(FAILED, &["another coordinator runs over the state folder"]);
}

#[test]
fn a_file_where_the_state_folder_should_be() {
    let place = Place::new();
    place.write("state", "");
    coordinator(&place, "127.0.0.1:0").refused(FAILED, &["cannot make the folder", "state"]);
}

#[test]
fn a_token_that_others_can_read() {
    let place = Place::new();
    fs::create_dir(place.state()).unwrap();
    let token = place.write("state/token", "5a".repeat(32));
    fs::set_permissions(token, Permissions::from_mode(0o644)).unwrap();
    coordinator(&place, "127.0.0.1:0").refused(FAILED, &["mode 644", "chmod 600"]);
}

#[test]
fn a_token_of_another_coordinator() {
    let farm = Farm::new(&[]);
    let stranger = Place::new();
    fs::create_dir(stranger.state()).unwrap();
    stranger.write("state/token", "5a".repeat(32));
    let address = farm.address.to_string();
    for command in [["job", "list"], ["worker", "--threads=1"]] {
        let outcome = stranger.flyby(command.into_iter().chain(["--coordinator", &address]));
        outcome.refused(UNREACHABLE, &["the token is not this coordinator's"]);
    }
}

#[test]
fn a_file_where_the_frames_should_go() {
    let place = Place::new();
    place.write("out", "");
    place
        .flyby(["render", FLYBY, "--frames", "0", "--out", "out"])
        .refused(FAILED, &["out"]);
    place
        .flyby(["render", FLYBY, "--frames", "0", "--out", "out/deeper"])
        .refused(FAILED, &["out"]);
}

#[test]
fn a_folder_that_may_not_be_written() {
    let place = Place::new();
    // Even root may make nothing here.
    place
        .flyby(["render", FLYBY, "--frames", "0", "--out", "/proc/flyby"])
        .refused(FAILED, &["/proc/flyby"]);
}

#[test]
fn a_scene_that_is_not_there_or_no_file() {
    let place = Place::new();
    place
        .flyby(["scene", "check", "nowhere.toml"])
        .refused(FAILED, &["nowhere.toml", "No such file"]);
    place
        .flyby(["render", "nowhere.toml"])
        .refused(FAILED, &["nowhere.toml"]);
    let pipe = Command::new("mkfifo").arg(place.path("pipe")).status();
    assert!(pipe.unwrap().success());
    // Opening a pipe that nobody writes to would wait for ever.
    for none in [".", "pipe", "/dev/zero"] {
        let phrases = [none, "this is not an ordinary file"];
        place.flyby(["scene", "check", none]).refused(2, &phrases);
    }
}

#[test]
fn a_frame_that_is_damaged() {
    let place = Place::new();
    let image = [&TINY[..], &["--frames", "0"]].concat();
    rendered(&place, "out", &image);
    let good = place.path("out/flyby_0000.exr");
    let bytes = fs::read(&good).unwrap();
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2..bytes.len() / 2 + 64].fill(0x55);
    let bad = [
        ("cut.exr", bytes[..bytes.len() / 2].to_vec(), "is damaged"),
        ("flipped.exr", flipped, "is damaged"),
        ("empty.exr", Vec::new(), "neither EXR, PNG nor"),
        ("text.exr", b"a text".to_vec(), "neither EXR, PNG nor"),
    ];
    for (name, bytes, phrase) in bad {
        place.write(name, bytes);
        place
            .flyby(["image", "digest", name])
            .refused(FAILED, &[name, phrase]);
        place
            .flyby(["image", "info", name])
            .refused(FAILED, &[name]);
        place
            .flyby(["image", "compare", "out/flyby_0000.exr", name])
            .refused(FAILED, &[name]);
    }
    place
        .flyby(["image", "digest", "nowhere.exr"])
        .refused(FAILED, &["nowhere.exr"]);
}
