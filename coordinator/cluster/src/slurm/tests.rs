use super::*;
use crate::sites;

const SQUEUE: &str = include_str!("../../tests/recorded/slurm-22.05.8-squeue.txt");
const CONFIG: &str = include_str!("../../tests/recorded/slurm-22.05.8-config.txt");
const PARTITION: &str = include_str!("../../tests/recorded/slurm-22.05.8-partition.txt");

fn site(more: &str) -> Site {
    let text = format!("[site.a]\nkind = 'slurm'\n{more}");
    sites::parse("s", &text, None).unwrap().0.remove(0)
}

#[test]
fn jobs_of_slurm_22_05() {
    let tasks = tasks(SQUEUE, "flyby-ab-");
    let state = |array: &str, task| {
        let id = TaskId::task(array, task);
        let mut found = tasks.iter().filter(|each| each.id == id);
        found.next().map(|task| task.state.clone())
    };
    assert_eq!(state("8", 1), Some(TaskState::Done));
    let how = "FAILED (NonZeroExitCode)".to_owned();
    assert_eq!(state("8", 2), Some(TaskState::Failed { how }));
    assert_eq!(state("9", 2), Some(TaskState::Deleted));
    assert_eq!(state("9", 4), Some(TaskState::TimeLimit));
    let host = "n1".to_owned();
    assert_eq!(state("17", 2), Some(TaskState::Running { host }));
    for task in 3..=7 {
        let why = "JobArrayTaskLimit".to_owned();
        assert_eq!(state("17", task), Some(TaskState::Waiting { why }));
    }
    // A whole array that was cancelled while it waited.
    let whole = tasks.iter().find(|task| task.id == TaskId::whole("10"));
    assert_eq!(whole.unwrap().state, TaskState::Deleted);
    let none = super::tasks(SQUEUE, "flyby-ac-");
    assert!(none.is_empty(), "others' names are nothing to us");
}

#[test]
fn what_waits_for_somebody_is_held() {
    let said = "10|1-2|PENDING|JobHeldUser||flyby-ab-4\n7|N/A|PENDING|Priority||x|y\n";
    let found = tasks(said, "flyby-");
    let why = "JobHeldUser".to_owned();
    assert_eq!(found.len(), 2);
    assert_eq!(found[1].state, TaskState::Held { why });
    assert_eq!(tasks(said, "x")[0].name, "x|y");
}

/// States as the manual of `squeue` names them.
#[test]
fn what_has_ended_in_other_ways() {
    assert_eq!(state_of("TIMEOUT", "TimeLimit", "n1"), TaskState::TimeLimit);
    let lost = TaskState::Lost {
        how: "NODE_FAIL".into(),
    };
    assert_eq!(state_of("NODE_FAIL", "None", ""), lost);
    assert!(matches!(
        state_of("OUT_OF_MEMORY", "None", ""),
        TaskState::Failed { .. }
    ));
    let waits = TaskState::Waiting {
        why: "Priority".into(),
    };
    assert_eq!(state_of("PENDING", "Priority", ""), waits);
    assert!(state_of("COMPLETING", "None", "n1").is_live());
}

#[test]
fn accounts_name_who_cancelled() {
    let said = "12_3|CANCELLED by 1000|flyby-ab-1\n12_4|TIMEOUT|flyby-ab-1\n13|COMPLETED|x\n";
    let tasks = accounts(said);
    assert_eq!(tasks.len(), 2);
    assert_eq!(tasks[0].state, TaskState::Deleted);
    assert_eq!(tasks[1].state, TaskState::TimeLimit);
}

#[test]
fn limits_of_slurm_22_05() {
    let said = format!("{CONFIG}==\n{PARTITION}==\nrender|3/1/0/4\n==\n4|100\n");
    let found = limits(&said, None);
    assert_eq!(found.array_tasks, Some(10_000));
    assert_eq!((found.running, found.jobs), (Some(4), Some(100)));
    assert_eq!(found.queues, ["render"]);
    assert_eq!(found.slots, Some((1, 4)));
    assert_eq!(found.time, None);
    let without = limits(&format!("{CONFIG}==\n{PARTITION}==\n==\n"), None);
    assert_eq!((without.running, without.jobs), (None, Some(20_000)));
}

#[test]
fn a_partition_s_times() {
    for (text, seconds) in [
        ("30", 1_800),
        ("5:30", 330),
        ("01:00:00", 3_600),
        ("2-00:00:00", 172_800),
        ("1-12", 129_600),
    ] {
        assert_eq!(duration(text), Some(Span::from_secs(seconds)), "{text}");
    }
    for none in ["UNLIMITED", "NONE", "", "INFINITE", "99999999999999999999"] {
        assert_eq!(duration(none), None, "{none}");
    }
    let line = "PartitionName=long Default=NO DefaultTime=01:00:00 MaxTime=2-00:00:00 State=UP\n";
    let usual = "PartitionName=short Default=YES DefaultTime=NONE MaxTime=00:30:00 State=UP\n";
    let said = format!("==\n{line}{usual}==\n==\n");
    assert_eq!(limits(&said, None).time_usual, Some(Span::from_secs(1_800)));
    assert_eq!(limits(&said, None).queues, ["short", "long"]);
    assert_eq!(
        limits(&said, Some("long")).time_usual,
        Some(Span::from_secs(3_600))
    );
}

#[test]
fn a_submission_quotes_every_value() {
    let site = site(
        "submit = ['--comment=it is; rm -rf']\ntime_limit = '1 h'\nmemory = '1 GiB'\nqueue = 'fast'\n",
    );
    let array = Array {
        name: "flyby-ab-1".into(),
        tasks: 3,
        running_max: Some(2),
        script: "true".into(),
        time_limit: site.time_limit,
        log: "~/.flyby/a b/x-%.log".into(),
    };
    let text = submission(&site, &array, "#!/bin/sh\ntrue\n");
    assert_eq!(
        text,
        "mkdir -p \"$(dirname \"$HOME\"/'.flyby/a b/x-%a.log')\" && sbatch --parsable --job-name=flyby-ab-1 --array=1-3%2 \
         --cpus-per-task=1 --ntasks=1 --requeue --open-mode=append --time=60 --signal=B:TERM@60 --mem=1024M \
         --partition=fast '--comment=it is; rm -rf' --output=\"$HOME\"/'.flyby/a b/x-%a.log' <<'END_OF_FLYBY_SCRIPT'\n\
         #!/bin/sh\ntrue\nEND_OF_FLYBY_SCRIPT\n"
    );
}
