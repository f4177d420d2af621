//! Entries into rows.

use model::{ImageRef, JobId, Rect};
use rusqlite::{Connection, Params, params};
use sched::{Command, Submission};

use super::values::{hex, int, tiles};
use crate::{Entry, LOG_LINES_MAX};

/// Writes all of them, in order.
pub(super) fn all(connection: &Connection, entries: &[Entry]) -> rusqlite::Result<()> {
    let mut writer = Writer {
        connection,
        wanted: None,
    };
    entries.iter().try_for_each(|entry| writer.write(entry))
}

struct Writer<'a> {
    connection: &'a Connection,
    /// Whether blocks of an image are wanted, for the image that was asked about last: blocks
    /// come in runs of one image.
    wanted: Option<(ImageRef, bool)>,
}

impl Writer<'_> {
    fn write(&mut self, entry: &Entry) -> rusqlite::Result<()> {
        if !matches!(entry, Entry::Block { .. }) {
            self.wanted = None;
        }
        match entry {
            Entry::Submitted {
                job,
                unix_ms,
                submission,
                about,
            } => self.submitted(*job, *unix_ms, submission, about),
            Entry::Block {
                image,
                rect,
                elapsed,
                pixels,
                about,
            } => {
                if !self.is_wanted(*image)? {
                    return Ok(());
                }
                self.run(
                    "INSERT INTO blocks VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)
                     ON CONFLICT DO NOTHING",
                    params![
                        int(image.job.0),
                        image.image.0,
                        rect.y0,
                        rect.x0,
                        rect.y1,
                        rect.x1,
                        int(elapsed.0),
                        pixels.0,
                        about,
                    ],
                )
            }
            Entry::BlocksLost { image, rects } => {
                rects.iter().try_for_each(|rect| self.lost(*image, *rect))
            }
            Entry::ImageEncoded {
                image,
                unix_ms,
                film,
                blocks,
                render_time,
                about,
            } => {
                self.run(
                    "INSERT INTO images
                     SELECT ?1, ?2, 'encoded', ?3, ?4, ?5, ?6, ?7, NULL FROM jobs WHERE job = ?1
                     ON CONFLICT DO NOTHING",
                    params![
                        int(image.job.0),
                        image.image.0,
                        int(*unix_ms),
                        film.to_string(),
                        blocks,
                        int(render_time.0),
                        about,
                    ],
                )?;
                self.drop_blocks(*image)?;
                self.wait_no_more(image.job)
            }
            Entry::ImageFailed {
                image,
                unix_ms,
                reason,
            } => {
                self.run(
                    "INSERT INTO images
                     SELECT ?1, ?2, 'failed', ?3, NULL, NULL, NULL, NULL, ?4 FROM jobs WHERE job = ?1
                     ON CONFLICT DO NOTHING",
                    params![int(image.job.0), image.image.0, int(*unix_ms), reason],
                )?;
                self.drop_blocks(*image)
            }
            Entry::Command {
                job,
                unix_ms,
                command,
            } => self.command(*job, *unix_ms, *command),
            Entry::Forgotten { job } => self.forget(*job),
            Entry::Line { job, unix_ms, text } => self.line(*job, *unix_ms, text),
        }
    }

    fn submitted(
        &self,
        job: JobId,
        unix_ms: u64,
        submission: &Submission,
        about: &str,
    ) -> rusqlite::Result<()> {
        let job = int(job.0);
        self.run("UPDATE farm SET last_job = max(last_job, ?1)", [job])?;
        let (frames, window) = (submission.frames, submission.window);
        let (shape, a, b) = tiles(submission.tiles);
        let sql = "INSERT INTO jobs (job, unix_ms, submission, name, scene, revision,
                frames_start, frames_end, frames_step, x0, y0, x1, y1, tiles, tiles_a, tiles_b,
                priority, share, priority_now, share_now, threads, memory_bytes, about)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16,
                ?17, ?18, ?17, ?18, ?19, ?20, ?21)
             ON CONFLICT DO NOTHING";
        let new = self.connection.prepare_cached(sql)?.execute(params![
            job,
            int(unix_ms),
            hex(submission.submission),
            submission.name,
            submission.scene.to_string(),
            submission.revision.0,
            frames.start(),
            frames.end(),
            frames.step(),
            window.x0,
            window.y0,
            window.x1,
            window.y1,
            shape,
            a,
            b,
            submission.priority,
            submission.share,
            submission.needs.threads,
            int(submission.needs.memory_bytes),
            about,
        ])?;
        if new == 0 {
            return Ok(());
        }
        for label in &submission.needs.labels {
            self.run("INSERT INTO labels VALUES (?1, ?2)", params![job, label])?;
        }
        for (place, after) in submission.after.iter().enumerate() {
            if self.is_finished(*after)? {
                continue;
            }
            self.run(
                "INSERT INTO waits VALUES (?1, ?2, ?3)",
                params![job, int(place as u64), int(after.0)],
            )?;
        }
        Ok(())
    }

    fn is_wanted(&mut self, image: ImageRef) -> rusqlite::Result<bool> {
        if let Some((_, wanted)) = self.wanted.filter(|(asked, _)| *asked == image) {
            return Ok(wanted);
        }
        let sql = "SELECT 1 FROM jobs WHERE job = ?1 AND cancelled_unix_ms IS NULL
                 AND NOT EXISTS (SELECT 1 FROM images WHERE job = ?1 AND image = ?2)";
        let wanted = self.exists(sql, params![int(image.job.0), image.image.0])?;
        self.wanted = Some((image, wanted));
        Ok(wanted)
    }

    fn lost(&self, image: ImageRef, rect: Rect) -> rusqlite::Result<()> {
        self.run(
            "DELETE FROM blocks WHERE job = ?1 AND image = ?2 AND y0 = ?3 AND x0 = ?4
                 AND y1 = ?5 AND x1 = ?6",
            params![
                int(image.job.0),
                image.image.0,
                rect.y0,
                rect.x0,
                rect.y1,
                rect.x1,
            ],
        )
    }

    /// Nobody waits any more for a job that is finished.
    fn wait_no_more(&self, job: JobId) -> rusqlite::Result<()> {
        let id = int(job.0);
        // Asked first, since few jobs are waited for, and a job may have very many images.
        let is_waited_for = self.exists("SELECT 1 FROM waits WHERE waits_for = ?1", [id])?;
        if is_waited_for && self.is_finished(job)? {
            self.run("DELETE FROM waits WHERE waits_for = ?1", [id])?;
        }
        Ok(())
    }

    /// Whether every image of a job is in its place.
    fn is_finished(&self, job: JobId) -> rusqlite::Result<bool> {
        let sql = "SELECT 1 FROM jobs WHERE job = ?1
                 AND (SELECT count(*) FROM images WHERE job = ?1 AND state = 'encoded')
                     >= (frames_end - frames_start + frames_step - 1) / frames_step";
        self.exists(sql, [int(job.0)])
    }

    fn drop_blocks(&self, image: ImageRef) -> rusqlite::Result<()> {
        self.run(
            "DELETE FROM blocks WHERE job = ?1 AND image = ?2",
            params![int(image.job.0), image.image.0],
        )
    }

    fn command(&self, job: JobId, unix_ms: u64, command: Command) -> rusqlite::Result<()> {
        let id = int(job.0);
        // One that was cancelled can only be removed.
        let open = "SELECT 1 FROM jobs WHERE job = ?1 AND cancelled_unix_ms IS NULL";
        if command != Command::Remove && !self.exists(open, [id])? {
            return Ok(());
        }
        match command {
            Command::Pause => self.run("UPDATE jobs SET paused = 1 WHERE job = ?1", [id]),
            Command::Resume => self.run("UPDATE jobs SET paused = 0 WHERE job = ?1", [id]),
            Command::Cancel => {
                self.run(
                    "UPDATE jobs SET cancelled_unix_ms = ?2 WHERE job = ?1
                         AND (SELECT count(*) FROM images WHERE images.job = ?1)
                             < (frames_end - frames_start + frames_step - 1) / frames_step",
                    [id, int(unix_ms)],
                )?;
                // Where every image is over there are none.
                self.run("DELETE FROM blocks WHERE job = ?1", [id])
            }
            Command::Retry => self.run(
                "DELETE FROM images WHERE job = ?1 AND state = 'failed'",
                [id],
            ),
            Command::Again(image) => {
                self.run(
                    "DELETE FROM images WHERE job = ?1 AND image = ?2",
                    params![id, image.0],
                )?;
                self.drop_blocks(ImageRef { job, image })
            }
            Command::Priority(priority) => self.run(
                "UPDATE jobs SET priority_now = ?2 WHERE job = ?1",
                params![id, priority],
            ),
            Command::Share(share) => self.run(
                "UPDATE jobs SET share_now = ?2 WHERE job = ?1",
                params![id, share],
            ),
            Command::Focus(focus) => self.run(
                "UPDATE jobs SET focus_x0 = ?2, focus_y0 = ?3, focus_x1 = ?4, focus_y1 = ?5
                 WHERE job = ?1",
                params![
                    id,
                    focus.map(|focus| focus.x0),
                    focus.map(|focus| focus.y0),
                    focus.map(|focus| focus.x1),
                    focus.map(|focus| focus.y1),
                ],
            ),
            Command::Remove => self.forget(job),
        }
    }

    fn forget(&self, job: JobId) -> rusqlite::Result<()> {
        let tables = ["blocks", "images", "log", "waits", "labels", "jobs"];
        tables.into_iter().try_for_each(|table| {
            let sql = format!("DELETE FROM {table} WHERE job = ?1");
            self.run(&sql, [int(job.0)])
        })
    }

    fn line(&self, job: JobId, unix_ms: u64, text: &str) -> rusqlite::Result<()> {
        let job = int(job.0);
        self.run(
            "UPDATE jobs SET log_lines = log_lines + 1 WHERE job = ?1",
            [job],
        )?;
        self.run(
            "INSERT INTO log SELECT job, log_lines, ?2, ?3 FROM jobs WHERE job = ?1",
            params![job, int(unix_ms), text],
        )?;
        self.run(
            "DELETE FROM log WHERE job = ?1
                 AND line <= (SELECT log_lines FROM jobs WHERE job = ?1) - ?2",
            [job, int(LOG_LINES_MAX as u64)],
        )
    }

    fn exists(&self, sql: &str, params: impl Params) -> rusqlite::Result<bool> {
        self.connection.prepare_cached(sql)?.exists(params)
    }

    fn run(&self, sql: &str, params: impl Params) -> rusqlite::Result<()> {
        self.connection
            .prepare_cached(sql)?
            .execute(params)
            .map(drop)
    }
}
