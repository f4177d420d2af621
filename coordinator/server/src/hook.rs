//! The operator's program that is run when a job is over.
//!
//! It is told of the job by its environment. One at a time, each for a limited time; a coordinator that is stopped or
//! killed meanwhile does not run it later.

use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use tokio::process::Command;
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
                    run(&program, about).await;
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

async fn run(program: &Path, about: About) {
    let shown = program.display();
    let child = Command::new(program)
        .envs(about)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .kill_on_drop(true)
        .spawn();
    let mut child = match child {
        Ok(child) => child,
        Err(error) => {
            tracing::error!("cannot run `{shown}` for a job that is over: {error}");
            return;
        }
    };
    match tokio::time::timeout(TIME_LIMIT, child.wait()).await {
        Ok(Ok(status)) if ExitStatus::success(&status) => {
            tracing::info!("`{shown}` was run for a job that is over");
        }
        Ok(Ok(status)) => {
            tracing::error!("`{shown}`, run for a job that is over, failed: {status}")
        }
        Ok(Err(error)) => tracing::error!("`{shown}` cannot be waited for: {error}"),
        Err(_) => tracing::error!(
            "`{shown}`, run for a job that is over, took longer than {} s and is killed",
            TIME_LIMIT.as_secs()
        ),
    }
}
