//! A disk without room, and a file that does not take all of it.

use std::fs;
use std::process::Command;

use model::JobId;
use store::{Entry, Sqlite, Store as _};

use crate::sample::{encoded, group, submitted};
use crate::{OTHER, need};

#[test]
fn a_full_disk_refuses_whole_commits_and_goes_on_when_there_is_room() {
    let Some(way) = need::mounting() else {
        return;
    };
    let said = Command::new(way[0])
        .args(&way[1..])
        .args([
            "sh",
            "-c",
            "mount -t tmpfs -o size=1m flyby-test /mnt && exec \"$@\"",
            "sh",
        ])
        .args([OTHER, "fill", "/mnt/store.sqlite"])
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
