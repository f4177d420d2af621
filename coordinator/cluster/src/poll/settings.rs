//! What does not change of a polled site while a coordinator runs.

use model::{Revision, Span};

use crate::queue::Limits;
use crate::sites::{Kind, Site};

/// Tasks of an array where neither the site nor its queue says how many there may be.
pub const ARRAY_TASKS: u32 = 1_000;

/// What does not change while a coordinator runs.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Settings {
    /// What names of arrays begin with; a number follows. It differs from start to start, so that no name comes twice.
    pub names: String,
    /// The renderer's revision.
    pub revision: Revision,
    /// Render threads of a task.
    pub threads: u32,
    /// Most tasks of an array that run at a time; on hosts without a queue, of all arrays.
    pub running_max: Option<u32>,
    /// Most tasks of an array.
    pub array_max: u32,
    /// Images that wait beyond the one that runs (thesis §C.3.5).
    pub ahead: u32,
    /// How long a task may run, by the site's word.
    pub time_limit: Option<Span>,
    /// The queue's own limit.
    pub time_max: Option<Span>,
}

impl Settings {
    /// Those of a site, by what it and its queue say.
    pub fn of(site: &Site, limits: &Limits, names: String, revision: Revision) -> Self {
        let array_max = [site.max_array_size, limits.array_tasks];
        let processors = limits
            .slots
            .map(|(_, all)| (all / site.threads.max(1)).max(1));
        Self {
            names,
            revision,
            threads: site.threads,
            running_max: match site.kind {
                Kind::Slurm | Kind::GridEngine => site.max_running,
                Kind::Ssh | Kind::Local => site.max_running.or(processors),
            },
            array_max: array_max.into_iter().flatten().min().unwrap_or(ARRAY_TASKS),
            ahead: site.ahead,
            time_limit: site.time_limit,
            time_max: limits.time,
        }
    }
}
