//! Grid Engine: Sun's, Son of, Univa's and Open.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use model::Span;
use roxmltree::{Document, Node};

use crate::error::{ClusterError, Refusal};
use crate::queue::{About, Array, Limits, Queue, Task, TaskId, TaskState};
use crate::sites::Site;
use crate::tasks::numbers;
use crate::template;
use crate::way::{LIMIT, Way, brief};
use crate::words::{quote, quote_all, quote_path};

const TEMPLATE: &str = include_str!("../../../deploy/gridengine/array.sh");

/// How long before its limit an allocation is told that it ends (`s_rt`).
const NOTICE: Span = Span::from_secs(30);

/// Shorter limits leave no time between the start and the notice.
const NOTICE_FROM: Span = Span::from_secs(300);

pub(crate) struct GridEngine {
    site: Site,
    way: Way,
}

impl GridEngine {
    pub(crate) fn new(site: Site, way: Way) -> Self {
        Self { site, way }
    }
}

impl Queue for GridEngine {
    fn about(&self) -> Result<About, ClusterError> {
        let script = "qstat -help | head -n 1";
        let said = self
            .way
            .ask("asking Grid Engine for its version", "qstat", script)?;
        let version = said.trim();
        if version.is_empty() {
            return Err(ClusterError::Missing {
                program: "qstat".to_owned(),
                said: "it says no version".to_owned(),
            });
        }
        Ok(About {
            name: "Grid Engine".to_owned(),
            version: version.to_owned(),
        })
    }

    fn limits(&self) -> Result<Limits, ClusterError> {
        let queue = match &self.site.queue {
            Some(queue) => format!("qconf -sq {}", quote(queue)),
            None => "qconf -sq \"$(qconf -sql | head -n 1)\"".to_owned(),
        };
        let script = format!(
            "qconf -sconf && echo == && qconf -ssconf && echo == && qconf -sql && echo == && {queue} && echo == && qstat -g c -xml"
        );
        let said = self
            .way
            .ask("asking Grid Engine for its limits", "qconf", &script)?;
        Ok(limits(&said, self.site.queue.as_deref()))
    }

    fn submit(&self, array: &Array) -> Result<TaskId, ClusterError> {
        let script = template::fill(TEMPLATE, self.site.template.as_deref(), &array.script)?;
        let script = submission(&self.site, array, &script);
        let attempt = format!("submitting {} to Grid Engine", array.name);
        let said = self.way.ask(&attempt, "qsub", &script)?;
        // Its range stands behind the number; a site's own words may stand before.
        let line = said
            .lines()
            .map(str::trim)
            .rfind(|line| !line.is_empty())
            .unwrap_or_default();
        let id = line.split('.').next().unwrap_or_default();
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
        let attempt = "asking Grid Engine for its jobs";
        // A host that fails leaves its tasks as they were: which of them nobody hears from stands with the queues.
        let script = "qstat -xml -u \"$(id -un)\" && echo == && qstat -f -qs u -s r -xml";
        let said = self.way.ask(attempt, "qstat", script)?;
        tasks(&said, prefix).map_err(|what| ClusterError::Nonsense {
            attempt: attempt.to_owned(),
            what,
            said: brief(&said),
        })
    }

    fn ended(&self, arrays: &[TaskId]) -> Result<Vec<Task>, ClusterError> {
        // It knows no job that never ran, and says so as a failure.
        let mut script = String::new();
        for id in arrays {
            let _ = writeln!(script, "qacct -j {} 2>/dev/null || :", quote(&id.array));
        }
        script.push(':');
        let said = self
            .way
            .ask("asking Grid Engine what has ended", "qacct", &script)?;
        Ok(accounts(&said))
    }

    fn delete(&self, tasks: &[TaskId]) -> Result<(), ClusterError> {
        if tasks.is_empty() {
            return Ok(());
        }
        let jobs = tasks.iter().map(TaskId::to_string);
        let attempt = "deleting jobs of Grid Engine";
        let said = self
            .way
            .run(attempt, &format!("qdel {}", quote_all(jobs)), LIMIT)?;
        // It fails where any of them is gone; of the others it has said what it does.
        let are_gone = said.stdout.lines().chain(said.stderr.lines()).all(|line| {
            [
                "does not exist",
                "do not exist",
                "has registered",
                "has deleted",
                "is already in deletion",
            ]
            .iter()
            .any(|words| line.contains(words))
                || line.trim().is_empty()
        });
        match said.code {
            Some(0) => {}
            Some(127) => return Err(said.refused(attempt, "qdel")),
            _ if are_gone => {}
            _ => {
                let words = brief(&format!("{}\n{}", said.stdout, said.stderr));
                return Err(ClusterError::Refused {
                    attempt: attempt.to_owned(),
                    refusal: Refusal::of(&words),
                    said: words,
                });
            }
        }
        self.force(tasks)
    }
}

impl GridEngine {
    /// Deletes those of the tasks that are on hosts of which the queue hears nothing: it waits for their hosts else. Only
    /// managers may, unless the queue lets everybody (`ENABLE_FORCED_QDEL`): where it refuses they stay.
    fn force(&self, deleted: &[TaskId]) -> Result<(), ClusterError> {
        let shown = self.list("")?;
        let is_deleted =
            |id: &TaskId| deleted.contains(id) || deleted.contains(&TaskId::whole(&id.array));
        let away = shown
            .iter()
            .filter(|task| matches!(task.state, TaskState::Away { .. }) && is_deleted(&task.id));
        let away: Vec<String> = away.map(|task| task.id.to_string()).collect();
        if !away.is_empty() {
            let script = format!("qdel -f {}", quote_all(away));
            self.way
                .run("deleting what has lost its host", &script, LIMIT)?;
        }
        Ok(())
    }
}

/// The script that submits an array.
fn submission(site: &Site, array: &Array, script: &str) -> String {
    let mut options: Vec<String> = Vec::new();
    let mut add = |words: &[&str]| options.extend(words.iter().map(|&word| word.to_owned()));
    add(&["-terse", "-N", &array.name, "-S", "/bin/sh", "-j", "y"]);
    add(&["-t", &format!("1-{}", array.tasks)]);
    // A host that fails gives its tasks back; one that is deleted is told before.
    add(&["-r", "y", "-notify"]);
    if let Some(running) = array.running_max {
        add(&["-tc", &running.to_string()]);
    }
    if let Some(limit) = array.time_limit {
        add(&["-l", &format!("h_rt={}", limit.0.div_ceil(1_000_000))]);
        if limit >= NOTICE_FROM {
            add(&[
                "-l",
                &format!("s_rt={}", (limit.0 - NOTICE.0).div_ceil(1_000_000)),
            ]);
        }
    }
    if let Some(bytes) = site.memory_bytes {
        add(&["-l", &format!("mem_free={}M", bytes.div_ceil(1 << 20))]);
    }
    if let (Some(environment), 2..) = (&site.parallel_environment, site.threads) {
        add(&["-pe", environment, &site.threads.to_string()]);
    }
    if let Some(queue) = &site.queue {
        add(&["-q", queue]);
    }
    if let Some(account) = &site.account {
        add(&["-P", account]);
    }
    options.extend(site.submit.iter().cloned());
    let log = quote_path(&array.log.replace('%', "$TASK_ID"));
    let end = template::END;
    let options = quote_all(options);
    format!("mkdir -p \"$(dirname {log})\" && qsub {options} -o {log} <<'{end}'\n{script}{end}\n")
}

/// What `qstat -xml` printed, of the names that begin so; behind `==` what it printed of the queues whose hosts do not answer.
fn tasks(said: &str, prefix: &str) -> Result<Vec<Task>, String> {
    let (jobs, queues) = said.split_once("\n==\n").unwrap_or((said, ""));
    let parse = |text| Document::parse(text).map_err(|error| error.to_string());
    let document = parse(jobs.trim_start())?;
    let mut away = BTreeSet::new();
    if !queues.trim().is_empty() {
        let queues = parse(queues.trim())?;
        let listed = queues.descendants();
        let listed = listed.filter(|node| node.has_tag_name("Queue-List"));
        away.extend(listed.filter_map(|queue| text(queue, "name").map(str::to_owned)));
    }
    let mut tasks = Vec::new();
    for job in document
        .descendants()
        .filter(|node| node.has_tag_name("job_list"))
    {
        let (Some(array), Some(name)) = (text(job, "JB_job_number"), text(job, "JB_name")) else {
            return Err("a job without number or name".to_owned());
        };
        if !name.starts_with(prefix) {
            continue;
        }
        let queue = text(job, "queue_name").filter(|queue| !queue.is_empty());
        let state = match queue {
            Some(queue) if away.contains(queue) => TaskState::Away {
                host: host_of(queue).to_owned(),
            },
            _ => state_of(array, text(job, "state").unwrap_or_default(), queue),
        };
        let Some(numbers) = numbers(text(job, "tasks").unwrap_or("1")) else {
            return Err(format!("tasks of job {array} that are no numbers"));
        };
        tasks.extend(numbers.into_iter().map(|number| Task {
            id: TaskId::task(array, number),
            name: name.to_owned(),
            state: state.clone(),
        }));
    }
    Ok(tasks)
}

fn text<'a>(node: Node<'a, 'a>, name: &str) -> Option<&'a str> {
    let child = node.children().find(|child| child.has_tag_name(name))?;
    child.text().map(str::trim)
}

/// A job's state is a few letters, of which the graver count first.
fn state_of(array: &str, letters: &str, queue: Option<&str>) -> TaskState {
    let has = |letter: char| letters.contains(letter);
    if has('d') {
        TaskState::Ending
    } else if has('E') {
        TaskState::Held {
            why: format!(
                "error state {letters}: `qstat -j {array}` says why, `qmod -cj {array}` lets it go on"
            ),
        }
    } else if has('h') {
        TaskState::Held {
            why: format!("held: {letters}"),
        }
    } else if has('q') || has('w') {
        TaskState::Waiting { why: String::new() }
    } else {
        TaskState::Running {
            host: queue.map_or("", host_of).to_owned(),
        }
    }
}

/// The host of a queue's part, such as `all.q@node7`.
fn host_of(queue: &str) -> &str {
    queue.split_once('@').map_or("", |(_, host)| host)
}

/// What `qacct -j` printed; of a task that was begun several times the last counts.
fn accounts(said: &str) -> Vec<Task> {
    let mut tasks: Vec<Task> = Vec::new();
    for record in said.split("====\n") {
        let value = |name: &str| {
            let line = record
                .lines()
                .find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
            line.map(str::trim)
        };
        let (Some(array), Some(name)) = (value("jobnumber"), value("jobname")) else {
            continue;
        };
        // A job that is no array says "undefined".
        let number = value("taskid")
            .and_then(|task| task.parse().ok())
            .unwrap_or(1);
        let id = TaskId::task(array, number);
        let failed = value("failed").unwrap_or("0");
        let (code, words) = failed.split_once(':').unwrap_or((failed, ""));
        let exit = value("exit_status").unwrap_or("0");
        let exit = exit.split_whitespace().next().unwrap_or("0");
        let state = match (code.trim(), exit) {
            // It went back to the queue.
            ("25", _) => continue,
            ("37", _) => TaskState::TimeLimit,
            // Killed while it ran: by whoever deleted it.
            ("100", "137" | "138" | "140" | "143") => TaskState::Deleted,
            ("0" | "100", "0") => TaskState::Done,
            ("0" | "100", exit) => TaskState::Failed {
                how: format!("exit status {exit}"),
            },
            ("22" | "23" | "24", _) => TaskState::Lost {
                how: words.trim().to_owned(),
            },
            (code, _) => TaskState::Failed {
                how: match words.trim() {
                    "" => format!("failure {code}"),
                    words => words.to_owned(),
                },
            },
        };
        tasks.retain(|task| task.id != id);
        tasks.push(Task {
            id,
            name: name.to_owned(),
            state,
        });
    }
    tasks
}

/// What `qconf` and `qstat -g c` printed, apart by `==`.
fn limits(said: &str, queue: Option<&str>) -> Limits {
    let mut parts = said.split("==\n");
    let mut part = || parts.next().unwrap_or_default();
    let (config, scheduler, queues, chosen, summary) = (part(), part(), part(), part(), part());
    fn value<'a>(text: &'a str, name: &str) -> Option<&'a str> {
        text.lines().find_map(|line| {
            let (key, value) = line.split_once(char::is_whitespace)?;
            (key == name).then(|| value.trim())
        })
    }
    // Where there is no limit it says 0.
    let number = |text, name| {
        let number = value(text, name).and_then(|digits| digits.parse().ok());
        number.filter(|&number: &u32| number > 0)
    };
    let chosen_name = value(chosen, "qname").or(queue);
    let mut queues: Vec<String> = queues.lines().map(|line| line.trim().to_owned()).collect();
    queues.retain(|queue| !queue.is_empty());
    queues.sort_by_key(|queue| Some(queue.as_str()) != chosen_name);
    let time = value(chosen, "h_rt").and_then(duration);
    Limits {
        array_tasks: number(config, "max_aj_tasks"),
        array_running: number(config, "max_aj_instances"),
        running: number(scheduler, "maxujobs"),
        jobs: number(config, "max_u_jobs").or_else(|| number(config, "max_jobs")),
        time,
        time_usual: time,
        queues,
        slots: slots(summary, chosen_name),
    }
}

/// Slots of a queue that are free, and that there are.
fn slots(summary: &str, queue: Option<&str>) -> Option<(u32, u32)> {
    let document = Document::parse(summary.trim()).ok()?;
    let queue = document.descendants().find(|node| {
        node.has_tag_name("cluster_queue_summary")
            && (queue.is_none() || text(*node, "name") == queue)
    })?;
    let number = |name| text(queue, name).and_then(|digits| digits.parse().ok());
    Some((number("available")?, number("total")?))
}

/// `hours:minutes:seconds` or seconds; `None` where there is no limit.
fn duration(text: &str) -> Option<Span> {
    // What holds on some hosts alone stands behind a comma.
    let text = text.split(',').next()?;
    let mut seconds = 0_u64;
    for part in text.split(':') {
        seconds = seconds.checked_mul(60)?.checked_add(part.parse().ok()?)?;
    }
    seconds.checked_mul(1_000_000).map(Span)
}

#[cfg(test)]
mod tests;
