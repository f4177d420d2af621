//! How a file is made, opened and held.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use rusqlite::{Connection, ErrorCode, OpenFlags};
use rusqlite_migration::Error as MigrationError;

use super::{corrupt, explain, schema};
use crate::StoreError;

/// Statements that are kept ready; more than there are.
const STATEMENTS: usize = 64;

/// Pages of the log after which it is copied back, and the bytes to which its file is cut
/// after a commit that was larger.
const LOG: &str = "PRAGMA wal_autocheckpoint = 1000; PRAGMA journal_size_limit = 16777216;";

pub(super) fn open(path: &Path) -> Result<Connection, StoreError> {
    // Not opened to be looked at: closing a file ends the locks that this process has on it.
    match fs::metadata(path) {
        Ok(file) if file.len() == 0 => return Err(corrupt(path, "it is empty")),
        Ok(_) => {}
        Err(error) if error.kind() == ErrorKind::NotFound => create(path)?,
        Err(error) => return Err(refused(path, error)),
    }
    hold(path)
}

/// Makes an empty store under another name, and puts it in its place when it is whole: a
/// file that is there is never half made.
fn create(path: &Path) -> Result<(), StoreError> {
    let log = beside(path, "-wal");
    if fs::metadata(&log).is_ok_and(|log| log.len() > 0) {
        let what = format!("it is gone, but its log {} is there", log.display());
        return Err(corrupt(path, what));
    }
    let fresh = beside(path, ".new");
    let make = || {
        for left in [beside(&fresh, "-journal"), fresh.clone()] {
            match fs::remove_file(left) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&fresh)
            .map(drop)
    };
    make().map_err(|error| refused(path, error))?;

    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let mut connection =
        Connection::open_with_flags(&fresh, flags).map_err(|error| explain(path, error))?;
    connection
        .pragma_update(None, "application_id", schema::APPLICATION)
        .map_err(|error| explain(path, error))?;
    migrate(path, &mut connection)?;
    connection
        .close()
        .map_err(|(_, error)| explain(path, error))?;

    let place = || {
        File::open(&fresh)?.sync_all()?;
        fs::rename(&fresh, path)?;
        File::open(folder(path))?.sync_all()
    };
    place().map_err(|error| refused(path, error))
}

/// Opens a file that is there, and keeps everybody else out.
fn hold(path: &Path) -> Result<Connection, StoreError> {
    let explain = |error| explain(path, error);
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let mut connection = Connection::open_with_flags(path, flags).map_err(explain)?;
    // SQLite opens for reading what it may not write, and then fails to lock it.
    if connection.is_readonly("main").map_err(explain)? {
        let path = path.to_owned();
        return Err(StoreError::ReadOnly { path });
    }
    connection.set_prepared_statement_cache_capacity(STATEMENTS);
    // Whoever has it open will not be done soon: it is another coordinator.
    connection
        .busy_timeout(std::time::Duration::ZERO)
        .map_err(explain)?;
    connection
        .execute_batch("PRAGMA locking_mode = EXCLUSIVE; PRAGMA cell_size_check = ON;")
        .map_err(explain)?;

    if number(&connection, "application_id").map_err(|error| opening(path, error))?
        != schema::APPLICATION
    {
        let path = path.to_owned();
        return Err(StoreError::Foreign { path });
    }
    let found = number(&connection, "user_version").map_err(explain)?;
    if found > schema::VERSION {
        let (path, known) = (path.to_owned(), schema::VERSION);
        return Err(StoreError::TooNew { path, found, known });
    }
    let mode: String = connection
        .query_row("PRAGMA journal_mode = WAL", [], |row| row.get(0))
        .map_err(|error| opening(path, error))?;
    if mode != "wal" {
        let source = format!("the journal is {mode}, and cannot be made a log").into();
        let path = path.to_owned();
        return Err(StoreError::Unexpected { path, source });
    }
    connection
        .execute_batch(
            "PRAGMA synchronous = FULL; PRAGMA fullfsync = ON; PRAGMA temp_store = MEMORY;
             PRAGMA cache_size = -16384; PRAGMA trusted_schema = OFF;",
        )
        .and_then(|()| connection.execute_batch(LOG))
        // Takes the lock, which is kept from here on.
        .and_then(|()| connection.execute_batch("BEGIN EXCLUSIVE; COMMIT;"))
        .map_err(|error| opening(path, error))?;
    migrate(path, &mut connection)?;
    Ok(connection)
}

fn migrate(path: &Path, connection: &mut Connection) -> Result<(), StoreError> {
    let migrated = schema::migrations().to_latest(connection);
    migrated.map_err(|error| match error {
        MigrationError::RusqliteError { err, .. } => explain(path, err),
        other => StoreError::Unexpected {
            path: path.to_owned(),
            source: other.into(),
        },
    })
}

fn number(connection: &Connection, pragma: &str) -> rusqlite::Result<i64> {
    connection.pragma_query_value(None, pragma, |row| row.get(0))
}

/// Where SQLite says no more than that it cannot open something, the folder is asked why.
fn opening(path: &Path, error: rusqlite::Error) -> StoreError {
    if error.sqlite_error_code() == Some(ErrorCode::CannotOpen) {
        let probe = beside(path, ".probe");
        let made = File::create(&probe);
        let _ = fs::remove_file(&probe);
        if let Err(why) = made {
            return refused(path, why);
        }
    }
    explain(path, error)
}

/// What an error of the system means to whoever runs a farm.
fn refused(path: &Path, error: io::Error) -> StoreError {
    let path = path.to_owned();
    match error.kind() {
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            StoreError::ReadOnly { path }
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => StoreError::Full { path },
        _ => StoreError::Io {
            path,
            source: error.into(),
        },
    }
}

fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(ending);
    name.into()
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
