//! Files of other versions: an earlier one is recalled, a later one is left alone.

use std::fs;
use std::path::Path;

use rusqlite::Connection;
use store::{Memory, Sqlite, Store as _, StoreError};

use crate::make;
use crate::sample::sampled;

#[test]
fn a_file_of_the_first_version_is_recalled_exactly() {
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/samples/v1.sqlite");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store.sqlite");
    fs::copy(sample, &path).unwrap();
    let mut store = Sqlite::open(&path).unwrap();
    store.check().unwrap();
    let mut memory = Memory::new();
    memory.commit(&sampled()).unwrap();
    assert_eq!(store.recall().unwrap(), memory.recall().unwrap());
}

#[test]
fn a_newer_file_is_refused_and_not_changed() {
    let folder = tempfile::tempdir().unwrap();
    let path = make(folder.path());
    let other = Connection::open(&path).unwrap();
    other.pragma_update(None, "user_version", 2).unwrap();
    other.close().unwrap();
    let before = fs::read(&path).unwrap();
    let refused = Sqlite::open(&path).unwrap_err();
    let found = matches!(
        refused,
        StoreError::TooNew {
            found: 2,
            known: 1,
            ..
        }
    );
    assert!(found, "{refused:?}");
    assert!(refused.to_string().contains("a later version"), "{refused}");
    assert_eq!(fs::read(&path).unwrap(), before);
}
