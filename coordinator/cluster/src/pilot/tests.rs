use super::*;

const NOW: Timestamp = Timestamp(1_000_000_000);
const HOUR: Span = Span::from_secs(3_600);

fn settings() -> Settings {
    Settings {
        names: "flyby-x-a.1-".into(),
        threads: 1,
        running_max: Some(3),
        queue_running_max: None,
        ahead: 1,
        array_max: 100,
        cancelled: Cancelled::Replace,
        times: Times {
            usual: Some(HOUR),
            ..Times::default()
        },
    }
}

/// So much work that there can never be enough allocations.
const PLENTY: Wanted = Wanted {
    squares: 1_000_000,
    unmeasured: 0,
    time: Span(HOUR.0 * 1_000),
    dearest: Span(0),
    others: 0,
};

const NOTHING: Wanted = Wanted {
    squares: 0,
    unmeasured: 0,
    time: Span(0),
    dearest: Span(0),
    others: 0,
};

fn task(number: u32, state: TaskState) -> Task {
    Task {
        id: TaskId::task("7", number),
        name: "flyby-x-a.1-1".into(),
        state,
    }
}

fn waits() -> TaskState {
    TaskState::Waiting { why: String::new() }
}

fn runs() -> TaskState {
    TaskState::Running { host: "n1".into() }
}

fn submit(number: u64, tasks: u32) -> Action {
    Action::Submit {
        name: format!("flyby-x-a.1-{number}"),
        tasks,
    }
}

/// A site whose three allocations were submitted and run.
fn running() -> (Pilot, Vec<Task>) {
    let mut pilot = Pilot::new(settings());
    assert_eq!(pilot.observe(NOW, &[], PLENTY), [submit(1, 3)]);
    pilot.submitted(&TaskId::whole("7"), 3);
    let shown: Vec<Task> = (1..=3).map(|number| task(number, runs())).collect();
    assert_eq!(pilot.observe(NOW, &shown, PLENTY), []);
    (pilot, shown)
}

#[test]
fn nothing_is_submitted_where_nothing_is_to_do() {
    assert_eq!(Pilot::new(settings()).observe(NOW, &[], NOTHING), []);
}

#[test]
fn what_an_earlier_coordinator_left_counts() {
    let mut pilot = Pilot::new(settings());
    let shown = [task(1, runs()), task(2, waits())];
    assert_eq!(pilot.observe(NOW, &shown, PLENTY), [submit(1, 1)]);
    let standing = pilot.standing();
    assert_eq!(
        (standing.running, standing.waiting, standing.wanted),
        (1, 1, 3)
    );
}

#[test]
fn few_are_submitted_for_little_work() {
    let mut pilot = Pilot::new(Settings {
        running_max: None,
        ..settings()
    });
    let tasks = |pilot: &mut Pilot, wanted| match pilot.observe(NOW, &[], wanted)[..] {
        [Action::Submit { tasks, .. }] => tasks,
        ref other => panic!("{other:?}"),
    };
    let wanted = |squares, minutes: u64, others| Wanted {
        squares,
        unmeasured: 0,
        time: Span::from_secs(60 * minutes),
        dearest: Span(0),
        others,
    };
    assert_eq!(tasks(&mut pilot, wanted(1_000, 5, 0)), 10);
    assert_eq!(tasks(&mut pilot, wanted(1_000, 5, 4)), 6);
    assert_eq!(tasks(&mut pilot, wanted(2, 5, 0)), 2);
    assert_eq!(tasks(&mut pilot, wanted(1_000_000, 60_000, 0)), 100);
    assert_eq!(pilot.observe(NOW, &[], wanted(1_000, 5, 10)), []);
    // Of what nobody has measured a few find out how long it takes; what else there is counts as before.
    let unmeasured = |minutes| Wanted {
        unmeasured: 500,
        ..wanted(1_000, minutes, 0)
    };
    assert_eq!(tasks(&mut pilot, unmeasured(0)), UNMEASURED_MAX);
    assert_eq!(tasks(&mut pilot, unmeasured(5)), 10 + UNMEASURED_MAX);
}

#[test]
fn the_queue_s_own_limit_lets_one_wait() {
    let mut pilot = Pilot::new(Settings {
        running_max: None,
        queue_running_max: Some(4),
        ..settings()
    });
    assert_eq!(pilot.observe(NOW, &[], PLENTY), [submit(1, 5)]);
}

#[test]
fn arrays_are_no_larger_than_they_may_be() {
    let mut pilot = Pilot::new(Settings {
        array_max: 2,
        ..settings()
    });
    assert_eq!(pilot.observe(NOW, &[], PLENTY), [submit(1, 2)]);
}

#[test]
fn one_that_is_lost_or_has_reached_its_limit_is_replaced_at_once() {
    for state in [
        TaskState::TimeLimit,
        TaskState::Lost {
            how: "NODE_FAIL".into(),
        },
        TaskState::Done,
    ] {
        let (mut pilot, mut shown) = running();
        shown[1].state = state;
        assert_eq!(pilot.observe(NOW, &shown, PLENTY), [submit(2, 1)]);
        assert_eq!(pilot.standing().trouble, None);
    }
}

#[test]
fn one_that_the_queue_shows_no_more_is_asked_for_and_replaced() {
    let (mut pilot, mut shown) = running();
    shown.pop();
    let asked = [TaskId::whole("7")];
    let actions = pilot.observe(NOW, &shown, PLENTY);
    assert_eq!(actions, [Action::LookUp(asked.to_vec())]);
    pilot.have_ended(NOW, &asked, &[]);
    assert_eq!(pilot.observe(NOW, &shown, PLENTY), [submit(2, 1)]);
    pilot.submitted(&TaskId::whole("8"), 1);
    shown.push(Task {
        id: TaskId::task("8", 1),
        name: "flyby-x-a.1-2".into(),
        state: waits(),
    });
    assert_eq!(pilot.observe(NOW, &shown, PLENTY), []);
}

#[test]
fn failures_are_said_and_tried_again_ever_later() {
    let (mut pilot, _) = running();
    let failed = |number| {
        task(
            number,
            TaskState::Failed {
                how: "exit status 1".into(),
            },
        )
    };
    let shown = [failed(1), failed(2), failed(3)];
    assert_eq!(pilot.observe(NOW, &shown, PLENTY), []);
    let trouble = pilot.standing().trouble.clone().unwrap();
    assert_eq!(
        trouble,
        "allocation 7.1 (flyby-x-a.1-1) failed: exit status 1"
    );
    // The queue goes on showing them.
    assert_eq!(
        pilot.observe(NOW + Span(PAUSE_FIRST.0 - 1), &shown, PLENTY),
        []
    );
    // One alone, to see whether it is over.
    let now = NOW + PAUSE_FIRST;
    assert_eq!(pilot.observe(now, &shown, PLENTY), [submit(2, 1)]);
    pilot.refused(now, "no".into());
    assert_eq!(pilot.observe(now + PAUSE_FIRST, &[], PLENTY), []);
    assert_eq!(pilot.standing().trouble.as_deref(), Some("no"));
    let now = now + PAUSE_FIRST.times(2);
    assert_eq!(pilot.observe(now, &[], PLENTY), [submit(3, 1)]);
    pilot.submitted(&TaskId::whole("9"), 1);
    let well = |state| Task {
        id: TaskId::task("9", 1),
        name: "flyby-x-a.1-3".into(),
        state,
    };
    assert_eq!(
        pilot.observe(now, &[well(TaskState::Done)], PLENTY),
        [submit(4, 3)]
    );
    assert_eq!(pilot.standing().trouble, None);
}

#[test]
fn the_pause_has_a_longest() {
    let mut pilot = Pilot::new(settings());
    for _ in 0..100 {
        pilot.refused(NOW, "no".into());
    }
    assert_eq!(
        pilot.observe(NOW + Span(PAUSE_LONGEST.0 - 1), &[], PLENTY),
        []
    );
    assert_eq!(
        pilot.observe(NOW + PAUSE_LONGEST, &[], PLENTY),
        [submit(1, 1)]
    );
}

#[test]
fn what_somebody_else_deleted_is_replaced_after_a_while_or_not_at_all() {
    let (mut pilot, mut shown) = running();
    shown[0].state = TaskState::Deleted;
    assert_eq!(pilot.observe(NOW, &shown, PLENTY), []);
    assert!(
        pilot
            .standing()
            .trouble
            .as_ref()
            .unwrap()
            .contains("somebody deleted allocation 7.1")
    );
    assert_eq!(
        pilot.observe(NOW + PAUSE_FIRST, &shown, PLENTY),
        [submit(2, 1)]
    );

    let (mut pilot, mut shown) = running();
    pilot.settings.cancelled = Cancelled::Stop;
    shown[0].state = TaskState::Deleted;
    assert_eq!(pilot.observe(NOW + HOUR, &shown, PLENTY), []);
    assert_eq!(pilot.observe(NOW + HOUR + HOUR, &shown, PLENTY), []);
    assert!(
        pilot
            .standing()
            .trouble
            .as_ref()
            .unwrap()
            .contains("cancelled = \"stop\"")
    );
}

#[test]
fn none_takes_the_place_of_one_that_may_stop_the_site_before_it_is_known_how_it_ended() {
    for is_shown in [true, false] {
        let (mut pilot, mut shown) = running();
        pilot.settings.cancelled = Cancelled::Stop;
        shown[2].state = TaskState::Ending;
        assert_eq!(pilot.observe(NOW, &shown, PLENTY), []);
        let mut gone = shown.pop().unwrap();
        gone.state = TaskState::Deleted;
        if is_shown {
            shown.push(gone);
        } else {
            let asked = [TaskId::whole("7")];
            let actions = pilot.observe(NOW, &shown, PLENTY);
            assert_eq!(actions, [Action::LookUp(asked.to_vec())]);
            pilot.have_ended(NOW, &asked, &[gone]);
        }
        assert_eq!(pilot.observe(NOW, &shown, PLENTY), []);
        assert_eq!(pilot.observe(NOW + HOUR, &shown, PLENTY), []);
    }
    // Where another takes its place anyway, it does at once.
    let (mut pilot, mut shown) = running();
    shown[2].state = TaskState::Ending;
    assert_eq!(pilot.observe(NOW, &shown, PLENTY), [submit(2, 1)]);
}

#[test]
fn what_nobody_needs_any_more_is_deleted_while_it_waits() {
    let (mut pilot, mut shown) = running();
    shown[1].state = waits();
    shown[2].state = waits();
    let gone = vec![TaskId::task("7", 3), TaskId::task("7", 2)];
    assert_eq!(pilot.observe(NOW, &shown, NOTHING), [Action::Delete(gone)]);
    // That is no failure.
    shown[1].state = TaskState::Deleted;
    shown[2].state = TaskState::Deleted;
    assert_eq!(pilot.observe(NOW, &shown, PLENTY), [submit(2, 2)]);
}

#[test]
fn an_array_that_was_deleted_whole_is_known_by_its_number() {
    let (mut pilot, _) = running();
    let whole = Task {
        id: TaskId::whole("7"),
        name: "flyby-x-a.1-1".into(),
        state: TaskState::Deleted,
    };
    assert_eq!(pilot.observe(NOW, &[whole], PLENTY), []);
    assert!(
        pilot
            .standing()
            .trouble
            .as_ref()
            .unwrap()
            .contains("somebody deleted")
    );
}

#[test]
fn what_waits_for_help_is_said() {
    let (mut pilot, mut shown) = running();
    shown[0].state = TaskState::Held {
        why: "JobHeldUser".into(),
    };
    assert_eq!(pilot.observe(NOW, &shown, PLENTY), []);
    assert!(
        pilot
            .standing()
            .trouble
            .as_ref()
            .unwrap()
            .contains("JobHeldUser")
    );
    shown[0].state = runs();
    pilot.observe(NOW, &shown, PLENTY);
    assert_eq!(pilot.standing().trouble, None);
}

#[test]
fn settings_follow_the_site_and_its_queue() {
    let site = |text: &str| {
        let text = format!("[site.a]\n{text}");
        crate::sites::parse("s", &text, None).unwrap().0.remove(0)
    };
    let limits = Limits {
        array_tasks: Some(1_000),
        slots: Some((3, 8)),
        ..Limits::default()
    };
    let of = |text: &str| Settings::of(&site(text), &limits, String::new());
    assert_eq!(of("kind = 'slurm'").array_max, 1_000);
    assert_eq!(of("kind = 'slurm'\nmax_array_size = 10").array_max, 10);
    assert_eq!(of("kind = 'slurm'").running_max, None);
    // A host holds nothing back by itself.
    assert_eq!(of("kind = 'local'\nthreads = 3").running_max, Some(2));
    assert_eq!(of("kind = 'local'\nthreads = 30").running_max, Some(1));
    assert_eq!(of("kind = 'local'\nmax_running = 5").running_max, Some(5));
}

#[test]
fn an_allocation_asks_for_as_long_as_a_block_needs() {
    let unmeasured = Wanted {
        unmeasured: PLENTY.squares,
        ..PLENTY
    };
    let (mut pilot, mut shown) = running();
    assert_eq!(pilot.time_limit(), Some(HOUR));
    // All three end, one after the other, and nobody has learned anything.
    for (number, doubled) in [(0, 2), (1, 4), (2, 8)] {
        shown[number].state = TaskState::TimeLimit;
        pilot.observe(NOW, &shown, unmeasured);
        assert_eq!(pilot.time_limit(), Some(HOUR.times(doubled)));
    }
    let dearest = HOUR.times(3);
    pilot.observe(NOW, &[], Wanted { dearest, ..PLENTY });
    assert!(pilot.time_limit() > Some(HOUR.times(6)));
    pilot.observe(NOW, &[], PLENTY);
    assert_eq!(pilot.time_limit(), Some(HOUR));
}

#[test]
fn where_no_block_is_done_in_the_time_that_the_site_says_it_is_told() {
    let mut pilot = Pilot::new(Settings {
        times: Times {
            asked: Some(HOUR),
            ..Times::default()
        },
        ..settings()
    });
    let dearest = HOUR.times(3);
    pilot.observe(NOW, &[], Wanted { dearest, ..PLENTY });
    let trouble = pilot.standing().trouble.clone().unwrap();
    assert!(trouble.contains("10800 s"), "{trouble}");
    pilot.observe(NOW, &[], PLENTY);
    assert_eq!(pilot.standing().trouble, None);
}
