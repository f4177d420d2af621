//! Why something could not be kept or recalled, in sentences that say what to do.

use std::error::Error;
use std::path::PathBuf;

/// Why a store did not do what was asked. Nothing of what was asked is done.
#[derive(Debug, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "the path is that of the store, and each sentence says the rest"
)]
pub enum StoreError {
    /// There is no room.
    #[error(
        "the disk that holds {} is full: make room on it, and everything goes on by itself",
        path.display()
    )]
    Full { path: PathBuf },
    /// This user may not write there.
    #[error(
        "cannot write {}: the file and its folder must be writable for this user, on a disk that is not mounted read-only",
        path.display()
    )]
    ReadOnly { path: PathBuf },
    /// Somebody else has it.
    #[error(
        "another program has {} open: stop the other coordinator, or leave the tool that looks at it",
        path.display()
    )]
    Locked { path: PathBuf },
    /// What is there is not what was written.
    #[error(
        "{} is damaged ({what}): put a copy from before in its place, or move it away (with its -wal, if there is one) to begin without the jobs in it",
        path.display()
    )]
    Corrupt { path: PathBuf, what: String },
    /// It was never a store.
    #[error(
        "{} is a database of another program: give the coordinator a state folder of its own",
        path.display()
    )]
    Foreign { path: PathBuf },
    /// A later version of this program wrote it.
    #[error(
        "{} was written by a later version of this program (its schema is {found}, and {known} is the last one known here): start that version, or move the file away to begin without the jobs in it",
        path.display()
    )]
    TooNew {
        path: PathBuf,
        found: i64,
        known: i64,
    },
    /// The system refused.
    #[error("cannot read or write {}", path.display())]
    Io {
        path: PathBuf,
        #[source]
        source: Box<dyn Error + Send + Sync>,
    },
    /// A mistake in this program.
    #[error("{} does not understand this program; please report it", path.display())]
    Unexpected {
        path: PathBuf,
        #[source]
        source: Box<dyn Error + Send + Sync>,
    },
}

impl StoreError {
    /// Whether it may pass, so that the same is worth trying again after a while.
    pub fn is_transient(&self) -> bool {
        matches!(self, Self::Full { .. } | Self::Io { .. })
    }
}
