//! Forgetting what nobody needs any more.

use std::fs;
use std::path::Path;
use std::time::{Duration, SystemTime};

use model::JobId;
use sched::Command;
use wire::Failure;
use wire::proto;

use super::Door;
use crate::input::{Frames, Input, Query, Wish};
use crate::storage::chain;

/// Forgets jobs that are over for long enough and, where asked, removes frames: theirs, and those that jobs left
/// that were forgotten before.
pub(super) async fn clean(
    door: &Door,
    request: proto::CleanRequest,
) -> Result<proto::CleanReply, Failure> {
    // Folders first: one of them whose job is not known afterwards is of a job that was forgotten.
    let folders = door.job_folders().await;
    let jobs = door.ask(|reply| Input::Ask(Query::Jobs(reply))).await?.jobs;
    let info = door.ask(|reply| Input::Ask(Query::Info(reply))).await?;
    let before = info.now_unix_ms.saturating_sub(request.older_ms);
    let is_old = |unix_ms: u64| unix_ms > 0 && unix_ms <= before;
    let known = |id: &JobId| jobs.iter().any(|job| job.job == id.0);
    let left: Vec<JobId> = folders.into_iter().filter(|id| !known(id)).collect();
    let mut cleaned = Vec::new();
    for job in jobs.iter().filter(|job| is_old(job.finished_unix_ms)) {
        let id = JobId(job.job);
        let bytes = match request.frames {
            true => door.frames_of(id).await.0,
            false => 0,
        };
        if !request.dry_run {
            let frames = match request.frames {
                true => Frames::Go,
                false => Frames::Stay,
            };
            let command = Command::Remove;
            let wish = Wish {
                command,
                frames,
                if_over_since: Some(job.finished_unix_ms),
            };
            let removed = door.ask(|reply| Input::Command(id, wish, reply)).await;
            if let Err(failure) = removed {
                // Others wait for it, it has just gone, or it goes on again.
                tracing::info!(job = %id, "a job is not cleaned away: {failure}");
                continue;
            }
        }
        cleaned.push(proto::Cleaned {
            job: id.0,
            name: job.name.clone(),
            bytes,
        });
    }
    for id in left.into_iter().filter(|_| request.frames) {
        let (bytes, written) = door.frames_of(id).await;
        if bytes == 0 || !is_old(written) {
            continue;
        }
        if !request.dry_run {
            door.remove_frames(id).await?;
        }
        cleaned.push(proto::Cleaned {
            job: id.0,
            name: String::new(),
            bytes,
        });
    }
    cleaned.sort_by_key(|cleaned| cleaned.job);
    Ok(proto::CleanReply { jobs: cleaned })
}

impl Door {
    async fn job_folders(&self) -> Vec<JobId> {
        let state = self.state.clone();
        let listed = tokio::task::spawn_blocking(move || state.job_folders());
        listed.await.unwrap_or_default()
    }

    /// Bytes of a job's frames, and when the latest was written, in milliseconds since 1970.
    async fn frames_of(&self, job: JobId) -> (u64, u64) {
        let folder = self.state.job(job).frames;
        let weighed = tokio::task::spawn_blocking(move || weigh(&folder));
        weighed.await.unwrap_or_default()
    }

    async fn remove_frames(&self, job: JobId) -> Result<(), Failure> {
        let folders = self.state.job(job);
        let removed = tokio::task::spawn_blocking(move || folders.forget(Frames::Go)).await;
        match removed {
            Ok(Err(error)) => Err(Failure::later(
                proto::ErrorKind::Storage,
                format!(
                    "what job {job} left could not be removed: {}",
                    chain(&error)
                ),
            )),
            _ => Ok(()),
        }
    }
}

fn weigh(folder: &Path) -> (u64, u64) {
    let listed = fs::read_dir(folder).into_iter().flatten().flatten();
    let files = listed.filter_map(|file| file.metadata().ok());
    files.fold((0, 0), |(bytes, latest), file| {
        let written = file.modified().unwrap_or(SystemTime::UNIX_EPOCH);
        let since = written.duration_since(SystemTime::UNIX_EPOCH);
        let since = since.as_ref().map_or(0, Duration::as_millis);
        let since = u64::try_from(since).unwrap_or(u64::MAX);
        (bytes + file.len(), latest.max(since))
    })
}
