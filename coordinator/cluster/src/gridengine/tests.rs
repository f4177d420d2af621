use super::*;
use crate::sites;

const QSTAT: &str = include_str!("../../tests/recorded/sge-8.1.9-qstat.xml");
const LOST: &str = include_str!("../../tests/recorded/sge-8.1.9-qstat-lost.xml");
const ERRORS: &str = include_str!("../../tests/recorded/sge-8.1.9-qstat-errors.xml");
const QACCT: &str = include_str!("../../tests/recorded/sge-8.1.9-qacct.txt");

#[test]
fn jobs_of_grid_engine_8_1_9() {
    let tasks = tasks(QSTAT, "flyby-ab-").unwrap();
    assert_eq!(tasks.len(), 8, "a job of another name stands among them");
    let running = |host: &str| TaskState::Running { host: host.into() };
    for (task, host) in [(1, "ge1"), (2, "ge2"), (3, "ge2"), (4, "ge1")] {
        let found = tasks.iter().find(|each| each.id == TaskId::task("1", task));
        assert_eq!(found.unwrap().state, running(host));
    }
    for task in 5..=8 {
        let found = tasks.iter().find(|each| each.id == TaskId::task("1", task));
        assert_eq!(
            found.unwrap().state,
            TaskState::Waiting { why: String::new() }
        );
    }
}

#[test]
fn tasks_of_a_host_that_lost_its_power_are_away_until_it_answers() {
    let tasks = tasks(LOST, "flyby-ab-").unwrap();
    let state = |number| {
        let id = TaskId::task("1", number);
        let found = tasks.iter().find(|task| task.id == id);
        found.unwrap().state.clone()
    };
    let away = TaskState::Away { host: "ge2".into() };
    let running = TaskState::Running { host: "ge1".into() };
    // The third was deleted, which needs its host's answer.
    assert_eq!((state(1), state(4)), (running.clone(), running));
    assert_eq!((state(2), state(3)), (away.clone(), away));
}

#[test]
fn held_and_broken_jobs_say_what_to_do() {
    let tasks = tasks(ERRORS, "flyby-ab-").unwrap();
    let why = |array: &str| {
        let found = tasks.iter().find(|task| task.id.array == array).unwrap();
        match &found.state {
            TaskState::Held { why } => why.clone(),
            other => panic!("{other:?}"),
        }
    };
    assert!(why("10").contains("qmod -cj 10"), "{}", why("10"));
    assert!(why("9").contains("hqw"));
    assert_eq!(state_of("1", "dr", None), TaskState::Ending);
    assert_eq!(
        state_of("1", "Rq", None),
        TaskState::Waiting { why: String::new() }
    );
    assert!(matches!(
        state_of("1", "Rr", Some("all.q@a")),
        TaskState::Running { .. }
    ));
}

#[test]
fn what_is_no_xml_is_an_answer() {
    assert!(tasks("error: commlib error", "").is_err());
    assert!(tasks("<a><job_list></job_list></a>", "").is_err());
    let wrong = "<a><job_list><JB_job_number>1</JB_job_number><JB_name>x</JB_name><tasks>1-</tasks></job_list></a>";
    assert!(tasks(wrong, "x").is_err());
}

#[test]
fn accounts_of_grid_engine_8_1_9() {
    let tasks = accounts(QACCT);
    let state = |array: &str, task| {
        let id = TaskId::task(array, task);
        tasks
            .iter()
            .find(|each| each.id == id)
            .map(|task| task.state.clone())
    };
    assert_eq!(state("6", 1), Some(TaskState::Done));
    let how = "exit status 7".to_owned();
    assert_eq!(state("6", 2), Some(TaskState::Failed { how }));
    assert_eq!(state("7", 1), Some(TaskState::TimeLimit));
    assert_eq!(state("8", 1), Some(TaskState::Deleted));
    let how = "opening input/output file".to_owned();
    assert_eq!(state("10", 1), Some(TaskState::Failed { how }));
}

#[test]
fn a_task_that_was_begun_again_counts_as_it_ended() {
    let record = |failed: &str, exit: &str| {
        format!("====\njobname a\njobnumber 5\ntaskid 2\nfailed {failed}\nexit_status {exit}\n")
    };
    let said = record("25 : rescheduling", "99") + &record("0", "0");
    assert_eq!(accounts(&said).len(), 1);
    assert_eq!(accounts(&said)[0].state, TaskState::Done);
}

#[test]
fn limits_of_grid_engine_8_1_9() {
    let said = [
        include_str!("../../tests/recorded/sge-8.1.9-conf.txt"),
        include_str!("../../tests/recorded/sge-8.1.9-sconf.txt"),
        "all.q\nlong.q\n",
        include_str!("../../tests/recorded/sge-8.1.9-queue.txt"),
        include_str!("../../tests/recorded/sge-8.1.9-summary.xml"),
    ]
    .join("==\n");
    let found = limits(&said, None);
    assert_eq!(
        (found.array_tasks, found.array_running),
        (Some(75_000), Some(2_000))
    );
    assert_eq!((found.running, found.jobs, found.time), (None, None, None));
    assert_eq!(found.queues, ["all.q", "long.q"]);
    assert_eq!(found.slots.unwrap().1, 4);
    let snowdon =
        "max_aj_tasks 75000\n==\nmaxujobs  4\n==\nq\n==\nqname q\nh_rt 8:00:00,[x=1:0:0]\n==\n";
    let found = limits(snowdon, Some("q"));
    assert_eq!(
        (found.running, found.time),
        (Some(4), Some(Span::from_secs(28_800)))
    );
}

#[test]
fn a_submission_quotes_every_value() {
    let text = "[site.a]\nkind = 'gridengine'\nthreads = 4\nparallel_environment = 'smp'\nsubmit = ['-l', 'a b']\ntime_limit = '10 min'\nqueue = 'all.q'\n";
    let site = sites::parse("s", text, None).unwrap().0.remove(0);
    let array = Array {
        name: "flyby-ab-1".into(),
        tasks: 3,
        running_max: None,
        script: "true".into(),
        time_limit: site.time_limit,
        log: "/scratch/x-%.log".into(),
    };
    assert_eq!(
        submission(&site, &array, "true\n"),
        "mkdir -p \"$(dirname '/scratch/x-$TASK_ID.log')\" && qsub -terse -N flyby-ab-1 -S /bin/sh -j y -t 1-3 -r y -notify \
         -l h_rt=600 -l s_rt=570 -pe smp 4 -q all.q -l 'a b' -o '/scratch/x-$TASK_ID.log' \
         <<'END_OF_FLYBY_SCRIPT'\ntrue\nEND_OF_FLYBY_SCRIPT\n"
    );
}
