//! A polled site with few slots, looked at every half minute, hour after hour (thesis §C.3.5): how long a slot is free
//! while nothing of ours waits in the queue. The queue, the tasks' times and the farm behind it are simulated; what is
//! submitted, and when, is `cluster::poll`'s own decision.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    clippy::print_stdout,
    reason = "a test ends where something is not as it must be, counts seconds, and says the shares to who asks"
)]

use std::collections::BTreeMap;

use cluster::busy::{Free, Look};
use cluster::orders::{Order, Seen, SeenArray, SeenTask, Stands};
use cluster::poll::{Action, Poll, Settings};
use model::{
    AttemptId, Digest, Epoch, ImageNumber, ImageRef, JobId, Lease, Rect, Revision, Span, Timestamp,
};

/// What a farm renders at a site, and how. Times in seconds.
#[derive(Clone, Copy)]
struct Case {
    ahead: u32,
    slots: u32,
    poll: u64,
    images: u32,
    image_tasks: u32,
    array_max: u32,
    /// The median of what a task takes…
    task: f64,
    /// …and the standard deviation of its logarithm.
    spread: f64,
}

/// Snowdon's: 800×600 pixels in tiles of 5000, four at a time (thesis §C.3.2, table C.1).
const SNOWDON: Case = Case {
    ahead: 1,
    slots: 4,
    poll: 30,
    images: 40,
    image_tasks: 48,
    array_max: 75_000,
    task: 240.0,
    spread: 0.7,
};

/// A task of the simulated queue.
#[derive(Clone, Copy)]
struct Task {
    stands: Stands,
    takes: u64,
    ends: u64,
}

struct There {
    case: Case,
    poll: Poll,
    now: u64,
    /// In the order in which they were submitted; the queue starts the first first.
    arrays: Vec<(Order, Vec<Task>)>,
    running: u32,
    /// Tiles that are not rendered yet, of each image that is held.
    open: BTreeMap<u32, u32>,
    next_image: u32,
    attempts: u64,
    key: u64,
    looks: Vec<Look>,
    /// Seconds since the queue was full first, up to when the last image was submitted; and those in which a slot was free.
    counted: u64,
    free: u64,
}

/// The shares of the time in which a slot was free: as it was, and as the looks tell it.
struct Shares {
    was: f64,
    told: f64,
}

impl Case {
    fn runs(self) -> Shares {
        let settings = Settings {
            names: "flyby-x-a.1-".into(),
            revision: Revision(1),
            threads: 1,
            running_max: None,
            array_max: self.array_max,
            ahead: self.ahead,
            time_limit: None,
            time_max: None,
        };
        let mut there = There {
            case: self,
            poll: Poll::new(settings),
            now: 0,
            arrays: Vec::new(),
            running: 0,
            open: BTreeMap::new(),
            next_image: 0,
            attempts: 0,
            key: 1,
            looks: Vec::new(),
            counted: 0,
            free: 0,
        };
        while there.next_image < self.images || !there.open.is_empty() {
            if there.now.is_multiple_of(self.poll) {
                there.look();
            }
            there.second();
            assert!(there.now < 10_000_000, "it ends");
        }
        Shares {
            was: there.free as f64 / there.counted as f64,
            told: Free::of(&there.looks, self.slots).share().unwrap(),
        }
    }
}

impl There {
    /// A number from 0 to 1.
    fn random(&mut self) -> f64 {
        // SplitMix64.
        self.key = self.key.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut word = self.key;
        word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((word ^ (word >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Lognormal.
    fn takes(&mut self) -> u64 {
        let normal = (0..12).map(|_| self.random()).sum::<f64>() - 6.0;
        (self.case.task * libm::exp(self.case.spread * normal)).max(1.0) as u64
    }

    /// The farm leases images up to the site's credit.
    fn leases(&mut self) {
        while self.next_image < self.case.images && self.open.len() < self.poll.credit() as usize {
            for tile in 0..self.case.image_tasks {
                self.attempts += 1;
                self.poll
                    .leased(lease(self.attempts, self.next_image, tile));
            }
            self.open.insert(self.next_image, self.case.image_tasks);
            self.next_image += 1;
        }
    }

    fn look(&mut self) {
        self.fetch();
        self.leases();
        let seen = self.seen();
        for action in self.poll.observe(&seen) {
            match action {
                Action::Remove(names) => {
                    self.arrays
                        .retain(|(order, _)| !names.contains(&order.name));
                }
                other => panic!("nothing fails here: {other:?}"),
            }
        }
        self.leases();
        let orders = self.poll.orders(Timestamp(self.now * 1_000_000));
        let (running, waiting) = (self.poll.standing().running, self.poll.standing().waiting);
        self.looks.push(Look {
            at_unix_ms: self.now * 1_000,
            running,
            waiting,
            submitted: orders.iter().map(|order| order.tasks.len() as u32).sum(),
            has_more: self.next_image < self.case.images,
        });
        for order in orders {
            let tasks = order.tasks.iter().map(|_| Task {
                stands: Stands::Waits,
                takes: self.takes(),
                ends: 0,
            });
            let tasks = tasks.collect();
            self.arrays.push((order, tasks));
        }
    }

    /// Blocks of tasks that have ended are delivered.
    fn fetch(&mut self) {
        for (order, tasks) in &self.arrays {
            for (number, task) in (1..).zip(tasks) {
                let lease = order.lease(number).unwrap();
                if task.stands == Stands::Ended && self.poll.held().contains(&lease.attempt) {
                    self.poll
                        .delivered(lease.attempt, lease.tile, Span::from_secs(task.takes));
                    let left = self.open.get_mut(&order.image).unwrap();
                    *left -= 1;
                    if *left == 0 {
                        self.open.remove(&order.image);
                    }
                }
            }
        }
    }

    fn seen(&self) -> Seen {
        let array = |(order, tasks): &(Order, Vec<Task>)| SeenArray {
            name: order.name.clone(),
            is_submitted: true,
            order: None,
            tasks: tasks.iter().map(|task| SeenTask(task.stands, 0)).collect(),
        };
        Seen {
            arrays: self.arrays.iter().map(array).collect(),
            files: Vec::new(),
            full: None,
        }
    }

    /// A second passes: tasks end, and others begin in the slots that are free.
    fn second(&mut self) {
        self.now += 1;
        let mut waiting = 0;
        for task in self.arrays.iter_mut().flat_map(|array| &mut array.1) {
            if task.stands == Stands::Runs && task.ends <= self.now {
                task.stands = Stands::Ended;
                self.running -= 1;
            }
        }
        for task in self.arrays.iter_mut().flat_map(|array| &mut array.1) {
            if task.stands == Stands::Waits && self.running < self.case.slots {
                task.stands = Stands::Runs;
                task.ends = self.now + task.takes;
                self.running += 1;
            }
            waiting += u32::from(task.stands == Stands::Waits);
        }
        if self.next_image < self.case.images {
            self.counted += 1;
            self.free += u64::from(waiting == 0 && self.running < self.case.slots);
        }
    }
}

fn lease(number: u64, image: u32, tile: u32) -> Lease {
    Lease {
        attempt: AttemptId {
            epoch: Epoch(1),
            number,
        },
        image: ImageRef {
            job: JobId(1),
            image: ImageNumber(image),
        },
        scene: Digest([3; 32]),
        tile: Rect {
            x0: 32 * tile,
            y0: 0,
            x1: 32 * tile + 32,
            y1: 32,
        },
        wanted: Vec::new(),
        expected: Span(0),
    }
}

fn share(case: Case) -> f64 {
    let shares = case.runs();
    let (was, told) = (100.0 * shares.was, 100.0 * shares.told);
    println!(
        "ahead {}, {} tasks of {} s in {} slots, every {} s: a slot free for {was:.2} %, by the looks {told:.2} %",
        case.ahead, case.image_tasks, case.task, case.slots, case.poll
    );
    // What people are shown is what was.
    assert!((was - told).abs() < 1.0 + was / 5.0, "{was} % and {told} %");
    shares.was
}

#[test]
fn with_one_image_ahead_no_slot_waits() {
    for poll in [30, 300] {
        let [none, one, two] = [0, 1, 2].map(|ahead| {
            share(Case {
                ahead,
                poll,
                ..SNOWDON
            })
        });
        assert!(one < 0.001 && two < 0.001, "{one} {two}");
        // Thesis §C.3.5: what schedule-ahead is for.
        assert!(none > 0.03, "{none}");
    }
}

#[test]
fn a_task_that_takes_very_long_holds_up_nothing() {
    // One task of an image may take as long as all others together.
    let case = Case {
        image_tasks: 12,
        spread: 1.5,
        ..SNOWDON
    };
    assert!(share(case) < 0.001);
}

#[test]
fn an_image_of_several_arrays_is_one() {
    let case = Case {
        array_max: 10,
        ..SNOWDON
    };
    assert!(share(case) < 0.001);
}

#[test]
fn where_images_are_rendered_between_two_looks_more_wait() {
    // The thesis's Everest: an image takes less than a poll.
    let quick = Case {
        slots: 64,
        images: 2_000,
        poll: 300,
        task: 60.0,
        ..SNOWDON
    };
    let share_of_quick = share(quick);
    assert!(share_of_quick < 0.02, "{share_of_quick}");
    // An image that has as many tasks as there are slots, or fewer.
    for image_tasks in [2, 4, 6] {
        let small = Case {
            image_tasks,
            images: 2_000,
            task: 45.0,
            ..SNOWDON
        };
        let share_of_small = share(small);
        assert!(share_of_small < 0.02, "{image_tasks}: {share_of_small}");
    }
}
