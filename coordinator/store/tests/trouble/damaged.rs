//! A file that is not what was written: found, said, and never a panic.

use std::fs;
use std::path::{Path, PathBuf};

use store::{Sqlite, Store as _, StoreError};

use crate::make;
use crate::sample::group;

/// A larger store: several pages of each kind.
fn make_large(folder: &Path) -> PathBuf {
    let path = make(folder);
    let mut store = Sqlite::open(&path).unwrap();
    for number in 0..20 {
        store.commit(&group(number)).unwrap();
    }
    path
}

#[test]
fn a_file_that_is_gone_and_left_its_log_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store.sqlite");
    let store = Sqlite::open(&path).unwrap();
    let log = folder.path().join("store.sqlite-wal");
    fs::write(folder.path().join("copy"), b"something").unwrap();
    drop(store);
    fs::remove_file(&path).unwrap();
    fs::rename(folder.path().join("copy"), log).unwrap();
    let refused = Sqlite::open(&path).unwrap_err();
    assert!(matches!(refused, StoreError::Corrupt { .. }), "{refused:?}");
    assert!(!path.exists());
}

#[test]
fn a_file_that_is_cut_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = make_large(folder.path());
    let whole = fs::read(&path).unwrap();
    for part in 1..16 {
        let length = whole.len() * part / 16;
        fs::write(&path, &whole[..length]).unwrap();
        let refused = Sqlite::open(&path)
            .and_then(|mut store| store.recall())
            .unwrap_err();
        assert!(
            matches!(refused, StoreError::Corrupt { .. }),
            "{length}: {refused:?}"
        );
        assert!(refused.to_string().contains("is damaged"), "{refused}");
    }
}

#[test]
fn a_page_that_is_garbage_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = make_large(folder.path());
    let whole = fs::read(&path).unwrap();
    let mut silent = 0;
    for page in 0..whole.len() / 4_096 {
        let mut bytes = whole.clone();
        bytes[page * 4_096..(page + 1) * 4_096].fill(0xa5);
        fs::write(&path, &bytes).unwrap();
        let found = Sqlite::open(&path).and_then(|mut store| {
            store.check()?;
            store.recall()
        });
        match found {
            Err(StoreError::Corrupt { .. } | StoreError::Foreign { .. }) => {}
            Err(other) => panic!("page {page}: {other:?}"),
            // Nothing was on it.
            Ok(_) => silent += 1,
        }
    }
    assert_eq!(silent, 0);
}

#[test]
fn flipped_bits_are_an_answer_and_never_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = make(folder.path());
    let whole = fs::read(&path).unwrap();
    let mut found = 0;
    for at in (0..whole.len()).step_by(61) {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << (at % 8);
        fs::write(&path, &bytes).unwrap();
        if let Err(refused) = Sqlite::open(&path).and_then(|mut store| store.check()) {
            assert!(!refused.is_transient(), "byte {at}: {refused:?}");
            found += 1;
        }
        // Whatever it left beside the file belongs to these bytes.
        let _ = fs::remove_file(folder.path().join("store.sqlite-wal"));
    }
    assert!(found > 0);
}
