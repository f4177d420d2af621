//! Workers of the null renderer, in this process.

use std::net::SocketAddr;
use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::{Duration, Instant};

use agent::{Admission, Ask, ExitReason, RunError};
use tokio::runtime::Runtime;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::timeout;
use wire::auth::Token;

use super::null::Null;
use crate::error::Error;
use crate::stop::Stop;

/// Threads of each worker.
pub(crate) const THREADS: NonZeroU32 = NonZeroU32::new(2).expect("it is not 0");

/// A worker's task.
type Worker = JoinHandle<Result<ExitReason, RunError>>;

/// Workers that run until they are told to leave.
pub(crate) struct Crew<'a> {
    runtime: &'a Runtime,
    workers: Vec<(mpsc::Sender<Ask>, Worker)>,
    null: Null,
}

impl<'a> Crew<'a> {
    /// Starts so many workers of so many threads each; each comes back by itself where the coordinator is gone for a while.
    pub(crate) fn start(
        runtime: &'a Runtime,
        (count, threads): (usize, NonZeroU32),
        coordinator: SocketAddr,
        token: &Token,
        null: Null,
    ) -> Self {
        let workers = (1..=count).map(|number| {
            let admission = Admission::Local {
                coordinator,
                token: token.clone(),
            };
            let config = agent::Config::new(admission, format!("null-{number}"), threads);
            let (asks, heard) = mpsc::channel(1);
            let painter = Arc::new(null.clone());
            (asks, runtime.spawn(agent::run(config, painter, heard)))
        });
        Self {
            runtime,
            workers: workers.collect(),
            null,
        }
    }

    /// Waits until the first of them renders its first tile; answers when that was, or nothing where it is not within `limit`.
    pub(crate) fn first(&self, limit: Duration, stop: &Stop) -> Result<Option<Instant>, Error> {
        self.runtime.block_on(async {
            tokio::select! {
                () = stop.wait() => Err(Error::interrupted("the measurement was stopped")),
                first = timeout(limit, self.null.first()) => Ok(first.ok()),
            }
        })
    }

    /// Why one of them has ended by itself, if one has.
    pub(crate) fn ended(&mut self) -> Option<Error> {
        let place = self
            .workers
            .iter()
            .position(|(_, task)| task.is_finished())?;
        let (_, task) = self.workers.swap_remove(place);
        let failed = Error::failed("a worker of the measurement ended by itself");
        Some(match self.runtime.block_on(task) {
            Ok(Ok(reason)) => failed.because(format!("{reason:?}")),
            Ok(Err(error)) => failed.because(error),
            Err(error) => failed.because(error),
        })
    }

    /// Has what is held back rendered.
    pub(crate) fn let_go(&self) {
        self.null.let_go();
    }

    /// Has all of them give back what they hold, and leave.
    pub(crate) fn leave(self) {
        for (asks, _) in &self.workers {
            // One that has ended by itself needs no telling.
            let _ = asks.try_send(Ask::Stop);
        }
        for (_, task) in self.workers {
            let _ = self.runtime.block_on(task);
        }
    }
}
