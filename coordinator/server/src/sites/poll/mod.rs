//! Poll mode (thesis §C.3.4 and §C.3.5): to the loop a site is one worker that takes whole images; there they are arrays,
//! which are asked after again and again. What is done is `cluster::poll`'s decision.

mod desk;
mod join;
mod line;
mod scenes;

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use cluster::busy::Look;
use cluster::orders::{End, Order, Seen};
use cluster::pilot::Wanted;
use cluster::poll::{Action, Came, Poll, Settings};
use cluster::{ClusterError, Limits, Site, survey};
use model::{AttemptId, Lease, Timestamp};
use sched::Event;
use tokio::sync::mpsc;
use wire::proto::control_down::Message;

use self::desk::{Desk, Looked};
use self::line::{Became, Cut, Line};
use self::scenes::Scenes;
use super::errand::{Errand, Stopping, program_makes, unix_ms};
use super::rest;

/// After so many looks in a row that failed, others may have the site's tiles.
const MISSED_MAX: u32 = 4;

/// The longest pause after a site could not be reached more often than that.
const PAUSE_LONGEST: Duration = Duration::from_secs(300);

/// The least time between two looks, however often there may be something new.
const LOOK_LEAST: Duration = Duration::from_secs(1);

/// Why a round ended early.
enum Trouble {
    Site(ClusterError),
    Line(Cut),
}

impl From<ClusterError> for Trouble {
    fn from(error: ClusterError) -> Self {
        Self::Site(error)
    }
}

impl From<Cut> for Trouble {
    fn from(cut: Cut) -> Self {
        Self::Line(cut)
    }
}

impl From<Stopping> for Trouble {
    fn from(_: Stopping) -> Self {
        Self::Line(Cut::Stopping)
    }
}

/// A site that is polled.
pub(super) struct Poller<'a> {
    errand: &'a Errand,
    desk: Desk<'a>,
    limits: Limits,
    poll: Poll,
    scenes: Scenes,
    line: Option<Line>,
    credit: u32,
    /// Whether it was told to leave.
    is_leaving: bool,
    /// Whether the program was seen to be the right one.
    is_ready: bool,
    origin: Instant,
}

impl<'a> Poller<'a> {
    pub(super) fn new(errand: &'a Errand, limits: Limits) -> Result<Self, ClusterError> {
        let site = &errand.camp.site;
        errand.board.has_slots(&site.name, slots(site, &limits));
        Ok(Self {
            desk: Desk::new(&errand.camp)?,
            poll: Poll::new(settings(errand, &limits)),
            limits,
            scenes: Scenes::default(),
            line: None,
            credit: 0,
            is_leaving: false,
            is_ready: false,
            origin: Instant::now(),
            errand,
        })
    }

    /// Runs until the loop has ended, or the site was told to leave and has.
    pub(super) fn run(mut self, woken: &mut mpsc::Receiver<()>) {
        let poll = Duration::from_micros(self.errand.camp.site.poll.0);
        let mut missed = 0_u32;
        loop {
            let begun = Instant::now();
            let pause = match self.round() {
                Ok(()) => {
                    missed = 0;
                    poll
                }
                Err(Trouble::Line(Cut::Stopping)) => return,
                Err(Trouble::Line(Cut::Ended(why))) => {
                    tracing::warn!(site = self.name(), why, "the site's line was ended");
                    self.line = None;
                    self.show(Some(why));
                    poll
                }
                Err(Trouble::Site(error)) => {
                    let words = self.errand.words(error);
                    tracing::warn!(site = self.name(), "{words}");
                    self.show(Some(words));
                    missed = missed.saturating_add(1);
                    if missed == MISSED_MAX
                        && let Some(line) = self.line.take()
                    {
                        line.close();
                    }
                    let longer = poll.saturating_mul(1 << missed.saturating_sub(MISSED_MAX).min(8));
                    longer.min(PAUSE_LONGEST).max(poll)
                }
            };
            if self.is_leaving && self.poll.is_empty() {
                if let Some(line) = self.line.take() {
                    let worker = line.worker();
                    let _ = line.say(Event::Goodbye { worker });
                }
                self.show(Some("it was told to leave, and has".to_owned()));
                return;
            }
            match self.wait(pause, woken) {
                Ok(true) if !rest(&self.errand.runtime, woken, begun + LOOK_LEAST) => return,
                Ok(true | false) => {}
                Err(Cut::Stopping) => return,
                Err(Cut::Ended(_)) => self.line = None,
            }
        }
    }

    fn name(&self) -> &str {
        &self.errand.camp.site.name
    }

    fn now(&self) -> Timestamp {
        Timestamp(u64::try_from(self.origin.elapsed().as_micros()).unwrap_or(u64::MAX))
    }

    /// Waits for the next look; whether somebody asked for it before its time.
    fn wait(&mut self, pause: Duration, woken: &mut mpsc::Receiver<()>) -> Result<bool, Cut> {
        let runtime = self.errand.runtime.clone();
        let line = self.line.as_mut();
        let heard = runtime.block_on(async {
            let hear = async {
                match line {
                    Some(line) => line.hear().await,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                () = tokio::time::sleep(pause) => Ok(None),
                awake = woken.recv() => match awake {
                    Some(()) => Ok(Some(None)),
                    None => Err(Cut::Stopping),
                },
                heard = hear => heard.map(Some),
            }
        })?;
        if let Some(Some(message)) = heard.clone() {
            self.take(message);
        }
        Ok(heard.is_some())
    }

    /// One look, and what follows from it.
    fn round(&mut self) -> Result<(), Trouble> {
        if self.line.is_none() {
            self.connect()?;
        }
        self.hear()?;
        // Nobody is asked about nothing.
        if self.poll.is_empty() && self.scenes.is_empty() && self.poll.full().is_none() {
            return Ok(());
        }
        let seen = self.fetch()?;
        // What was leased because of that.
        self.hear()?;
        let actions = self.poll.observe(&seen);
        // Before anything is removed: who sees that it is gone must not find it among what runs.
        self.count();
        // Before anything is given back: what there is no room for shall not come again.
        self.wants()?;
        // What is given back may come again at once.
        let comes_again = |action: &Action| matches!(action, Action::GiveBack(_));
        let may_tidy = !actions.iter().any(comes_again);
        for action in actions {
            self.perform(action)?;
        }
        self.scenes.are(&seen.files);
        if let Some(line) = &self.line {
            line.runs(self.poll.running());
        }
        // What is leased because of all this is submitted now, and not at the next look: a slot may be free.
        let wanted = self.hear()?;
        let submitted = self.submit()?;
        if may_tidy {
            self.tidy()?;
        }
        self.show(None);
        let standing = self.poll.standing();
        let look = Look {
            at_unix_ms: unix_ms(),
            running: standing.running,
            waiting: standing.waiting,
            submitted,
            has_more: wanted.squares > self.poll.squares(),
        };
        self.errand.board.saw(self.name(), look);
        Ok(())
    }

    /// Says how many images it wants, where that has changed.
    fn wants(&mut self) -> Result<(), Trouble> {
        let credit = match self.is_leaving {
            true => 0,
            false => self.poll.credit(),
        };
        if credit != self.credit
            && let Some(line) = &self.line
        {
            let worker = line.worker();
            line.say(Event::Credit { worker, credit })?;
            self.credit = credit;
        }
        Ok(())
    }

    /// Hears all that was said until now: what the loop leases at a time comes whole. Answers what the farm has for the site.
    fn hear(&mut self) -> Result<Wanted, Trouble> {
        // The loop answers after all that it did before.
        let wanted = self.errand.wanted()?;
        while let Some(line) = &mut self.line {
            match line.heard()? {
                Some(message) => self.take(message),
                None => break,
            }
        }
        Ok(wanted)
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::Lease(lease) => match Lease::try_from(lease) {
                Ok(lease) => self.poll.leased(lease),
                Err(bad) => tracing::error!(site = self.name(), %bad, "a lease cannot be read"),
            },
            Message::Revoke(revoke) => {
                if let Some(Ok(attempt)) = revoke.attempt.map(AttemptId::try_from) {
                    self.poll.revoked(attempt);
                }
            }
            Message::Drain(_) => self.is_leaving = true,
            Message::Welcome(_) => {}
        }
    }

    /// Looks, and fetches all blocks that are there; answers how everything stood before the last call.
    fn fetch(&mut self) -> Result<Seen, Trouble> {
        loop {
            let Looked { seen, blocks, end } = self.desk.look(&self.poll)?;
            let brought = blocks.iter().map(|block| block.bytes);
            let brought = brought.filter(|&bytes| bytes > 0);
            let (count, bytes) = (brought.clone().count() as u64, brought.sum::<u64>());
            // Before they are anybody's: who sees a job's last block done finds it among these.
            self.errand.board.change(self.name(), |site| {
                site.fetched_blocks += count;
                site.fetched_bytes += bytes;
            });
            let mut deliveries = Vec::new();
            for block in &blocks {
                deliveries.extend(block.delivery.clone());
            }
            let mut again = 0;
            if let Some(line) = &mut self.line {
                for (attempt, rect, took, became) in line.deliver(&deliveries)? {
                    if became == Became::Durable {
                        again += u64::from(self.poll.delivered(attempt, rect, took) == Came::Again);
                    }
                }
            }
            self.errand.board.change(self.name(), |site| {
                site.fetched_again += again;
            });
            // Only now: all before these is durable, or nobody wants it.
            for block in &blocks {
                self.poll.is_done_to(&block.array, block.task, block.end);
            }
            match (end?, seen) {
                (End::Whole, Some(seen)) => return Ok(seen),
                // Others must not wait for what may take long.
                _ => drop(self.hear()?),
            }
        }
    }

    fn perform(&mut self, action: Action) -> Result<(), Trouble> {
        match action {
            Action::Delete(tasks) => self.desk.delete(tasks)?,
            Action::Remove(arrays) => self.desk.remove(arrays, BTreeSet::new())?,
            Action::GiveBack(attempts) => {
                tracing::info!(
                    site = self.name(),
                    count = attempts.len(),
                    "tasks ended before their tiles were done: the rest is submitted again"
                );
                if let Some(line) = &self.line {
                    let worker = line.worker();
                    line.say(Event::GivenBack { worker, attempts })?;
                }
            }
            Action::Fail {
                attempt,
                array,
                task,
            } => {
                let said = self.errand.camp.said(&array, task).unwrap_or_default();
                let reason = format!(
                    "at site {} its task ended several times without a block: {said}",
                    self.name()
                );
                if let Some(line) = &self.line {
                    let worker = line.worker();
                    line.say(Event::TileFailed {
                        worker,
                        attempt,
                        reason: wire::convert::sentence(&reason, 2_000),
                    })?;
                }
            }
        }
        Ok(())
    }

    /// Submits what is leased and in no array; answers how many tasks the queue took.
    fn submit(&mut self) -> Result<u32, Trouble> {
        let mut submitted = 0;
        for order in self.poll.orders(self.now()) {
            let (name, tasks) = (&order.name, order.tasks.len());
            match self.bring(&order) {
                Ok(id) => {
                    tracing::info!(site = self.name(), id, name, tasks, "an array is submitted");
                    self.poll.submitted();
                    submitted += u32::try_from(tasks).unwrap_or(u32::MAX);
                }
                Err(Trouble::Site(error)) => {
                    let words = self.errand.words(error);
                    tracing::warn!(site = self.name(), name, tasks, "{words}");
                    self.is_ready = false;
                    let now = self.now();
                    self.poll.refused(now, name, words);
                    // Its limits may be others than they were.
                    if let Ok(limits) = self.errand.camp.queue.limits() {
                        let site = &self.errand.camp.site;
                        self.errand
                            .board
                            .has_slots(&site.name, slots(site, &limits));
                        self.poll.settle(settings(self.errand, &limits));
                        self.limits = limits;
                    }
                }
                Err(line) => return Err(line),
            }
        }
        Ok(submitted)
    }

    /// Sees once that the program there makes the same pixels; brings the scene where it is not there, and the order.
    fn bring(&mut self, order: &Order) -> Result<String, Trouble> {
        let camp = &self.errand.camp;
        if !self.is_ready {
            let program = survey::program(&camp.site, &camp.way)?;
            program_makes(&camp.site, &program, self.errand.revision)?;
            self.is_ready = true;
        }
        self.scenes.bring(self.errand, &order.scene)?;
        Ok(self.desk.submit(order)?)
    }

    /// Removes scenes that nothing there needs.
    fn tidy(&mut self) -> Result<(), Trouble> {
        let unneeded = self.scenes.unneeded(&self.poll.scenes());
        if !unneeded.is_empty() {
            self.desk.remove(Vec::new(), unneeded.clone())?;
            self.scenes.are_gone(&unneeded);
        }
        Ok(())
    }

    /// Says how many tasks wait and run.
    fn count(&self) {
        let standing = self.poll.standing();
        self.errand.board.change(self.name(), |site| {
            site.waiting = standing.waiting;
            site.running = standing.running;
        });
    }

    /// Says what is held, and what is wrong.
    fn show(&self, trouble: Option<String>) {
        let standing = self.poll.standing();
        let away = (standing.away > 0).then(|| {
            format!(
                "the queue hears nothing of the hosts of {} tasks: others render what they leave",
                standing.away
            )
        });
        let full = self.poll.full().map(|said| {
            let error = self.errand.camp.is_full(said.clone());
            self.errand.words(error)
        });
        let trouble = trouble.or(full);
        let trouble = trouble.or_else(|| standing.trouble.clone()).or(away);
        let wanted = u32::try_from(self.poll.held().len()).unwrap_or(u32::MAX);
        self.errand.board.change(self.name(), |site| {
            site.wanted = wanted;
            site.trouble = trouble.unwrap_or_default();
        });
    }
}

/// What does not change of a site, by what its queue says.
fn settings(errand: &Errand, limits: &Limits) -> Settings {
    let names = format!("{}{}-", errand.camp.prefix(), errand.epoch.0);
    Settings::of(&errand.camp.site, limits, names, errand.revision)
}

/// Tasks that may run at a time, by the site's word and its queue's; `None` where neither says.
fn slots(site: &Site, limits: &Limits) -> Option<u32> {
    let processors = limits.slots.map(|(_, all)| all / site.threads.max(1));
    let slots = [site.max_running, limits.running, processors];
    slots.into_iter().flatten().min().map(|slots| slots.max(1))
}
