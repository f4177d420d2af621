//! Hosts without a queue: processes that are started detached, and found again by files.
//!
//! ```text
//! FARM/run/NAME/count, script, boot     of an array
//! FARM/run/NAME/PID.runner              who takes tasks; as many as may run at a time
//! FARM/run/NAME/TASK.claim, .pid, .exit, .deleted
//! FARM/run/slot.NUMBER                  locks: of arrays with a limit no more tasks run at a time than it says, together
//! ```
//!
//! A process counts as ours where its number, its start time and the boot of its machine are those that were written
//! down: nobody else's is ever ended.

use std::fmt::Write as _;
use std::path::PathBuf;

use crate::error::ClusterError;
use crate::queue::{About, Array, Limits, Queue, Task, TaskId, TaskState};
use crate::sites::Site;
use crate::template;
use crate::way::Way;
use crate::words::{quote, quote_all, quote_path};

/// `deploy/ssh/runner.sh`.
const RUNNER: &str = include_str!("../../../deploy/ssh/runner.sh");

/// What the scripts below share: whether the process of a file lives.
const ALIVE: &str = r#"
boot=$(cat /proc/sys/kernel/random/boot_id)
alive() { # FILE: sets pid
    [ -r "$1" ] && read -r pid start <"$1" || return 1
    stat=$(sed -n 's/^.*) //p' "/proc/$pid/stat" 2>/dev/null)
    # shellcheck disable=SC2086
    set -- $stat
    [ "${20:-}" = "$start" ] && [ "$1" != Z ]
}
runs() { # whether anybody takes tasks in this folder
    [ "$(cat boot)" = "$boot" ] || return 1
    for r in *.runner; do alive "$r" && return 0; done
    return 1
}
"#;

const TEMPLATE: &str = include_str!("../../../deploy/ssh/array.sh");

/// Arrays of which is kept what became of them.
const KEPT_MAX: u32 = 50;

pub(crate) struct Processes {
    template: Option<PathBuf>,
    way: Way,
    farm: String,
}

impl Processes {
    pub(crate) fn new(site: &Site, way: Way, farm: String) -> Self {
        Self {
            template: site.template.clone(),
            way,
            farm,
        }
    }

    fn run_folder(&self) -> String {
        quote_path(&format!("{}/run", self.farm))
    }
}

impl Queue for Processes {
    fn about(&self) -> Result<About, ClusterError> {
        let script = "[ -r /proc/self/stat ] && uname -sr";
        let said = self.way.ask("looking at the host", "uname", script)?;
        Ok(About {
            name: "processes".to_owned(),
            version: said.trim().to_owned(),
        })
    }

    fn limits(&self) -> Result<Limits, ClusterError> {
        let said = self
            .way
            .ask("counting processors", "nproc", "nproc && cat /proc/loadavg")?;
        let mut lines = said.lines();
        let processors = lines
            .next()
            .and_then(|count| count.trim().parse::<u32>().ok());
        let load = lines
            .next()
            .and_then(|line| line.split('.').next()?.parse::<u32>().ok());
        Ok(Limits {
            slots: processors.map(|count| (count.saturating_sub(load.unwrap_or(0)), count)),
            ..Limits::default()
        })
    }

    fn submit(&self, array: &Array) -> Result<TaskId, ClusterError> {
        let script = template::fill(TEMPLATE, self.template.as_deref(), &array.script)?;
        let script = start(&self.run_folder(), array, &script);
        self.way
            .ask(&format!("starting {}", array.name), "setsid", &script)?;
        Ok(TaskId::whole(&array.name))
    }

    fn list(&self, prefix: &str) -> Result<Vec<Task>, ClusterError> {
        let script = listing(&self.run_folder(), &format!("{}*", quote(prefix)));
        Ok(tasks(&self.way.ask(
            "looking at processes",
            "sed",
            &script,
        )?))
    }

    fn ended(&self, _arrays: &[TaskId]) -> Result<Vec<Task>, ClusterError> {
        // All there is stands in the folder, until it is removed.
        Ok(Vec::new())
    }

    fn delete(&self, tasks: &[TaskId]) -> Result<(), ClusterError> {
        if tasks.is_empty() {
            return Ok(());
        }
        self.way.ask(
            "ending processes",
            "kill",
            &ending(&self.run_folder(), tasks),
        )?;
        Ok(())
    }
}

/// The script that starts an array. The same array is started once, however often it runs.
fn start(folder: &str, array: &Array, script: &str) -> String {
    let (name, end) = (quote(&array.name), template::END);
    let runners = array
        .running_max
        .unwrap_or(array.tasks)
        .clamp(1, array.tasks.max(1));
    let slots = array
        .running_max
        .map_or(String::new(), |most| most.to_string());
    let log = quote_path(&array.log);
    let mut text = format!(
        "set -e; umask 077; d={folder}/{name}; log={log}; mkdir -p {folder} \"$(dirname \"$log\")\"\n\
         if [ -d \"$d\" ]; then exit 0; fi\n\
         t=$d.new.$$; trap 'rm -rf \"$t\"' EXIT; mkdir \"$t\"; cat /proc/sys/kernel/random/boot_id >\"$t/boot\"; echo {} >\"$t/count\"\n",
        array.tasks
    );
    let _ = write!(
        text,
        "cat >\"$t/script\" <<'{end}'\n{script}{end}\ncat >\"$t/runner\" <<'{end}'\n{RUNNER}{end}\n"
    );
    // Of arrays that have ended only the latest are kept.
    let _ = writeln!(
        text,
        "(cd {folder} && ls -td -- */ 2>/dev/null | tail -n +{KEPT_MAX} | while read -r old; do\n\
         ls \"$old\"/*.runner >/dev/null 2>&1 || rm -rf \"./$old\"; done)"
    );
    // In place before anybody runs in it.
    let _ = write!(
        text,
        "mv \"$t\" \"$d\"\ni=0\nwhile [ $i -lt {runners} ]; do i=$((i + 1))\n\
         setsid sh \"$d/runner\" \"$d\" \"$log\" $i {slots} </dev/null >/dev/null 2>&1 &\ndone\n\
         gone=\n\
         while ! ls \"$d\"/*.runner >/dev/null 2>&1 && [ ! -e \"$d/1.exit\" ]; do\n\
         if [ -n \"$gone\" ]; then cp \"$d/script\" \"$d/again\" || :; rm -rf \"$d\"; echo 'nobody stayed to take tasks' >&2; exit 1; fi\n\
         kill -0 $! 2>/dev/null || gone=yes\n\
         sleep 0.05\ndone\n"
    );
    text
}

/// The script that lists the tasks of arrays whose names match a pattern.
fn listing(folder: &str, pattern: &str) -> String {
    format!(
        r#"{ALIVE}
cd {folder} 2>/dev/null || exit 0
root=$(pwd)
for d in {pattern}/; do
    d=${{d%/}}
    cd "$root/$d" 2>/dev/null || continue
    read -r count <count 2>/dev/null || continue
    if runs; then takers=yes; else takers=no; fi
    i=0
    while [ "$i" -lt "$count" ]; do
        i=$((i + 1))
        if [ -e "$i.deleted" ] && {{ [ -e "$i.exit" ] || [ ! -e "$i.pid" ] || ! alive "$i.pid"; }}; then echo "deleted|$i||$d"
        elif [ -e "$i.exit" ]; then read -r code <"$i.exit"; echo "exit|$i|$code|$d"
        elif [ -d "$i.claim" ]; then
            if [ "$takers" = yes ] || {{ [ "$(cat boot)" = "$boot" ] && alive "$i.pid"; }}; then echo "running|$i|$(uname -n)|$d"
            else echo "lost|$i||$d"; fi
        elif [ "$takers" = yes ]; then echo "waiting|$i||$d"
        else echo "lost|$i||$d"; fi
    done
done
:"#
    )
}

/// The script that ends tasks: asked first, and killed where they take too long.
fn ending(folder: &str, tasks: &[TaskId]) -> String {
    let words = tasks.iter().map(|id| match id.task {
        Some(task) => format!("{}/{task}", id.array),
        None => format!("{}/*", id.array),
    });
    let words = quote_all(words);
    format!(
        r#"{ALIVE}
cd {folder} 2>/dev/null || exit 0
root=$(pwd)
each() {{ # COMMAND of every task, in its folder
    for word in {words}; do
        cd "$root/${{word%/*}}" 2>/dev/null || continue
        read -r count <count || continue
        case $word in
        */\*) i=0; while [ "$i" -lt "$count" ]; do i=$((i + 1)); "$1" "$i"; done ;;
        *) "$1" "${{word##*/}}" ;;
        esac
    done
}}
# A task that nobody has begun is taken away from whoever would.
take() {{ : >"$1.deleted"; mkdir "$1.claim" 2>/dev/null && echo deleted >"$1.exit"; [ "$(cat boot)" = "$boot" ] && alive "$1.pid" && kill -s TERM -- "-$pid" 2>/dev/null; :; }}
left() {{ [ "$(cat boot)" = "$boot" ] && alive "$1.pid" && lives=yes; :; }}
end() {{ [ "$(cat boot)" = "$boot" ] && alive "$1.pid" && kill -s KILL -- "-$pid" 2>/dev/null; :; }}
each take
tries=100
lives=yes
while [ "$lives" = yes ] && [ "$tries" -gt 0 ]; do
    lives=no; each left; tries=$((tries - 1))
    [ "$lives" = no ] || sleep 0.1
done
each end
:"#
    )
}

/// What the listing printed.
fn tasks(said: &str) -> Vec<Task> {
    let task = |line: &str| {
        let fields: Vec<_> = line.splitn(4, '|').collect();
        let [state, number, detail, name] = fields[..] else {
            return None;
        };
        let state = match (state, detail) {
            ("waiting", _) => TaskState::Waiting { why: String::new() },
            ("running", host) => TaskState::Running {
                host: host.to_owned(),
            },
            ("exit", "0") => TaskState::Done,
            ("exit", code) => TaskState::Failed {
                how: format!("exit status {code}"),
            },
            ("deleted", _) => TaskState::Deleted,
            _ => TaskState::Lost {
                how: "its host was started again, or killed it".to_owned(),
            },
        };
        Some(Task {
            id: TaskId::task(name, number.parse().ok()?),
            name: name.to_owned(),
            state,
        })
    };
    said.lines().filter_map(task).collect()
}

#[cfg(test)]
mod tests;
