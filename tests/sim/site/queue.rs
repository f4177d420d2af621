//! The cluster: arrays whose tasks wait for slots, render their blocks one after the other into a file each, and are ended by
//! limits, by their hosts or by whoever asks. It lives by itself: what happened is found out when somebody looks.

use std::collections::{BTreeSet, VecDeque};

use cluster::orders::{Order, Seen, SeenArray, SeenTask, Stands, Wants, edges};
use model::{AttemptId, ImageRef, Rect, Span, Timestamp};
use sched::BlockRef;

use crate::random::Random;

/// Blocks that one call brings, at most.
const FETCH_MAX: usize = 6;

pub(super) struct Queue {
    slots: u64,
    pace: Span,
    /// In the order in which they were submitted.
    arrays: Vec<Array>,
    /// Until when it has lived.
    now: Timestamp,
    /// So many of 1,000 blocks are the last of a task that is not done.
    pub(super) deaths: u64,
    random: Random,
}

struct Array {
    order: Order,
    tasks: Vec<Task>,
}

struct Task {
    attempt: AttemptId,
    image: ImageRef,
    stands: Stands,
    left: VecDeque<Rect>,
    /// Its file: whole blocks, and how long they took. An entry counts as one byte.
    file: Vec<(Rect, Span)>,
    /// When its block in hand is done, and how long that takes.
    next: (Timestamp, Span),
    /// When its limit ends it.
    limit: Timestamp,
}

/// A block of a task's file; none where it is not wanted.
pub(super) struct Fetched {
    pub(super) array: String,
    pub(super) task: u32,
    pub(super) end: u64,
    pub(super) block: Option<Block>,
}

/// A block as it stands in a file.
#[derive(Clone, Copy)]
pub(super) struct Block {
    pub(super) attempt: AttemptId,
    pub(super) image: ImageRef,
    pub(super) rect: Rect,
    pub(super) took: Span,
}

impl Block {
    pub(super) fn reference(&self) -> BlockRef {
        BlockRef {
            attempt: self.attempt,
            image: self.image,
            rect: self.rect,
        }
    }
}

impl Queue {
    pub(super) fn new(slots: u64, pace: Span, random: Random) -> Self {
        Self {
            slots,
            pace,
            arrays: Vec::new(),
            now: Timestamp(0),
            deaths: 0,
            random,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.arrays.is_empty()
    }

    pub(super) fn submit(&mut self, now: Timestamp, order: Order) {
        self.lives(now);
        let names = self.arrays.iter().map(|array| &array.order.name);
        assert!(
            names.clone().all(|name| *name != order.name),
            "no array is submitted twice"
        );
        let task = |number| {
            let lease = order.lease(number).expect("an order is whole");
            Task {
                attempt: lease.attempt,
                image: lease.image,
                stands: Stands::Waits,
                left: lease.blocks().collect(),
                file: Vec::new(),
                next: (now, Span(0)),
                limit: now,
            }
        };
        let tasks = (1..).zip(&order.tasks).map(|(number, _)| task(number));
        let tasks = tasks.collect();
        self.arrays.push(Array { order, tasks });
        self.begin(now);
    }

    pub(super) fn delete(&mut self, tasks: &[(String, Option<u32>)]) {
        for (name, number) in tasks {
            for array in self.arrays.iter_mut().filter(|it| it.order.name == *name) {
                for (task, it) in (1..).zip(&mut array.tasks) {
                    if number.is_none_or(|number| number == task) {
                        it.stands = Stands::Ended;
                    }
                }
            }
        }
        self.begin(self.now);
    }

    pub(super) fn remove(&mut self, names: &[String]) {
        self.arrays.retain(|array| {
            let is_removed = names.contains(&array.order.name);
            let mut tasks = array.tasks.iter();
            assert!(
                !is_removed || tasks.all(|task| task.stands == Stands::Ended),
                "the folder of what runs is not removed"
            );
            !is_removed
        });
    }

    /// How everything stands, and some of the blocks that are wanted; whether those are all.
    pub(super) fn look(
        &mut self,
        now: Timestamp,
        known: &BTreeSet<String>,
        wants: &[Wants],
    ) -> (Seen, Vec<Fetched>, bool) {
        self.lives(now);
        let arrays = self.arrays.iter().map(|array| SeenArray {
            name: array.order.name.clone(),
            is_submitted: true,
            order: (!known.contains(&array.order.name)).then(|| array.order.clone()),
            tasks: array
                .tasks
                .iter()
                .map(|task| SeenTask(task.stands, task.file.len() as u64))
                .collect(),
        });
        let seen = Seen {
            arrays: arrays.collect(),
            files: Vec::new(),
            full: None,
        };
        let mut fetched = Vec::new();
        for wants in wants {
            let array = self.arrays.iter().find(|it| it.order.name == wants.array);
            let tasks = array.into_iter().flat_map(|array| &array.tasks);
            for (place, (task, offset)) in tasks.zip(&wants.offsets).enumerate() {
                let Some(offset) = *offset else {
                    continue;
                };
                let but = wants.but.get(place).map_or(&[][..], Vec::as_slice);
                for (end, &(rect, took)) in (1..).zip(&task.file).filter(|it| it.0 > offset) {
                    let is_wanted = !but.contains(&edges(rect));
                    fetched.push(Fetched {
                        array: wants.array.clone(),
                        task: u32::try_from(place + 1).expect("arrays are small"),
                        end,
                        block: is_wanted.then_some(Block {
                            attempt: task.attempt,
                            image: task.image,
                            rect,
                            took,
                        }),
                    });
                }
            }
        }
        let is_whole = fetched.len() <= FETCH_MAX;
        fetched.truncate(FETCH_MAX);
        (seen, fetched, is_whole)
    }

    /// Lives through what has happened until now.
    fn lives(&mut self, now: Timestamp) {
        loop {
            let running = self.arrays.iter_mut().flat_map(|array| &mut array.tasks);
            let running = running.filter(|task| task.stands == Stands::Runs);
            let next = running.min_by_key(|task| task.next.0.min(task.limit));
            let Some(task) = next.filter(|task| task.next.0.min(task.limit) <= now) else {
                break;
            };
            self.now = task.next.0.min(task.limit);
            if task.limit < task.next.0 {
                task.stands = Stands::Ended;
            } else {
                let rect = task.left.pop_front().expect("it renders a block");
                task.file.push((rect, task.next.1));
                let took = self.random.span(self.pace);
                task.next = (self.now + took, took);
                if task.left.is_empty() {
                    task.stands = Stands::Ended;
                } else if self.random.happens(self.deaths) {
                    // Its host may be gone, of which the queue hears nothing.
                    task.stands = match self.random.below(3) {
                        0 => Stands::Away,
                        _ => Stands::Ended,
                    };
                }
            }
            self.begin(self.now);
        }
        self.now = now;
    }

    /// Tasks that wait begin where slots are free.
    fn begin(&mut self, now: Timestamp) {
        let all = || self.arrays.iter().flat_map(|array| &array.tasks);
        let running = all().filter(|task| task.stands == Stands::Runs).count();
        let mut free = self.slots.saturating_sub(running as u64);
        for array in &mut self.arrays {
            let limit = array.order.time_limit;
            let waiting = array.tasks.iter_mut();
            let waiting = waiting.filter(|task| task.stands == Stands::Waits);
            for task in waiting {
                if free == 0 {
                    return;
                }
                free -= 1;
                let took = self.random.span(self.pace);
                task.stands = Stands::Runs;
                task.next = (now + took, took);
                task.limit = limit.map_or(Timestamp(u64::MAX), |limit| now + limit);
            }
        }
    }
}
