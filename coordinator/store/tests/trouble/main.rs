//! What a file may meet: a full disk, one that cannot be written, damage, another version, another program, and death.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod damaged;
mod foreign;
mod full_disk;
mod killed;
mod locked;
#[path = "../../../../tests/harness/need.rs"]
#[expect(dead_code, reason = "no test here needs a tool")]
mod need;
mod read_only;
#[path = "../sample/mod.rs"]
mod sample;
mod versions;

use std::path::{Path, PathBuf};
use std::process::Command;

use store::{Sqlite, Store as _};

/// A store with the sample's entries in it, closed.
fn make(folder: &Path) -> PathBuf {
    let path = folder.join("store.sqlite");
    let mut store = Sqlite::open(&path).unwrap();
    store.commit(&sample::sampled()).unwrap();
    path
}

/// What another process does with a store: see `other.rs`.
const OTHER: &str = env!("CARGO_BIN_EXE_store-other");

/// Another process, which does with a store what the verb says.
fn other(verb: &str, path: &Path) -> Command {
    let mut process = Command::new(OTHER);
    process.arg(verb).arg(path);
    process
}

/// Lets a process end that must fail; what it says.
fn refusal(mut process: Command) -> String {
    let ended = process.output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(!ended.status.success(), "it was not refused: {said}");
    said
}
