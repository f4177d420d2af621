//! How many events a second the scheduler takes, and how much memory tiles in flight need.
//!
//! 10,000 workers hold two of 1,000,000 tiles each. For every tile a worker asks for another one, and sends
//! its block or, one time in twenty, says that it failed; every second each worker gives a sign of life.
//! `cargo bench -p sched --bench events`
#![expect(clippy::print_stdout, reason = "a bench prints what it measured")]

use std::collections::{BTreeSet, VecDeque};
use std::time::Instant;

use model::{
    Digest, Epoch, Lease, Resolution, Revision, Running, Span, SubmissionId, Timestamp, WorkerId,
};
use sched::{BlockRef, Config, Effect, Event, LinkId, Needs, Offer, Sched, Submission, TileShape};

const WORKERS: u64 = 10_000;
const TILES: u64 = 1_000_000;

/// One tile of so many fails.
const FAILS_ONE_OF: u64 = 20;

struct Farm {
    sched: Sched,
    now: Timestamp,
    out: Vec<Effect>,
    held: VecDeque<(WorkerId, Lease)>,
    events: u64,
}

impl Farm {
    fn tell(&mut self, event: Event) {
        self.events += 1;
        self.sched.handle(self.now, event, &mut self.out);
        for effect in self.out.drain(..) {
            match effect {
                Effect::Lease { worker, lease } => self.held.push_back((worker, lease)),
                Effect::GiveUp { reason, .. } => panic!("{reason}"),
                _ => {}
            }
        }
    }
}

fn worker(id: u64) -> WorkerId {
    WorkerId { id, incarnation: 1 }
}

/// Resident memory of this process in bytes; 0 where that cannot be told.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = status
        .split(' ')
        .nth(1)
        .and_then(|pages| pages.parse().ok());
    pages.unwrap_or(0_u64) * 4_096
}

/// Whether an attempt fails; no two in a row for a reason.
fn fails(number: u64) -> bool {
    (number.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32).is_multiple_of(FAILS_ONE_OF)
}

/// What this thread has had of a processor, in seconds: what else the machine does is left out.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = stat
        .split(' ')
        .next()
        .and_then(|first| first.parse::<f64>().ok());
    nanoseconds.unwrap_or(f64::NAN) / 1e9
}

fn farm(tiles: TileShape, count: u64) -> Farm {
    // 256 by 256 grid squares.
    let window = Resolution {
        width: 8_192,
        height: 8_192,
    };
    let per_image = 65_536;
    let images = count.div_ceil(per_image);
    let mut farm = Farm {
        sched: Sched::new(Config {
            images_in_flight_max: 64,
            tile_failures_max: 1_000,
            ..Config::new(Epoch(1))
        }),
        now: Timestamp(1),
        out: Vec::new(),
        held: VecDeque::new(),
        events: 0,
    };
    farm.tell(Event::Submit(Submission {
        submission: SubmissionId(1),
        name: "bench".into(),
        scene: Digest([0; 32]),
        revision: Revision(1),
        frames: format!("0..{images}").parse().expect("a range"),
        window: window.rect(),
        tiles,
        priority: 0,
        share: 1,
        needs: Needs::default(),
        after: Vec::new(),
    }));
    for id in 0..WORKERS {
        farm.tell(Event::WorkerJoined {
            worker: worker(id),
            link: LinkId(id),
            offer: Offer {
                revision: Revision(1),
                threads: 1,
                memory_bytes: 0,
                labels: BTreeSet::new(),
                time_left: None,
            },
            held: Vec::new(),
            begun: Vec::new(),
        });
    }
    for id in 0..WORKERS {
        let worker = worker(id);
        farm.tell(Event::Credit { worker, credit: 2 });
    }
    farm
}

fn run(name: &str, tiles: TileShape, count: u64) {
    let before = resident();
    let mut farm = farm(tiles, count);
    farm.events = 0;
    let mut peak = 0;
    let mut done = 0_u64;
    let start = (Instant::now(), cpu_seconds());
    while let Some((worker, lease)) = farm.held.pop_front() {
        if farm.sched.attempt(lease.attempt).is_none() {
            continue;
        }
        farm.now = farm.now + Span(100);
        farm.tell(Event::Credit { worker, credit: 2 });
        done += 1;
        if fails(lease.attempt.number) {
            let attempt = lease.attempt;
            let reason = "out of memory".into();
            farm.tell(Event::TileFailed {
                worker,
                attempt,
                reason,
            });
        } else {
            for rect in lease.blocks() {
                farm.tell(Event::BlockStored {
                    worker,
                    block: BlockRef {
                        attempt: lease.attempt,
                        image: lease.image,
                        rect,
                    },
                    elapsed: Span::from_secs(1),
                    pixels: Digest([1; 32]),
                });
            }
        }
        if done.is_multiple_of(10_000) {
            beat(&mut farm);
            peak = peak.max(resident());
        }
    }
    let took = start.0.elapsed();
    let cpu = cpu_seconds() - start.1;
    let job = farm.sched.jobs().next().expect("it was submitted");
    assert_eq!(job.pixels_done, job.pixels);
    let rate = farm.events as f64 / cpu;
    let bytes = peak.saturating_sub(before);
    println!(
        "events/{name}: {} tiles, {} events in {cpu:.2} s of one processor ({took:.2?}): {rate:.0} events/s; {} MiB in all, {} bytes per tile",
        done,
        farm.events,
        bytes >> 20,
        bytes / count,
    );
}

/// Every worker gives a sign of life.
fn beat(farm: &mut Farm) {
    let mut running = vec![Vec::new(); usize::try_from(WORKERS).expect("it is small")];
    for (worker, lease) in &farm.held {
        let of_worker = &mut running[usize::try_from(worker.id).expect("it is small")];
        if of_worker.is_empty() {
            of_worker.push(Running {
                attempt: lease.attempt,
                blocks: 0,
            });
        }
    }
    for (id, running) in (0..).zip(running) {
        let worker = worker(id);
        farm.tell(Event::Heartbeat { worker, running });
    }
    farm.tell(Event::Tick);
}

fn main() {
    let size = TileShape::Size {
        width: 32,
        height: 32,
    };
    let count = std::env::var("TILES")
        .ok()
        .and_then(|count| count.parse().ok());
    let count = count.unwrap_or(TILES);
    run("size", size, count);
    run("time", TileShape::Time { aim: None }, count);
}
