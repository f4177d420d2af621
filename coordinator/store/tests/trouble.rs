//! What a file may meet: a full disk, one that cannot be written, damage, another version, another program, and death.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod sample;

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead as _, BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Stdio};

use model::{JobId, Rect, Span};
use rusqlite::Connection;
use sample::{block, digest, encoded, failed, image, line, submitted, wants};
use sched::Command;
use store::{Entry, Memory, Recalled, Sqlite, Store, StoreError};

/// Names the file that this program, started again by a test, works on.
const FILE: &str = "FLYBY_STORE_TEST_FILE";

/// What `tests/samples/v1.sqlite` holds.
fn sample_entries() -> Vec<Entry> {
    let mut entries = vec![submitted(1), submitted(2), submitted(3)];
    if let Entry::Submitted { submission, .. } = &mut entries[2] {
        submission.after = vec![JobId(2), JobId(1)];
    }
    entries.extend([
        encoded(1, 3),
        failed(1, 4),
        block(1, 5, 0),
        block(1, 5, 3),
        line(1, "image 3 is in its place"),
        wants(1, Command::Pause),
        wants(1, Command::Focus(Some(sample::rect(1)))),
        block(2, 3, 0),
        wants(2, Command::Cancel),
        submitted(9),
        Entry::Forgotten { job: JobId(9) },
    ]);
    entries
}

fn sample_recalled() -> Recalled {
    let mut memory = Memory::new();
    memory.commit(&sample_entries()).unwrap();
    memory.recall().unwrap()
}

/// A store with the sample's entries in it, closed.
fn make(folder: &Path) -> PathBuf {
    let path = folder.join("store.sqlite");
    Sqlite::open(&path)
        .unwrap()
        .commit(&sample_entries())
        .unwrap();
    path
}

#[test]
fn a_file_of_the_first_version_is_recalled_exactly() {
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/samples/v1.sqlite");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store.sqlite");
    fs::copy(sample, &path).unwrap();
    let mut store = Sqlite::open(&path).unwrap();
    store.check().unwrap();
    assert_eq!(store.recall().unwrap(), sample_recalled());
}

#[test]
#[ignore = "writes the sample of the newest schema, once per version"]
fn write_the_sample() {
    // Asked for by name, so that nobody who runs all tests writes one.
    if let Some(sample) = std::env::var_os(FILE) {
        let folder = tempfile::tempdir().unwrap();
        fs::copy(make(folder.path()), sample).unwrap();
    }
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
fn nobody_else_gets_in() {
    let folder = tempfile::tempdir().unwrap();
    let path = make(folder.path());
    let mut store = Sqlite::open(&path).unwrap();
    let refused = Sqlite::open(&path).unwrap_err();
    assert!(matches!(refused, StoreError::Locked { .. }), "{refused:?}");
    assert!(!refused.is_transient());
    // Neither another process.
    let said = again("opens_what_it_is_told", &path).output().unwrap();
    let said = String::from_utf8_lossy(&said.stderr).into_owned();
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

#[test]
#[ignore = "the part of other tests that another process plays"]
fn opens_what_it_is_told() {
    let Some(path) = std::env::var_os(FILE) else {
        return;
    };
    match Sqlite::open(Path::new(&path)) {
        Ok(mut store) => eprintln!("opened: {:?}", store.commit(&[submitted(4)])),
        Err(error) => eprintln!("refused: {error:?}"),
    }
}

/// This program once more, for one of its tests and a file.
fn again(test: &str, path: &Path) -> Process {
    let mut process = Process::new(std::env::current_exe().unwrap());
    process
        .args([test, "--exact", "--ignored", "--nocapture"])
        .env(FILE, path)
        .stdin(Stdio::null());
    process
}

#[test]
fn what_cannot_be_written_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = make(folder.path());
    let program = std::env::current_exe().unwrap();
    let is_root = fs::metadata(folder.path()).unwrap().uid() == 0;
    // Root may write everywhere: it lets nobody try, with a copy of this program that nobody may read.
    let copy = folder.path().join("program");
    fs::copy(program, &copy).unwrap();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
    let attempt = |path: &Path| {
        let mut process = Process::new(&copy);
        process
            .args([
                "opens_what_it_is_told",
                "--exact",
                "--ignored",
                "--nocapture",
            ])
            .env(FILE, path);
        if is_root {
            process.uid(65_534).gid(65_534);
        }
        let said = process.output().unwrap().stderr;
        String::from_utf8_lossy(&said).into_owned()
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
    let said = attempt(&file);
    assert!(said.contains("refused: ReadOnly"), "the file: {said}");
    modes(0o555, 0o666);
    let said = attempt(&file);
    assert!(said.contains("refused: ReadOnly"), "the folder: {said}");
    let said = attempt(&inside.join("none.sqlite"));
    assert!(said.contains("refused: ReadOnly"), "a new file: {said}");
    modes(0o777, 0o666);
    let said = attempt(&file);
    assert!(said.contains("opened: Ok"), "{said}");
}

#[test]
fn a_folder_that_is_not_there_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let refused = Sqlite::open(&folder.path().join("none/store.sqlite")).unwrap_err();
    assert!(matches!(refused, StoreError::Io { .. }), "{refused:?}");
}

#[test]
fn a_full_disk_refuses_whole_commits_and_goes_on_when_there_is_room() {
    let Some(way) = mounting() else {
        return;
    };
    let said = Process::new(way[0])
        .args(&way[1..])
        .args([
            "sh",
            "-c",
            "mount -t tmpfs -o size=1m flyby-test /mnt && exec \"$@\"",
            "sh",
        ])
        .arg(std::env::current_exe().unwrap())
        .args(["fills_the_disk", "--exact", "--ignored", "--nocapture"])
        .env(FILE, "/mnt/store.sqlite")
        .output()
        .unwrap();
    let (out, err) = (
        String::from_utf8_lossy(&said.stdout),
        String::from_utf8_lossy(&said.stderr),
    );
    assert!(said.status.success(), "{out}{err}");
    assert!(out.contains("filled and emptied"), "{out}{err}");
}

#[test]
#[ignore = "the part of another test that another process plays, on a disk of its own"]
fn fills_the_disk() {
    let Some(path) = std::env::var_os(FILE) else {
        return;
    };
    let path = PathBuf::from(path);
    let mut store = Sqlite::open(&path).unwrap();
    store.commit(&[submitted(1)]).unwrap();
    let ballast = path.with_extension("ballast");
    fs::write(&ballast, vec![1; 256 << 10]).unwrap();
    let mut kept = 0;
    let refused = loop {
        match store.commit(&group(kept)) {
            Ok(()) => kept += 1,
            Err(refused) => break refused,
        }
    };
    assert!(matches!(refused, StoreError::Full { .. }), "{refused:?}");
    assert!(refused.is_transient());
    // Refused again as long as it is full, and nothing of it is there.
    for _ in 0..3 {
        store.commit(&group(kept)).unwrap_err();
        assert_eq!(store.recall().unwrap().jobs[0].blocks.len(), kept * GROUP);
    }
    // What deletes needs room too; then there is some.
    fs::remove_file(&ballast).unwrap();
    store.commit(&group(kept)).unwrap();
    store.check().unwrap();
    drop(store);
    let mut store = Sqlite::open(&path).unwrap();
    assert_eq!(
        store.recall().unwrap().jobs[0].blocks.len(),
        (kept + 1) * GROUP
    );
    println!("filled and emptied");
}

/// Blocks in a commit of these tests.
const GROUP: usize = 50;

/// The `number`-th commit of blocks, all of them different.
fn group(number: usize) -> Vec<Entry> {
    (0..GROUP)
        .map(|index| {
            let column = u32::try_from(number * GROUP + index).unwrap();
            Entry::Block {
                image: image(1, 3),
                rect: Rect {
                    x0: column,
                    y0: 0,
                    x1: column + 1,
                    y1: 1,
                },
                elapsed: Span(1),
                pixels: digest(column),
                about: vec![0; 20],
            }
        })
        .collect()
}

/// Whether this user may mount a file system in a namespace of its own, and how; if not, the test is skipped by name.
fn mounting() -> Option<&'static [&'static str]> {
    let ways: [&[&str]; 2] = [
        &["unshare", "--mount"],
        &["unshare", "--map-root-user", "--mount"],
    ];
    let may = |way: &&&[&str]| {
        Process::new(way[0])
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
    let way = ways.iter().find(may).copied();
    if way.is_none() {
        let why = "full disk of the store: this user may not mount a tmpfs (unshare --mount)";
        assert!(
            std::env::var("CI").as_deref() != Ok("true"),
            "in CI nothing may be skipped, but: {why}"
        );
        eprintln!("skipped: {why}");
        if let Some(list) = std::env::var_os("FLYBY_TESTS_SKIPPED") {
            let mut list = OpenOptions::new()
                .create(true)
                .append(true)
                .open(list)
                .unwrap();
            list.write_all(format!("{why}\n").as_bytes()).unwrap();
        }
    }
    way
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

#[test]
fn the_file_does_not_grow_with_what_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store.sqlite");
    let mut store = Sqlite::open(&path).unwrap();
    let sizes: Vec<u64> = (0..12)
        .map(|_| {
            store.commit(&[submitted(1)]).unwrap();
            for number in 0..100 {
                store.commit(&group(number)).unwrap();
            }
            store.commit(&[encoded(1, 3)]).unwrap();
            store.commit(&[Entry::Forgotten { job: JobId(1) }]).unwrap();
            let log = fs::metadata(folder.path().join("store.sqlite-wal")).unwrap();
            fs::metadata(&path).unwrap().len() + log.len()
        })
        .collect();
    // Ever the same goes in and out; the log is begun anew after some 4 MiB.
    assert!(sizes[11] < 12 << 20, "{sizes:?}");
    assert!(sizes[11] <= sizes[5] + (1 << 20), "{sizes:?}");
}

#[test]
#[ignore = "the part of another test that another process plays until it is killed"]
fn commits_for_ever() {
    let Some(path) = std::env::var_os(FILE) else {
        return;
    };
    let mut store = Sqlite::open(Path::new(&path)).unwrap();
    store.commit(&[submitted(1)]).unwrap();
    let known = store.recall().unwrap().jobs[0].blocks.len() / GROUP;
    for number in known.. {
        store.commit(&group(number)).unwrap();
        println!("committed {}", number + 1);
    }
}

#[test]
fn what_was_committed_outlives_kill_9() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store.sqlite");
    let mut kept = 0;
    for round in 1..=12 {
        let mut child = again("commits_for_ever", &path)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut said = 0;
        let count = |line: &str| line.strip_prefix("committed ")?.parse::<usize>().ok();
        // After ever other numbers of commits, so that the log is copied back now and then.
        let enough = kept + 7 * round;
        while said < enough {
            let line = lines
                .next()
                .expect("it goes on until it is killed")
                .unwrap();
            said = count(&line).unwrap_or(said);
        }
        child.kill().unwrap();
        child.wait().unwrap();
        said = lines
            .map_while(Result::ok)
            .filter_map(|line| count(&line))
            .last()
            .unwrap_or(said);
        let mut store = Sqlite::open(&path).unwrap();
        store.check().unwrap();
        let blocks = store.recall().unwrap().jobs.remove(0).blocks;
        assert_eq!(blocks.len() % GROUP, 0, "whole commits");
        kept = blocks.len() / GROUP;
        // The last one may have been committed and not said.
        assert!(
            (said..=said + 1).contains(&kept),
            "{said} said, {kept} kept"
        );
    }
}

#[test]
fn a_torn_end_of_the_log_costs_that_commit_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store.sqlite");
    let mut store = Sqlite::open(&path).unwrap();
    store.commit(&[submitted(1)]).unwrap();
    store.commit(&group(0)).unwrap();
    let log = folder.path().join("store.sqlite-wal");
    let synced = fs::metadata(&log).unwrap().len();
    store.commit(&group(1)).unwrap();
    let after = folder.path().join("after.sqlite");
    let (mut bytes, whole) = (Vec::new(), fs::read(&path).unwrap());
    File::open(&log).unwrap().read_to_end(&mut bytes).unwrap();
    assert!(bytes.len() as u64 > synced);
    for lost in (0..bytes.len() - usize::try_from(synced).unwrap()).step_by(500) {
        fs::write(&after, &whole).unwrap();
        let mut torn = File::create(folder.path().join("after.sqlite-wal")).unwrap();
        torn.write_all(&bytes[..bytes.len() - lost]).unwrap();
        // A sector of what was not synced may be missing in the middle.
        torn.seek(SeekFrom::Start(synced + 100)).unwrap();
        if lost % 1_000 == 0 && lost > 0 {
            torn.write_all(&[0; 512]).unwrap();
        }
        drop(torn);
        let mut store = Sqlite::open(&after).unwrap();
        let kept = store.recall().unwrap().jobs[0].blocks.len();
        assert_eq!(
            kept,
            if lost == 0 { 2 * GROUP } else { GROUP },
            "{lost} bytes lost"
        );
    }
}
