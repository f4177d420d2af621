//! What each step does, to whatever there is at that moment.

use model::{
    AttemptId, Begun, Digest, Epoch, ImageRef, JobId, Lease, Rect, Resolution, Revision, Running,
    Span, SubmissionId,
};
use proptest::sample::Index;
use sched::{BlockRef, Command, Event, ImageState, LinkId, Offer, Submission, Verdict};

use crate::history::History;
use crate::situation::{self, EPOCH, film, worker};
use crate::step::{Step, Wish};

/// What a worker says of a lease that it has begun.
pub(crate) fn begun(lease: &Lease) -> Begun {
    Begun {
        attempt: lease.attempt,
        image: lease.image,
        tile: lease.tile,
    }
}

impl History {
    pub(crate) fn take(&mut self, step: Step) {
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
                        worker: self.seen.leases[&attempt].0,
                        attempt,
                        reason: "no memory".into(),
                    });
                }
            }
            Step::GivesBack(attempt) => {
                if let Some((attempt, _)) = self.pick(&attempt) {
                    self.tell(Event::GivenBack {
                        worker: self.seen.leases[&attempt].0,
                        attempts: vec![attempt],
                    });
                }
            }
            Step::Goodbye(id) => self.tell(Event::Goodbye { worker: worker(id) }),
            Step::Encoded(index) => self.encoded(&index),
            Step::ImageFails(index) => {
                let images: Vec<ImageRef> = self.seen.durable.keys().copied().collect();
                if !images.is_empty() {
                    let image = *index.get(&images);
                    self.seen.encoding.remove(&image);
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
                    if self.seen.drops_of(&event) == drops {
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

    pub(crate) fn join(&mut self, id: u64, held: u64) {
        self.links += 1;
        let still = self.seen.leases.iter().filter(|(attempt, lease)| {
            lease.0 == worker(id) && held >> (attempt.number % 64) & 1 == 1
        });
        let (held, bits) = (still.map(|(&attempt, _)| attempt).collect(), held);
        let (own, of_before) = (worker(id), self.begun.iter());
        let of_before = of_before.filter(|(whose, _)| bits == u64::MAX && *whose == own);
        let mut begun: Vec<Begun> = of_before.map(|(_, begun)| *begun).collect();
        // Now and then it says so of any tile that there ever was.
        if bits % 5 == 1
            && let Some((_, lease)) = self.seen.leases.values().nth((bits % 7) as usize)
        {
            begun.push(Begun {
                attempt: AttemptId {
                    epoch: Epoch(EPOCH.0 - 1),
                    number: bits % 3,
                },
                ..self::begun(lease)
            });
        }
        self.tell(Event::WorkerJoined {
            worker: worker(id),
            link: LinkId(self.links),
            offer: Offer {
                revision: Revision(u32::from(id == 3)),
                threads: 1 + u32::from(id >= 2),
                memory_bytes: u64::from(id >= 1),
                labels: (id != 1).then(|| "fast".to_owned()).into_iter().collect(),
                time_left: (id == 1).then_some(Span::from_secs(40)),
                queue: None,
            },
            held,
            begun,
        });
    }

    fn heartbeat(&mut self, id: u64) {
        let running = self
            .seen
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
            .seen
            .leases
            .iter()
            .filter(|(attempt, _)| self.sched.attempt(**attempt).is_some());
        let all: Vec<_> = live.chain(self.seen.leases.iter().rev().take(3)).collect();
        (!all.is_empty()).then(|| {
            let (attempt, (_, lease)) = index.get(&all);
            (**attempt, lease.clone())
        })
    }

    /// A block arrives: the shell asks, and tells what it stored.
    pub(crate) fn block(&mut self, attempt: AttemptId, lease: &Lease, (rect, pixels): (Rect, u8)) {
        let worker = self.seen.leases[&attempt].0;
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
        let images: Vec<ImageRef> = self.seen.encoding.iter().copied().collect();
        if !images.is_empty() {
            let image = *index.get(&images);
            self.seen.encoding.remove(&image);
            self.tell(Event::ImageEncoded {
                image,
                film: film(1),
            });
            let view = self.sched.image(image).expect("it is known");
            assert_eq!(view.state, ImageState::Encoded { film: film(1) });
        }
    }

    pub(crate) fn wait(&mut self, span: Span) {
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
}
