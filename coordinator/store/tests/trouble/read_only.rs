//! A place that cannot be written.

use std::fs;
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::Command;

use store::{Sqlite, StoreError};

use crate::{OTHER, make, refusal};

#[test]
fn what_cannot_be_written_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = make(folder.path());
    let is_root = fs::metadata(folder.path()).unwrap().uid() == 0;
    // Root may write everywhere: it lets nobody try, with a copy of the program that nobody may read.
    let copy = folder.path().join("program");
    fs::copy(OTHER, &copy).unwrap();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
    let attempt = |path: &Path| {
        let mut process = Command::new(&copy);
        process.arg("open").arg(path);
        if is_root {
            process.uid(65_534).gid(65_534);
        }
        process
    };
    let inside = folder.path().join("inside");
    fs::create_dir(&inside).unwrap();
    let file = inside.join("store.sqlite");
    fs::copy(&path, &file).unwrap();

    let modes = |folder, of_file| {
        fs::set_permissions(&file, fs::Permissions::from_mode(of_file)).unwrap();
        fs::set_permissions(&inside, fs::Permissions::from_mode(folder)).unwrap();
    };
    modes(0o777, 0o444);
    let said = refusal(attempt(&file));
    assert!(said.contains("ReadOnly"), "the file: {said}");
    modes(0o555, 0o666);
    let said = refusal(attempt(&file));
    assert!(said.contains("ReadOnly"), "the folder: {said}");
    let said = refusal(attempt(&inside.join("none.sqlite")));
    assert!(said.contains("ReadOnly"), "a new file: {said}");
    modes(0o777, 0o666);
    let opened = attempt(&file).status().unwrap();
    assert!(opened.success(), "{opened}");
}

#[test]
fn a_folder_that_is_not_there_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let refused = Sqlite::open(&folder.path().join("none/store.sqlite")).unwrap_err();
    assert!(matches!(refused, StoreError::Io { .. }), "{refused:?}");
}
