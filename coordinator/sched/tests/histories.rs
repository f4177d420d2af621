//! Random histories: whatever workers, users and the network do, what must hold holds.
//!
//! The scheduler is told random events, late and repeated ones among them, and
//! is held against a plain model of what it said. In the end diligent workers
//! join and every job must come to its end; or the coordinator dies first, and what it had
//! committed is told to another one. `PROPTEST_CASES=20000` looks longer.

mod situation;

use std::collections::{BTreeMap, BTreeSet};

use model::{
    AttemptId, Digest, Epoch, ImageRef, JobId, Lease, Rect, Resolution, Revision, Running, Span,
    SubmissionId, Timestamp, WorkerId,
};
use proptest::prelude::*;
use proptest::sample::Index;
use sched::{
    BlockRef, Command, Config, Effect, Event, ImageState, JobOutcome, JobState, LinkId, Needs,
    Offer, Sched, Submission, TileShape, Verdict,
};
use situation::{EPOCH, film, worker};

/// One thing that happens; an index picks among what there is at that moment.
#[derive(Clone, Debug)]
enum Step {
    Submit {
        images: u32,
        tiles: TileShape,
        revision: u32,
        priority: i32,
        share: u32,
        needs: Needs,
        after: Option<Index>,
    },
    Command(Index, Wish),
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
        pixels: u8,
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

/// What a user wants; an index picks an image.
#[derive(Clone, Debug)]
enum Wish {
    Just(Command),
    Again(Index),
}

fn wish() -> impl Strategy<Value = Wish> {
    let just = |command| Just(Wish::Just(command));
    prop_oneof![
        just(Command::Pause),
        just(Command::Resume),
        just(Command::Cancel),
        just(Command::Retry),
        just(Command::Remove),
        just(Command::Focus(None)),
        (0..60_u32, 0..40_u32).prop_map(|(x0, y0)| {
            let focus = Rect {
                x0,
                y0,
                x1: x0 + 9,
                y1: y0 + 9,
            };
            Wish::Just(Command::Focus(Some(focus)))
        }),
        (-1..2).prop_map(|priority| Wish::Just(Command::Priority(priority))),
        (0..3_u32).prop_map(|share| Wish::Just(Command::Share(share))),
        any::<Index>().prop_map(Wish::Again),
    ]
}

fn shape() -> impl Strategy<Value = TileShape> {
    let size = (10..70_u32, 10..70_u32);
    prop_oneof![
        size.prop_map(|(width, height)| TileShape::Size { width, height }),
        (0..100_000_u64).prop_map(|micros| TileShape::Time {
            aim: Some(Span(micros))
        }),
        Just(TileShape::Time { aim: None }),
        Just(TileShape::Rule {
            min_tile_pixels: Some(500)
        }),
    ]
}

fn needs() -> impl Strategy<Value = Needs> {
    let labels = prop_oneof![3 => Just(None), 1 => Just(Some("fast".to_owned()))];
    (labels, 0..3_u32, 0..2_u64).prop_map(|(label, threads, memory_bytes)| Needs {
        labels: label.into_iter().collect(),
        threads,
        memory_bytes,
    })
}

fn submit() -> impl Strategy<Value = Step> {
    let after = prop::option::weighted(0.2, any::<Index>());
    let rank = (0..2_u32, -1..2_i32, 1..4_u32);
    (1..4_u32, shape(), rank, needs(), after).prop_map(|(images, tiles, rank, needs, after)| {
        let (revision, priority, share) = rank;
        Step::Submit {
            images,
            tiles,
            revision,
            priority,
            share,
            needs,
            after,
        }
    })
}

fn step() -> impl Strategy<Value = Step> {
    let worker = 0..4_u64;
    let index = any::<Index>;
    let pixels = prop_oneof![19 => Just(1), 1 => Just(2)];
    prop_oneof![
        2 => submit(),
        4 => (index(), wish()).prop_map(|(job, wish)| Step::Command(job, wish)),
        6 => (worker.clone(), any::<u64>()).prop_map(|(worker, held)| Step::Join { worker, held }),
        3 => worker.clone().prop_map(Step::LinkBreaks),
        8 => (worker.clone(), 0..5_u32).prop_map(|(worker, credit)| Step::Credit { worker, credit }),
        6 => worker.clone().prop_map(Step::Heartbeat),
        20 => (index(), index(), pixels).prop_map(|(attempt, block, pixels)| {
            Step::Block { attempt, block, pixels }
        }),
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
    /// What was told, and how often the scratch file of its image had been dropped by then.
    told: Vec<(Event, u32)>,
    links: u64,

    /// Every lease there ever was.
    leases: BTreeMap<AttemptId, (WorkerId, Lease)>,
    /// Pixels that were acknowledged.
    durable: BTreeMap<ImageRef, BTreeSet<(u32, u32)>>,
    encoding: BTreeSet<ImageRef>,
    begun_encoding: BTreeSet<ImageRef>,
    over: BTreeSet<JobId>,
    drops: BTreeMap<ImageRef, u32>,
}

/// The image that something is reported of.
fn image_of(event: &Event) -> Option<ImageRef> {
    match event {
        Event::BlockStored { block, .. } => Some(block.image),
        Event::ImageEncoded { image, .. } | Event::ImageFailed { image, .. } => Some(*image),
        _ => None,
    }
}

fn config() -> Config {
    Config {
        images_in_flight_max: 2,
        aside: Span::from_secs(20),
        ..Config::new(EPOCH)
    }
}

impl History {
    fn new() -> Self {
        Self {
            sched: Sched::new(config()),
            now: Timestamp(1),
            told: Vec::new(),
            links: 0,

            leases: BTreeMap::new(),
            durable: BTreeMap::new(),
            encoding: BTreeSet::new(),
            begun_encoding: BTreeSet::new(),
            over: BTreeSet::new(),
            drops: BTreeMap::new(),
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
        let is_command = matches!(event, Event::Command { .. });
        let drops = image_of(&event).and_then(|image| self.drops.get(&image));
        let drops = drops.copied().unwrap_or(0);
        self.told.push((event, drops));
        self.over.retain(|&job| {
            let view = self.sched.job(job);
            view.is_some_and(|view| view.state != JobState::Running)
        });
        if is_command {
            self.drop_what_waits_again();
        }
        let mut given_up = Vec::new();
        for effect in effects {
            if let Effect::GiveUp { image, reason } = effect {
                given_up.push(Event::ImageFailed { image, reason });
            } else {
                self.hear(effect);
            }
        }
        self.check();
        for event in given_up {
            self.tell(event);
        }
    }

    /// An image that was finished and waits again has no pixels.
    fn drop_what_waits_again(&mut self) {
        let images: Vec<ImageRef> = self.durable.keys().copied().collect();
        for image in images {
            let view = self.sched.image(image);
            let waits = |view: sched::ImageView| {
                let begins = [ImageState::Waiting, ImageState::Rendering].contains(&view.state);
                begins && view.pixels_done == 0
            };
            if view.is_none_or(waits) {
                self.drop(image);
            }
        }
    }

    fn drop(&mut self, image: ImageRef) {
        self.encoding.remove(&image);
        self.begun_encoding.remove(&image);
        self.durable.remove(&image);
        *self.drops.entry(image).or_default() += 1;
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
            Effect::DropScratch { image } => self.drop(image),
            Effect::JobDone { job, .. } => {
                // One that is removed is forgotten at once.
                let known = self.sched.job(job).is_some();
                assert!(self.over.insert(job) || !known, "over once");
            }
            Effect::ForgetJob { job } => {
                self.over.remove(&job);
                self.durable.retain(|image, _| image.job != job);
            }
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
        let mut blocks: Vec<Rect> = lease.blocks().collect();
        blocks.sort_by_key(|block| (block.y0, block.x0));
        assert_eq!(blocks, missing, "exactly what is missing is leased");
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
        for (index, (image, tile)) in live.keys().enumerate() {
            let mut others = live.keys().skip(index + 1);
            let apart =
                others.all(|(other, rect)| other != image || tile.intersection(*rect).is_none());
            assert!(apart, "no pixel is in two tiles");
        }
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
            Step::Submit { .. } => self.submit(step),
            Step::Command(index, wish) => self.command(&index, wish),
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
            Step::Block {
                attempt,
                block,
                pixels,
            } => {
                if let Some((attempt, lease)) = self.pick(&attempt) {
                    let blocks: Vec<Rect> = lease.tile.blocks().collect();
                    self.block(attempt, &lease, (*block.get(&blocks), pixels));
                }
            }
            Step::Tile(attempt) => {
                if let Some((attempt, lease)) = self.pick(&attempt) {
                    for rect in lease.blocks() {
                        self.block(attempt, &lease, (rect, 1));
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
                    let (event, drops) = index.get(&self.told).clone();
                    // A shell reports nothing of a scratch file that was dropped.
                    let now = image_of(&event).and_then(|image| self.drops.get(&image));
                    if now.copied().unwrap_or(0) == drops {
                        self.tell(event);
                    }
                }
            }
        }
    }

    fn submit(&mut self, step: Step) {
        let Step::Submit {
            images,
            tiles,
            revision,
            priority,
            share,
            needs,
            after,
        } = step
        else {
            return;
        };
        let jobs: Vec<JobId> = self.sched.jobs().map(|job| job.job).collect();
        let after = after.filter(|_| !jobs.is_empty());
        self.tell(Event::Submit(Submission {
            submission: SubmissionId(self.told.len() as u128),
            revision: Revision(revision),
            window: Resolution {
                width: 70,
                height: 45,
            }
            .rect(),
            tiles,
            priority,
            share,
            needs,
            after: after.iter().map(|index| *index.get(&jobs)).collect(),
            ..situation::submission(0, images)
        }));
    }

    fn command(&mut self, index: &Index, wish: Wish) {
        let jobs: Vec<JobId> = self.sched.jobs().map(|job| job.job).collect();
        if jobs.is_empty() {
            return;
        }
        let job = *index.get(&jobs);
        let command = match wish {
            Wish::Just(command) => command,
            Wish::Again(index) => {
                let images: Vec<_> = self.sched.images(job).map(|view| view.image).collect();
                Command::Again(*index.get(&images))
            }
        };
        self.tell(Event::Command { job, command });
    }

    fn join(&mut self, id: u64, held: u64) {
        self.links += 1;
        let held = self.leases.iter().filter(|(attempt, lease)| {
            lease.0 == worker(id) && held >> (attempt.number % 64) & 1 == 1
        });
        self.tell(Event::WorkerJoined {
            worker: worker(id),
            link: LinkId(self.links),
            offer: Offer {
                revision: Revision(u32::from(id == 3)),
                threads: 1 + u32::from(id >= 2),
                memory_bytes: u64::from(id >= 1),
                labels: (id != 1).then(|| "fast".to_owned()).into_iter().collect(),
                time_left: (id == 1).then_some(Span::from_secs(40)),
            },
            held: held.map(|(&attempt, _)| attempt).collect(),
            begun: Vec::new(),
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
    fn block(&mut self, attempt: AttemptId, lease: &Lease, (rect, pixels): (Rect, u8)) {
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
                pixels: Digest([pixels; 32]),
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

    /// The coordinator dies; another one is told what was committed.
    fn begin_anew(&mut self) {
        let mut sched = Sched::new(Config {
            epoch: Epoch(EPOCH.0 + 1),
            ..config()
        });
        for (event, _) in self.told.iter().filter(|(event, _)| event.is_durable()) {
            sched.handle(Timestamp(1), event.clone(), &mut Vec::new());
            sched.check_invariants();
        }
        assert_eq!(sched.jobs().count(), self.sched.jobs().count());
        for (before, after) in self.sched.jobs().zip(sched.jobs()) {
            assert_eq!(after.job, before.job);
            assert_eq!(after.state, before.state, "{before:?} {after:?}");
            assert_eq!(after.pixels_done, before.pixels_done);
            let rank = |job: &sched::JobView<'_>| (job.priority, job.share, job.paused);
            assert_eq!(rank(&after), rank(&before));
            assert_eq!(after.after, before.after);
            for (before, after) in self.sched.images(before.job).zip(sched.images(after.job)) {
                assert_eq!(after.pixels_done, before.pixels_done);
                let begun = |state| match state {
                    ImageState::Rendering => ImageState::Waiting,
                    state => state,
                };
                assert_eq!(begun(after.state), begun(before.state));
            }
            assert_eq!(sched.failures(before.job), self.sched.failures(before.job));
        }
        self.sched = sched;
        self.now = Timestamp(1);
        self.leases.clear();
        // What was being encoded is encoded anew.
        let jobs: Vec<JobId> = self.sched.jobs().map(|job| job.job).collect();
        for job in jobs {
            for view in self.sched.images(job) {
                let image = ImageRef {
                    job,
                    image: view.image,
                };
                if view.state == ImageState::Encoding {
                    self.encoding.insert(image);
                }
            }
        }
    }

    /// Diligent workers of both revisions, and a diligent user, finish what is left.
    fn finish(&mut self) {
        let jobs: Vec<JobId> = self.sched.jobs().map(|job| job.job).collect();
        for &job in &jobs {
            let command = Command::Resume;
            self.tell(Event::Command { job, command });
        }
        for id in [0, 2, 3] {
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
                    self.block(attempt, &lease, (rect, 1));
                }
            } else if let Some(image) = self.encoding.pop_first() {
                self.tell(Event::ImageEncoded {
                    image,
                    film: film(1),
                });
            } else if let Some(job) = self.waits_in_vain() {
                let command = Command::Cancel;
                self.tell(Event::Command { job, command });
            } else {
                break;
            }
        }
        for job in self.sched.jobs() {
            assert_ne!(job.state, JobState::Running, "{job:?}");
            assert_eq!(job.attempts_live, 0);
        }
    }

    /// A job that waits for one that is over and not finished.
    fn waits_in_vain(&self) -> Option<JobId> {
        let is_over = |job: &JobId| {
            let state = self.sched.job(*job).map(|job| job.state);
            matches!(
                state,
                Some(JobState::Over(JobOutcome::Failed | JobOutcome::Cancelled))
            )
        };
        let mut jobs = self.sched.jobs();
        let vain = jobs.find(|job| job.after.iter().any(is_over));
        vain.map(|job| job.job)
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

    #[test]
    fn what_is_durable_comes_back(steps in prop::collection::vec(step(), 1..120)) {
        let mut history = History::new();
        for step in steps {
            history.take(step);
        }
        history.begin_anew();
        history.finish();
    }
}
