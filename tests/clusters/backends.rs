//! One suite for every kind of queue, on the real one.

use std::path::Path;

use cluster::camp::Camp;
use cluster::{Array, ClusterError, Refusal, Task, TaskId, TaskState};
use tempfile::TempDir;

use crate::engine::{Engine, Kind};
use crate::harness::wait;

/// A farm's camp at a site of a real engine.
struct Suite {
    camp: Camp,
    kind: Kind,
    number: u32,
    folder: TempDir,
}

impl Suite {
    fn new(engine: &Engine, kind: Kind) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let there = folder.path().join("it's here");
        let text = format!(
            "[site.test]\n{}folder = \"{}\"\n",
            engine.site(kind),
            there.display()
        );
        let sites = cluster::sites::parse("sites.toml", &text, None)
            .unwrap_or_else(|error| panic!("{error}"));
        let site = sites.0.into_iter().next().unwrap();
        let sockets = engine.folder.join("s");
        Self {
            camp: Camp::new(site, "00c0ffee".to_owned(), &sockets),
            kind,
            number: 0,
            folder,
        }
    }

    /// Everything that a queue must do.
    fn runs(mut self) {
        self.says_what_it_is();
        self.runs_tasks_and_says_how_they_ended();
        self.deletes_some_and_all();
        self.leaves_others_alone();
        self.refuses_too_large_an_array();
        self.leaves_nothing();
    }

    #[track_caller]
    fn submit(&mut self, tasks: u32, script: &str) -> (String, TaskId) {
        self.number += 1;
        let name = format!("{}{}", self.camp.prefix(), self.number);
        let array = Array {
            name: name.clone(),
            tasks,
            running_max: None,
            script: script.to_owned(),
            time_limit: None,
            log: self.camp.log(&name),
        };
        let id = self.camp.queue.submit(&array);
        (name, id.unwrap_or_else(|error| panic!("{error}")))
    }

    /// What the queue shows of an array, and keeps of it.
    fn tasks(&self, array: &TaskId) -> Vec<Task> {
        let queue = &self.camp.queue;
        let shown = queue.list(&self.camp.prefix());
        let shown = shown.unwrap_or_else(|error| panic!("{error}"));
        let mut tasks: Vec<_> = shown
            .into_iter()
            .filter(|task| task.id.array == array.array)
            .collect();
        if !tasks.iter().any(|task| task.state.is_live()) {
            let kept = queue.ended(std::slice::from_ref(array));
            tasks.extend(kept.unwrap_or_else(|error| panic!("{error}")));
        }
        tasks
    }

    fn state(&self, array: &TaskId, task: u32) -> Option<TaskState> {
        let tasks = self.tasks(array).into_iter();
        let mut of_it = tasks.filter(|each| each.id.task == Some(task));
        of_it.next().map(|task| task.state)
    }

    #[track_caller]
    fn wait_state(
        &self,
        array: &TaskId,
        task: u32,
        what: &str,
        condition: impl Fn(&TaskState) -> bool,
    ) -> TaskState {
        wait::until(what, || self.state(array, task).filter(&condition))
    }

    fn says_what_it_is(&self) {
        let about = self.camp.queue.about().unwrap();
        let limits = self.camp.queue.limits().unwrap();
        match self.kind {
            Kind::Slurm | Kind::SlurmOverSsh => {
                assert!(
                    about
                        .version
                        .starts_with(|digit: char| digit.is_ascii_digit()),
                    "{about:?}"
                );
                assert_eq!(limits.array_tasks, Some(10_000), "{limits:?}");
                assert_eq!(limits.queues, ["render"]);
            }
            Kind::GridEngine | Kind::GridEngineOverSsh => {
                assert!(about.version.contains("GE"), "{about:?}");
                assert_eq!(limits.array_tasks, Some(1_000), "{limits:?}");
                assert_eq!(limits.queues, ["all.q"]);
            }
            Kind::Ssh | Kind::Local => assert_eq!(limits.running, None, "{limits:?}"),
        }
        assert!(limits.slots.unwrap().1 > 0, "{limits:?}");
    }

    fn runs_tasks_and_says_how_they_ended(&mut self) {
        let script = "echo this is $FLYBY_TASK\n[ \"$FLYBY_TASK\" != 2 ] || exit 7";
        let (name, array) = self.submit(3, script);
        self.wait_state(&array, 1, "the first is done", |state| {
            *state == TaskState::Done
        });
        self.wait_state(&array, 3, "the third is done", |state| {
            *state == TaskState::Done
        });
        let failed = |state: &TaskState| matches!(state, TaskState::Failed { .. });
        self.wait_state(&array, 2, "the second has failed", failed);
        assert_eq!(self.camp.said(&name, 3).unwrap(), "this is 3");
    }

    fn deletes_some_and_all(&mut self) {
        let folder = self.folder.path().join("begun");
        std::fs::create_dir_all(&folder).unwrap();
        let script = format!(
            "echo x >'{}/'$FLYBY_TASK\nexec sleep 1000",
            folder.display()
        );
        let (name, array) = self.submit(6, &script);
        let runs = |state: &TaskState| matches!(state, TaskState::Running { .. });
        self.wait_state(&array, 1, "the first runs", runs);
        let waits = matches!(self.state(&array, 6), Some(TaskState::Waiting { .. }));
        match self.kind {
            // Four processors for six tasks.
            Kind::Slurm | Kind::SlurmOverSsh | Kind::GridEngine | Kind::GridEngineOverSsh => {
                assert!(waits, "{:?}", self.tasks(&array));
            }
            Kind::Ssh | Kind::Local => {}
        }
        assert!(self.tasks(&array).iter().all(|task| task.name == name));
        let some = [TaskId::task(&array.array, 1), TaskId::task(&array.array, 6)];
        self.camp.queue.delete(&some).unwrap();
        wait::until("two are gone", || {
            let live = |task| {
                self.state(&array, task)
                    .is_some_and(|state| state.is_live())
            };
            (!live(1) && !live(6)).then_some(())
        });
        self.wait_state(&array, 2, "the second runs on", runs);
        // Those that are gone already are no error.
        self.camp.queue.delete(&some).unwrap();
        self.camp
            .queue
            .delete(&[TaskId::whole(&array.array)])
            .unwrap();
        wait::until("all are gone", || {
            let live = self.tasks(&array).iter().any(|task| task.state.is_live());
            (!live).then_some(())
        });
    }

    fn leaves_others_alone(&mut self) {
        // A name that begins as ours do, of another site of ours.
        let name = self.camp.prefix().replace("-test.", "-test2.") + "1";
        let array = Array {
            name: name.clone(),
            tasks: 1,
            running_max: None,
            script: "exec sleep 1000".to_owned(),
            time_limit: None,
            log: self.camp.log(&name),
        };
        let id = self.camp.queue.submit(&array).unwrap();
        let shown = self.camp.queue.list(&self.camp.prefix()).unwrap();
        assert!(shown.iter().all(|task| task.name != name), "{shown:?}");
        let others = name.trim_end_matches('1');
        let is_live = || {
            let shown = self.camp.queue.list(others).unwrap();
            shown.iter().any(|task| task.state.is_live())
        };
        assert!(is_live());
        self.camp.queue.delete(&[id]).unwrap();
        wait::until("the other is gone", || (!is_live()).then_some(()));
    }

    fn refuses_too_large_an_array(&mut self) {
        let tasks = match self.kind {
            Kind::Slurm | Kind::SlurmOverSsh => 20_000,
            Kind::GridEngine | Kind::GridEngineOverSsh => 1_001,
            Kind::Ssh | Kind::Local => return,
        };
        let array = Array {
            name: format!("{}large", self.camp.prefix()),
            tasks,
            running_max: None,
            script: "true".to_owned(),
            time_limit: None,
            log: self.camp.log("large"),
        };
        let error = self.camp.queue.submit(&array).unwrap_err();
        let ClusterError::Refused { refusal, said, .. } = &error else {
            panic!("{error}");
        };
        assert_eq!(*refusal, Refusal::ArrayTooLarge, "{said}");
        assert!(error.next().contains("max_array_size"));
    }

    fn leaves_nothing(&mut self) {
        let (_, array) = self.submit(2, "exec sleep 1000");
        let runs = |state: &TaskState| matches!(state, TaskState::Running { .. });
        self.wait_state(&array, 1, "the first runs", runs);
        self.camp.clean().unwrap();
        let shown = self.camp.queue.list(&self.camp.prefix()).unwrap();
        assert!(!shown.iter().any(|task| task.state.is_live()), "{shown:?}");
        assert!(!Path::new(&self.camp.folder()).exists());
        // Twice is harmless.
        assert_eq!(self.camp.clean().unwrap().ended, 0);
    }
}

#[test]
#[ignore = "long: tests/run --all"]
fn slurm_here_and_over_ssh() {
    let Some(mut engine) = Engine::slurm(2) else {
        return;
    };
    Suite::new(&engine, Kind::Slurm).runs();
    if engine.add_ssh() {
        Suite::new(&engine, Kind::SlurmOverSsh).runs();
    }
}

#[test]
#[ignore = "long: tests/run --all"]
fn grid_engine_here_and_over_ssh() {
    let Some(mut engine) = Engine::gridengine(2, &[("GE_MAX_AJ_TASKS", "1000")]) else {
        return;
    };
    Suite::new(&engine, Kind::GridEngine).runs();
    if engine.add_ssh() {
        Suite::new(&engine, Kind::GridEngineOverSsh).runs();
    }
}

#[test]
#[ignore = "long: tests/run --all"]
fn grid_engine_kills_what_runs_for_too_long() {
    let Some(engine) = Engine::gridengine(1, &[]) else {
        return;
    };
    let suite = Suite::new(&engine, Kind::GridEngine);
    let name = format!("{}1", suite.camp.prefix());
    let array = Array {
        name: name.clone(),
        tasks: 1,
        running_max: None,
        script: "exec sleep 1000".to_owned(),
        time_limit: Some(model::Span::from_secs(5)),
        log: suite.camp.log(&name),
    };
    let id = suite.camp.queue.submit(&array).unwrap();
    suite.wait_state(&id, 1, "it is killed at its limit", |state| {
        *state == TaskState::TimeLimit
    });
    suite.camp.clean().unwrap();
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_host_over_ssh() {
    let Some(engine) = Engine::ssh() else {
        return;
    };
    Suite::new(&engine, Kind::Ssh).runs();
}
