//! Real processes on this machine.

use std::path::Path;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::*;
use crate::sites;

struct Host {
    folder: TempDir,
    queue: Processes,
}

impl Host {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let farm = folder.path().join("a farm").display().to_string();
        let site = sites::parse("s", "[site.here]\nkind = 'local'\n", None).unwrap();
        let way = Way::to(&site.0[0], Path::new("/nowhere"));
        Self {
            queue: Processes::new(&site.0[0], way, farm),
            folder,
        }
    }

    fn array(&self, name: &str, tasks: u32, running_max: Option<u32>, script: &str) -> Array {
        Array {
            name: name.to_owned(),
            tasks,
            running_max,
            script: script.to_owned(),
            time_limit: None,
            log: self.folder.path().join("logs/%.log").display().to_string(),
        }
    }

    fn states(&self) -> Vec<TaskState> {
        let tasks = self.queue.list("flyby-").unwrap();
        tasks.into_iter().map(|task| task.state).collect()
    }

    #[track_caller]
    fn wait(&self, what: &str, condition: impl Fn(&[TaskState]) -> bool) -> Vec<TaskState> {
        let start = Instant::now();
        loop {
            let states = self.states();
            if condition(&states) {
                return states;
            }
            assert!(
                start.elapsed() < Duration::from_secs(60),
                "{what}: {states:?}"
            );
        }
    }

    fn file(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).unwrap()
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        let arrays = self.queue.list("flyby-").unwrap_or_default();
        let ids: Vec<_> = arrays
            .iter()
            .map(|task| TaskId::whole(&task.name))
            .collect();
        let _ = self.queue.delete(&ids);
    }
}

fn is_running(state: &TaskState) -> bool {
    matches!(state, TaskState::Running { .. })
}

#[test]
fn tasks_run_and_say_how_they_ended() {
    let host = Host::new();
    let array = host.array(
        "flyby-1",
        3,
        None,
        "echo task $FLYBY_TASK; [ $FLYBY_TASK != 2 ]",
    );
    assert_eq!(host.queue.submit(&array).unwrap(), TaskId::whole("flyby-1"));
    let states = host.wait("they end", |states| !states.iter().any(TaskState::is_live));
    let how = "exit status 1".to_owned();
    assert_eq!(
        states,
        [TaskState::Done, TaskState::Failed { how }, TaskState::Done]
    );
    assert_eq!(host.file("logs/3.log"), "task 3\n");
    // Submitted again under its name it is the same array.
    host.queue.submit(&array).unwrap();
    assert_eq!(host.states().len(), 3);
    assert_eq!(host.file("logs/3.log"), "task 3\n");
}

#[test]
fn no_more_run_than_may() {
    let host = Host::new();
    let fifo = host.folder.path().join("go");
    let script = format!(
        "mkfifo {0}.$FLYBY_TASK; read x <{0}.$FLYBY_TASK",
        fifo.display()
    );
    host.queue
        .submit(&host.array("flyby-1", 3, Some(2), &script))
        .unwrap();
    let states = host.wait("two run", |states| {
        states.iter().filter(|state| is_running(state)).count() == 2
    });
    assert_eq!(states[2], TaskState::Waiting { why: String::new() });
    let open = |task: u32| {
        let path = format!("{}.{task}", fifo.display());
        while std::fs::metadata(&path).is_err() {
            std::thread::yield_now();
        }
        std::fs::write(path, "x\n").unwrap();
    };
    open(1);
    host.wait("the third begins", |states| {
        states[0] == TaskState::Done && is_running(&states[2])
    });
    open(2);
    open(3);
    host.wait("all end", |states| {
        states.iter().all(|state| *state == TaskState::Done)
    });
}

#[test]
fn no_more_of_all_arrays_run_than_may() {
    let host = Host::new();
    // Who finds another at work says so; each takes long enough to be found.
    let alone = host.folder.path().join("alone");
    let script = format!(
        "mkdir '{0}' || exit 1; i=0; while [ $i -lt 20 ]; do i=$((i + 1)); sleep 0.05; done; rmdir '{0}'",
        alone.display()
    );
    for (name, tasks) in [("flyby-1", 2), ("flyby-2", 1), ("flyby-3", 1)] {
        let array = host.array(name, tasks, Some(1), &script);
        host.queue.submit(&array).unwrap();
    }
    // Nobody who waits for what is deleted stays.
    host.queue.delete(&[TaskId::whole("flyby-2")]).unwrap();
    let states = host.wait("they end", |states| !states.iter().any(TaskState::is_live));
    let deleted = TaskState::Deleted;
    assert_eq!(
        states,
        [TaskState::Done, TaskState::Done, deleted, TaskState::Done]
    );
    let gone = host.folder.path().join("a farm/run/flyby-2");
    host.wait("who took its tasks ends", |_| {
        let mut files = std::fs::read_dir(&gone).unwrap().flatten();
        !files.any(|file| file.file_name().to_string_lossy().ends_with(".runner"))
    });
}

#[test]
fn what_is_deleted_ends_with_all_it_started() {
    let host = Host::new();
    let script =
        "sleep 1000 & echo $! >>PIDS; trap '' TERM; sleep 1000 & echo $! >>PIDS; wait; wait";
    let pids = host.folder.path().join("pids");
    let script = script.replace("PIDS", &pids.display().to_string());
    host.queue
        .submit(&host.array("flyby-1", 2, Some(1), &script))
        .unwrap();
    while std::fs::read_to_string(&pids)
        .unwrap_or_default()
        .lines()
        .count()
        < 2
    {
        std::thread::yield_now();
    }
    host.queue
        .delete(&[TaskId::task("flyby-1", 1), TaskId::task("flyby-1", 2)])
        .unwrap();
    let states = host.wait("both are gone", |states| {
        !states.iter().any(TaskState::is_live)
    });
    assert_eq!(states, [TaskState::Deleted, TaskState::Deleted]);
    for pid in std::fs::read_to_string(&pids).unwrap().lines() {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat"));
        assert!(
            stat.is_err() || stat.unwrap().contains(") Z "),
            "{pid} runs"
        );
    }
}

#[test]
fn a_process_of_somebody_else_with_the_same_number_is_left_alone() {
    let host = Host::new();
    let mut other = std::process::Command::new("setsid")
        .args(["sleep", "1000"])
        .spawn()
        .unwrap();
    let folder = host.folder.path().join("a farm/run/flyby-1");
    std::fs::create_dir_all(folder.join("1.claim")).unwrap();
    let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("count", "1\n");
    write("boot", &boot);
    write("1.pid", &format!("{} 1\n", other.id()));
    let how = "its host was started again, or killed it".to_owned();
    assert_eq!(host.states(), [TaskState::Lost { how: how.clone() }]);
    host.queue.delete(&[TaskId::whole("flyby-1")]).unwrap();
    assert!(other.try_wait().unwrap().is_none(), "it was killed");
    // Nor is one that was started at the same time after another boot.
    std::fs::remove_file(folder.join("1.deleted")).unwrap();
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", other.id())).unwrap();
    let start = stat
        .rsplit_once(") ")
        .unwrap()
        .1
        .split(' ')
        .nth(19)
        .unwrap();
    write("1.pid", &format!("{} {start}\n", other.id()));
    write("boot", "another\n");
    assert_eq!(host.states(), [TaskState::Lost { how }]);
    host.queue.delete(&[TaskId::whole("flyby-1")]).unwrap();
    assert!(other.try_wait().unwrap().is_none(), "it was killed");
    other.kill().unwrap();
    other.wait().unwrap();
}

#[test]
fn a_folder_that_is_not_there_holds_nothing() {
    assert!(Host::new().states().is_empty());
}
