//! Numbers and names as the schema has them.

use std::error::Error;
use std::str::FromStr;

use model::{Digest, Span, SubmissionId};
use rusqlite::Row;
use rusqlite::types::Type;
use sched::TileShape;

/// SQLite's integers have a sign: numbers from 2^63 on become negative ones, and come back as they were.
pub(super) fn int(number: u64) -> i64 {
    number.cast_signed()
}

pub(super) fn uint(row: &Row<'_>, column: usize) -> rusqlite::Result<u64> {
    row.get(column).map(i64::cast_unsigned)
}

pub(super) fn hex(submission: SubmissionId) -> String {
    format!("{:032x}", submission.0)
}

pub(super) fn submission(row: &Row<'_>, column: usize) -> rusqlite::Result<SubmissionId> {
    let text = row.get_ref(column)?.as_str()?;
    match u128::from_str_radix(text, 16) {
        Ok(number) => Ok(SubmissionId(number)),
        Err(error) => Err(nonsense(column, Box::new(error))),
    }
}

pub(super) fn digest(row: &Row<'_>, column: usize) -> rusqlite::Result<Digest> {
    let text = row.get_ref(column)?.as_str()?;
    Digest::from_str(text).map_err(|error| nonsense(column, Box::new(error)))
}

/// The kind of a tile shape and its two numbers.
pub(super) fn tiles(shape: TileShape) -> (&'static str, Option<i64>, Option<i64>) {
    match shape {
        TileShape::Rule { min_tile_pixels } => ("rule", min_tile_pixels.map(int), None),
        TileShape::Size { width, height } => ("size", Some(width.into()), Some(height.into())),
        TileShape::Time { aim } => ("time", aim.map(|aim| int(aim.0)), None),
    }
}

/// Reads what [`tiles`] wrote, in three columns from `column` on.
pub(super) fn tile_shape(row: &Row<'_>, column: usize) -> rusqlite::Result<TileShape> {
    let number: Option<i64> = row.get(column + 1)?;
    let number = number.map(i64::cast_unsigned);
    match row.get_ref(column)?.as_str()? {
        "rule" => Ok(TileShape::Rule {
            min_tile_pixels: number,
        }),
        "size" => Ok(TileShape::Size {
            width: row.get(column + 1)?,
            height: row.get(column + 2)?,
        }),
        "time" => Ok(TileShape::Time {
            aim: number.map(Span),
        }),
        other => Err(nonsense(
            column,
            format!("{other:?} is no shape of tiles").into(),
        )),
    }
}

/// A value that was not written by this program.
pub(super) fn nonsense(column: usize, why: Box<dyn Error + Send + Sync>) -> rusqlite::Error {
    rusqlite::Error::FromSqlConversionFailure(column, Type::Text, why)
}
