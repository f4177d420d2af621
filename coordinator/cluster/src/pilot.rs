//! Pilot mode: how many allocations a site should have, decided from what was seen. A function of its state and an
//! observation; whoever drives it asks the queue, and does what it says.
//!
//! What always holds: nothing is submitted before the queue was looked at, so that what an earlier coordinator left there
//! counts; no more is submitted than the limits allow; after a refusal or a failure nothing is submitted for a while,
//! longer each time.

mod script;
#[cfg(test)]
mod tests;
mod times;

use std::collections::{BTreeMap, BTreeSet};

use model::{Span, Timestamp};

use crate::queue::{Limits, Task, TaskId, TaskState};
use crate::sites::{Cancelled, Kind, Site};

pub use script::{Dials, script, token_file};
pub use times::Times;

/// Most allocations of a site that sets no limit.
const ALLOCATIONS_MAX: u32 = 1_000;

/// Tasks of an array where neither the site nor its queue says how many there may be.
const ARRAY_TASKS: u32 = 1_000;

/// Allocations while nobody knows how much there is to do.
const UNMEASURED_MAX: u32 = 4;

/// An allocation is worth its start where each of its threads has so much to do.
const USEFUL: Span = Span::from_secs(30);

/// How long nothing is submitted after the first failure; twice as long after each further one…
const PAUSE_FIRST: Span = Span::from_secs(10);

/// …and never longer than this.
const PAUSE_LONGEST: Span = Span::from_secs(900);

/// Arrays whose end is asked for at a time.
const LOOKED_UP_MAX: usize = 64;

/// What does not change while a coordinator runs.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Settings {
    /// What names of arrays begin with; a number follows. It differs from start to start, so that no name comes twice.
    pub names: String,
    /// Render threads of an allocation.
    pub threads: u32,
    /// Most allocations that may run, as the site says.
    pub running_max: Option<u32>,
    /// Most that the queue lets run.
    pub queue_running_max: Option<u32>,
    /// Allocations beyond those, that wait in the queue.
    pub ahead: u32,
    /// Most tasks of an array.
    pub array_max: u32,
    /// What becomes of an allocation that somebody deleted.
    pub cancelled: Cancelled,
    /// How long an allocation may run.
    pub times: Times,
}

impl Settings {
    /// Those of a site, by what it and its queue say.
    pub fn of(site: &Site, limits: &Limits, names: String) -> Self {
        let array_max = [site.max_array_size, limits.array_tasks];
        // Where nothing holds back what is too much, there are no more than have processors.
        let processors = limits
            .slots
            .map(|(_, all)| (all / site.threads.max(1)).max(1));
        let running_max = match site.kind {
            Kind::Slurm | Kind::GridEngine => site.max_running,
            Kind::Ssh | Kind::Local => site.max_running.or(processors),
        };
        Self {
            names,
            threads: site.threads,
            running_max,
            queue_running_max: limits.running,
            ahead: site.ahead,
            array_max: array_max.into_iter().flatten().min().unwrap_or(ARRAY_TASKS),
            cancelled: site.cancelled,
            times: Times {
                asked: site.time_limit,
                usual: limits.time_usual,
                most: limits.time,
            },
        }
    }
}

/// What the farm wants.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Wanted {
    /// Threads that could be of use, at most.
    pub squares: u64,
    /// Of those, the ones of which nobody knows how long they take.
    pub unmeasured: u64,
    /// How long one thread takes over the others.
    pub time: Span,
    /// How long it took over the dearest block that was measured.
    pub dearest: Span,
    /// Threads of workers that are no allocations of this site.
    pub others: u64,
}

/// What to do now.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Action {
    /// Submit an array, and say what became of it: [`Pilot::submitted`] or [`Pilot::refused`].
    Submit {
        /// Its name.
        name: String,
        /// Its tasks.
        tasks: u32,
    },
    /// Delete what nobody needs.
    Delete(Vec<TaskId>),
    /// Ask what became of these arrays, and say it: [`Pilot::have_ended`].
    LookUp(Vec<TaskId>),
}

/// How a site stands, for people.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Standing {
    /// Allocations that wait in the queue.
    pub waiting: u32,
    /// Allocations that run.
    pub running: u32,
    /// Allocations that there should be.
    pub wanted: u32,
    /// What is wrong, and what to do; nothing where nothing is.
    pub trouble: Option<String>,
}

/// The state of one site.
#[derive(Clone, Debug)]
pub struct Pilot {
    settings: Settings,
    number: u64,
    /// Allocations that have not been seen to end.
    open: BTreeMap<TaskId, Shown>,
    /// Those that were deleted from here.
    deleted: BTreeSet<TaskId>,
    failures: u32,
    quiet_until: Timestamp,
    stopped: bool,
    standing: Standing,
    wanted: Wanted,
    /// How many times in a row allocations ended when nothing of what is wanted had been measured.
    barren: u32,
    /// Whether an allocation has ended well since that was counted last.
    has_ended: bool,
    /// The allocation that failed last, and of which nobody has read what it said.
    failed: Option<(String, u32)>,
}

/// Whether the queue still shows an allocation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Shown {
    Yes,
    No,
}

/// How an allocation ended, as far as it matters.
enum End {
    Well,
    Failed(String),
    Deleted,
}

impl Pilot {
    /// A site of which nothing was seen.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            number: 0,
            open: BTreeMap::new(),
            deleted: BTreeSet::new(),
            failures: 0,
            quiet_until: Timestamp(0),
            stopped: false,
            standing: Standing::default(),
            wanted: Wanted::default(),
            barren: 0,
            has_ended: false,
            failed: None,
        }
    }

    /// The array and the number of an allocation that failed, once: what it wrote may say why.
    pub fn take_failed(&mut self) -> Option<(String, u32)> {
        self.failed.take()
    }

    /// What an allocation that failed had to say.
    pub fn has_said(&mut self, words: &str) {
        if let Some(trouble) = self.standing.trouble.as_mut().filter(|_| !words.is_empty()) {
            trouble.push_str(": ");
            trouble.push_str(words);
        }
    }

    /// The site's settings, by what its queue says now.
    pub fn settle(&mut self, settings: Settings) {
        self.settings = settings;
    }

    /// How it stands.
    pub fn standing(&self) -> &Standing {
        &self.standing
    }

    /// Notes that nothing is to do, and that nothing of ours is there.
    pub fn rests(&mut self) {
        let standing = &mut self.standing;
        (standing.waiting, standing.running, standing.wanted) = (0, 0, 0);
    }

    /// How long the next allocation may run; `None`: as long as the queue lets it.
    pub fn time_limit(&self) -> Option<Span> {
        self.settings.times.limit(self.wanted.dearest, self.barren)
    }

    /// Whether the latest allocations failed, or submissions were refused.
    pub fn is_failing(&self) -> bool {
        self.failures > 0
    }

    /// Looks at what the queue shows of ours, and says what to do. Actions are done in order.
    ///
    /// Where it is to be asked what became of some, that is all: it decides whether others take their place, and so this is asked
    /// again afterwards.
    pub fn observe(&mut self, now: Timestamp, shown: &[Task], wanted: Wanted) -> Vec<Action> {
        self.wanted = wanted;
        if let Some(asked) = self.follow(now, shown) {
            return vec![asked];
        }
        let mut actions = Vec::new();
        let has_ended = std::mem::take(&mut self.has_ended);
        self.barren = match wanted.squares > 0 && wanted.unmeasured == wanted.squares {
            true => self.barren.saturating_add(u32::from(has_ended)),
            false => 0,
        };
        let count = |of: &dyn Fn(&TaskState) -> bool| {
            let count = shown.iter().filter(|task| of(&task.state)).count();
            u32::try_from(count).unwrap_or(u32::MAX)
        };
        let waits =
            |state: &TaskState| matches!(state, TaskState::Waiting { .. } | TaskState::Held { .. });
        let waiting = count(&waits);
        // Who is on a host that is gone renders nothing: another takes its place.
        let running = count(&|state| matches!(state, TaskState::Running { .. }));
        let target = self.target(wanted);
        self.standing.waiting = waiting;
        self.standing.running = running;
        self.standing.wanted = target;
        self.note_held(shown);
        if self.standing.trouble.is_none() {
            self.standing.trouble = self.settings.times.too_short(wanted.dearest);
        }
        let live = waiting.saturating_add(running);
        if live < target {
            let missing = (target - live).saturating_sub(self.unexplained(shown));
            actions.extend(self.submit(now, missing));
        } else {
            // What is wanted goes up and down a little; all of it goes where nothing is left to do.
            let slack = if target == 0 { 0 } else { self.settings.ahead };
            let surplus = live - target;
            let surplus = if surplus > slack { surplus } else { 0 };
            let mut queued: Vec<TaskId> = shown
                .iter()
                .filter(|task| waits(&task.state))
                .map(|task| task.id.clone())
                .collect();
            // The latest first: the others are nearer to their turn.
            queued.reverse();
            queued.truncate(usize::try_from(surplus).unwrap_or(usize::MAX));
            if !queued.is_empty() {
                self.deleted.extend(queued.iter().cloned());
                actions.push(Action::Delete(queued));
            }
        }
        actions
    }

    /// An array was submitted.
    pub fn submitted(&mut self, array: &TaskId, tasks: u32) {
        for task in 1..=tasks {
            self.open
                .insert(TaskId::task(&array.array, task), Shown::Yes);
        }
        self.standing.trouble = None;
        self.standing.waiting = self.standing.waiting.saturating_add(tasks);
    }

    /// A submission was refused, in these words.
    pub fn refused(&mut self, now: Timestamp, words: String) {
        self.fail(now, words);
    }

    /// What the queue keeps of arrays that it does not show any more.
    pub fn have_ended(&mut self, now: Timestamp, arrays: &[TaskId], kept: &[Task]) {
        for task in kept {
            if self.open.remove(&task.id).is_some() {
                self.end(now, task);
            }
        }
        // Nobody knows what became of the others: they are gone, which is all that matters.
        self.open.retain(|id, shown| {
            let asked = arrays.iter().any(|array| array.array == id.array);
            !(asked && *shown == Shown::No)
        });
        let open = &self.open;
        self.deleted.retain(|id| open.contains_key(id));
    }

    /// Notes what has ended; asks for what the queue shows no more.
    fn follow(&mut self, now: Timestamp, shown: &[Task]) -> Option<Action> {
        let mut states: BTreeMap<&TaskId, &Task> = BTreeMap::new();
        for task in shown {
            states.insert(&task.id, task);
            if task.state.is_live() {
                self.open.insert(task.id.clone(), Shown::Yes);
            }
        }
        let mut ended = Vec::new();
        let mut missing = BTreeSet::new();
        for (id, still) in &mut self.open {
            // An array that was deleted before any of it began is shown as one.
            let whole = TaskId::whole(&id.array);
            match states.get(id).or_else(|| states.get(&whole)) {
                Some(task) if task.state.is_live() => {}
                Some(task) => ended.push(Task {
                    id: id.clone(),
                    name: task.name.clone(),
                    state: task.state.clone(),
                }),
                None => {
                    *still = Shown::No;
                    missing.insert(whole);
                }
            }
        }
        for task in &ended {
            self.open.remove(&task.id);
            self.end(now, task);
        }
        let missing: Vec<TaskId> = missing.into_iter().take(LOOKED_UP_MAX).collect();
        (!missing.is_empty()).then_some(Action::LookUp(missing))
    }

    fn end(&mut self, now: Timestamp, task: &Task) {
        let ours = self.deleted.remove(&task.id);
        let end = match &task.state {
            TaskState::Failed { how } => End::Failed(how.clone()),
            TaskState::Deleted if !ours => End::Deleted,
            // A time limit and a lost host are the scheduler's to mend: what is missing is rendered elsewhere.
            _ => End::Well,
        };
        match end {
            End::Well => {
                self.has_ended = true;
                self.failures = 0;
                self.standing.trouble = None;
            }
            // Of tasks that fail together the first tells.
            End::Failed(_) if self.quiet_until > now => {}
            End::Failed(how) => {
                self.fail(
                    now,
                    format!("allocation {} ({}) failed: {how}", task.id, task.name),
                );
                self.failed = task.id.task.map(|number| (task.name.clone(), number));
            }
            End::Deleted => self.was_deleted(now, task),
        }
    }

    fn was_deleted(&mut self, now: Timestamp, task: &Task) {
        let whom = format!("somebody deleted allocation {} ({})", task.id, task.name);
        match self.settings.cancelled {
            Cancelled::Stop => {
                self.stopped = true;
                self.standing.trouble = Some(format!(
                    "{whom}: nothing is submitted there until the coordinator is started again (`cancelled = \"stop\"`)"
                ));
            }
            Cancelled::Replace if self.quiet_until > now => {}
            Cancelled::Replace => self.fail(
                now,
                format!("{whom}: another takes its place after a while"),
            ),
        }
    }

    /// Notes a failure, and submits nothing for a while.
    fn fail(&mut self, now: Timestamp, words: String) {
        let times = 1 << self.failures.min(10);
        self.failures = self.failures.saturating_add(1);
        self.quiet_until = now + PAUSE_FIRST.times(times).min(PAUSE_LONGEST);
        self.standing.trouble = Some(words);
    }

    /// What waits for somebody's help is said, unless worse is.
    fn note_held(&mut self, shown: &[Task]) {
        let held = shown.iter().find_map(|task| match &task.state {
            TaskState::Held { why } => {
                Some(format!("allocation {} waits for help: {why}", task.id))
            }
            TaskState::Away { host } => Some(format!(
                "allocation {} is on {host}, of which the queue hears nothing: another takes its place",
                task.id
            )),
            _ => None,
        });
        if self.failures == 0 && !self.stopped {
            self.standing.trouble = held;
        }
    }

    /// Allocations that are being ended, where their deletion would stop the site: none takes their place before that is known.
    /// Elsewhere they are not waited for, since on a host that is gone that may take long.
    fn unexplained(&self, shown: &[Task]) -> u32 {
        let waits = self.settings.cancelled == Cancelled::Stop;
        let ending = |task: &&Task| waits && task.state == TaskState::Ending;
        u32::try_from(shown.iter().filter(ending).count()).unwrap_or(u32::MAX)
    }

    fn submit(&mut self, now: Timestamp, tasks: u32) -> Option<Action> {
        if tasks == 0 || self.stopped || now < self.quiet_until {
            return None;
        }
        // After a failure one shows whether it is over.
        let most = if self.failures > 0 {
            1
        } else {
            self.settings.array_max.max(1)
        };
        self.number += 1;
        Some(Action::Submit {
            name: format!("{}{}", self.settings.names, self.number),
            tasks: tasks.min(most),
        })
    }

    /// How many allocations there should be, those that run among them.
    fn target(&self, wanted: Wanted) -> u32 {
        let threads = u64::from(self.settings.threads.max(1));
        let measured = wanted.time.0.div_ceil(USEFUL.0);
        let few = u64::from(UNMEASURED_MAX).saturating_mul(threads);
        let useful = measured.saturating_add(wanted.unmeasured.min(few));
        let useful = useful.min(wanted.squares).saturating_sub(wanted.others);
        let allocations = u32::try_from(useful.div_ceil(threads)).unwrap_or(u32::MAX);
        allocations.min(self.most())
    }

    /// Most allocations, those that wait among them: what the queue holds back by itself may wait there.
    fn most(&self) -> u32 {
        let Settings {
            running_max,
            queue_running_max,
            ahead,
            ..
        } = self.settings;
        let most = match (running_max, queue_running_max) {
            (Some(ours), Some(queue)) if ours < queue => ours,
            (Some(ours), None) => ours,
            (_, Some(queue)) => queue.saturating_add(ahead),
            (None, None) => ALLOCATIONS_MAX,
        };
        most.min(ALLOCATIONS_MAX)
    }
}
