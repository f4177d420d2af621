//! A process that is killed, and a machine that loses power: what was committed is there.

use std::fs::{self, File};
use std::io::{BufRead as _, BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::process::Stdio;

use store::{Sqlite, Store as _};

use crate::other;
use crate::sample::{GROUP, group, submitted};

#[test]
fn what_was_committed_outlives_kill_9() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("store.sqlite");
    let mut kept = 0;
    for round in 1..=12 {
        let mut child = other("commit", &path)
            .stdout(Stdio::piped())
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
