//! What all queues have in common.

use std::fmt;

use model::Span;

use crate::error::ClusterError;
use crate::gridengine::GridEngine;
use crate::processes::Processes;
use crate::sites::{Kind, Site};
use crate::slurm::Slurm;
use crate::way::Way;

/// A site's queue.
///
/// Every call runs one script there, however many tasks it is about.
pub trait Queue: Send {
    /// What the queue is, and its version.
    fn about(&self) -> Result<About, ClusterError>;

    /// What it lets one user have, as far as it says.
    fn limits(&self) -> Result<Limits, ClusterError>;

    /// Submits an array. Where that fails it may have been taken nevertheless: [`Queue::list`] shows it by its name.
    fn submit(&self, array: &Array) -> Result<TaskId, ClusterError>;

    /// All tasks of this user whose names begin so: those that wait and run, and those that have ended lately, as far
    /// as the queue still shows them.
    fn list(&self, prefix: &str) -> Result<Vec<Task>, ClusterError>;

    /// What became of arrays that [`Queue::list`] shows no more, as far as the queue keeps it.
    fn ended(&self, arrays: &[TaskId]) -> Result<Vec<Task>, ClusterError>;

    /// Deletes tasks, or whole arrays; those that are gone already are no error.
    fn delete(&self, tasks: &[TaskId]) -> Result<(), ClusterError>;
}

/// The queue of a site; `farm` is the folder there that holds what this farm has at it.
pub fn open(site: &Site, way: Way, farm: &str) -> Box<dyn Queue> {
    match site.kind {
        Kind::Slurm => Box::new(Slurm::new(site.clone(), way)),
        Kind::GridEngine => Box::new(GridEngine::new(site.clone(), way)),
        Kind::Ssh | Kind::Local => Box::new(Processes::new(site, way, farm.to_owned())),
    }
}

/// What a queue is.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct About {
    /// Such as `Slurm`.
    pub name: String,
    /// Its version, as it says it.
    pub version: String,
}

/// What a queue lets one user have; `None` where it sets no limit or does not say.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Limits {
    /// Most tasks of one array (`MaxArraySize`, `max_aj_tasks`).
    pub array_tasks: Option<u32>,
    /// Tasks of one array that run at a time (`max_aj_instances`).
    pub array_running: Option<u32>,
    /// Tasks of one user that run at a time (`maxujobs`), or processors where there is no queue.
    pub running: Option<u32>,
    /// Jobs that one user, or everybody, may have in the queue (`max_u_jobs`, `MaxJobCount`).
    pub jobs: Option<u32>,
    /// How long a task may run at most.
    pub time: Option<Span>,
    /// How long one may run that asks for no time.
    pub time_usual: Option<Span>,
    /// Partitions or queues that there are, the usual one first.
    pub queues: Vec<String>,
    /// Slots that are free now, and that there are.
    pub slots: Option<(u32, u32)>,
}

/// An array to submit.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Array {
    /// Its name, which names the farm: letters, digits, `-` and `_`, a letter first.
    pub name: String,
    /// How many tasks, numbered from 1.
    pub tasks: u32,
    /// Most of them that run at a time.
    pub running_max: Option<u32>,
    /// What each runs: a script of POSIX shell that finds its number in `$FLYBY_TASK`.
    pub script: String,
    /// How long each may run.
    pub time_limit: Option<Span>,
    /// Where each writes what it says, a path there in which `%` stands for its number.
    pub log: String,
}

/// Names a task; without a number all tasks of an array.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct TaskId {
    /// The queue's id of the array.
    pub array: String,
    /// The task's number in it.
    pub task: Option<u32>,
}

impl TaskId {
    /// The whole array.
    pub fn whole(array: impl Into<String>) -> Self {
        Self {
            array: array.into(),
            task: None,
        }
    }

    /// One task.
    pub fn task(array: impl Into<String>, task: u32) -> Self {
        Self {
            array: array.into(),
            task: Some(task),
        }
    }
}

impl fmt::Display for TaskId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.task {
            Some(task) => write!(f, "{}.{task}", self.array),
            None => write!(f, "{}", self.array),
        }
    }
}

/// A task, as the queue shows it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Task {
    /// Which.
    pub id: TaskId,
    /// The array's name.
    pub name: String,
    /// How it stands.
    pub state: TaskState,
}

/// How a task stands.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum TaskState {
    /// It waits for its turn.
    Waiting {
        /// Why, as the queue says it; empty where it does not.
        why: String,
    },
    /// It waits, and will not run until somebody does something.
    Held {
        /// Why, as the queue says it.
        why: String,
    },
    /// It runs.
    Running {
        /// On which host; empty where the queue does not say.
        host: String,
    },
    /// The queue shows it as running, on a host of which it hears nothing any more.
    Away {
        /// Which.
        host: String,
    },
    /// It is being ended.
    Ending,
    /// It ended by itself, and well.
    Done,
    /// It failed.
    Failed {
        /// How, as the queue says it.
        how: String,
    },
    /// It ran for as long as it may, and was killed: the thesis's lockout.
    TimeLimit,
    /// Somebody deleted it.
    Deleted,
    /// Its host failed, or the queue gave its place to another.
    Lost {
        /// How, as the queue says it.
        how: String,
    },
}

impl TaskState {
    /// Whether the queue counts it as waiting or running.
    pub fn is_live(&self) -> bool {
        matches!(
            self,
            Self::Waiting { .. }
                | Self::Held { .. }
                | Self::Running { .. }
                | Self::Away { .. }
                | Self::Ending
        )
    }
}
