//! How often tiles change hands on a small farm where much goes wrong: workers freeze, slow down, are lost and must be gone
//! soon. Whatever is called back or leased twice must be worth it, so that leases stay in proportion to tiles.
//! `cargo test --release -p sched --test to_and_fro -- --nocapture` prints the worst farms.

mod situation;

use std::collections::VecDeque;

use model::{Digest, JobId, Lease, Rect, Resolution, Running, Span, Timestamp};
use sched::{Config, Effect, Event, JobState, LinkId, Offer, Sched, TileShape, Verdict};
use situation::*;

const STEP: Span = Span::from_millis(10);

/// `SplitMix64`.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ (mixed >> 31)) % limit
    }
}

/// What goes wrong.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Trouble {
    Nothing,
    /// One worker is ten times as slow.
    Slow,
    /// Workers stand still for up to three seconds.
    Freezes,
    /// The coordinator stands still for up to three seconds.
    Pauses,
    /// Workers are lost and come back.
    Losses,
    /// Workers must be gone soon.
    Limits,
    Everything,
}

/// A lease at its worker.
struct Held {
    lease: Lease,
    blocks: VecDeque<Rect>,
    done: u32,
    /// When the block in hand was begun, and when it will be done.
    block: Option<(Timestamp, Timestamp)>,
}

struct Worker {
    id: u64,
    threads: u32,
    pace: u64,
    held: Vec<Held>,
    frozen_until: Timestamp,
    away_until: Option<Timestamp>,
    time_left: Option<Span>,
}

/// What was counted.
#[derive(Clone, Copy, Debug, Default)]
struct Counted {
    leases: u64,
    called_back: u64,
    seconds: u64,
    /// Leases that ended with their worker.
    ended: u64,
}

struct World {
    sched: Sched,
    now: Timestamp,
    out: Vec<Effect>,
    workers: Vec<Worker>,
    random: Random,
    /// The coordinator hears nothing before…
    paused_until: Timestamp,
    /// …and then of these blocks.
    late: Vec<(u64, sched::BlockRef, Span)>,
    links: u64,
    counted: Counted,
}

impl World {
    fn tell(&mut self, event: Event) {
        self.sched.handle(self.now, event, &mut self.out);
        let mut encoded = Vec::new();
        for effect in std::mem::take(&mut self.out) {
            match effect {
                Effect::Lease { worker, lease } => {
                    self.counted.leases += 1;
                    let worker = self.workers.iter_mut().find(|known| known.id == worker.id);
                    let blocks = lease.blocks().collect();
                    let held = Held {
                        lease,
                        blocks,
                        done: 0,
                        block: None,
                    };
                    worker.expect("it joined").held.push(held);
                }
                Effect::Revoke { attempt, .. } => {
                    for worker in &mut self.workers {
                        worker.held.retain(|held| held.lease.attempt != attempt);
                    }
                }
                Effect::Forget { worker } => {
                    let known = self.workers.iter_mut().find(|known| known.id == worker.id);
                    let known = known.expect("it joined");
                    self.counted.ended += known.held.len() as u64;
                    known.held.clear();
                    known.away_until = Some(self.now + Span::from_secs(1));
                }
                Effect::Encode { image } => encoded.push(image),
                _ => {}
            }
        }
        for image in encoded {
            let film = film(1);
            self.tell(Event::ImageEncoded { image, film });
        }
    }

    fn join(&mut self, place: usize) {
        self.links += 1;
        let Worker {
            id,
            threads,
            time_left,
            ..
        } = self.workers[place];
        self.tell(Event::WorkerJoined {
            worker: worker(id),
            link: LinkId(self.links),
            offer: Offer {
                threads,
                time_left,
                queue: None,
                ..offer()
            },
            held: vec![],
            begun: vec![],
        });
        let credit = threads + 6;
        self.tell(Event::Credit {
            worker: worker(id),
            credit,
        });
    }

    /// A worker renders for one step.
    fn works(&mut self, place: usize) {
        let now = self.now;
        let worker = &mut self.workers[place];
        if worker.frozen_until > now || worker.away_until.is_some() {
            return;
        }
        let (id, pace) = (worker.id, worker.pace);
        let mut stored = Vec::new();
        for held in worker.held.iter_mut().take(worker.threads as usize) {
            if let Some((began, done)) = held.block
                && done <= now
                && let Some(rect) = held.blocks.pop_front()
            {
                held.block = None;
                held.done += 1;
                stored.push((block_of(&held.lease, rect), now - began));
            }
            if held.block.is_none() {
                let takes = pace / 2 + self.random.below(pace);
                held.block = Some((now, now + Span(takes)));
            }
        }
        worker.held.retain(|held| !held.blocks.is_empty());
        let stored = stored.into_iter();
        self.late
            .extend(stored.map(|(block, elapsed)| (id, block, elapsed)));
        if self.paused_until <= now {
            self.hears();
        }
    }

    /// The coordinator takes what arrived.
    fn hears(&mut self) {
        for (id, block, elapsed) in std::mem::take(&mut self.late) {
            let worker = worker(id);
            if let Verdict::Refuse(_) = self.sched.accepts(worker, block) {
                continue;
            }
            let pixels = Digest([1; 32]);
            self.tell(Event::BlockStored {
                worker,
                block,
                elapsed,
                pixels,
            });
        }
    }

    fn beats(&mut self, place: usize) {
        let worker = &self.workers[place];
        if worker.frozen_until > self.now || worker.away_until.is_some() {
            return;
        }
        let running = worker.held.iter().filter(|held| held.block.is_some());
        let running = running.map(|held| Running {
            attempt: held.lease.attempt,
            blocks: held.done,
        });
        let (worker, running) = (situation::worker(worker.id), running.collect());
        self.tell(Event::Heartbeat { worker, running });
    }

    fn leaves(&mut self, place: usize) {
        let worker = worker(self.workers[place].id);
        self.tell(Event::Goodbye { worker });
    }

    fn goes_wrong(&mut self, trouble: Trouble) {
        let count = self.workers.len() as u64;
        let place = usize::try_from(self.random.below(count)).expect("it is small");
        let is = |of| trouble == of || trouble == Trouble::Everything;
        if is(Trouble::Freezes) && self.random.below(3) == 0 {
            let until = self.now + Span(self.random.below(3_000_000));
            self.workers[place].frozen_until = until;
        }
        if is(Trouble::Pauses) && self.random.below(3) == 0 {
            self.paused_until = self.now + Span(self.random.below(3_000_000));
        }
        if is(Trouble::Losses) && self.random.below(10) == 0 {
            self.leaves(place);
        }
        if is(Trouble::Limits) && self.random.below(3) == 0 {
            self.leaves(place);
            self.workers[place].away_until = None;
            self.workers[place].time_left = Some(Span(1_000_000 + self.random.below(9_000_000)));
            self.join(place);
        }
        for place in 0..self.workers.len() {
            let back = self.workers[place].away_until;
            if back.is_some_and(|back| back <= self.now) {
                self.workers[place].away_until = None;
                self.join(place);
            }
        }
    }
}

fn block_of(lease: &Lease, rect: Rect) -> sched::BlockRef {
    sched::BlockRef {
        attempt: lease.attempt,
        image: lease.image,
        rect,
    }
}

/// A job of so many images of 64 squares, cut by time or one square to a tile.
fn lives_through(key: u64, trouble: Trouble, tiles: TileShape) -> Counted {
    let mut random = Random(key);
    let count = 2 + random.below(4);
    let workers: Vec<Worker> = (0..count)
        .map(|id| Worker {
            id,
            threads: 1 + u32::try_from(random.below(3)).expect("it is small"),
            pace: 20_000 + random.below(150_000),
            held: Vec::new(),
            frozen_until: Timestamp(0),
            away_until: None,
            time_left: None,
        })
        .collect();
    let mut world = World {
        sched: Sched::new(Config::new(EPOCH)),
        now: Timestamp(1_000_000),
        out: Vec::new(),
        workers,
        random,
        paused_until: Timestamp(0),
        late: Vec::new(),
        links: 0,
        counted: Counted::default(),
    };
    if matches!(trouble, Trouble::Slow | Trouble::Everything) {
        world.workers[0].pace *= 10;
    }
    let mut job = submission(1, 6);
    job.tiles = tiles;
    job.window = Resolution {
        width: 256,
        height: 256,
    }
    .rect();
    world.tell(Event::Submit(job));
    for place in 0..world.workers.len() {
        world.join(place);
    }
    for step in 0..1_000_000_u64 {
        world.now = world.now + STEP;
        for place in 0..world.workers.len() {
            world.works(place);
            if step.is_multiple_of(100) && world.paused_until <= world.now {
                world.beats(place);
            }
        }
        if world.paused_until > world.now {
            continue;
        }
        if step % 100 == 50 {
            world.goes_wrong(trouble);
        }
        while world
            .sched
            .next_deadline()
            .is_some_and(|due| due <= world.now)
        {
            world.tell(Event::Tick);
        }
        let job = world.sched.job(JobId(1)).expect("it is known");
        if job.state != JobState::Running {
            world.counted.called_back = job.called_back;
            world.counted.seconds = job.seconds;
            return world.counted;
        }
    }
    panic!("{trouble:?} {key}: it ends");
}

/// Grid squares of all images.
const TILES_MOST: u64 = 6 * 64;

#[test]
fn leases_stay_in_proportion_to_tiles() {
    let one = TileShape::Size {
        width: 32,
        height: 32,
    };
    for (name, tiles) in [("size", one), ("time", TileShape::Time { aim: None })] {
        for trouble in [
            Trouble::Nothing,
            Trouble::Slow,
            Trouble::Freezes,
            Trouble::Pauses,
            Trouble::Losses,
            Trouble::Limits,
            Trouble::Everything,
        ] {
            let mut most = Counted::default();
            for key in 0..40 {
                let counted = lives_through(key, trouble, tiles);
                let Counted {
                    leases,
                    called_back,
                    seconds,
                    ended,
                } = counted;
                // At its end each of at most fifteen threads may be helped once or twice.
                assert!(called_back <= 30, "{name} {trouble:?} {key}: {counted:?}");
                assert!(seconds <= 30, "{name} {trouble:?} {key}: {counted:?}");
                let again = called_back + seconds + ended;
                assert!(
                    leases <= TILES_MOST + again,
                    "{name} {trouble:?} {key}: {counted:?}"
                );
                if leases > most.leases {
                    most = counted;
                }
            }
            println!("{name} {trouble:?}: {most:?}");
        }
    }
}
