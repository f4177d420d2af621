//! Rows into what is recalled.

use std::collections::BTreeMap;

use model::{Digest, FrameRange, ImageNumber, ImageRef, JobId, Rect, Revision, Span};
use rusqlite::{Connection, Row};
use sched::{Needs, Submission};

use super::values::{digest, int, nonsense, submission, tile_shape, uint};
use crate::{Recalled, RecalledBlock, RecalledImage, RecalledJob};

type Jobs = BTreeMap<JobId, RecalledJob>;

/// All but blocks.
pub(super) fn jobs(connection: &Connection) -> rusqlite::Result<Recalled> {
    let last_job = connection.query_row("SELECT last_job FROM farm", [], |row| uint(row, 0))?;
    let mut jobs = bare_jobs(connection)?;
    // Each of these tables is read in the order of its key.
    rows(
        connection,
        "SELECT job, label FROM labels ORDER BY job, label",
        |row| {
            let job = of(&mut jobs, row)?;
            job.submission.needs.labels.insert(row.get(1)?);
            Ok(())
        },
    )?;
    rows(
        connection,
        "SELECT job, waits_for FROM waits ORDER BY job, place",
        |row| {
            let after = JobId(uint(row, 1)?);
            of(&mut jobs, row)?.submission.after.push(after);
            Ok(())
        },
    )?;
    rows(
        connection,
        "SELECT job, image, state, unix_ms, film, blocks, render_us, about, reason
         FROM images ORDER BY job, image",
        |row| {
            let image = image(row)?;
            of(&mut jobs, row)?.images.push(image);
            Ok(())
        },
    )?;
    rows(
        connection,
        "SELECT job, unix_ms, text FROM log ORDER BY job, line",
        |row| {
            let line = (uint(row, 1)?, row.get(2)?);
            let job = of(&mut jobs, row)?;
            job.log.push(line);
            // So far it counts all lines there ever were.
            job.log_dropped = job.log_dropped.saturating_sub(1);
            Ok(())
        },
    )?;
    Ok(Recalled {
        last_job: JobId(last_job),
        jobs: jobs.into_values().collect(),
    })
}

/// The blocks, by image.
pub(super) fn blocks(
    connection: &Connection,
    mut image: impl FnMut(ImageRef, Vec<RecalledBlock>),
) -> rusqlite::Result<()> {
    let sql = "SELECT job, image, x0, y0, x1, y1, elapsed_us, pixels, about
         FROM blocks ORDER BY job, image, y0, x0, y1, x1";
    let mut is_known = connection.prepare("SELECT 1 FROM jobs WHERE job = ?1")?;
    let mut together: Option<(ImageRef, Vec<RecalledBlock>)> = None;
    rows(connection, sql, |row| {
        let (job, block) = (JobId(uint(row, 0)?), block(row)?);
        let next = ImageRef {
            job,
            image: block.image,
        };
        match &mut together {
            Some((same, blocks)) if *same == next => blocks.push(block),
            other => {
                if !is_known.exists([int(job.0)])? {
                    return Err(nonsense(0, format!("there is no job {job}").into()));
                }
                if let Some((last, blocks)) = other.replace((next, vec![block])) {
                    image(last, blocks);
                }
            }
        }
        Ok(())
    })?;
    if let Some((last, blocks)) = together {
        image(last, blocks);
    }
    Ok(())
}

fn rows(
    connection: &Connection,
    sql: &str,
    mut take: impl FnMut(&Row<'_>) -> rusqlite::Result<()>,
) -> rusqlite::Result<()> {
    let mut statement = connection.prepare(sql)?;
    let mut rows = statement.query([])?;
    while let Some(row) = rows.next()? {
        take(row)?;
    }
    Ok(())
}

/// The job that a row names first.
fn of<'a>(jobs: &'a mut Jobs, row: &Row<'_>) -> rusqlite::Result<&'a mut RecalledJob> {
    let job = JobId(uint(row, 0)?);
    let what = || nonsense(0, format!("there is no job {job}").into());
    jobs.get_mut(&job).ok_or_else(what)
}

fn bare_jobs(connection: &Connection) -> rusqlite::Result<Jobs> {
    let mut jobs = Jobs::new();
    let sql = "SELECT job, unix_ms, about, paused, focus_x0, focus_y0, focus_x1, focus_y1,
            cancelled_unix_ms, log_lines,
            submission, name, scene, revision, frames_start, frames_end, frames_step,
            x0, y0, x1, y1, tiles, tiles_a, tiles_b, priority, share, threads, memory_bytes,
            priority_now, share_now
         FROM jobs";
    rows(connection, sql, |row| {
        let job = JobId(uint(row, 0)?);
        let cancelled: Option<i64> = row.get(8)?;
        let focus: Option<u32> = row.get(4)?;
        let recalled = RecalledJob {
            job,
            unix_ms: uint(row, 1)?,
            submission: submission_of(row, 10)?,
            about: row.get(2)?,
            priority: row.get(28)?,
            share: row.get(29)?,
            paused: row.get(3)?,
            focus: focus.map(|_| rect(row, 4)).transpose()?,
            cancelled_unix_ms: cancelled.map(i64::cast_unsigned),
            images: Vec::new(),
            blocks: Vec::new(),
            log: Vec::new(),
            log_dropped: uint(row, 9)?,
        };
        jobs.insert(job, recalled);
        Ok(())
    })?;
    Ok(jobs)
}

fn submission_of(row: &Row<'_>, column: usize) -> rusqlite::Result<Submission> {
    let frames = FrameRange::new(
        row.get(column + 4)?,
        row.get(column + 5)?,
        row.get(column + 6)?,
    );
    Ok(Submission {
        submission: submission(row, column)?,
        name: row.get(column + 1)?,
        scene: digest(row, column + 2)?,
        revision: Revision(row.get(column + 3)?),
        frames: frames.map_err(|error| nonsense(column + 4, error.to_string().into()))?,
        window: rect(row, column + 7)?,
        tiles: tile_shape(row, column + 11)?,
        priority: row.get(column + 14)?,
        share: row.get(column + 15)?,
        needs: Needs {
            threads: row.get(column + 16)?,
            memory_bytes: uint(row, column + 17)?,
            ..Needs::default()
        },
        after: Vec::new(),
    })
}

fn image(row: &Row<'_>) -> rusqlite::Result<RecalledImage> {
    let image = ImageNumber(row.get(1)?);
    let unix_ms = uint(row, 3)?;
    match row.get_ref(2)?.as_str()? {
        "encoded" => Ok(RecalledImage::Encoded {
            image,
            unix_ms,
            film: digest(row, 4)?,
            blocks: row.get(5)?,
            render_time: Span(uint(row, 6)?),
            about: row.get(7)?,
        }),
        "failed" => Ok(RecalledImage::Failed {
            image,
            unix_ms,
            reason: row.get(8)?,
        }),
        other => {
            let why = format!("{other:?} is no state of an image").into();
            Err(nonsense(2, why))
        }
    }
}

fn block(row: &Row<'_>) -> rusqlite::Result<RecalledBlock> {
    Ok(RecalledBlock {
        image: ImageNumber(row.get(1)?),
        rect: rect(row, 2)?,
        elapsed: Span(uint(row, 6)?),
        pixels: Digest(row.get(7)?),
        about: row.get(8)?,
    })
}

/// Four columns from `column` on.
fn rect(row: &Row<'_>, column: usize) -> rusqlite::Result<Rect> {
    Ok(Rect {
        x0: row.get(column)?,
        y0: row.get(column + 1)?,
        x1: row.get(column + 2)?,
        y1: row.get(column + 3)?,
    })
}
