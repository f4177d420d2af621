//! What was never a store is refused, and left alone.

use std::fs;

use rusqlite::Connection;
use store::{Sqlite, StoreError};

#[test]
fn a_database_of_another_program_is_refused_and_not_changed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store.sqlite");
    let other = Connection::open(&path).unwrap();
    other.execute_batch("CREATE TABLE theirs (a)").unwrap();
    other.close().unwrap();
    let before = fs::read(&path).unwrap();
    let refused = Sqlite::open(&path).unwrap_err();
    assert!(matches!(refused, StoreError::Foreign { .. }), "{refused:?}");
    assert_eq!(fs::read(&path).unwrap(), before);
}

#[test]
fn what_is_no_store_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store.sqlite");
    for bytes in [&b""[..], b"x", &[0; 4_096], &[7; 100_000]] {
        fs::write(&path, bytes).unwrap();
        let refused = Sqlite::open(&path).unwrap_err();
        assert!(
            matches!(
                refused,
                StoreError::Corrupt { .. } | StoreError::Foreign { .. }
            ),
            "{refused:?}"
        );
        assert_eq!(
            fs::read(&path).unwrap(),
            bytes,
            "what was there is not touched"
        );
    }
}
