//! The thread of one site. In pilot mode it asks the loop what is wanted and the queue what is there, and does what the pilot says.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use cluster::busy::Look;
use cluster::camp::Camp;
use cluster::pilot::{self, Action, Pilot, Settings, Standing, Wanted};
use cluster::survey::Program;
use cluster::{Array, ClusterError, Limits, Mode, Site, survey};
use model::{Epoch, Revision, Span, Timestamp};
use sched::Offer;
use tokio::runtime::Handle;
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;

use super::pass::Pass;
use super::poll::Poller;
use super::{Board, rest};
use crate::input::{Gates, Input, Query};

/// The least time between two looks at the queue, however often there may be something new.
const LOOK_LEAST: Duration = Duration::from_secs(1);

/// The longest pause after a site could not be reached several times in a row.
const PAUSE_LONGEST: Duration = Duration::from_secs(300);

/// How long the token may take to arrive.
const TOKEN_LIMIT: Span = Span::from_secs(60);

/// What the thread of a site works with.
pub(crate) struct Errand {
    pub(crate) camp: Camp,
    /// Where its workers dial.
    pub(crate) coordinator: String,
    /// What its workers join by.
    pub(crate) pass: Pass,
    pub(crate) revision: Revision,
    pub(crate) epoch: Epoch,
    pub(crate) inputs: mpsc::Sender<Input>,
    pub(crate) board: Board,
    pub(crate) gates: Gates,
    pub(crate) runtime: Handle,
}

/// What a site was found to be.
enum Found {
    /// Its workers dial.
    Pilot(Box<Known>),
    /// Nothing there dials.
    Poll(Limits),
}

/// A site in pilot mode that was looked at.
struct Known {
    pilot: Pilot,
    /// Whether the queue was seen to hold nothing of ours.
    is_empty: bool,
    /// Whether the program was seen to be the right one.
    is_ready: bool,
}

/// The loop has ended.
pub(super) struct Stopping;

impl Errand {
    /// Runs until the loop has ended.
    pub(crate) fn run(self, mut woken: mpsc::Receiver<()>) {
        let origin = Instant::now();
        let poll = Duration::from_micros(self.camp.site.poll.0);
        let mut known: Option<Box<Known>> = None;
        let mut failures = 0_u32;
        loop {
            let begun = Instant::now();
            let Ok(wanted) = self.wanted() else { return };
            let now = Timestamp(u64::try_from(origin.elapsed().as_micros()).unwrap_or(u64::MAX));
            let pause = match self.round(now, &mut known, wanted) {
                Ok(None) => {
                    failures = 0;
                    poll
                }
                Ok(Some(poller)) => return poller.run(&mut woken),
                Err(error) => {
                    let words = self.words(error);
                    tracing::warn!(site = self.camp.site.name, "{words}");
                    self.board
                        .change(&self.camp.site.name, |site| site.trouble = words);
                    let longer = poll.saturating_mul(1 << failures.min(8));
                    failures = failures.saturating_add(1);
                    longer.min(PAUSE_LONGEST).max(poll)
                }
            };
            let awake = async { timeout(pause, woken.recv()).await };
            match self.runtime.block_on(awake) {
                Ok(None) => return,
                Err(_) => {}
                Ok(Some(())) if !rest(&self.runtime, &mut woken, begun + LOOK_LEAST) => return,
                Ok(Some(())) => {}
            }
        }
    }

    /// What the farm wants of this site.
    pub(super) fn wanted(&self) -> Result<Wanted, Stopping> {
        let site = &self.camp.site;
        let offer = Offer {
            revision: self.revision,
            threads: site.threads,
            // A job that asks for memory is served where the site says how much there is.
            memory_bytes: site.memory_bytes.unwrap_or(0),
            labels: site.labels.iter().cloned().chain([site.label()]).collect(),
            time_left: None,
            queue: None,
        };
        let (reply, answer) = oneshot::channel();
        let query = Query::Wanted(offer, site.label(), reply);
        let asked = self.inputs.blocking_send(Input::Ask(query));
        asked.map_err(|_| Stopping)?;
        match answer.blocking_recv() {
            Ok(Ok(wanted)) => Ok(wanted),
            _ => Err(Stopping),
        }
    }

    /// One look, and what follows from it; a site that is found to be polled is so from then on.
    fn round(
        &self,
        now: Timestamp,
        known: &mut Option<Box<Known>>,
        wanted: Wanted,
    ) -> Result<Option<Poller<'_>>, ClusterError> {
        let known = match known {
            Some(known) => known,
            None => match self.look()? {
                Found::Pilot(found) => known.insert(found),
                Found::Poll(limits) => return Poller::new(self, limits).map(Some),
            },
        };
        // Nobody is asked about nothing.
        if wanted.squares == 0 && known.is_empty {
            known.pilot.rests();
            self.show(known.pilot.standing());
            return Ok(None);
        }
        self.fly(now, known, wanted).map(|()| None)
    }

    /// Looks at a site for the first time.
    fn look(&self) -> Result<Found, ClusterError> {
        let site = &self.camp.site;
        let dials = match site.mode {
            Mode::Auto => survey::host(site, &self.camp.way, Some(&self.coordinator))?.dials,
            Mode::Pilot | Mode::Poll => None,
        };
        let mode = survey::fitting(site, dials);
        self.board.change(&site.name, |status| {
            status.mode = mode.name().to_owned();
        });
        let limits = self.camp.queue.limits()?;
        if mode == Mode::Poll {
            return Ok(Found::Poll(limits));
        }
        Ok(Found::Pilot(Box::new(Known {
            pilot: Pilot::new(self.settings(&limits)),
            is_empty: false,
            is_ready: false,
        })))
    }

    fn fly(&self, now: Timestamp, known: &mut Known, wanted: Wanted) -> Result<(), ClusterError> {
        let (queue, site) = (&self.camp.queue, &self.camp.site.name);
        let shown = queue.list(&self.camp.prefix())?;
        known.is_empty = !shown.iter().any(|task| task.state.is_live());
        let mut actions = known.pilot.observe(now, &shown, wanted);
        while let [Action::LookUp(arrays)] = &actions[..] {
            let kept = queue.ended(arrays)?;
            known.pilot.have_ended(now, arrays, &kept);
            actions = known.pilot.observe(now, &shown, wanted);
        }
        for action in actions {
            match action {
                // It stands alone, and is done.
                Action::LookUp(_) => {}
                Action::Delete(tasks) => {
                    let count = tasks.len();
                    tracing::info!(site, count, "allocations that nobody needs are deleted");
                    queue.delete(&tasks)?;
                }
                Action::Submit { name, tasks } => {
                    known.is_empty = false;
                    self.submit(now, known, &name, tasks);
                }
            }
        }
        if let Some((array, task)) = known.pilot.take_failed() {
            // What was there may be there no more.
            known.is_ready = false;
            let said = match self.camp.has_room() {
                // Its log would be there, too.
                Err(full @ ClusterError::Full { .. }) => self.words(full),
                _ => self.camp.said(&array, task).unwrap_or_default(),
            };
            known.pilot.has_said(&said);
            tracing::warn!(site, array, task, said, "an allocation failed");
        }
        let standing = known.pilot.standing();
        self.show(standing);
        let look = Look {
            at_unix_ms: unix_ms(),
            running: standing.running,
            waiting: standing.waiting,
            ..Look::default()
        };
        self.board.saw(site, look);
        Ok(())
    }

    fn submit(&self, now: Timestamp, known: &mut Known, name: &str, tasks: u32) {
        let submitted = self.make_ready(known).and_then(|()| {
            let array = self.array(known.pilot.time_limit(), name, tasks);
            self.camp.queue.submit(&array)
        });
        let site = &self.camp.site.name;
        match submitted {
            Ok(array) => {
                tracing::info!(site, %array, name, tasks, "allocations are submitted");
                known.pilot.submitted(&array, tasks);
            }
            Err(error) => {
                let words = self.words(error);
                tracing::warn!(site, name, tasks, "{words}");
                known.is_ready = false;
                known.pilot.refused(now, words);
                // Its limits may be others than they were.
                if let Ok(limits) = self.camp.queue.limits() {
                    known.pilot.settle(self.settings(&limits));
                }
            }
        }
    }

    fn settings(&self, limits: &Limits) -> Settings {
        let names = format!("{}{}-", self.camp.prefix(), self.epoch.0);
        Settings::of(&self.camp.site, limits, names)
    }

    fn array(&self, time_limit: Option<Span>, name: &str, tasks: u32) -> Array {
        Array {
            script: pilot::script(&self.camp, self.pass.dials(&self.coordinator), time_limit),
            log: self.camp.log(name),
            name: name.to_owned(),
            tasks,
            running_max: None,
            time_limit,
        }
    }

    /// Sees once that the program there makes the same pixels, and brings the token: each time, since it may be another.
    fn make_ready(&self, known: &mut Known) -> Result<(), ClusterError> {
        let (site, way) = (&self.camp.site, &self.camp.way);
        if !known.is_ready {
            let program = survey::program(site, way)?;
            program_makes(site, &program, self.revision)?;
            known.is_ready = true;
        }
        let token = self.pass.content()?;
        let way = &self.camp.way;
        let path = pilot::token_file(&self.camp);
        let bytes = token.len() as u64;
        way.put(token.as_bytes(), bytes, &path, 0o600, TOKEN_LIMIT)?;
        self.camp.trim_logs()
    }

    /// An error of the site with its causes, and what to change.
    pub(super) fn words(&self, error: ClusterError) -> String {
        let error = self.camp.full(error);
        let mut words = error.to_string();
        let mut source = std::error::Error::source(&error);
        while let Some(cause) = source {
            words = format!("{words}: {cause}");
            source = cause.source();
        }
        format!("{words}; {}", error.next())
    }

    fn show(&self, standing: &Standing) {
        self.board.change(&self.camp.site.name, |site| {
            site.waiting = standing.waiting;
            site.running = standing.running;
            site.wanted = standing.wanted;
            site.trouble = standing.trouble.clone().unwrap_or_default();
        });
    }
}

/// Sees that a program makes the farm's pixels.
pub(super) fn program_makes(
    site: &Site,
    program: &Program,
    revision: Revision,
) -> Result<(), ClusterError> {
    match program.revision == revision.0 {
        true => Ok(()),
        false => Err(ClusterError::Program {
            path: site.program.clone(),
            site: site.name.clone(),
            what: format!(
                "it makes pixels of renderer revision {}, and this farm those of {revision}",
                program.revision
            ),
        }),
    }
}

pub(super) fn unix_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    u64::try_from(since.unwrap_or_default().as_millis()).unwrap_or(u64::MAX)
}
