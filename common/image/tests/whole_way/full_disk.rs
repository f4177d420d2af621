//! A disk that is really full: a small tmpfs in a mount namespace of its own, where the machine
//! lets us have one. The test runs itself once more in there.

use std::path::Path;
use std::process::Command;

use image::{Opened, Scratch};

use crate::film::{RESOLUTION, blocks, finished, identity, payload, write_all};

/// Says to the inner run where the tmpfs is.
const INSIDE: &str = "FLYBY_TEST_TMPFS";
const MOUNT: &str = r#"mount -t tmpfs -o size=1m none "$FLYBY_TEST_TMPFS" && exec "$@""#;

#[test]
fn a_full_disk_costs_the_block_that_did_not_fit() {
    if let Some(folder) = std::env::var_os(INSIDE) {
        return inside(Path::new(&folder));
    }
    let folder = tempfile::tempdir().unwrap();
    let in_namespace = |arguments: &[&str]| {
        Command::new("unshare")
            .args(["-rm", "sh", "-c", MOUNT, "sh"])
            .args(arguments)
            .env(INSIDE, folder.path())
            .output()
    };
    if !in_namespace(&["true"]).is_ok_and(|output| output.status.success()) {
        eprintln!("skipped a_full_disk_costs_the_block_that_did_not_fit: no mount namespaces here");
        return;
    }
    let this = std::env::current_exe().unwrap();
    let name = "full_disk::a_full_disk_costs_the_block_that_did_not_fit";
    let output = in_namespace(&[this.to_str().unwrap(), "--exact", name]).unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && said.contains("1 passed"),
        "{said}"
    );
}

fn inside(folder: &Path) {
    let ballast = folder.join("ballast");
    std::fs::write(&ballast, vec![1; 600 * 1024]).unwrap();
    let window = RESOLUTION.rect();
    let path = folder.join("scratch");
    let scratch = Scratch::create(&path, identity(), window).unwrap();
    let mut done = 0;
    let error = blocks(window, 40, 60)
        .into_iter()
        .find_map(|block| match scratch.write_block(block, &payload(block)) {
            Ok(()) => {
                done += block.area();
                None
            }
            Err(error) => Some(error),
        })
        .unwrap();
    assert!(error.is_disk_full(), "{error:?}");
    assert!(
        error.to_string().contains(path.to_str().unwrap()),
        "{error}"
    );
    assert!(done > 0 && scratch.pixels_done() == done);

    drop(scratch);
    let (scratch, opened) = Scratch::open_or_create(&path, identity(), window).unwrap();
    let resumed = Opened::Resumed {
        pixels_done: done,
        blocks_lost: 0,
    };
    assert_eq!(opened, resumed);
    std::fs::remove_file(&ballast).unwrap();
    write_all(&scratch, &scratch.remaining());
    let elsewhere = tempfile::tempdir_in("/tmp").unwrap();
    let expected = finished(elsewhere.path(), window).film_digest().unwrap();
    assert_eq!(scratch.film_digest().unwrap(), expected);
}
