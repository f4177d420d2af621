//! The other process of the tests beside it: it does one thing with one store.
//!
//! It fails with the store's answer where that is a refusal, and with a panic where the store breaks its word.

#![expect(clippy::print_stdout, reason = "a test reads what it says")]

#[path = "../sample/mod.rs"]
mod sample;

use std::error::Error;
use std::fs;
use std::path::Path;

use sample::{GROUP, group, sampled, submitted};
use store::{Sqlite, Store as _, StoreError};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [verb, path] = &arguments[..] else {
        return Err("usage: store-other open|fill|commit|sample FILE".into());
    };
    let path = Path::new(path);
    match verb.as_str() {
        "open" => Ok(open(path)?),
        "fill" => fill(path),
        "commit" => Ok(commit(path)?),
        "sample" => sample(path),
        _ => Err(format!("there is no {verb}").into()),
    }
}

/// Opens it, and commits something.
fn open(path: &Path) -> Result<(), StoreError> {
    Sqlite::open(path)?.commit(&[submitted(4)])
}

/// Commits until the disk is full, on a disk of its own, and goes on when there is room.
fn fill(path: &Path) -> Result<(), Box<dyn Error>> {
    let mut store = Sqlite::open(path)?;
    store.commit(&[submitted(1)])?;
    let ballast = path.with_extension("ballast");
    fs::write(&ballast, vec![1; 256 << 10])?;
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
        let refused = store.commit(&group(kept));
        assert!(refused.is_err(), "there is no room for another group");
        assert_eq!(blocks(&mut store)?, kept * GROUP);
    }
    // What deletes needs room too; then there is some.
    fs::remove_file(&ballast)?;
    store.commit(&group(kept))?;
    store.check()?;
    drop(store);
    assert_eq!(blocks(&mut Sqlite::open(path)?)?, (kept + 1) * GROUP);
    println!("filled and emptied");
    Ok(())
}

/// Commits until it is killed, and says so each time.
fn commit(path: &Path) -> Result<(), StoreError> {
    let mut store = Sqlite::open(path)?;
    store.commit(&[submitted(1)])?;
    let known = blocks(&mut store)? / GROUP;
    for number in known.. {
        store.commit(&group(number))?;
        println!("committed {}", number + 1);
    }
    Ok(())
}

/// Writes the sample of the newest schema, once per version.
fn sample(path: &Path) -> Result<(), Box<dyn Error>> {
    if path.exists() {
        return Err(format!("{} is there already", path.display()).into());
    }
    Ok(Sqlite::open(path)?.commit(&sampled())?)
}

/// How many blocks of the first job there are.
fn blocks(store: &mut Sqlite) -> Result<usize, StoreError> {
    Ok(store.recall()?.jobs[0].blocks.len())
}
