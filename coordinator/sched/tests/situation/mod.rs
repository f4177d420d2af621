//! A farm in a situation, told in few words.

#![allow(
    dead_code,
    reason = "each test program uses its own part of the language"
)]

use std::collections::BTreeSet;

use model::{
    AttemptId, Digest, Epoch, ImageNumber, ImageRef, JobId, Lease, Rect, Resolution, Revision,
    Running, Span, SubmissionId, Timestamp, WorkerId,
};
use sched::{
    BlockRef, Command, Config, Effect, Event, ImageState, JobOutcome, LinkId, Needs, Offer,
    RevokeReason, Sched, Submission, TileShape, Verdict,
};

pub(crate) const EPOCH: Epoch = Epoch(3);
pub(crate) const REVISION: Revision = Revision(1);

/// A scheduler, the time, and what it wanted done since somebody last looked.
pub(crate) struct Farm {
    pub(crate) sched: Sched,
    pub(crate) now: Timestamp,
    effects: Vec<Effect>,
    links: u64,
}

impl Farm {
    pub(crate) fn new(config: Config) -> Self {
        Self {
            sched: Sched::new(config),
            now: Timestamp(1_000_000),
            effects: Vec::new(),
            links: 0,
        }
    }

    /// Something happens now. An image that is given up is failed at once, as a shell does it.
    pub(crate) fn is_told(&mut self, event: Event) -> &mut Self {
        let before = self.effects.len();
        self.sched.handle(self.now, event, &mut self.effects);
        self.sched.check_invariants();
        let given_up = |effect: &Effect| match effect {
            Effect::GiveUp { image, reason } => Some((*image, reason.clone())),
            _ => None,
        };
        let images: Vec<_> = self.effects[before..].iter().filter_map(given_up).collect();
        for (image, reason) in images {
            self.is_told(Event::ImageFailed { image, reason });
        }
        self
    }

    /// A user wants something of the first job.
    pub(crate) fn command(&mut self, command: Command) -> &mut Self {
        self.command_of(1, command)
    }

    /// A user wants something of a job.
    pub(crate) fn command_of(&mut self, job: u64, command: Command) -> &mut Self {
        self.is_told(Event::Command {
            job: JobId(job),
            command,
        })
    }

    /// A job of so many images, each of two tiles of two blocks: see [`tile`].
    pub(crate) fn job(&mut self, images: u32) -> &mut Self {
        self.is_told(Event::Submit(submission(1, images)))
    }

    /// A worker of one thread joins on a new link, still holding attempts.
    pub(crate) fn joins(&mut self, id: u64, held: &[u64]) -> &mut Self {
        self.links += 1;
        self.is_told(Event::WorkerJoined {
            worker: worker(id),
            link: LinkId(self.links),
            offer: offer(),
            held: held.iter().copied().map(attempt).collect(),
            begun: vec![],
        })
    }

    /// A worker that wants so many tiles joins.
    pub(crate) fn worker(&mut self, id: u64, credit: u32) -> &mut Self {
        self.joins(id, &[]).wants_tiles(id, credit)
    }

    pub(crate) fn wants_tiles(&mut self, id: u64, credit: u32) -> &mut Self {
        self.is_told(Event::Credit {
            worker: worker(id),
            credit,
        })
    }

    /// The newest link breaks, of whomever that is.
    pub(crate) fn newest_link_breaks(&mut self, id: u64) -> &mut Self {
        self.is_told(Event::LinkClosed {
            worker: worker(id),
            link: LinkId(self.links),
        })
    }

    /// A block is stored, as the shell does it: asked first.
    #[track_caller]
    pub(crate) fn stores(&mut self, id: u64, number: u64, image: u32, rect: Rect) -> &mut Self {
        let verdict = self
            .sched
            .accepts(worker(id), block_ref(number, image, rect));
        assert!(
            !matches!(verdict, Verdict::Refuse(_)),
            "{number}: {verdict:?}"
        );
        self.is_told(Event::BlockStored {
            worker: worker(id),
            block: block_ref(number, image, rect),
            elapsed: Span::from_millis(1),
            pixels: Digest([1; 32]),
        })
    }

    /// All blocks of a tile are stored.
    #[track_caller]
    pub(crate) fn stores_tile(
        &mut self,
        id: u64,
        number: u64,
        image: u32,
        index: u32,
    ) -> &mut Self {
        for rect in tile(index).blocks() {
            self.stores(id, number, image, rect);
        }
        self
    }

    pub(crate) fn encoded(&mut self, image: u32) -> &mut Self {
        self.is_told(Event::ImageEncoded {
            image: image_ref(image),
            film: film(image),
        })
    }

    pub(crate) fn heartbeat(&mut self, id: u64, running: &[(u64, u32)]) -> &mut Self {
        let running = running.iter().map(|&(number, blocks)| Running {
            attempt: attempt(number),
            blocks,
        });
        self.is_told(Event::Heartbeat {
            worker: worker(id),
            running: running.collect(),
        })
    }

    pub(crate) fn fails(&mut self, id: u64, number: u64) -> &mut Self {
        self.is_told(Event::TileFailed {
            worker: worker(id),
            attempt: attempt(number),
            reason: "no memory".into(),
        })
    }

    /// Time passes, with a tick whenever one is due.
    pub(crate) fn waits(&mut self, span: Span) -> &mut Self {
        let end = self.now + span;
        while let Some(due) = self.sched.next_deadline().filter(|&due| due <= end) {
            assert!(due >= self.now, "a deadline is not left behind");
            self.now = due;
            self.is_told(Event::Tick);
        }
        self.now = end;
        self
    }

    /// Time passes while a worker gives signs of life.
    pub(crate) fn waits_with_heartbeats(
        &mut self,
        span: Span,
        id: u64,
        running: &[(u64, u32)],
    ) -> &mut Self {
        let end = self.now + span;
        while self.now < end {
            self.heartbeat(id, running);
            self.waits(Span::from_secs(1).min(end - self.now));
        }
        self
    }

    /// It wanted exactly this, and nothing else; that jobs changed is understood.
    #[track_caller]
    pub(crate) fn wants(&mut self, effects: &[Effect]) -> &mut Self {
        let wanted = self.never_mind();
        assert_eq!(wanted, effects);
        self
    }

    /// What it wanted so far, without the changes of jobs.
    pub(crate) fn never_mind(&mut self) -> Vec<Effect> {
        let mut effects = std::mem::take(&mut self.effects);
        effects.retain(|effect| !matches!(effect, Effect::JobChanged { .. }));
        effects
    }
}

/// Every tile is verified.
pub(crate) fn suspicious() -> Farm {
    Farm::new(Config {
        verify: 1_000_000,
        ..Config::new(EPOCH)
    })
}

/// A worker delivers a tile, of some pixels.
pub(crate) fn makes(farm: &mut Farm, (id, number): (u64, u64), image: u32, index: u32, pixels: u8) {
    for rect in tile(index).blocks() {
        let block = block_ref(number, image, rect);
        if let Verdict::Refuse(_) = farm.sched.accepts(worker(id), block) {
            // Its attempt was ended by the block before.
            continue;
        }
        farm.is_told(Event::BlockStored {
            worker: worker(id),
            block,
            elapsed: Span::from_millis(1),
            pixels: Digest([pixels; 32]),
        });
    }
}

/// The blocks of leases since somebody last looked, as (worker, number, blocks).
pub(crate) fn leased_blocks(farm: &mut Farm) -> Vec<(u64, u64, Vec<Rect>)> {
    let effects = farm.never_mind();
    let leases = effects.into_iter().filter_map(|effect| match effect {
        Effect::Lease { worker, lease } => {
            Some((worker.id, lease.attempt.number, lease.blocks().collect()))
        }
        _ => None,
    });
    leases.collect()
}

/// The attempts that were leased since somebody last looked, as (worker, number, tile).
pub(crate) fn leased(farm: &mut Farm) -> Vec<(u64, u64, u32)> {
    let effects = farm.never_mind();
    let leases = effects.into_iter().filter_map(|effect| match effect {
        Effect::Lease { worker, lease } => {
            Some((worker.id, lease.attempt.number, lease.tile.y0 / 32))
        }
        _ => None,
    });
    leases.collect()
}

pub(crate) fn state(farm: &Farm, image: u32) -> ImageState {
    let view = farm.sched.image(image_ref(image));
    view.expect("it is there").state
}

/// Tiles of an image were to be verified and were not.
pub(crate) fn unverified(image: u32, tiles: u32) -> Effect {
    Effect::Unverified {
        image: image_ref(image),
        tiles,
    }
}

pub(crate) fn farm() -> Farm {
    Farm::new(Config::new(EPOCH))
}

pub(crate) fn submission(id: u128, images: u32) -> Submission {
    Submission {
        submission: SubmissionId(id),
        name: "flyby".into(),
        scene: Digest([7; 32]),
        revision: REVISION,
        frames: format!("0..{images}").parse().expect("a range"),
        window: Resolution {
            width: 64,
            height: 64,
        }
        .rect(),
        tiles: TileShape::Size {
            width: 64,
            height: 32,
        },
        priority: 0,
        share: 1,
        needs: Needs::default(),
        after: vec![],
    }
}

/// What a worker of one thread offers.
pub(crate) fn offer() -> Offer {
    Offer {
        revision: REVISION,
        threads: 1,
        memory_bytes: 0,
        labels: BTreeSet::new(),
        time_left: None,
        queue: None,
    }
}

/// What a command that was followed is answered.
pub(crate) fn commanded() -> Effect {
    Effect::Commanded { job: JobId(1) }
}

/// The upper or the lower half of an image.
pub(crate) fn tile(index: u32) -> Rect {
    Rect {
        x0: 0,
        y0: 32 * index,
        x1: 64,
        y1: 32 * (index + 1),
    }
}

/// One of the four blocks of an image, counted row by row.
pub(crate) fn block(index: u32) -> Rect {
    tile(index / 2)
        .blocks()
        .nth(index as usize % 2)
        .expect("two blocks a tile")
}

pub(crate) fn worker(id: u64) -> WorkerId {
    WorkerId { id, incarnation: 1 }
}

pub(crate) fn attempt(number: u64) -> AttemptId {
    AttemptId {
        epoch: EPOCH,
        number,
    }
}

pub(crate) fn image_ref(image: u32) -> ImageRef {
    ImageRef {
        job: JobId(1),
        image: ImageNumber(image),
    }
}

pub(crate) fn film(image: u32) -> Digest {
    Digest([u8::try_from(image).expect("a small number"); 32])
}

pub(crate) fn block_ref(number: u64, image: u32, rect: Rect) -> BlockRef {
    BlockRef {
        attempt: attempt(number),
        image: image_ref(image),
        rect,
    }
}

/// A lease of a whole tile of which nothing is known.
pub(crate) fn lease(id: u64, number: u64, image: u32, index: u32) -> Effect {
    lease_of(id, number, image, index, &[], Span(0))
}

/// A lease of the missing blocks of a tile.
pub(crate) fn lease_of(
    id: u64,
    number: u64,
    image: u32,
    index: u32,
    wanted: &[Rect],
    expected: Span,
) -> Effect {
    Effect::Lease {
        worker: worker(id),
        lease: Lease {
            attempt: attempt(number),
            image: image_ref(image),
            scene: Digest([7; 32]),
            tile: tile(index),
            wanted: wanted.to_vec(),
            expected,
        },
    }
}

pub(crate) fn welcome(id: u64, live: &[u64]) -> Effect {
    Effect::Welcome {
        worker: worker(id),
        live: live.iter().copied().map(attempt).collect(),
    }
}

pub(crate) fn ack(id: u64, number: u64, rect: Rect) -> Effect {
    Effect::Ack {
        worker: worker(id),
        attempt: attempt(number),
        rect,
    }
}

pub(crate) fn revoke(id: u64, number: u64, reason: RevokeReason) -> Effect {
    Effect::Revoke {
        worker: worker(id),
        attempt: attempt(number),
        reason,
    }
}

pub(crate) fn encode(image: u32) -> Effect {
    Effect::Encode {
        image: image_ref(image),
    }
}

pub(crate) fn drop_scratch(image: u32) -> Effect {
    Effect::DropScratch {
        image: image_ref(image),
    }
}

pub(crate) fn forget(id: u64) -> Effect {
    Effect::Forget { worker: worker(id) }
}

pub(crate) fn done(outcome: JobOutcome) -> Effect {
    Effect::JobDone {
        job: JobId(1),
        outcome,
    }
}

pub(crate) fn give_up(image: u32, reason: &str) -> Effect {
    Effect::GiveUp {
        image: image_ref(image),
        reason: reason.into(),
    }
}
