//! Tools that a machine may lack: the tests that use them are then skipped by name.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::net::{IpAddr, Ipv4Addr, UdpSocket};
use std::process::{Command, Stdio};

/// Whether the program `tool` is here; if not, the test that asks must return.
///
/// What is skipped is written to the file that `FLYBY_TESTS_SKIPPED` names, for `tests/run`
/// to say; with `CI=true` it fails the test instead.
#[must_use]
pub(crate) fn tool(tool: &str) -> bool {
    let found = Command::new("sh")
        .args(["-c", "command -v \"$1\"", "sh", tool])
        .stdout(Stdio::null())
        .status()
        .is_ok_and(|status| status.success());
    if !found {
        skip(tool, &format!("the program `{tool}` is not installed"));
    }
    found
}

/// Whether this user may mount a file system in a namespace of its own; if not, the test
/// that asks must return. Answers the start of a command that may mount.
#[must_use]
pub(crate) fn mounting() -> Option<&'static [&'static str]> {
    let ways: [&[&str]; 2] = [
        &["unshare", "--mount"],
        &["unshare", "--map-root-user", "--mount"],
    ];
    let may = |way: &&'static [&'static str]| {
        Command::new(way[0])
            .args(&way[1..])
            .args([
                "mount",
                "-t",
                "tmpfs",
                "-o",
                "size=64k",
                "flyby-test",
                "/mnt",
            ])
            .stderr(Stdio::null())
            .status()
            .is_ok_and(|status| status.success())
    };
    let way = ways.iter().find(|way| may(way)).copied();
    if way.is_none() {
        skip(
            "full disk",
            "this user may not mount a tmpfs (unshare --mount)",
        );
    }
    way
}

/// An address of this machine that is not loopback; where there is none, the test that asks must return.
#[must_use]
pub(crate) fn address() -> Option<IpAddr> {
    let own = || {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
        // Nothing is sent: the system only chooses a route.
        socket.connect(("203.0.113.1", 9)).ok()?;
        let ip = socket.local_addr().ok()?.ip();
        Some(ip).filter(|ip| !ip.is_loopback() && !ip.is_unspecified())
    };
    let found = own();
    if found.is_none() {
        leave_out(
            "other machines",
            "this machine has no address but loopback, so that nothing speaks TLS",
        );
    }
    found
}

/// Says that a test is skipped, since this machine lacks what it needs; the test must return. In CI that is a failure.
pub(crate) fn skip(name: &str, why: &str) {
    assert!(
        std::env::var("CI").as_deref() != Ok("true"),
        "in CI nothing may be skipped, but: {name}: {why}"
    );
    note("skipped", name, why);
}

/// Says that a test is left out, since machines of this kind cannot run it, whatever is installed; the test must return.
pub(crate) fn leave_out(name: &str, why: &str) {
    note("left out", name, why);
}

fn note(what: &str, name: &str, why: &str) {
    let line = format!("{what}: {name}: {why}\n");
    eprint!("{line}");
    if let Some(list) = std::env::var_os("FLYBY_TESTS_SKIPPED") {
        let mut list = OpenOptions::new()
            .create(true)
            .append(true)
            .open(list)
            .unwrap();
        // One write, so that tests that skip at the same time do not mix their lines.
        list.write_all(line.as_bytes()).unwrap();
    }
}
