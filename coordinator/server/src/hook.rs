//! The operator's program that is run when a job is over.
//!
//! It is told of the job by its environment. One at a time, each for a limited time; a coordinator that is stopped or
//! killed meanwhile does not run it later.

use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process_group};
use tokio::process::{Child, Command};
use tokio::sync::mpsc;

/// Jobs whose hook has not been run; of more that end meanwhile it is not.
const WAITING_MAX: usize = 1_000;

/// How long one run may take.
const TIME_LIMIT: Duration = Duration::from_secs(600);

/// What the program is told of a job, as the names and values of its environment.
pub(crate) type About = Vec<(&'static str, String)>;

/// Runs the program for one job after the other.
#[derive(Debug)]
pub(crate) struct Hook(Option<mpsc::Sender<About>>);

impl Hook {
    /// Runs `program`, if there is one, on the runtime that this is called on.
    pub(crate) fn start(program: Option<PathBuf>) -> Self {
        Self(program.map(|program| {
            let (jobs, mut ended) = mpsc::channel::<About>(WAITING_MAX);
            tokio::spawn(async move {
                while let Some(about) = ended.recv().await {
                    run(&program, about, TIME_LIMIT).await;
                }
            });
            jobs
        }))
    }

    /// A job is over.
    pub(crate) fn job_ended(&self, about: impl FnOnce() -> About) {
        let Some(jobs) = &self.0 else { return };
        if jobs.try_send(about()).is_err() {
            tracing::error!("too many jobs ended at once: the program for one of them is not run");
        }
    }
}

async fn run(program: &Path, about: About, limit: Duration) {
    let shown = program.display();
    let child = Command::new(program)
        .envs(about)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .process_group(0)
        .spawn();
    let mut child = match child {
        Ok(child) => Group(child),
        Err(error) => {
            tracing::error!("cannot run `{shown}` for a job that is over: {error}");
            return;
        }
    };
    match tokio::time::timeout(limit, child.0.wait()).await {
        Ok(Ok(status)) if ExitStatus::success(&status) => {
            tracing::info!("`{shown}` was run for a job that is over");
        }
        Ok(Ok(status)) => {
            tracing::error!("`{shown}`, run for a job that is over, failed: {status}")
        }
        Ok(Err(error)) => tracing::error!("`{shown}` cannot be waited for: {error}"),
        Err(_) => tracing::error!(
            "`{shown}`, run for a job that is over, took longer than {} s and is killed",
            limit.as_secs()
        ),
    }
}

/// A program in a group of its own: where it is dropped before it ended, all that it started is killed.
struct Group(Child);

impl Drop for Group {
    fn drop(&mut self) {
        // None once it was waited for: then its number may be another's.
        let leader = self.0.id().and_then(|id| i32::try_from(id).ok());
        if let Some(group) = leader.and_then(Pid::from_raw) {
            let _ = kill_process_group(group, Signal::KILL);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt as _;

    use rustix::fs::{CWD, FileType, Mode, mknodat};

    use super::*;

    /// Whether a process runs; one that has ended and that nobody waited for does not.
    fn runs(process: &str) -> bool {
        let stat = fs::read_to_string(format!("/proc/{process}/stat"));
        stat.is_ok_and(|stat| !stat.contains(") Z "))
    }

    #[tokio::test]
    async fn what_the_program_started_is_killed_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let (program, started) = (folder.path().join("hook"), folder.path().join("started"));
        // Reading it waits until the program has said what it started.
        let mode = Mode::RUSR | Mode::WUSR;
        mknodat(CWD, &started, FileType::Fifo, mode, 0).unwrap();
        let script = format!(
            "#!/bin/sh\nsleep 1000 &\necho $! > {}\nwait\n",
            started.display()
        );
        fs::write(&program, script).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o700)).unwrap();
        let mut running = Box::pin(run(&program, About::new(), Duration::MAX));
        let child = tokio::select! {
            () = &mut running => panic!("it ended by itself"),
            child = tokio::fs::read_to_string(&started) => child.unwrap(),
        };
        let child = child.trim();
        assert!(runs(child));
        drop(running);
        while runs(child) {
            tokio::task::yield_now().await;
        }
    }
}
