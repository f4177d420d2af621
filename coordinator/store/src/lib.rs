//! What outlives a coordinator: of all durable events, what still matters.
//!
//! A [`Store`] takes [`Entry`]s, many at a time, and makes all of them durable or none. It keeps
//! facts and no history: what an entry makes meaningless is gone, so that a store is bounded by the
//! jobs that are there. [`Recalled`] is what is kept, and [`Recalled::events`] what
//! a scheduler of a later epoch must be told.
//!
//! [`Sqlite`] keeps it in one file that the `sqlite3` tool opens, [`Memory`] for as long
//! as the process lives. Both are held against each other (`tests/conformance.rs`). A store blocks, and is
//! meant for a thread of its own. It never looks at a scene or a pixel, and what an `about` holds is its caller's business.

mod entry;
mod error;
mod events;
mod memory;
mod recalled;
mod sqlite;

pub use entry::Entry;
pub use error::StoreError;
pub use memory::Memory;
pub use recalled::{Recalled, RecalledBlock, RecalledImage, RecalledJob};
pub use sqlite::Sqlite;

/// Most lines of a job's log that are kept; the oldest give way, and are counted.
pub const LOG_LINES_MAX: usize = 1_000;

/// Where facts are kept.
pub trait Store: Send {
    /// Makes all of it durable before it returns, or nothing of it.
    ///
    /// After an error the same entries may be given again: where [`StoreError::is_transient`] says so, it is worth
    /// trying. After one of those a *crash* may still bring the entries to light, since a disk that
    /// failed to say that it holds them may hold them; telling entries twice does no harm.
    fn commit(&mut self, entries: &[Entry]) -> Result<(), StoreError>;

    /// What is kept. Costs time and memory by the blocks of all images that are not finished.
    fn recall(&mut self) -> Result<Recalled, StoreError>;
}
