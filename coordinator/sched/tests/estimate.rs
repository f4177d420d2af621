//! When a job will be over: foretold on the way, held against what then happens.

mod situation;

use std::collections::{BTreeMap, VecDeque};

use model::{Digest, JobId, Lease, Resolution, Span, Timestamp, WorkerId};
use sched::{BlockRef, Config, Effect, Event, LinkId, Sched, Submission, TileShape};
use situation::{EPOCH, farm, offer, submission, worker};

/// What the images of a real flyby took.
fn recorded() -> Vec<u64> {
    let text = include_str!("recorded/flyby.txt");
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    let numbers = lines.flat_map(str::split_whitespace);
    numbers
        .map(|number| number.parse().expect("a number"))
        .collect()
}

/// Workers that take exactly what was recorded, each at a speed of its own in per cent.
struct Farm {
    sched: Sched,
    now: Timestamp,
    costs: Vec<u64>,
    speeds: BTreeMap<WorkerId, u64>,
    waiting: BTreeMap<WorkerId, VecDeque<Lease>>,
    /// What each is at work on, and when it is done.
    busy: BTreeMap<WorkerId, (Timestamp, Lease)>,
}

const WINDOW: Resolution = Resolution {
    width: 128,
    height: 96,
};

impl Farm {
    fn new(costs: Vec<u64>, speeds: &[u64]) -> Self {
        let mut farm = Self {
            sched: Sched::new(Config::new(EPOCH)),
            now: Timestamp(1_000_000),
            speeds: (1..).map(worker).zip(speeds.iter().copied()).collect(),
            costs,
            waiting: BTreeMap::new(),
            busy: BTreeMap::new(),
        };
        let workers: Vec<WorkerId> = farm.speeds.keys().copied().collect();
        for (link, worker) in (1..).map(LinkId).zip(workers) {
            farm.tell(Event::WorkerJoined {
                worker,
                link,
                offer: offer(),
                held: vec![],
                begun: vec![],
            });
            farm.tell(Event::Credit { worker, credit: 3 });
        }
        farm
    }

    fn submit(&mut self, id: u128, priority: i32) {
        let images = u32::try_from(self.costs.len()).expect("few images");
        self.tell(Event::Submit(Submission {
            window: WINDOW.rect(),
            tiles: TileShape::Time { aim: None },
            priority,
            ..submission(id, images)
        }));
    }

    fn tell(&mut self, event: Event) {
        let mut effects = Vec::new();
        self.sched.handle(self.now, event, &mut effects);
        for effect in effects {
            match effect {
                Effect::Lease { worker, lease } => {
                    self.waiting.entry(worker).or_default().push_back(lease);
                }
                Effect::Revoke {
                    worker, attempt, ..
                } => {
                    let waiting = self.waiting.entry(worker).or_default();
                    waiting.retain(|lease| lease.attempt != attempt);
                    self.busy.retain(|_, (_, lease)| lease.attempt != attempt);
                }
                Effect::Encode { image } => self.tell(Event::ImageEncoded {
                    image,
                    film: Digest([1; 32]),
                }),
                _ => {}
            }
        }
    }

    /// What one thread of usual speed takes over a block: its part of what its image took.
    fn cost(&self, lease: &Lease, pixels: u64) -> u64 {
        let image = self.costs[lease.image.image.0 as usize];
        image * pixels / WINDOW.rect().area()
    }

    /// Goes on until a worker is done with something; whether there was anything.
    fn goes_on(&mut self) -> bool {
        for (&worker, &speed) in &self.speeds {
            let waiting = self.waiting.entry(worker).or_default();
            if self.busy.contains_key(&worker) {
                continue;
            }
            if let Some(lease) = waiting.pop_front() {
                let pixels: u64 = lease.blocks().map(model::Rect::area).sum();
                let image = self.costs[lease.image.image.0 as usize];
                let cost = image * pixels / WINDOW.rect().area();
                let took = Span(cost * 100 / speed);
                self.busy.insert(worker, (self.now + took, lease));
            }
        }
        let first = self.busy.iter().min_by_key(|(_, (done, _))| *done);
        let Some((&worker, &(done, _))) = first else {
            return false;
        };
        self.now = done;
        let (_, lease) = self.busy.remove(&worker).expect("it is busy");
        for rect in lease.blocks().collect::<Vec<_>>() {
            let took = self.cost(&lease, rect.area()) * 100 / self.speeds[&worker];
            self.tell(Event::BlockStored {
                worker,
                block: BlockRef {
                    attempt: lease.attempt,
                    image: lease.image,
                    rect,
                },
                elapsed: Span(took),
                pixels: Digest([1; 32]),
            });
        }
        true
    }

    fn part_done(&self, job: u64) -> f64 {
        let view = self.sched.job(JobId(job)).expect("it is there");
        view.pixels_done as f64 / view.pixels as f64
    }
}

/// Foretells at each of these parts of a job; how far each was off, and whether the truth lay within its bounds.
fn foretell(farm: &mut Farm, job: u64, parts: &[f64]) -> Vec<(f64, bool)> {
    let mut told = Vec::new();
    while farm.part_done(job) < 1.0 {
        if parts
            .get(told.len())
            .is_some_and(|part| farm.part_done(job) >= *part)
        {
            let estimate = farm.sched.time_left(JobId(job)).expect("it is measured");
            told.push((farm.now, estimate));
        }
        assert!(farm.goes_on());
    }
    let right = told.into_iter().map(|(then, estimate)| {
        let truth = farm.now - then;
        let within = (estimate.early..=estimate.late).contains(&truth);
        (estimate.left.0 as f64 / truth.0 as f64 - 1.0, within)
    });
    right.collect()
}

#[test]
fn after_a_tenth_of_the_flyby_its_end_is_known_within_fifteen_per_cent() {
    for speeds in [&[100][..], &[100; 8], &[40, 70, 100, 130, 250]] {
        let mut farm = Farm::new(recorded(), speeds);
        farm.submit(1, 0);
        let told = foretell(&mut farm, 1, &[0.1, 0.25, 0.5]);
        println!("{} workers: {told:?}", speeds.len());
        for (off, within) in &told {
            assert!(off.abs() <= 0.15, "{told:?}");
            assert!(within, "{told:?}");
        }
    }
}

#[test]
fn jobs_that_come_first_and_jobs_beside_it_are_taken_into_account() {
    let mut farm = Farm::new(recorded().into_iter().take(200).collect(), &[100; 4]);
    farm.submit(1, 0);
    farm.submit(2, 0);
    let told = foretell(&mut farm, 1, &[0.1, 0.5]);
    assert!(told.iter().all(|(off, _)| off.abs() <= 0.15), "{told:?}");

    let mut farm = Farm::new(recorded().into_iter().take(200).collect(), &[100; 4]);
    farm.submit(1, 0);
    while farm.part_done(1) < 0.2 {
        farm.goes_on();
    }
    farm.submit(2, 7);
    while farm.part_done(2) < 0.1 {
        farm.goes_on();
    }
    let told = foretell(&mut farm, 1, &[0.1]);
    assert!(told.iter().all(|(off, _)| off.abs() <= 0.15), "{told:?}");
}

#[test]
fn nobody_can_say_where_nothing_is_known_or_nobody_is_there() {
    let mut farm = farm();
    farm.job(2);
    let left = |farm: &situation::Farm| farm.sched.time_left(JobId(1));
    assert_eq!(left(&farm), None, "nothing is measured");
    farm.worker(1, 1).stores_tile(1, 1, 0, 0);
    let estimate = left(&farm).unwrap();
    assert!(estimate.early <= estimate.left && estimate.left <= estimate.late);
    farm.command(sched::Command::Pause);
    assert_eq!(left(&farm), None, "it is paused");
    farm.command(sched::Command::Resume);
    assert!(left(&farm).is_some());
    farm.is_told(Event::Goodbye { worker: worker(1) });
    assert_eq!(left(&farm), None, "nobody is there");
    assert_eq!(farm.sched.time_left(JobId(7)), None);
}
