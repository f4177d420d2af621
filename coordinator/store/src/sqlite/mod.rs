//! A store in one SQLite file.
//!
//! Write-ahead log, synced at each commit (`synchronous = FULL`). The file is
//! locked for as long as it is open, so that no other program changes it. After each 1,000 pages
//! the log is copied back and begun anew; pages of what is deleted are used again, so
//! the file is as large as the most that was ever there at a time. `v1.sql` says what a row means.

mod open;
mod read;
mod schema;
mod values;
mod write;

use std::error::Error;
use std::path::{Path, PathBuf};

use model::ImageRef;
use rusqlite::{Connection, ErrorCode, TransactionBehavior};

use crate::{Entry, Recalled, RecalledBlock, Store, StoreError};

/// A store in a file.
#[derive(Debug)]
pub struct Sqlite {
    path: PathBuf,
    connection: Connection,
}

impl Sqlite {
    /// Opens the store at `path`, or makes an empty one where there is no file.
    ///
    /// An older schema is brought up to date. A newer one, a damaged file, one that another program
    /// has open and one that cannot be written are refused, and not changed. The folder must be there, on a disk of this machine.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        Ok(Self {
            connection: open::open(path)?,
            path: path.to_owned(),
        })
    }

    /// Looks at every page of the file. [`StoreError::Corrupt`] says what is wrong.
    pub fn check(&mut self) -> Result<(), StoreError> {
        let found: Result<String, _> =
            self.connection
                .query_row("PRAGMA integrity_check(1)", [], |row| row.get(0));
        match found.map_err(|error| explain(&self.path, error))? {
            ok if ok == "ok" => self.recall().map(drop),
            what => Err(corrupt(&self.path, what)),
        }
    }

    /// What is kept but for blocks, of which there may be a million: [`Sqlite::recall_blocks`] gives those.
    pub fn recall_jobs(&mut self) -> Result<Recalled, StoreError> {
        read::jobs(&self.connection).map_err(|error| explain(&self.path, error))
    }

    /// The durable blocks, image by image as they are read, in order; those of each image row by row from the top left.
    pub fn recall_blocks(
        &mut self,
        image: impl FnMut(ImageRef, Vec<RecalledBlock>),
    ) -> Result<(), StoreError> {
        read::blocks(&self.connection, image).map_err(|error| explain(&self.path, error))
    }
}

impl Store for Sqlite {
    fn commit(&mut self, entries: &[Entry]) -> Result<(), StoreError> {
        let path = &self.path;
        let behavior = TransactionBehavior::Immediate;
        let transaction = self.connection.transaction_with_behavior(behavior);
        let written = transaction.and_then(|transaction| {
            write::all(&transaction, entries)?;
            transaction.commit()
        });
        written.map_err(|error| explain(path, error))
    }

    fn recall(&mut self) -> Result<Recalled, StoreError> {
        let mut recalled = self.recall_jobs()?;
        self.recall_blocks(|image, blocks| {
            let place = recalled
                .jobs
                .binary_search_by_key(&image.job, |job| job.job);
            let job = place.ok().and_then(|place| recalled.jobs.get_mut(place));
            job.into_iter()
                .for_each(|job| job.blocks.extend_from_slice(&blocks));
        })?;
        Ok(recalled)
    }
}

/// What an error of SQLite means to whoever runs a farm.
fn explain(path: &Path, error: rusqlite::Error) -> StoreError {
    let path = path.to_owned();
    match error.sqlite_error_code() {
        Some(ErrorCode::DiskFull) => StoreError::Full { path },
        Some(ErrorCode::ReadOnly | ErrorCode::PermissionDenied) => StoreError::ReadOnly { path },
        Some(
            ErrorCode::DatabaseBusy
            | ErrorCode::DatabaseLocked
            | ErrorCode::FileLockingProtocolFailed,
        ) => StoreError::Locked { path },
        Some(ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase) => {
            let what = error.to_string();
            StoreError::Corrupt { path, what }
        }
        Some(ErrorCode::SystemIoFailure | ErrorCode::CannotOpen | ErrorCode::OutOfMemory) => {
            let source = error.into();
            StoreError::Io { path, source }
        }
        // A value that this program would not have written.
        None if is_about_a_value(&error) => {
            let what = match error.source() {
                Some(source) => format!("{error}: {source}"),
                None => error.to_string(),
            };
            StoreError::Corrupt { path, what }
        }
        _ => {
            let source = error.into();
            StoreError::Unexpected { path, source }
        }
    }
}

fn is_about_a_value(error: &rusqlite::Error) -> bool {
    use rusqlite::Error as E;
    matches!(
        error,
        E::FromSqlConversionFailure(..)
            | E::IntegralValueOutOfRange(..)
            | E::InvalidColumnType(..)
            | E::Utf8Error(..)
            | E::QueryReturnedNoRows
    )
}

fn corrupt(path: &Path, what: impl Into<String>) -> StoreError {
    StoreError::Corrupt {
        path: path.to_owned(),
        what: what.into(),
    }
}
