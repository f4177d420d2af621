//! Slurm.
//!
//! `squeue` is asked for a few columns and not for JSON: as JSON it shows every job of every user in some versions,
//! whatever is asked (22.05 does), with a hundred fields each; the columns are the same in all versions.

use std::fmt::Write as _;

use model::Span;

use crate::error::ClusterError;
use crate::queue::{About, Array, Limits, Queue, Task, TaskId, TaskState};
use crate::sites::Site;
use crate::tasks::numbers;
use crate::template;
use crate::way::{Way, brief};
use crate::words::{quote, quote_all, quote_path};

const TEMPLATE: &str = include_str!("../../../deploy/slurm/array.sh");

/// How long before its limit an allocation is told that it ends. Slurm may tell it up to a minute earlier.
const NOTICE: Span = Span::from_secs(60);

/// Shorter limits leave no time between the notice and the start.
const NOTICE_FROM: Span = Span::from_secs(600);

pub(crate) struct Slurm {
    site: Site,
    way: Way,
}

impl Slurm {
    pub(crate) fn new(site: Site, way: Way) -> Self {
        Self { site, way }
    }
}

impl Queue for Slurm {
    fn about(&self) -> Result<About, ClusterError> {
        let said = self
            .way
            .ask("asking Slurm for its version", "sinfo", "sinfo --version")?;
        Ok(About {
            name: "Slurm".to_owned(),
            version: said
                .trim()
                .trim_start_matches("slurm-wlm")
                .trim_start_matches("slurm")
                .trim()
                .to_owned(),
        })
    }

    fn limits(&self) -> Result<Limits, ClusterError> {
        // Accounting may be off; its limits are then none.
        let script = "scontrol show config && echo == && scontrol show partition --oneliner && echo == && \
                      sinfo -h -o '%R|%C' && echo == && \
                      { sacctmgr -n -P show assoc user=\"$(id -un)\" format=MaxJobs,MaxSubmit 2>/dev/null || :; }";
        let said = self
            .way
            .ask("asking Slurm for its limits", "scontrol", script)?;
        Ok(limits(&said, self.site.queue.as_deref()))
    }

    fn submit(&self, array: &Array) -> Result<TaskId, ClusterError> {
        let script = template::fill(TEMPLATE, self.site.template.as_deref(), &array.script)?;
        let script = submission(&self.site, array, &script);
        let attempt = format!("submitting {} to Slurm", array.name);
        let said = self.way.ask(&attempt, "sbatch", &script)?;
        // The cluster's name may stand behind the number.
        let id = said.trim().split(';').next().unwrap_or_default();
        match !id.is_empty() && id.chars().all(|digit| digit.is_ascii_digit()) {
            true => Ok(TaskId::whole(id)),
            false => Err(ClusterError::Nonsense {
                attempt,
                what: "no number of a job".to_owned(),
                said: brief(&said),
            }),
        }
    }

    fn list(&self, prefix: &str) -> Result<Vec<Task>, ClusterError> {
        let script = "SLURM_BITSTR_LEN=0 squeue -h -t all -u \"$(id -un)\" -o '%F|%K|%T|%r|%N|%j'";
        let said = self
            .way
            .ask("asking Slurm for its jobs", "squeue", script)?;
        Ok(tasks(&said, prefix))
    }

    fn ended(&self, arrays: &[TaskId]) -> Result<Vec<Task>, ClusterError> {
        let jobs: Vec<_> = arrays.iter().map(|id| id.array.as_str()).collect();
        // Without accounting nobody knows.
        let script = format!(
            "sacct -n -P -X -j {} -o JobID,State,JobName 2>/dev/null || :",
            quote(&jobs.join(","))
        );
        let said = self
            .way
            .ask("asking Slurm what has ended", "sacct", &script)?;
        Ok(accounts(&said))
    }

    fn delete(&self, tasks: &[TaskId]) -> Result<(), ClusterError> {
        if tasks.is_empty() {
            return Ok(());
        }
        let jobs = tasks.iter().map(|id| match id.task {
            Some(task) => format!("{}_{task}", id.array),
            None => id.array.clone(),
        });
        let script = format!("scancel --quiet {}", quote_all(jobs));
        self.way.ask("deleting jobs of Slurm", "scancel", &script)?;
        Ok(())
    }
}

/// The script that submits an array.
fn submission(site: &Site, array: &Array, script: &str) -> String {
    let tasks = match array.running_max {
        Some(running) => format!("1-{}%{running}", array.tasks),
        None => format!("1-{}", array.tasks),
    };
    let mut options = vec![
        "--parsable".to_owned(),
        format!("--job-name={}", array.name),
        format!("--array={tasks}"),
        format!("--cpus-per-task={}", site.threads),
        "--ntasks=1".to_owned(),
        // A node that fails gives its tasks back to the queue.
        "--requeue".to_owned(),
        "--open-mode=append".to_owned(),
    ];
    if let Some(limit) = array.time_limit {
        // Its grain is a minute.
        options.push(format!("--time={}", limit.0.div_ceil(60_000_000)));
        if limit >= NOTICE_FROM {
            options.push(format!("--signal=B:TERM@{}", NOTICE.0 / 1_000_000));
        }
    }
    if let Some(bytes) = site.memory_bytes {
        options.push(format!("--mem={}M", bytes.div_ceil(1 << 20)));
    }
    options.extend(
        site.queue
            .iter()
            .map(|queue| format!("--partition={queue}")),
    );
    options.extend(
        site.account
            .iter()
            .map(|account| format!("--account={account}")),
    );
    options.extend(site.submit.iter().cloned());
    let log = quote_path(&array.log.replace('%', "%a"));
    let end = template::END;
    let mut text = format!("mkdir -p \"$(dirname {log})\" && ");
    let options = quote_all(options);
    let _ = write!(
        text,
        "sbatch {options} --output={log} <<'{end}'\n{script}{end}\n"
    );
    text
}

/// What `squeue` printed, of the names that begin so.
fn tasks(said: &str, prefix: &str) -> Vec<Task> {
    let mut tasks = Vec::new();
    for line in said.lines() {
        // The name is last: it alone may hold anything.
        let fields: Vec<_> = line.splitn(6, '|').collect();
        let [array, numbered, state, reason, host, name] = fields[..] else {
            continue;
        };
        if !name.starts_with(prefix) {
            continue;
        }
        let state = state_of(state, reason, host);
        let ids: Vec<_> = match numbers(numbered) {
            Some(numbers) => numbers
                .into_iter()
                .map(|number| TaskId::task(array, number))
                .collect(),
            // An array that was cancelled before any of it began.
            None => vec![TaskId::whole(array)],
        };
        tasks.extend(ids.into_iter().map(|id| Task {
            id,
            name: name.to_owned(),
            state: state.clone(),
        }));
    }
    tasks
}

/// What `sacct` printed.
fn accounts(said: &str) -> Vec<Task> {
    let task = |line: &str| {
        let mut fields = line.splitn(3, '|');
        let (id, state, name) = (fields.next()?, fields.next()?, fields.next()?);
        let (array, number) = id.split_once('_')?;
        // Who cancelled it stands behind the state.
        let state = state.split(' ').next()?;
        Some(Task {
            id: TaskId::task(array, number.parse().ok()?),
            name: name.to_owned(),
            state: state_of(state, "", ""),
        })
    };
    said.lines().filter_map(task).collect()
}

fn state_of(state: &str, reason: &str, host: &str) -> TaskState {
    let how = || match reason {
        "" | "None" => state.to_owned(),
        reason => format!("{state} ({reason})"),
    };
    match state {
        "PENDING" | "REQUEUED" | "RESIZING" | "REQUEUE_FED" => match reason {
            "JobHeldUser"
            | "JobHeldAdmin"
            | "BadConstraints"
            | "DependencyNeverSatisfied"
            | "InvalidAccount"
            | "InvalidQOS"
            | "PartitionDown"
            | "PartitionInactive" => TaskState::Held {
                why: reason.to_owned(),
            },
            "None" => TaskState::Waiting { why: String::new() },
            _ => TaskState::Waiting {
                why: reason.to_owned(),
            },
        },
        "REQUEUE_HOLD" | "SPECIAL_EXIT" => TaskState::Held { why: how() },
        "RUNNING" | "CONFIGURING" | "SUSPENDED" | "STOPPED" | "SIGNALING" | "STAGE_OUT" => {
            TaskState::Running {
                host: host.to_owned(),
            }
        }
        "COMPLETING" => TaskState::Ending,
        "COMPLETED" => TaskState::Done,
        "TIMEOUT" | "DEADLINE" => TaskState::TimeLimit,
        "CANCELLED" | "REVOKED" => TaskState::Deleted,
        "NODE_FAIL" | "PREEMPTED" | "BOOT_FAIL" => TaskState::Lost { how: how() },
        _ => TaskState::Failed { how: how() },
    }
}

/// What `scontrol`, `sinfo` and `sacctmgr` printed, apart by `==`.
fn limits(said: &str, queue: Option<&str>) -> Limits {
    let mut parts = said.split("==\n");
    let mut part = || parts.next().unwrap_or_default();
    let (config, partitions, free, account) = (part(), part(), part(), part());
    let number = |name: &str| {
        let line = config
            .lines()
            .find(|line| line.split('=').next().map(str::trim) == Some(name))?;
        line.split_once('=')?.1.trim().parse::<u32>().ok()
    };
    let mut partitions: Vec<Partition> = partitions.lines().filter_map(Partition::read).collect();
    partitions.sort_by_key(|partition| !partition.usual);
    let chosen = match queue {
        Some(queue) => partitions.iter().find(|partition| partition.name == queue),
        None => partitions.first(),
    };
    let slots = free.lines().find_map(|line| {
        let (name, counts) = line.split_once('|')?;
        chosen.filter(|chosen| chosen.name == name)?;
        // Allocated, idle, other, total.
        let counts: Vec<u32> = counts
            .split('/')
            .filter_map(|count| count.trim().parse().ok())
            .collect();
        Some((*counts.get(1)?, *counts.get(3)?))
    });
    let (running, submitted) = account
        .lines()
        .find_map(|line| line.split_once('|'))
        .unwrap_or(("", ""));
    Limits {
        // It counts from 0, and ours from 1.
        array_tasks: number("MaxArraySize").map(|size| size.saturating_sub(1)),
        array_running: None,
        running: running.trim().parse().ok(),
        jobs: submitted
            .trim()
            .parse()
            .ok()
            .or_else(|| number("MaxJobCount")),
        time: chosen.and_then(|partition| partition.time_max),
        time_usual: chosen.and_then(|partition| partition.time_usual.or(partition.time_max)),
        queues: partitions
            .iter()
            .map(|partition| partition.name.clone())
            .collect(),
        slots,
    }
}

struct Partition {
    name: String,
    usual: bool,
    time_max: Option<Span>,
    time_usual: Option<Span>,
}

impl Partition {
    /// A line of `scontrol show partition --oneliner`.
    fn read(line: &str) -> Option<Self> {
        let value = |name: &str| {
            let mut words = line.split_whitespace();
            words.find_map(|word| word.strip_prefix(name)?.strip_prefix('='))
        };
        Some(Self {
            name: value("PartitionName")?.to_owned(),
            usual: value("Default") == Some("YES"),
            time_max: value("MaxTime").and_then(duration),
            time_usual: value("DefaultTime").and_then(duration),
        })
    }
}

/// `days-hours:minutes:seconds` and its shorter forms; `None` where there is no limit.
fn duration(text: &str) -> Option<Span> {
    let (days, rest) = match text.split_once('-') {
        Some((days, rest)) => (days.parse::<u64>().ok()?, rest),
        None => (0, text),
    };
    let parts: Option<Vec<u64>> = rest.split(':').map(|part| part.parse().ok()).collect();
    let seconds = match (days, parts?[..].as_ref()) {
        (0, &[minutes]) => minutes.checked_mul(60)?,
        (0, &[minutes, seconds]) => minutes.checked_mul(60)?.checked_add(seconds)?,
        (_, &[hours]) => hours.checked_mul(3_600)?,
        (_, &[hours, minutes]) => hours
            .checked_mul(3_600)?
            .checked_add(minutes.checked_mul(60)?)?,
        (_, &[hours, minutes, seconds]) => hours
            .checked_mul(3_600)?
            .checked_add(minutes.checked_mul(60)?)?
            .checked_add(seconds)?,
        _ => return None,
    };
    let seconds = days.checked_mul(86_400)?.checked_add(seconds)?;
    seconds.checked_mul(1_000_000).map(Span)
}

#[cfg(test)]
mod tests;
