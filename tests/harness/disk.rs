//! A small disk for a folder, which can be filled.

use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write as _};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::{Place, Process, need, wait};

/// A folder of a place on a file system of its own, in memory.
///
/// A process holds it mounted where nobody else sees it, so that it outlives every coordinator and
/// goes with the test. Coordinators enter by [`SmallDisk::wrapper`]; for everybody else
/// the folder is a link through `/proc`.
pub(crate) struct SmallDisk {
    filler: PathBuf,
    wrapper: Vec<String>,
    _holder: Process,
}

impl SmallDisk {
    /// Mounts one of so much room in a folder's place; `None`, and said by name, where this user may not.
    #[must_use]
    pub(crate) fn mount(place: &Place, folder: &Path, size: &str) -> Option<Self> {
        const MOUNT: &str =
            "mount -t tmpfs -o size=\"$1\" flyby-test \"$2\" && echo mounted && exec cat";
        let way = need::mounting()?;
        if !need::tool("nsenter") {
            return None;
        }
        let disk = place.path("disk");
        fs::create_dir(&disk).unwrap();
        let mut command = Command::new(way[0]);
        command
            .args(&way[1..])
            .args(["sh", "-c", MOUNT, "sh", size])
            .arg(&disk);
        let mut holder = place.start_command("disk", command);
        wait::until("the disk is mounted", || {
            assert!(holder.ended().is_none(), "{}", holder.stderr());
            holder.stdout().contains("mounted").then_some(())
        });
        let holder_id = holder.id().to_string();
        let inside = PathBuf::from(format!("/proc/{holder_id}/root{}", disk.display()));
        symlink(&inside, folder).unwrap();
        let mut wrapper = vec!["nsenter", "--target", &holder_id, "--mount"];
        if way.contains(&"--map-root-user") {
            wrapper.extend(["--user", "--preserve-credentials"]);
        }
        wrapper.push("--");
        Some(Self {
            filler: inside.join("filler"),
            wrapper: wrapper.into_iter().map(str::to_owned).collect(),
            _holder: holder,
        })
    }

    /// The start of a command that sees the disk in the folder's place and wherever that leads.
    pub(crate) fn wrapper(&self) -> Vec<&str> {
        self.wrapper.iter().map(String::as_str).collect()
    }

    /// Takes all the room that is left.
    pub(crate) fn fill(&self) {
        let mut filler = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&self.filler)
            .unwrap();
        let full = loop {
            if let Err(why) = filler.write_all(&[0; 64 << 10]) {
                break why;
            }
        };
        assert_eq!(full.kind(), ErrorKind::StorageFull, "{full}");
    }

    /// Gives back what [`SmallDisk::fill`] took.
    pub(crate) fn empty(&self) {
        fs::remove_file(&self.filler).unwrap();
    }
}
