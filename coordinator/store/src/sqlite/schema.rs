//! The versions of the schema. A file says its own in `user_version`.
//!
//! A version that was ever released stays as it is: what changes is another migration at the end,
//! and another file beside `tests/samples`.

use rusqlite_migration::{M, Migrations};

/// Each of these brings a file from the version before to the next one; the first makes it.
const MIGRATIONS: &[M<'static>] = &[M::up(include_str!("v1.sql"))];

/// The version that this program writes.
pub(super) const VERSION: i64 = MIGRATIONS.len() as i64;

/// What a file says of whose it is, in `application_id`: "Flyb".
pub(super) const APPLICATION: i64 = 0x466c_7962;

pub(super) fn migrations() -> Migrations<'static> {
    Migrations::from_slice(MIGRATIONS)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_migrations_are_right() {
        super::migrations().validate().unwrap();
    }
}
