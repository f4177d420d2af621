//! A site that takes what it is given, and does with it what each test says.

use model::{Epoch, ImageNumber, JobId, Revision};

use super::submit::LIMIT_LEAST;
use super::*;
use crate::orders::SeenTask;

const TAKES: Span = Span::from_secs(10);

struct There {
    poll: Poll,
    seen: Seen,
    now: Timestamp,
}

fn there() -> There {
    There {
        poll: Poll::new(Settings {
            names: "flyby-x-a.2-".into(),
            revision: Revision(5),
            threads: 2,
            running_max: Some(4),
            array_max: 100,
            ahead: 1,
            time_limit: None,
            time_max: None,
        }),
        seen: Seen::default(),
        now: Timestamp(0),
    }
}

fn lease(number: u64, image: u32) -> Lease {
    let x0 = 64 * u32::try_from(number % 100).unwrap();
    Lease {
        attempt: attempt(number),
        image: ImageRef {
            job: JobId(1),
            image: ImageNumber(image),
        },
        scene: Digest([3; 32]),
        tile: Rect {
            x0,
            y0: 0,
            x1: x0 + 64,
            y1: 32,
        },
        wanted: Vec::new(),
        expected: Span(0),
    }
}

fn attempt(number: u64) -> AttemptId {
    AttemptId {
        epoch: Epoch(2),
        number,
    }
}

impl There {
    fn looks(&mut self) -> Vec<Action> {
        self.now = self.now + Span::from_secs(30);
        let actions = self.poll.observe(&self.seen);
        for action in &actions {
            if let Action::Remove(names) = action {
                self.seen.arrays.retain(|a| !names.contains(&a.name));
            }
        }
        actions
    }

    fn submits(&mut self) -> Vec<Order> {
        self.looks();
        let orders = self.poll.orders(self.now);
        self.seen
            .arrays
            .extend(orders.iter().map(|order| SeenArray {
                name: order.name.clone(),
                is_submitted: true,
                order: Some(order.clone()),
                tasks: vec![SeenTask(Stands::Waits, 0); order.tasks.len()],
            }));
        orders
    }

    fn are(&mut self, stands: Stands) {
        for task in self
            .seen
            .arrays
            .iter_mut()
            .flat_map(|array| &mut array.tasks)
        {
            task.0 = stands;
        }
    }

    fn brings(&mut self, number: u64, blocks: usize) {
        for block in lease(number, 0).tile.blocks().take(blocks) {
            self.poll.delivered(attempt(number), block, TAKES);
        }
    }
}

#[test]
fn a_burst_of_one_image_is_one_array_and_it_goes_when_it_is_done() {
    let mut there = there();
    assert_eq!(there.poll.credit(), 2);
    for number in 0..4 {
        there.poll.leased(lease(number, 0));
    }
    there.poll.leased(lease(4, 1));
    let orders = there.submits();
    let tasks: Vec<_> = orders
        .iter()
        .map(|order| (order.image, order.tasks.len()))
        .collect();
    assert_eq!(tasks, [(0, 4), (1, 1)]);
    assert_eq!(orders[0].lease(2).unwrap().attempt, attempt(1));
    there.are(Stands::Runs);
    assert_eq!(there.looks(), []);
    assert_eq!(there.poll.running().len(), 5);
    assert_eq!(there.poll.wants()[0].offsets, [Some(0); 4]);
    there.poll.is_done_to(&orders[0].name, 1, 77);
    assert_eq!(there.poll.wants()[0].offsets[0], Some(77));
    for number in 0..4 {
        there.brings(number, 2);
    }
    // Its tasks are ended before their folder goes.
    let delete = Action::Delete(vec![(orders[0].name.clone(), None)]);
    assert_eq!(there.looks(), [delete]);
    there.are(Stands::Ended);
    there.poll.revoked(attempt(4));
    let both = orders.iter().map(|order| order.name.clone()).collect();
    assert_eq!(there.looks(), [Action::Remove(both)]);
    assert_eq!(there.looks(), []);
    assert!(there.poll.is_empty());
}

#[test]
fn an_image_that_is_too_large_for_an_array_is_several() {
    let mut there = there();
    for number in 0..250 {
        there.poll.leased(lease(number, 0));
    }
    let orders = there.submits();
    let sizes: Vec<_> = orders.iter().map(|order| order.tasks.len()).collect();
    assert_eq!(sizes, [100, 100, 50]);
}

#[test]
fn what_was_killed_goes_back_and_its_limit_is_drawn_from_its_blocks() {
    let mut there = there();
    there.poll.leased(lease(0, 0));
    let first = there.submits().remove(0);
    assert_eq!(first.time_limit, None);
    there.brings(0, 1);
    there.are(Stands::Ended);
    assert_eq!(there.looks()[0], Action::GiveBack(vec![attempt(0)]));
    // The scheduler leases the rest.
    there.poll.leased(Lease {
        wanted: lease(0, 0).tile.blocks().skip(1).collect(),
        attempt: attempt(9),
        ..lease(0, 0)
    });
    let again = there.submits().remove(0);
    assert_eq!(again.tasks[0].wanted.len(), 1);
    assert_eq!(again.time_limit, Some(LIMIT_LEAST));
}

#[test]
fn three_tries_without_a_block_fail_a_tile_and_one_block_forgives() {
    let mut there = there();
    let mut limits = Vec::new();
    for (number, blocks) in [(0, 0), (100, 0), (200, 1), (300, 0), (400, 0), (500, 0)] {
        there.poll.leased(Lease {
            expected: Span::from_secs(100),
            ..lease(number, 0)
        });
        limits.push(there.submits().remove(0).time_limit.unwrap().0 / 1_000_000);
        there.brings(number, blocks);
        there.are(Stands::Ended);
        let actions = there.looks();
        let fails = |action: &Action| matches!(action, Action::Fail { .. });
        assert_eq!(actions.iter().any(fails), number == 500, "{actions:?}");
    }
    // 100 s by two threads four times, and a minute; twice that after each try that brought nothing.
    assert_eq!(limits, [260, 520, 1_040, 120, 240, 480]);
}

#[test]
fn a_folder_that_is_full_blames_no_tile_keeps_what_runs_and_is_left_alone_until_there_is_room() {
    let mut there = there();
    for number in 0..3 {
        there.poll.leased(lease(number, 0));
    }
    let order = there.submits().remove(0);
    let is_full = |there: &There| (there.poll.credit(), there.poll.full().is_some());
    assert_eq!(is_full(&there), (2, false));
    // One runs, one waits, one could not write; and there is no room for more.
    let stand = [Stands::Runs, Stands::Waits, Stands::Full];
    for (task, stands) in there.seen.arrays[0].tasks.iter_mut().zip(stand) {
        task.0 = stands;
    }
    there.seen.full = Some("no space left on device".into());
    let back = Action::GiveBack(vec![attempt(2), attempt(1)]);
    let delete = Action::Delete(vec![(order.name.clone(), Some(2))]);
    assert_eq!(there.looks(), [back, delete]);
    assert_eq!(is_full(&there), (0, true));
    assert_eq!(there.poll.held(), [attempt(0)]);
    // What is leased before that is heard goes back, too.
    there.poll.leased(lease(10, 1));
    assert_eq!(there.poll.orders(there.now), []);
    assert_eq!(there.looks(), [Action::GiveBack(vec![attempt(10)])]);
    // However often one tries.
    for number in (100..600).step_by(100) {
        there.are(Stands::Ended);
        there.seen.full = Some("no space left on device".into());
        there.looks();
        there.seen.full = None;
        there.poll.leased(lease(number, 0));
        let orders = there.submits();
        assert_eq!((is_full(&there), orders.len()), ((2, false), 1));
        there.are(Stands::Full);
        let actions = there.looks();
        assert_eq!(actions[0], Action::GiveBack(vec![attempt(number)]));
        assert_eq!(is_full(&there), (0, true), "what a task says is believed");
    }
}

#[test]
fn a_refusal_for_want_of_room_is_over_when_there_is_room() {
    let mut there = there();
    there.poll.leased(lease(0, 0));
    let order = there.submits().remove(0);
    there.seen.arrays.clear();
    there.poll.refused(there.now, &order.name, "no room".into());
    there.poll.quiet_until = there.now + Span::from_secs(1_000_000);
    there.seen.full = Some("no space left on device".into());
    assert_eq!(there.looks(), [Action::GiveBack(vec![attempt(0)])]);
    there.seen.full = None;
    there.poll.leased(lease(1, 0));
    assert_eq!(there.submits().len(), 1);
    assert_eq!(there.poll.standing().trouble, None);
}

#[test]
fn what_was_refused_is_submitted_again_after_a_while_and_never_twice() {
    let mut there = there();
    there.poll.leased(lease(0, 0));
    let order = there.submits().remove(0);
    there.poll.refused(there.now, &order.name, "no room".into());
    assert_eq!(there.poll.standing().trouble.as_deref(), Some("no room"));
    // It came there all the same.
    assert_eq!(there.submits(), []);
    there.poll.revoked(attempt(0));
    there.are(Stands::Ended);
    there.looks();

    there.poll.leased(lease(1, 0));
    let order = there.submits().remove(0);
    there.seen.arrays.clear();
    there.poll.refused(there.now, &order.name, "no room".into());
    there.poll.quiet_until = there.now + Span::from_secs(31);
    assert_eq!(there.submits(), []);
    let again = there.submits().remove(0);
    assert_ne!(again.name, order.name);
    assert_eq!(again.tasks, order.tasks);
}

#[test]
fn what_ran_is_taken_up_and_what_waited_is_deleted() {
    let mut before = there();
    for number in 0..3 {
        before.poll.leased(lease(number, 0));
    }
    let order = before.submits().remove(0);
    before.seen.arrays[0].tasks[0].0 = Stands::Runs;
    before.seen.arrays[0].tasks[1] = SeenTask(Stands::Ended, 40);
    let mut now = there();
    now.seen = before.seen;
    let begun = now.poll.takes_up(&now.seen);
    let begun: Vec<_> = begun.iter().map(|begun| begun.attempt).collect();
    assert_eq!(begun, [attempt(0), attempt(1)]);
    // The scheduler has given one to somebody else.
    now.poll.keeps(&[attempt(0)]);
    assert_eq!(now.looks(), [Action::Delete(vec![(order.name, Some(3))])]);
    assert_eq!(now.looks(), []);
    assert_eq!(now.poll.wants()[0].offsets, [Some(0), None, None]);
}

#[test]
fn what_is_durable_already_is_not_fetched_again() {
    let mut before = there();
    before.poll.leased(lease(0, 0));
    before.poll.leased(lease(1, 0));
    before.submits();
    before.are(Stands::Ended);
    let mut now = there();
    now.seen = before.seen;
    now.seen.arrays[0].tasks = vec![SeenTask(Stands::Ended, 99); 2];
    let begun = now.poll.takes_up(&now.seen);
    assert_eq!(begun.len(), 2);
    let blocks: Vec<Rect> = lease(0, 0).tile.blocks().collect();
    now.poll.keeps(&[attempt(0), attempt(1)]);
    now.poll.lacks(attempt(0), &blocks[1..]);
    now.poll.lacks(attempt(1), &[]);
    assert_eq!(now.poll.held(), [attempt(0)]);
    let wants = now.poll.wants().remove(0);
    assert_eq!(wants.offsets, [Some(0), None]);
    assert_eq!(wants.but, [vec![edges(blocks[0])], vec![]]);
    let came = |now: &mut There, block| now.poll.delivered(attempt(0), block, TAKES);
    assert_eq!(came(&mut now, blocks[0]), Came::Again);
    assert_eq!(came(&mut now, blocks[1]), Came::First);
    assert!(now.poll.held().is_empty());
}

#[test]
fn what_was_durable_at_one_hello_is_not_fetched_after_the_next() {
    let mut there = there();
    there.poll.leased(lease(0, 0));
    there.submits();
    there.are(Stands::Runs);
    there.looks();
    let blocks: Vec<Rect> = lease(0, 0).tile.blocks().collect();
    // Nothing was fetched between the two.
    for _ in 0..2 {
        there.poll.lacks(attempt(0), &blocks[1..]);
        let wants = there.poll.wants().remove(0);
        assert_eq!(wants.but, [vec![edges(blocks[0])]]);
    }
}

#[test]
fn a_task_whose_host_is_gone_is_given_back_by_nobody_s_fault() {
    let mut there = there();
    for round in 0..5_u64 {
        let number = 100 * round;
        there.poll.leased(lease(number, 0));
        let order = there.submits().remove(0);
        there.are(Stands::Away);
        for _ in 1..AWAY_LOOKS {
            assert_eq!(there.looks(), []);
        }
        assert!(there.poll.standing().away > 0);
        // It is not deleted again and again: nobody there hears of it.
        let back = Action::GiveBack(vec![attempt(number)]);
        let delete = Action::Delete(vec![(order.name.clone(), None)]);
        assert_eq!(there.looks(), [back, delete]);
        assert_eq!(there.looks(), []);
        there.are(Stands::Ended);
        assert_eq!(there.looks(), [Action::Remove(vec![order.name])]);
    }
}

#[test]
fn arrays_of_nobody_are_ended_and_removed() {
    let mut before = there();
    before.poll.leased(lease(0, 0));
    let order = before.submits().remove(0);
    let mut now = there();
    now.seen = before.seen;
    let delete = Action::Delete(vec![(order.name.clone(), None)]);
    assert_eq!(now.looks(), [delete]);
    now.are(Stands::Ended);
    assert_eq!(now.looks(), [Action::Remove(vec![order.name])]);
}

#[test]
fn an_image_that_has_begun_is_no_stock() {
    let mut there = there();
    for number in 0..8 {
        there.poll.leased(lease(number, u32::from(number > 3)));
    }
    let orders = there.submits();
    assert_eq!(there.poll.credit(), 2);
    // The first image's last task runs beside the second's first: a third may come.
    there.seen.arrays[0].tasks = vec![SeenTask(Stands::Runs, 0); 4];
    there.seen.arrays[1].tasks[0] = SeenTask(Stands::Runs, 0);
    assert_eq!(there.submits(), []);
    assert_eq!(
        there.poll.credit(),
        5,
        "two have begun, and five tasks in one look"
    );
    for number in 0..4 {
        there.brings(number, 2);
    }
    there.seen.arrays[0].tasks = vec![SeenTask(Stands::Ended, 0); 4];
    let remove = Action::Remove(vec![orders[0].name.clone()]);
    assert_eq!(there.looks(), [remove]);
    assert_eq!(there.poll.credit(), 3);
}

#[test]
fn nothing_waits_where_the_site_says_so() {
    let mut there = there();
    there.poll = Poll::new(Settings {
        ahead: 0,
        ..there.poll.settings.clone()
    });
    for number in 0..4 {
        there.poll.leased(lease(number, 0));
    }
    there.submits();
    there.are(Stands::Runs);
    there.looks();
    assert_eq!(there.poll.credit(), 1);
}
