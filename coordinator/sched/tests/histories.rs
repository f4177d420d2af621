//! Random histories: whatever workers, users and the network do, what must hold holds.
//!
//! The scheduler is told random events, late and repeated ones among them, and
//! is held against a plain model of what it said. In the end a diligent worker
//! joins and every job must come to its end. `PROPTEST_CASES=20000` looks longer.

mod situation;

use std::collections::{BTreeMap, BTreeSet};

use model::{
    AttemptId, ImageRef, JobId, Lease, Rect, Resolution, Revision, Running, Span, SubmissionId,
    Timestamp, WorkerId,
};
use proptest::prelude::*;
use proptest::sample::Index;
use sched::{
    BlockRef, Config, Effect, Event, ImageState, JobState, LinkId, Sched, Submission, TileShape,
    Verdict,
};
use situation::{EPOCH, film, worker};

/// One thing that happens; an index picks among what there is at that moment.
#[derive(Clone, Debug)]
enum Step {
    Submit {
        images: u32,
        tile: (u32, u32),
        revision: u32,
    },
    Cancel(Index),
    /// A worker dials, and still holds those of its attempts that are picked.
    Join {
        worker: u64,
        held: u64,
    },
    LinkBreaks(u64),
    Credit {
        worker: u64,
        credit: u32,
    },
    Heartbeat(u64),
    /// A block of some attempt that was ever leased, sent by its worker.
    Block {
        attempt: Index,
        block: Index,
    },
    /// All blocks of it.
    Tile(Index),
    Fails(Index),
    GivesBack(Index),
    Goodbye(u64),
    Encoded(Index),
    ImageFails(Index),
    Wait(u64),
    /// Something that was told before is told again.
    Again(Index),
}

fn step() -> impl Strategy<Value = Step> {
    let worker = 0..4_u64;
    let index = any::<Index>;
    prop_oneof![
        2 => (1..4_u32, (10..70_u32, 10..70_u32), 0..2_u32).prop_map(|(images, tile, revision)| {
            Step::Submit { images, tile, revision }
        }),
        1 => index().prop_map(Step::Cancel),
        6 => (worker.clone(), any::<u64>()).prop_map(|(worker, held)| Step::Join { worker, held }),
        3 => worker.clone().prop_map(Step::LinkBreaks),
        8 => (worker.clone(), 0..5_u32).prop_map(|(worker, credit)| Step::Credit { worker, credit }),
        6 => worker.clone().prop_map(Step::Heartbeat),
        20 => (index(), index()).prop_map(|(attempt, block)| Step::Block { attempt, block }),
        20 => index().prop_map(Step::Tile),
        3 => index().prop_map(Step::Fails),
        3 => index().prop_map(Step::GivesBack),
        1 => worker.prop_map(Step::Goodbye),
        4 => index().prop_map(Step::Encoded),
        1 => index().prop_map(Step::ImageFails),
        6 => (0..3_000_u64).prop_map(Step::Wait),
        1 => (0..400_000_u64).prop_map(Step::Wait),
        6 => index().prop_map(Step::Again),
    ]
}

/// The scheduler, and what a bystander makes of its words.
struct History {
    sched: Sched,
    now: Timestamp,
    told: Vec<Event>,
    links: u64,

    /// Every lease there ever was.
    leases: BTreeMap<AttemptId, (WorkerId, Lease)>,
    /// Pixels that were acknowledged.
    durable: BTreeMap<ImageRef, BTreeSet<(u32, u32)>>,
    encoding: BTreeSet<ImageRef>,
    begun_encoding: BTreeSet<ImageRef>,
    over: BTreeSet<JobId>,
}

impl History {
    fn new() -> Self {
        let config = Config {
            images_in_flight_max: 2,
            ..Config::new(EPOCH)
        };
        Self {
            sched: Sched::new(config),
            now: Timestamp(1),
            told: Vec::new(),
            links: 0,

            leases: BTreeMap::new(),
            durable: BTreeMap::new(),
            encoding: BTreeSet::new(),
            begun_encoding: BTreeSet::new(),
            over: BTreeSet::new(),
        }
    }

    fn tell(&mut self, event: Event) {
        let mut effects = Vec::new();
        let mut twin = self.sched.clone();
        self.sched.handle(self.now, event.clone(), &mut effects);
        self.sched.check_invariants();
        let mut again = Vec::new();
        twin.handle(self.now, event.clone(), &mut again);
        assert_eq!(effects, again, "the same event gives the same effects");
        self.told.push(event);
        for effect in effects {
            self.hear(effect);
        }
        self.check();
    }

    fn hear(&mut self, effect: Effect) {
        match effect {
            Effect::Lease { worker, lease } => self.hear_lease(worker, lease),
            Effect::Ack { attempt, rect, .. } => {
                // The image is that of the attempt, which a bystander remembers.
                let image = self.leases[&attempt].1.image;
                let pixels = self.durable.entry(image).or_default();
                pixels.extend(pixels_of(rect));
            }
            Effect::Encode { image } => {
                let view = self.sched.job(image.job).expect("it is known");
                let durable = self.durable[&image].len() as u64;
                assert_eq!(durable, view.window.area(), "every pixel is there");
                assert!(self.begun_encoding.insert(image), "encoded once");
                self.encoding.insert(image);
            }
            Effect::DropScratch { image } => {
                self.encoding.remove(&image);
            }
            Effect::JobDone { job, .. } => assert!(self.over.insert(job), "over once"),
            _ => {}
        }
    }

    fn hear_lease(&mut self, worker: WorkerId, lease: Lease) {
        let view = self.sched.worker(worker).expect("it is known");
        assert!(view.attempts <= view.credit, "credit is kept");
        assert_eq!(
            self.sched
                .job(lease.image.job)
                .expect("it is known")
                .revision,
            view.revision
        );
        let durable = self.durable.entry(lease.image).or_default();
        let missing = |block: &Rect| pixels_of(*block).any(|pixel| !durable.contains(&pixel));
        let missing: Vec<Rect> = lease.tile.blocks().filter(missing).collect();
        assert_eq!(lease.blocks().collect::<Vec<_>>(), missing);
        let before = self.leases.insert(lease.attempt, (worker, lease));
        assert_eq!(before, None, "an attempt is leased once");
    }

    fn check(&self) {
        let mut live: BTreeMap<(ImageRef, Rect), usize> = BTreeMap::new();
        for (&attempt, (worker, lease)) in &self.leases {
            let rect = lease.tile.blocks().next().expect("a tile has a block");
            let image = lease.image;
            let verdict = self.sched.accepts(
                *worker,
                BlockRef {
                    attempt,
                    image,
                    rect,
                },
            );
            if self.sched.attempt(attempt).is_some() {
                assert!(!matches!(verdict, Verdict::Refuse(_)));
                *live.entry((image, lease.tile)).or_default() += 1;
            } else {
                assert!(matches!(verdict, Verdict::Refuse(_)), "a dead one never");
            }
        }
        assert!(live.values().all(|&attempts| attempts <= 2));
        for job in self.sched.jobs() {
            let of_job = self
                .durable
                .iter()
                .filter(|(image, _)| image.job == job.job);
            let durable: usize = of_job.map(|(_, pixels)| pixels.len()).sum();
            assert_eq!(
                job.pixels_done, durable as u64,
                "each pixel is counted once"
            );
        }
    }

    fn take(&mut self, step: Step) {
        match step {
            Step::Submit {
                images,
                tile,
                revision,
            } => self.submit(images, tile, revision),
            Step::Cancel(index) => {
                let jobs: Vec<JobId> = self.sched.jobs().map(|job| job.job).collect();
                if !jobs.is_empty() {
                    let job = *index.get(&jobs);
                    self.tell(Event::Cancel { job });
                }
            }
            Step::Join { worker: id, held } => self.join(id, held),
            Step::LinkBreaks(id) => {
                let link = LinkId(self.links);
                self.tell(Event::LinkClosed {
                    worker: worker(id),
                    link,
                });
            }
            Step::Credit { worker: id, credit } => self.tell(Event::Credit {
                worker: worker(id),
                credit,
            }),
            Step::Heartbeat(id) => self.heartbeat(id),
            Step::Block { attempt, block } => {
                if let Some((attempt, lease)) = self.pick(&attempt) {
                    let blocks: Vec<Rect> = lease.tile.blocks().collect();
                    self.block(attempt, &lease, *block.get(&blocks));
                }
            }
            Step::Tile(attempt) => {
                if let Some((attempt, lease)) = self.pick(&attempt) {
                    for rect in lease.blocks() {
                        self.block(attempt, &lease, rect);
                    }
                }
            }
            Step::Fails(attempt) => {
                if let Some((attempt, _)) = self.pick(&attempt) {
                    self.tell(Event::TileFailed {
                        worker: self.leases[&attempt].0,
                        attempt,
                        reason: "no memory".into(),
                    });
                }
            }
            Step::GivesBack(attempt) => {
                if let Some((attempt, _)) = self.pick(&attempt) {
                    self.tell(Event::GivenBack {
                        worker: self.leases[&attempt].0,
                        attempts: vec![attempt],
                    });
                }
            }
            Step::Goodbye(id) => self.tell(Event::Goodbye { worker: worker(id) }),
            Step::Encoded(index) => self.encoded(&index),
            Step::ImageFails(index) => {
                let images: Vec<ImageRef> = self.durable.keys().copied().collect();
                if !images.is_empty() {
                    let image = *index.get(&images);
                    self.encoding.remove(&image);
                    self.tell(Event::ImageFailed {
                        image,
                        reason: "no space".into(),
                    });
                }
            }
            Step::Wait(milliseconds) => self.wait(Span::from_millis(milliseconds)),
            Step::Again(index) => {
                if !self.told.is_empty() {
                    let event = index.get(&self.told).clone();
                    self.tell(event);
                }
            }
        }
    }

    fn submit(&mut self, images: u32, tile: (u32, u32), revision: u32) {
        self.tell(Event::Submit(Submission {
            submission: SubmissionId(self.told.len() as u128),
            revision: Revision(revision),
            window: Resolution {
                width: 70,
                height: 45,
            }
            .rect(),
            tiles: TileShape::Size {
                width: tile.0,
                height: tile.1,
            },
            ..situation::submission(0, images)
        }));
    }

    fn join(&mut self, id: u64, held: u64) {
        self.links += 1;
        let held = self.leases.iter().filter(|(attempt, lease)| {
            lease.0 == worker(id) && held >> (attempt.number % 64) & 1 == 1
        });
        self.tell(Event::WorkerJoined {
            worker: worker(id),
            link: LinkId(self.links),
            revision: Revision(u32::from(id == 3)),
            threads: 1 + u32::from(id == 2),
            held: held.map(|(&attempt, _)| attempt).collect(),
        });
    }

    fn heartbeat(&mut self, id: u64) {
        let running = self
            .leases
            .iter()
            .filter(|(_, lease)| lease.0 == worker(id))
            .map(|(&attempt, _)| Running { attempt, blocks: 1 })
            .take(2)
            .collect();
        self.tell(Event::Heartbeat {
            worker: worker(id),
            running,
        });
    }

    fn pick(&self, index: &Index) -> Option<(AttemptId, Lease)> {
        // Those that live come more often than those that are long dead.
        let live = self
            .leases
            .iter()
            .filter(|(attempt, _)| self.sched.attempt(**attempt).is_some());
        let all: Vec<_> = live.chain(self.leases.iter().rev().take(3)).collect();
        (!all.is_empty()).then(|| {
            let (attempt, (_, lease)) = index.get(&all);
            (**attempt, lease.clone())
        })
    }

    /// A block arrives: the shell asks, and tells what it stored.
    fn block(&mut self, attempt: AttemptId, lease: &Lease, rect: Rect) {
        let worker = self.leases[&attempt].0;
        let image = lease.image;
        let block = BlockRef {
            attempt,
            image,
            rect,
        };
        if !matches!(self.sched.accepts(worker, block), Verdict::Refuse(_)) {
            self.tell(Event::BlockStored {
                worker,
                block,
                elapsed: Span(10_000),
            });
        }
    }

    fn encoded(&mut self, index: &Index) {
        let images: Vec<ImageRef> = self.encoding.iter().copied().collect();
        if !images.is_empty() {
            let image = *index.get(&images);
            self.encoding.remove(&image);
            self.tell(Event::ImageEncoded {
                image,
                film: film(1),
            });
            let view = self.sched.image(image).expect("it is known");
            assert_eq!(view.state, ImageState::Encoded { film: film(1) });
        }
    }

    fn wait(&mut self, span: Span) {
        let end = self.now + span;
        while let Some(due) = self.sched.next_deadline().filter(|&due| due <= end) {
            assert!(due >= self.now, "a deadline is not left behind");
            self.now = due;
            let before = self.sched.next_deadline();
            self.tell(Event::Tick);
            assert_ne!(
                self.sched.next_deadline(),
                before,
                "a tick is worth sending"
            );
        }
        self.now = end;
    }

    /// Everybody falls silent: every lease ends by a limit.
    fn fall_silent(&mut self) {
        self.wait(Span::from_secs(4));
        assert!(
            self.leases
                .keys()
                .all(|&id| self.sched.attempt(id).is_none())
        );
        assert_eq!(self.sched.workers().count(), 0);
        assert_eq!(self.sched.next_deadline(), None);
    }

    /// Diligent workers of both revisions finish what is left.
    fn finish(&mut self) {
        for id in [0, 3] {
            self.join(id, 0);
            self.tell(Event::Credit {
                worker: worker(id),
                credit: 2,
            });
        }
        for _ in 0..10_000 {
            let live = self
                .leases
                .keys()
                .find(|&&attempt| self.sched.attempt(attempt).is_some());
            if let Some(&attempt) = live {
                let lease = self.leases[&attempt].1.clone();
                for rect in lease.blocks() {
                    self.block(attempt, &lease, rect);
                }
            } else if let Some(image) = self.encoding.pop_first() {
                self.tell(Event::ImageEncoded {
                    image,
                    film: film(1),
                });
            } else {
                break;
            }
        }
        for job in self.sched.jobs() {
            assert_ne!(job.state, JobState::Running, "{job:?}");
            assert_eq!(job.attempts_live, 0);
        }
    }
}

fn pixels_of(rect: Rect) -> impl Iterator<Item = (u32, u32)> {
    (rect.y0..rect.y1).flat_map(move |y| (rect.x0..rect.x1).map(move |x| (x, y)))
}

proptest! {
    #[test]
    fn what_must_hold_holds(steps in prop::collection::vec(step(), 1..120)) {
        let mut history = History::new();
        for step in steps {
            history.take(step);
        }
        history.fall_silent();
        history.finish();
    }
}
