//! Whoever has it open keeps everybody else out.

use rusqlite::Connection;
use store::{Sqlite, Store as _, StoreError};

use crate::sample::block;
use crate::{make, other, refusal};

#[test]
fn nobody_else_gets_in() {
    let folder = tempfile::tempdir().unwrap();
    let path = make(folder.path());
    let mut store = Sqlite::open(&path).unwrap();
    let refused = Sqlite::open(&path).unwrap_err();
    assert!(matches!(refused, StoreError::Locked { .. }), "{refused:?}");
    assert!(!refused.is_transient());
    // Neither another process.
    let said = refusal(other("open", &path));
    assert!(said.contains("Locked"), "{said}");
    store.commit(&[block(1, 5, 1)]).unwrap();
    drop(store);
    Sqlite::open(&path).unwrap();
}

#[test]
fn a_reader_that_has_it_open_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = make(folder.path());
    let tool = Connection::open(&path).unwrap();
    tool.execute_batch("BEGIN; SELECT * FROM jobs;").unwrap();
    let refused = Sqlite::open(&path).unwrap_err();
    assert!(matches!(refused, StoreError::Locked { .. }), "{refused:?}");
    drop(tool);
    Sqlite::open(&path).unwrap();
}
