//! The loop around the scheduler: wait for the first input, turn it into an event, let
//! the scheduler decide, perform the effects.
//!
//! It never waits for anything but its inputs: messages to workers are dropped with their
//! link where they do not fit, the disk works on threads of its own.

mod effects;
mod inputs;
mod queries;
mod views;

use std::sync::Arc;
use std::time::Duration;

use model::{SubmissionId, Timestamp};
use sched::{Effect, Event, Sched};
use tokio::sync::mpsc;
use tokio::time::Instant;
use wire::proto;

use crate::clock::Clock;
use crate::config::Config;
use crate::inbox::NewJob;
use crate::input::{Input, Reply};
use crate::job::Jobs;
use crate::state::State;
use crate::storage::Storage;
use crate::worker::Workers;

/// How often watchers are told of changes, at most.
const WATCH_INTERVAL: Duration = Duration::from_millis(100);

/// Most workers: all must fit into one message.
const WORKERS_MAX: u32 = 2_000;

/// Inputs that are taken before a tick that is due. What had arrived before a pause of the
/// coordinator is thus heard before anyone is blamed for being silent during it.
const INPUTS_BEFORE_TICK: u32 = 8_192;

/// Everything that the loop owns.
#[derive(Debug)]
pub(crate) struct Shell {
    sched: Sched,
    clock: Clock,
    config: Arc<Config>,
    state: Arc<State>,
    storage: Storage,
    jobs: Jobs,
    workers: Workers,
    /// The submission that is being fed, until the scheduler has answered.
    submitting: Option<(SubmissionId, Box<NewJob>, Reply<proto::Submitted>)>,
    /// Why the command that was just fed is refused, if it is.
    refused: Option<sched::CommandRefusal>,
    effects: Vec<Effect>,
}

/// Whether the loop goes on.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Next {
    GoOn,
    Stop,
}

impl Shell {
    pub(crate) fn new(
        config: Arc<Config>,
        state: Arc<State>,
        clock: Clock,
        storage: Storage,
    ) -> Self {
        let sched = Sched::new(sched::Config {
            revision: Some(config.revision),
            liveness_limit: config.liveness_limit,
            limits: sched::Limits {
                workers_max: WORKERS_MAX,
                ..sched::Limits::default()
            },
            ..sched::Config::new(state.epoch())
        });
        Self {
            sched,
            clock,
            config,
            state,
            storage,
            jobs: Jobs::default(),
            workers: Workers::new(),
            submitting: None,
            refused: None,
            effects: Vec::new(),
        }
    }

    /// Runs until [`Input::Stop`]; then cleans up and answers.
    pub(crate) async fn run(mut self, mut inputs: mpsc::Receiver<Input>) {
        let mut watch_at: Option<Instant> = None;
        let mut since_tick = 0;
        loop {
            let tick_at = self
                .sched
                .next_deadline()
                .map(|deadline| self.clock.instant(deadline));
            let tick_is_overdue =
                since_tick >= INPUTS_BEFORE_TICK && tick_at.is_some_and(|at| at <= Instant::now());
            tokio::select! {
                biased;
                () = wait_until(watch_at) => {
                    watch_at = None;
                    self.tell_watchers();
                }
                input = inputs.recv(), if !tick_is_overdue => {
                    since_tick += 1;
                    match input {
                        Some(input) => {
                            if self.take(input) == Next::Stop {
                                break;
                            }
                        }
                        None => break,
                    }
                }
                () = wait_until(tick_at) => {
                    since_tick = 0;
                    self.feed(Event::Tick);
                }
            }
            if watch_at.is_none() && self.jobs.has_dirty() {
                watch_at = Some(Instant::now() + WATCH_INTERVAL);
            }
        }
        drop(inputs);
        self.end().await;
    }

    /// Lets the scheduler decide, and performs what it decided.
    fn feed(&mut self, event: Event) {
        let now = self.now();
        tracing::debug!(?event, "event");
        let mut effects = std::mem::take(&mut self.effects);
        self.sched.handle(now, event, &mut effects);
        for effect in effects.drain(..) {
            tracing::debug!(?effect, "effect");
            self.perform(effect);
        }
        self.effects = effects;
    }

    fn now(&self) -> Timestamp {
        self.clock.now()
    }

    fn unix_ms_now(&self) -> u64 {
        self.clock.unix_ms(self.now())
    }

    fn tell_watchers(&mut self) {
        for id in self.jobs.take_dirty() {
            let Some(summary) = self.summary(id) else {
                continue;
            };
            let over = views::is_over(&summary);
            let sched = &self.sched;
            let Some(job) = self.jobs.get_mut(id) else {
                continue;
            };
            job.tell_watchers(summary, |job, image| {
                views::image_status(sched, id, job, image)
            });
            if over {
                job.dismiss_watchers();
            }
        }
    }

    /// Tells everybody that the coordinator stops, and leaves no scratch file behind.
    async fn end(mut self) {
        self.tell_watchers();
        self.dismiss_workers();
        let Self {
            storage,
            jobs,
            state,
            ..
        } = self;
        for (_, job) in jobs.iter() {
            job.plan
                .cancelled
                .store(true, std::sync::atomic::Ordering::Relaxed);
            storage.clear(job.folders().clone());
        }
        drop(jobs);
        let finished = tokio::task::spawn_blocking(move || storage.finish());
        if finished.await.is_err() {
            tracing::error!("the storage threads could not be ended");
        }
        state.withdraw();
    }
}

/// Waits for an instant; for ever where there is none.
async fn wait_until(at: Option<Instant>) {
    match at {
        Some(at) => tokio::time::sleep_until(at).await,
        None => std::future::pending().await,
    }
}
