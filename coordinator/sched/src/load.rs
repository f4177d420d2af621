//! A farm that keeps a scheduler busy, for measuring: workers that answer at once, and a clock that only events move.
//!
//! Every worker holds up to two tiles. For every tile its worker asks for another one, and sends its block or, one
//! time in twenty, says that it failed; once in so many tiles each worker gives a sign of life. Images are encoded at
//! once. It reads no clock: whoever measures has one. `benches/events.rs` and `flyby bench farm` do.

use alloc::collections::{BTreeSet, VecDeque};
use alloc::vec::Vec;

use model::{
    Digest, Epoch, FrameRange, Lease, Resolution, Revision, Running, Span, SubmissionId, Timestamp,
    WorkerId,
};

use crate::{BlockRef, Config, Effect, Event, LinkId, Needs, Offer, Sched, Submission, TileShape};

/// One tile of so many fails.
const FAILS_ONE_OF: u64 = 20;

/// Grid squares of an image: 256 by 256.
const PER_IMAGE: u64 = 65_536;

/// Tiles between two signs of life of every worker.
const BEAT_EVERY: u64 = 10_000;

/// How large a [`Load`] is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LoadSize {
    /// Workers of one thread.
    pub workers: u64,
    /// Grid squares to render, in whole images of 65,536.
    pub squares: u64,
}

/// A scheduler, its workers and one job.
#[derive(Debug)]
pub struct Load {
    sched: Sched,
    now: Timestamp,
    out: Vec<Effect>,
    held: VecDeque<(WorkerId, Lease)>,
    workers: u64,
    events: u64,
    tiles: u64,
}

impl Load {
    /// Workers that hold their first tiles. What that took counts as no events.
    pub fn new(tiles: TileShape, size: LoadSize) -> Self {
        let window = Resolution {
            width: 8_192,
            height: 8_192,
        };
        let images = size.squares.div_ceil(PER_IMAGE).clamp(1, 1 << 20);
        let images = u32::try_from(images).expect("it was clamped");
        let mut load = Self {
            sched: Sched::new(Config {
                images_in_flight_max: 64,
                tile_failures_max: 1_000,
                ..Config::new(Epoch(1))
            }),
            now: Timestamp(1),
            out: Vec::new(),
            held: VecDeque::new(),
            workers: size.workers,
            events: 0,
            tiles: 0,
        };
        load.tell(Event::Submit(Submission {
            submission: SubmissionId(1),
            name: "bench".into(),
            scene: Digest([0; 32]),
            revision: Revision(1),
            frames: FrameRange::new(0, images, 1).expect("there is an image"),
            window: window.rect(),
            tiles,
            priority: 0,
            share: 1,
            needs: Needs::default(),
            after: Vec::new(),
        }));
        for id in 0..size.workers {
            load.tell(Event::WorkerJoined {
                worker: worker(id),
                link: LinkId(id),
                offer: Offer {
                    revision: Revision(1),
                    threads: 1,
                    memory_bytes: 0,
                    labels: BTreeSet::new(),
                    time_left: None,
                    queue: None,
                },
                held: Vec::new(),
                begun: Vec::new(),
            });
        }
        for id in 0..size.workers {
            let worker = worker(id);
            load.tell(Event::Credit { worker, credit: 2 });
        }
        load.events = 0;
        load
    }

    /// Events that the scheduler was told so far.
    pub fn events(&self) -> u64 {
        self.events
    }

    /// Tiles that were answered for so far, failed ones included.
    pub fn tiles(&self) -> u64 {
        self.tiles
    }

    /// Whether every pixel is there.
    pub fn is_done(&self) -> bool {
        let mut jobs = self.sched.jobs();
        jobs.all(|job| job.pixels_done == job.pixels)
    }

    /// Answers for the tile that was leased first; false where none is held.
    pub fn step(&mut self) -> bool {
        let Some((worker, lease)) = self.held.pop_front() else {
            return false;
        };
        if self.sched.attempt(lease.attempt).is_none() {
            return true;
        }
        self.now = self.now + Span(100);
        self.tell(Event::Credit { worker, credit: 2 });
        self.tiles += 1;
        if fails(lease.attempt.number) {
            self.tell(Event::TileFailed {
                worker,
                attempt: lease.attempt,
                reason: "out of memory".into(),
            });
        } else {
            for rect in lease.blocks() {
                self.tell(Event::BlockStored {
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
        if self.tiles.is_multiple_of(BEAT_EVERY) {
            self.beat();
        }
        true
    }

    /// Every worker gives a sign of life.
    fn beat(&mut self) {
        let mut running: Vec<Vec<Running>> = (0..self.workers).map(|_| Vec::new()).collect();
        for (worker, lease) in &self.held {
            let place = usize::try_from(worker.id).ok();
            if let Some(of_worker) = place.and_then(|place| running.get_mut(place))
                && of_worker.is_empty()
            {
                of_worker.push(Running {
                    attempt: lease.attempt,
                    blocks: 0,
                });
            }
        }
        for (id, running) in (0..).zip(running) {
            let worker = worker(id);
            self.tell(Event::Heartbeat { worker, running });
        }
        self.tell(Event::Tick);
    }

    fn tell(&mut self, event: Event) {
        self.events += 1;
        self.sched.handle(self.now, event, &mut self.out);
        let mut encoded = None;
        for effect in self.out.drain(..) {
            match effect {
                Effect::Lease { worker, lease } => self.held.push_back((worker, lease)),
                Effect::Encode { image } => encoded = Some(image),
                _ => {}
            }
        }
        if let Some(image) = encoded {
            let film = Digest([1; 32]);
            self.tell(Event::ImageEncoded { image, film });
        }
    }
}

fn worker(id: u64) -> WorkerId {
    WorkerId { id, incarnation: 1 }
}

/// Whether an attempt fails; no two in a row for a reason.
fn fails(number: u64) -> bool {
    (number.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32).is_multiple_of(FAILS_ONE_OF)
}
