//! How much longer a farm takes than its work divided by its speed.
//!
//! 1,000 workers of one thread, speeds over a factor of ten, 100 tiles of four blocks for each, whose times are
//! lognormal with σ = 1 and median 5 s on the slowest; 50 ms from a block's end to the next
//! lease. Ten images of one landscape: what a place takes in one image it takes in the next, give or
//! take a tenth. What is not so known is printed, too: images that have nothing to do with each other.
//! `cargo test --release -p sched --test makespan -- --include-ignored --nocapture`
#![expect(clippy::print_stdout, reason = "it prints what it measured")]

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use model::{
    Digest, Epoch, ImageRef, Lease, Rect, Resolution, Revision, Running, Span, SubmissionId,
    Timestamp, WorkerId,
};
use sched::{
    BlockRef, Config, Effect, Event, JobState, LinkId, Needs, Offer, Sched, Submission, TailGain,
    TileShape, Verdict,
};

const WORKERS: u64 = 1_000;
const IMAGES: u32 = 10;

/// Tiles along each side of an image; all images together have 100 tiles for each worker.
const SIDE: u32 = 100;

const ONE_WAY: Span = Span::from_millis(25);

/// SplitMix64, and a normal number as a sum of twelve even ones.
fn random(key: u64) -> f64 {
    let mut sum = -6.0;
    for index in 0..12 {
        let mixed = (key.wrapping_mul(12) + index).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        sum += ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 53) as f64;
    }
    sum
}

/// What images have in common.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Images {
    /// They follow each other in a flyby.
    Alike,
    /// Nothing.
    Unlike,
}

impl Images {
    /// What a block takes at speed 1, in seconds.
    fn cost(self, image: ImageRef, block: Rect) -> f64 {
        let tile = u64::from(block.y0 / 64 * SIDE + block.x0 / 64);
        let of_image = u64::from(image.image.0) * 100_000 + tile + 1_000_000;
        let normal = match self {
            Self::Alike => random(tile) + 0.1 * random(of_image),
            Self::Unlike => random(of_image),
        };
        exp(normal) * 5.0 / 4.0
    }
}

/// e to the power of a small number; of no importance to the last digit.
fn exp(x: f64) -> f64 {
    let mut term = 1.0;
    let mut sum = 1.0;
    for n in 1..60 {
        term *= x / f64::from(n);
        sum += term;
    }
    sum
}

/// Speeds are spread evenly over the logarithm from 1 to 10.
fn speed(worker: u64) -> f64 {
    exp(worker as f64 / (WORKERS - 1) as f64 * std::f64::consts::LN_10)
}

#[derive(Debug)]
enum Happening {
    Leased(u64, Lease),
    Revoked(u64, u64),
    Rendered(u64, u64),
    Arrived(u64, BlockRef, Span),
    Beat(u64),
}

#[derive(Default)]
struct Worker {
    held: VecDeque<(Lease, VecDeque<Rect>, u32)>,
    busy: bool,
}

struct Farm {
    sched: Sched,
    now: Timestamp,
    agenda: BTreeMap<(Timestamp, u64), Happening>,
    planned: u64,
    workers: Vec<Worker>,
    ended: Option<Timestamp>,
    rendered: u64,
    images: Images,
}

fn span(seconds: f64) -> Span {
    let micros = Duration::from_secs_f64(seconds).as_micros();
    Span(u64::try_from(micros).expect("it is short"))
}

fn id(worker: u64) -> WorkerId {
    WorkerId {
        id: worker,
        incarnation: 1,
    }
}

impl Farm {
    fn plan(&mut self, after: Span, happening: Happening) {
        self.planned += 1;
        self.agenda
            .insert((self.now + after, self.planned), happening);
    }

    fn tell(&mut self, event: Event) {
        let mut effects = Vec::new();
        self.sched.handle(self.now, event, &mut effects);
        for effect in effects {
            match effect {
                Effect::Lease { worker, lease } => {
                    self.plan(ONE_WAY, Happening::Leased(worker.id, lease));
                }
                Effect::Revoke {
                    worker, attempt, ..
                } => self.plan(ONE_WAY, Happening::Revoked(worker.id, attempt.number)),
                Effect::Encode { image } => {
                    let film = Digest([0; 32]);
                    self.tell(Event::ImageEncoded { image, film });
                }
                Effect::GiveUp { reason, .. } => panic!("{reason}"),
                _ => {}
            }
        }
        let mut jobs = self.sched.jobs();
        if self.ended.is_none() && jobs.all(|job| job.state != JobState::Running) {
            self.ended = Some(self.now);
        }
    }

    fn begins(&mut self, worker: u64) {
        let state = &mut self.workers[usize::try_from(worker).expect("it is small")];
        if state.busy {
            return;
        }
        if let Some((lease, blocks, _)) = state.held.front()
            && let Some(&block) = blocks.front()
        {
            state.busy = true;
            let took = self.images.cost(lease.image, block) / speed(worker);
            let took = span(took);
            let number = lease.attempt.number;
            self.plan(took, Happening::Rendered(worker, number));
        }
    }

    fn lives(&mut self, happening: Happening) {
        match happening {
            Happening::Leased(worker, lease) => {
                let blocks = lease.blocks().collect();
                let state = &mut self.workers[usize::try_from(worker).expect("it is small")];
                state.held.push_back((lease, blocks, 0));
                self.begins(worker);
            }
            Happening::Revoked(worker, number) => {
                let state = &mut self.workers[usize::try_from(worker).expect("it is small")];
                let first = state.held.front().map(|held| held.0.attempt.number);
                state.held.retain(|held| held.0.attempt.number != number);
                if first == Some(number) {
                    state.busy = false;
                }
                self.begins(worker);
            }
            Happening::Rendered(worker, number) => self.renders(worker, number),
            Happening::Arrived(worker, block, elapsed) => {
                if !matches!(self.sched.accepts(id(worker), block), Verdict::Refuse(_)) {
                    self.tell(Event::BlockStored {
                        worker: id(worker),
                        block,
                        elapsed,
                        pixels: Digest([1; 32]),
                    });
                }
            }
            Happening::Beat(worker) => {
                let state = &self.workers[usize::try_from(worker).expect("it is small")];
                let running = state.held.front().filter(|_| state.busy);
                let running = running.map(|(lease, _, blocks)| Running {
                    attempt: lease.attempt,
                    blocks: *blocks,
                });
                self.tell(Event::Heartbeat {
                    worker: id(worker),
                    running: running.into_iter().collect(),
                });
                self.plan(Span::from_secs(1), Happening::Beat(worker));
            }
        }
    }

    fn renders(&mut self, worker: u64, number: u64) {
        let state = &mut self.workers[usize::try_from(worker).expect("it is small")];
        let Some((lease, blocks, rendered)) = state.held.front_mut() else {
            return;
        };
        if lease.attempt.number != number || !state.busy {
            return;
        }
        let Some(rect) = blocks.pop_front() else {
            return;
        };
        *rendered += 1;
        let took = self.images.cost(lease.image, rect) / speed(worker);
        let block = BlockRef {
            attempt: lease.attempt,
            image: lease.image,
            rect,
        };
        if blocks.is_empty() {
            state.held.pop_front();
        }
        state.busy = false;
        self.rendered += 1;
        let elapsed = span(took);
        self.plan(ONE_WAY, Happening::Arrived(worker, block, elapsed));
        self.begins(worker);
    }
}

fn window() -> Rect {
    Resolution {
        width: 64 * SIDE,
        height: 64 * SIDE,
    }
    .rect()
}

/// The time that a farm takes over the time that its work divided by its speed is.
fn makespan(
    name: &str,
    (tiles, like): (TileShape, Images),
    change: impl FnOnce(&mut Config),
) -> f64 {
    let mut config = Config {
        min_tile_pixels: 64 * 64,
        tile_time: Span::from_secs(2),
        ..Config::new(Epoch(1))
    };
    change(&mut config);
    let mut farm = Farm {
        sched: Sched::new(config),
        now: Timestamp(1),
        agenda: BTreeMap::new(),
        planned: 0,
        workers: (0..WORKERS).map(|_| Worker::default()).collect(),
        ended: None,
        rendered: 0,
        images: like,
    };
    farm.tell(Event::Submit(Submission {
        submission: SubmissionId(1),
        name: "makespan".into(),
        scene: Digest([0; 32]),
        revision: Revision(1),
        frames: format!("0..{IMAGES}").parse().expect("a range"),
        window: window(),
        tiles,
        priority: 0,
        share: 1,
        needs: Needs::default(),
        after: Vec::new(),
    }));
    for worker in 0..WORKERS {
        farm.tell(Event::WorkerJoined {
            worker: id(worker),
            link: LinkId(worker),
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
        farm.tell(Event::Credit {
            worker: id(worker),
            credit: 2,
        });
        farm.plan(Span(worker * 1_000), Happening::Beat(worker));
    }
    while farm.ended.is_none() {
        let ((time, _), happening) = farm.agenda.pop_first().expect("the farm goes on");
        farm.now = time;
        farm.lives(happening);
    }
    let images = (0..IMAGES).map(|image| ImageRef {
        job: model::JobId(1),
        image: model::ImageNumber(image),
    });
    let work: f64 = images
        .flat_map(|image| window().blocks().map(move |block| like.cost(image, block)))
        .sum();
    let speeds: f64 = (0..WORKERS).map(speed).sum();
    let ended = farm.ended.expect("it ended").0 as f64 / 1e6;
    let ratio = ended / (work / speeds);
    let job = farm.sched.jobs().next().expect("it was submitted");
    println!(
        "makespan/{name}: {ended:.1} s for {:.1} s of work: {ratio:.4}; {} tiles leased twice, {} called back, {} blocks rendered twice",
        work / speeds,
        job.seconds,
        job.called_back,
        farm.rendered.saturating_sub(job.blocks_done),
    );
    ratio
}

const TIME: (TileShape, Images) = (TileShape::Time { aim: None }, Images::Alike);

#[test]
fn a_farm_takes_no_longer_than_its_work_by_more_than_two_in_a_hundred() {
    let ratio = makespan("all", TIME, |_| ());
    assert!(ratio <= 1.02, "{ratio}");
}

#[test]
#[ignore = "long: tests/run --all"]
fn what_is_done_about_the_end_of_a_job_is_worth_it() {
    let never = TailGain {
        call_back: None,
        second: None,
    };
    let all = makespan("all", TIME, |_| ());
    let alone = |config: &mut Config| config.tail_gain.second = None;
    makespan("no second leases", TIME, alone);
    makespan("no smaller tiles", TIME, |config| config.tail_parts = 0);
    let unlike = (TIME.0, Images::Unlike);
    let helped = makespan("unlike images", unlike, |_| ());
    let alone = makespan("unlike images, no second leases", unlike, alone);
    let size = TileShape::Size {
        width: 64,
        height: 64,
    };
    let size = (size, Images::Alike);
    makespan("tiles of one size", size, |_| ());
    let plain = makespan("tiles of one size, no help", size, |config| {
        config.tail_gain = never;
        config.tail_parts = 0;
    });
    assert!(
        alone > helped && plain > all,
        "{all} {helped} {alone} {plain}"
    );
}

#[test]
#[ignore = "long: tests/run --all"]
fn checks_that_are_slow_are_helped_as_tiles_are() {
    // Everything is rendered once more, and that is twice the work.
    let ratio = makespan("verified", TIME, |config| config.verify = 1_000_000) / 2.0;
    assert!(ratio <= 1.035, "{ratio}");
}
