//! The loop around the scheduler: wait for the first input, turn it into an event, let
//! the scheduler decide, perform the effects.
//!
//! It never waits for anything but its inputs: messages to workers are dropped with their
//! link where they do not fit, the disk works on threads of its own.
//!
//! What is durable comes before what is said. A block is written, synced and committed before the scheduler hears of it. Any
//! other durable event is told first, and its effects wait, with all later ones behind them, until it
//! is committed (`hold`). A link that closed is told behind the blocks that came by it.

mod effects;
mod hold;
mod inputs;
mod queries;
mod recall;
mod views;

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use model::{ImageRef, JobId, SubmissionId, Timestamp};
use sched::{Command, Event, Sched};
use tokio::sync::mpsc;
use tokio::time::Instant;
use wire::proto;

use crate::clock::Clock;
use crate::config::{Config, scheduling};
use crate::hook::Hook;
use crate::inbox::NewJob;
use crate::input::{Frames, Input, News, Reply};
use crate::job::{Job, Jobs};
use crate::sites::Sites;
use crate::state::State;
use crate::storage::{Era, Hand, Storage};
use crate::worker::{Leaving, Workers};

use self::hold::Held;
pub(crate) use self::recall::Kept;

/// How often watchers are told of changes, at most.
const WATCH_INTERVAL: Duration = Duration::from_millis(100);

/// Inputs that are taken before a tick that is due. What had arrived before a pause of the
/// coordinator is thus heard before anyone is blamed for being silent during it.
const INPUTS_BEFORE_TICK: u32 = 8_192;

/// Inputs that are taken one after another before the disk is heard again.
const INPUTS_AT_ONCE: u32 = 64;

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
    leaving: Leaving,
    /// Submissions that were fed and are not answered, in order.
    submitting: VecDeque<Submitting>,
    /// The submission that is being fed, until it is a job.
    arriving: Option<Box<NewJob>>,
    /// Commands that were fed and are not answered, in order.
    commanding: VecDeque<Commanding>,
    /// Jobs that users remove, until they are forgotten: what becomes of their frames, and what they were before.
    removing: BTreeMap<JobId, (Frames, proto::JobSummary)>,
    hook: Hook,
    sites: Sites,
    held: Held,
    /// Eras of images that are not in their first.
    eras: BTreeMap<ImageRef, Era>,
    /// What the disk waits for, by who waits.
    troubles: BTreeMap<Hand, String>,
}

/// A submission on its way.
#[derive(Debug)]
struct Submitting {
    submission: SubmissionId,
    formats: image::Formats,
    /// Whether it was a job already.
    again: bool,
    reply: Reply<proto::Submitted>,
}

/// A command on its way.
#[derive(Debug)]
struct Commanding {
    command: Command,
    frames: Frames,
    /// The job as it was before.
    before: proto::JobSummary,
    reply: Reply<proto::JobSummary>,
}

/// Whether the loop goes on.
#[derive(PartialEq, Eq)]
enum Next {
    GoOn,
    /// As it was asked to, or because it must.
    Stop(Result<(), String>),
}

impl Shell {
    pub(crate) fn new(
        config: Arc<Config>,
        state: Arc<State>,
        clock: Clock,
        storage: Storage,
        sites: Sites,
    ) -> Self {
        let sched = Sched::new(scheduling(&config, state.epoch()));
        Self {
            hook: Hook::start(config.on_job_end.clone()),
            sched,
            sites,
            clock,
            config,
            state,
            storage,
            jobs: Jobs::default(),
            workers: Workers::new(),
            leaving: Leaving::default(),
            submitting: VecDeque::new(),
            arriving: None,
            commanding: VecDeque::new(),
            removing: BTreeMap::new(),
            held: Held::default(),
            eras: BTreeMap::new(),
            troubles: BTreeMap::new(),
        }
    }

    /// Runs until [`News::Stop`]; then cleans up and answers. An error is why it had to end.
    pub(crate) async fn run(
        mut self,
        mut news: mpsc::Receiver<News>,
        mut inputs: mpsc::Receiver<Input>,
    ) -> Result<(), String> {
        let mut watch_at: Option<Instant> = None;
        let mut since_tick = 0;
        let ended = loop {
            let deadline = self.sched.next_deadline();
            let tick_at = deadline
                .filter(|_| !self.clock.is_held())
                .map(|deadline| self.clock.instant(deadline));
            let tick_is_overdue =
                since_tick >= INPUTS_BEFORE_TICK && tick_at.is_some_and(|at| at <= Instant::now());
            tokio::select! {
                biased;
                () = wait_until(watch_at) => {
                    watch_at = None;
                    self.tell_watchers();
                }
                news = news.recv() => {
                    let next = news.map(|news| self.hear(news));
                    if let Next::Stop(ended) = next.unwrap_or(Next::Stop(Ok(()))) {
                        break ended;
                    }
                }
                // Where much waits for the disk, whoever would add to it waits too.
                input = inputs.recv(), if !tick_is_overdue && !self.is_full() => {
                    let Some(input) = input else { break Ok(()) };
                    self.take(input);
                    since_tick += 1 + self.take_more(&mut inputs);
                }
                () = wait_until(tick_at) => {
                    since_tick = 0;
                    self.feed(Event::Tick);
                }
            }
            if watch_at.is_none() && self.jobs.has_dirty() {
                watch_at = Some(Instant::now() + WATCH_INTERVAL);
            }
        };
        drop((news, inputs));
        self.end().await;
        ended
    }

    /// Takes what has come meanwhile, for which no timer need be set anew; says how many inputs that were.
    fn take_more(&mut self, inputs: &mut mpsc::Receiver<Input>) -> u32 {
        let mut taken = 0;
        while taken < INPUTS_AT_ONCE && !self.is_full() {
            let Ok(input) = inputs.try_recv() else { break };
            self.take(input);
            taken += 1;
        }
        taken
    }

    fn is_full(&self) -> bool {
        self.held.is_full() || self.storage.is_full()
    }

    fn now(&self) -> Timestamp {
        self.clock.now()
    }

    fn unix_ms_now(&self) -> u64 {
        self.clock.unix_ms_now()
    }

    fn tell_watchers(&mut self) {
        for id in self.jobs.take_dirty() {
            let is_watched = self.jobs.get(id).is_some_and(Job::has_watchers);
            let summary = match is_watched {
                true => self.summary_with_estimate(id),
                false => self.summary(id),
            };
            let Some(summary) = summary else {
                continue;
            };
            let over = views::is_over(&summary);
            let sched = &self.sched;
            let Some(job) = self.jobs.get_mut(id) else {
                continue;
            };
            job.tell_watchers(summary, |job, image| {
                views::image_status(sched, id, job, image, over)
            });
            if over {
                job.dismiss_watchers();
            }
        }
    }

    /// Tells everybody that the coordinator stops; jobs go on at the next start.
    async fn end(mut self) {
        self.tell_watchers();
        self.dismiss_workers();
        let Self { storage, state, .. } = self;
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
