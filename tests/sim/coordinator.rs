//! The coordinator's shell: a disk that takes its time, frames that are encoded.

use std::collections::{BTreeMap, BTreeSet};

use model::{
    AttemptId, Digest, Epoch, ImageRef, Lease, Rect, Resolution, Revision, Running, Span,
    SubmissionId, Timestamp, WorkerId,
};
use sched::{
    BlockRef, Config, Effect, Event, LinkId, Needs, Offer, RevokeReason, Sched, Submission,
    TileShape, Verdict,
};
use session::{BlockVerdict, Retry, Welcome};

/// What workers send.
#[derive(Clone, Debug)]
pub(crate) enum Up {
    Hello(Vec<AttemptId>),
    Credit(u32),
    Heartbeat(Vec<Running>),
    Failed(AttemptId, String),
    GiveBack(Vec<AttemptId>),
    Goodbye,
    Block(BlockRef, Span),
}

/// What is sent to workers.
#[derive(Clone, Debug)]
pub(crate) enum Down {
    Welcome(Welcome),
    Refused(String, Retry),
    Lease(Lease),
    Revoke(AttemptId),
    Ack(AttemptId, Rect),
    BlockRefused(AttemptId, Rect, BlockVerdict),
}

/// What the coordinator's machine reports later.
#[derive(Clone, Debug)]
pub(crate) enum Later {
    Stored(WorkerId, BlockRef, Span),
    Encoded(ImageRef),
}

/// What the shell wants of the world.
#[derive(Debug)]
pub(crate) enum Wish {
    Send(WorkerId, Down),
    Disk(Later),
    Close(WorkerId),
}

pub(crate) struct Coordinator {
    pub(crate) sched: Sched,
    /// Which pixels are in the scratch files, row by row.
    scratch: BTreeMap<ImageRef, Vec<bool>>,
    /// Images that are in their place, and how often they were put there.
    pub(crate) encoded: BTreeMap<ImageRef, u32>,
    /// Blocks that were acknowledged.
    acked: BTreeSet<(ImageRef, Rect)>,
    told: u64,
    wishes: Vec<Wish>,
}

pub(crate) const EPOCH: Epoch = Epoch(1);
pub(crate) const REVISION: Revision = Revision(1);

const WIDTH: usize = 200;
const HEIGHT: usize = 150;

/// The whole state is looked at after so many events; sched's own histories look after each.
const CHECK_EVERY: u64 = 16;

impl Coordinator {
    pub(crate) fn new(images: u32, tiles: TileShape) -> Self {
        let mut coordinator = Self {
            sched: Sched::new(Config {
                images_in_flight_max: 3,
                tile_failures_max: 20,
                tile_losses_max: 50,
                ..Config::new(EPOCH)
            }),
            scratch: BTreeMap::new(),
            encoded: BTreeMap::new(),
            acked: BTreeSet::new(),
            told: 0,
            wishes: Vec::new(),
        };
        let window = Resolution {
            width: 200,
            height: 150,
        };
        assert_eq!(window.rect().area(), (WIDTH * HEIGHT) as u64);
        let submission = Submission {
            submission: SubmissionId(1),
            name: "flyby".into(),
            scene: Digest([1; 32]),
            revision: REVISION,
            frames: format!("0..{images}").parse().expect("a range"),
            window: window.rect(),
            tiles,
            priority: 0,
            share: 1,
            needs: Needs::default(),
            after: Vec::new(),
        };
        coordinator.tell(Timestamp(0), Event::Submit(submission));
        coordinator
    }

    /// What it wished for since the last time.
    pub(crate) fn wishes(&mut self) -> Vec<Wish> {
        std::mem::take(&mut self.wishes)
    }

    pub(crate) fn is_done(&self) -> bool {
        self.sched
            .jobs()
            .all(|job| job.state != sched::JobState::Running)
    }

    pub(crate) fn hears(&mut self, now: Timestamp, worker: WorkerId, link: u64, message: Up) {
        let event = match message {
            Up::Hello(held) => Event::WorkerJoined {
                worker,
                link: LinkId(link),
                offer: Offer {
                    revision: REVISION,
                    threads: 1,
                    memory_bytes: 0,
                    labels: BTreeSet::new(),
                    time_left: None,
                },
                held,
            },
            Up::Credit(credit) => Event::Credit { worker, credit },
            Up::Heartbeat(running) => Event::Heartbeat { worker, running },
            Up::Failed(attempt, reason) => Event::TileFailed {
                worker,
                attempt,
                reason,
            },
            Up::GiveBack(attempts) => Event::GivenBack { worker, attempts },
            Up::Goodbye => Event::Goodbye { worker },
            Up::Block(block, elapsed) => return self.takes(now, worker, block, elapsed),
        };
        self.tell(now, event);
    }

    fn takes(&mut self, now: Timestamp, worker: WorkerId, block: BlockRef, elapsed: Span) {
        match self.sched.accepts(worker, block) {
            Verdict::Accept => {
                self.wishes
                    .push(Wish::Disk(Later::Stored(worker, block, elapsed)));
            }
            Verdict::AlreadyDone => self.tell(
                now,
                Event::BlockStored {
                    worker,
                    block,
                    elapsed,
                    pixels: Digest([1; 32]),
                },
            ),
            Verdict::Refuse(_) => self.refuse(worker, block, BlockVerdict::AttemptDead),
        }
    }

    /// The disk is full at this moment.
    pub(crate) fn refuses_for_now(&mut self, worker: WorkerId, block: BlockRef) {
        self.refuse(worker, block, BlockVerdict::Later);
    }

    fn refuse(&mut self, worker: WorkerId, block: BlockRef, verdict: BlockVerdict) {
        let down = Down::BlockRefused(block.attempt, block.rect, verdict);
        self.wishes.push(Wish::Send(worker, down));
    }

    pub(crate) fn finishes(&mut self, now: Timestamp, later: Later) {
        match later {
            Later::Stored(worker, block, elapsed) => {
                let rect = block.rect;
                let scratch = self.scratch.entry(block.image);
                let scratch = scratch.or_insert_with(|| vec![false; WIDTH * HEIGHT]);
                for y in rect.y0..rect.y1 {
                    let row = y as usize * WIDTH;
                    scratch[row + rect.x0 as usize..row + rect.x1 as usize].fill(true);
                }
                self.tell(
                    now,
                    Event::BlockStored {
                        worker,
                        block,
                        elapsed,
                        pixels: Digest([1; 32]),
                    },
                );
            }
            Later::Encoded(image) => {
                let mut pixels = self.scratch[&image].iter();
                assert!(
                    pixels.all(|&there| there),
                    "all pixels of {image:?} are there"
                );
                *self.encoded.entry(image).or_default() += 1;
                let film = Digest([2; 32]);
                self.tell(now, Event::ImageEncoded { image, film });
            }
        }
    }

    pub(crate) fn tell(&mut self, now: Timestamp, event: Event) {
        let mut effects = Vec::new();
        self.sched.handle(now, event, &mut effects);
        self.told += 1;
        if self.told.is_multiple_of(CHECK_EVERY) {
            self.sched.check_invariants();
        }
        let mut failed = Vec::new();
        for effect in effects {
            match effect {
                Effect::GiveUp { image, reason } => failed.push((image, reason)),
                effect => self.perform(effect),
            }
        }
        for (image, reason) in failed {
            self.tell(now, Event::ImageFailed { image, reason });
        }
    }

    fn perform(&mut self, effect: Effect) {
        let (worker, down) = match effect {
            Effect::Welcome { worker, live } => {
                let welcome = Welcome {
                    epoch: EPOCH,
                    heartbeat_interval: Span::from_secs(1),
                    liveness_limit: Span::from_secs(4),
                    live,
                };
                (worker, Down::Welcome(welcome))
            }
            Effect::WorkerRefused { worker, refusal } => {
                (worker, Down::Refused(refusal.to_string(), Retry::Later))
            }
            Effect::Lease { worker, lease } => {
                for block in lease.blocks() {
                    let again = self.acked.contains(&(lease.image, block));
                    assert!(!again, "what is acknowledged is never rendered again");
                }
                (worker, Down::Lease(lease))
            }
            Effect::Revoke {
                worker,
                attempt,
                reason,
            } => {
                assert_ne!(reason, RevokeReason::Cancelled);
                (worker, Down::Revoke(attempt))
            }
            Effect::Ack {
                worker,
                attempt,
                rect,
            } => {
                if let Some((_, image, _)) = self.sched.attempt(attempt) {
                    self.acked.insert((image, rect));
                }
                (worker, Down::Ack(attempt, rect))
            }
            Effect::RefuseBlock { worker, block, .. } => {
                return self.refuse(worker, block, BlockVerdict::AttemptDead);
            }
            Effect::Encode { image } => {
                return self.wishes.push(Wish::Disk(Later::Encoded(image)));
            }
            Effect::Forget { worker } => return self.wishes.push(Wish::Close(worker)),
            Effect::JobDone { .. } | Effect::JobChanged { .. } | Effect::Submitted { .. } => return,
            Effect::DropScratch { .. }
            | Effect::DropJob { .. }
            | Effect::ForgetJob { .. }
            | Effect::GiveUp { .. }
            | Effect::Incident { .. }
            | Effect::Commanded { .. }
            | Effect::CommandRefused { .. }
            | Effect::SubmitRefused { .. } => panic!("nobody asked for {effect:?}"),
        };
        self.wishes.push(Wish::Send(worker, down));
    }
}
