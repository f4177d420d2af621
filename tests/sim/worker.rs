//! A worker's shell: threads that take their time, and the bytes of blocks.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use model::{AttemptId, ImageRef, Lease, Rect, Span, Timestamp, WorkerId};
use sched::BlockRef;
use session::{Backoff, Config, Effect, Event, Session};

use crate::clock::Clock;
use crate::disk::Pixels;
use crate::message::{Down, Up};

/// What the shell wants of the world.
#[derive(Debug)]
pub(crate) enum Wish {
    Dial,
    Close,
    Send(Up),
    /// A thread has a block to render.
    Render(usize),
    Exit,
}

pub(crate) struct Worker {
    session: Session,
    pub(crate) clock: Clock,
    pub(crate) frozen_until: Timestamp,
    pub(crate) gone: bool,
    /// How long one of its threads takes over a block, in the mean.
    pub(crate) pace: Span,
    config: Config,
    threads: Vec<Option<Tile>>,
    queue: VecDeque<Lease>,
    paused: bool,
    /// The bytes of blocks, so to say, and how long they took.
    kept: BTreeMap<(AttemptId, Rect), (ImageRef, Span, Pixels)>,
    /// Every tile that was started.
    started: BTreeSet<AttemptId>,
    pub(crate) events: u64,
    /// Whether it makes wrong pixels now and then.
    pub(crate) lies: bool,
    wishes: Vec<Wish>,
}

/// What a thread works on.
struct Tile {
    attempt: AttemptId,
    image: ImageRef,
    blocks: VecDeque<Rect>,
    /// Whether a block is being rendered.
    busy: bool,
}

impl Worker {
    pub(crate) fn new(now: Timestamp, id: WorkerId, threads: u32, pace: Span) -> Self {
        let config = Config {
            unacked_blocks_max: 12,
            backoff: Backoff {
                key: id.id,
                ..Backoff::default()
            },
            ..Config::new(threads)
        };
        Self {
            session: Session::new(config.clone()),
            clock: Clock::new(now),
            frozen_until: Timestamp(0),
            gone: false,
            pace,
            threads: (0..threads).map(|_| None).collect(),
            config,
            queue: VecDeque::new(),
            paused: false,
            kept: BTreeMap::new(),
            started: BTreeSet::new(),
            events: 0,
            lies: false,
            wishes: Vec::new(),
        }
    }

    /// When, by the world's clock, it wants to look at its own.
    pub(crate) fn next_deadline(&self) -> Option<Timestamp> {
        let due = self.clock.shows(self.session.next_deadline()?);
        Some(due.max(self.frozen_until))
    }

    /// What it wished for since the last time.
    pub(crate) fn wishes(&mut self) -> Vec<Wish> {
        std::mem::take(&mut self.wishes)
    }

    pub(crate) fn hears(&mut self, now: Timestamp, message: Down) {
        let event = match message {
            Down::Welcome(welcome) => Event::Connected(welcome),
            Down::Refused(reason, retry) => Event::Refused { reason, retry },
            Down::Lease(lease) => Event::Leased(lease),
            Down::Revoke(attempt) => Event::Revoked { attempt },
            Down::Ack(attempt, rect) => Event::Acked { attempt, rect },
            Down::BlockRefused(attempt, rect, verdict) => Event::BlockRefused {
                attempt,
                rect,
                verdict,
            },
        };
        self.tell(now, event);
    }

    /// A thread has rendered the block it had in hand, or failed to.
    pub(crate) fn renders(
        &mut self,
        now: Timestamp,
        thread: usize,
        took: Span,
        made: Option<Pixels>,
    ) {
        let Some(tile) = self.threads[thread].as_mut().filter(|tile| tile.busy) else {
            return;
        };
        tile.busy = false;
        let attempt = tile.attempt;
        let Some(pixels) = made else {
            self.threads[thread] = None;
            let reason = "out of memory".into();
            return self.tell(now, Event::RenderFailed { attempt, reason });
        };
        if let Some(rect) = tile.blocks.pop_front() {
            let image = tile.image;
            let is_last = tile.blocks.is_empty();
            self.kept.insert((attempt, rect), (image, took, pixels));
            assert!(
                self.kept.len() <= self.config.unacked_blocks_max as usize,
                "rendering pauses in time"
            );
            if is_last {
                self.threads[thread] = None;
            }
            self.tell(now, Event::BlockRendered { attempt, rect });
            if is_last && !self.gone {
                self.tell(now, Event::TileRendered { attempt });
            }
        }
        self.give_threads_work();
    }

    pub(crate) fn tell(&mut self, now: Timestamp, event: Event) {
        let mut effects = Vec::new();
        self.events += 1;
        self.session
            .handle(self.clock.read(now), event, &mut effects);
        self.session.check_invariants();
        for effect in effects {
            assert!(!self.gone, "nothing follows the exit");
            self.perform(effect);
        }
        self.give_threads_work();
    }

    fn perform(&mut self, effect: Effect) {
        let message = match effect {
            Effect::Connect => return self.wishes.push(Wish::Dial),
            Effect::CloseLink => return self.wishes.push(Wish::Close),
            Effect::SendHello { held, begun } => Up::Hello(held, begun),
            Effect::SendCredit { credit } => Up::Credit(credit),
            Effect::SendHeartbeat { running } => Up::Heartbeat(running),
            Effect::StartTile { lease } => {
                assert!(self.started.insert(lease.attempt), "started once");
                return self.queue.push_back(lease);
            }
            Effect::CancelTile { attempt } => return self.cancel(attempt),
            Effect::PauseRendering => {
                self.paused = true;
                return;
            }
            Effect::ResumeRendering => {
                self.paused = false;
                return;
            }
            Effect::SendBlock { attempt, rect } => {
                let kept = self.kept.get(&(attempt, rect));
                let (image, took, pixels) = *kept.expect("the bytes of a block to send are kept");
                let block = BlockRef {
                    attempt,
                    image,
                    rect,
                };
                Up::Block(block, took, pixels)
            }
            Effect::DropBlock { attempt, rect } => {
                self.kept.remove(&(attempt, rect));
                return;
            }
            Effect::GiveBack { attempts } => Up::GiveBack(attempts),
            Effect::SendFailed { attempt, reason } => Up::Failed(attempt, reason),
            Effect::SendGoodbye => Up::Goodbye,
            Effect::Exit { .. } => {
                self.gone = true;
                return self.wishes.push(Wish::Exit);
            }
        };
        self.wishes.push(Wish::Send(message));
    }

    fn cancel(&mut self, attempt: AttemptId) {
        self.queue.retain(|lease| lease.attempt != attempt);
        for thread in &mut self.threads {
            // A block in hand is finished first; the thread then finds nothing left of the tile.
            if let Some(tile) = thread.as_mut().filter(|tile| tile.attempt == attempt) {
                if tile.busy {
                    tile.blocks.truncate(1);
                } else {
                    *thread = None;
                }
            }
        }
    }

    fn give_threads_work(&mut self) {
        for (index, thread) in self.threads.iter_mut().enumerate() {
            if thread.is_none() {
                *thread = self.queue.pop_front().map(|lease| Tile {
                    attempt: lease.attempt,
                    image: lease.image,
                    blocks: lease.blocks().collect(),
                    busy: false,
                });
            }
            if let Some(tile) = thread.as_mut().filter(|tile| !tile.busy)
                && !self.paused
            {
                tile.busy = true;
                self.wishes.push(Wish::Render(index));
            }
        }
    }

    /// Blocks whose bytes it still has.
    pub(crate) fn blocks_kept(&self) -> usize {
        self.kept.len()
    }
}
