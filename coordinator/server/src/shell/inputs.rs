//! From inputs to events.

use std::collections::BTreeSet;

use model::{ImageRef, JobId, WorkerId};
use sched::{BlockRefusal, Event, LinkId, Offer, Verdict};
use wire::proto::{self, ErrorKind, control_down, deliver_down};
use wire::{Failure, convert};

use super::{Commanding, Next, Shell, Submitting};
use crate::inbox::NewJob;
use crate::input::{Arrived, Greeting, Input, Link, News, Reply, Wanderers, Wish};
use crate::job::Sign;
use crate::storage::{Encoded, Hand, Stored};
use crate::worker::{Draining, Worker};

/// Most workers that are named when some are to leave.
const DRAINED_MAX: usize = 1_000;

impl Shell {
    /// Hears what the coordinator itself has to say.
    pub(super) fn hear(&mut self, news: News) -> Next {
        match news {
            News::Stored(group) => {
                for stored in group {
                    let worker = stored.arrived.worker;
                    self.stored(stored);
                    self.has_stored(worker);
                }
            }
            News::Committed(ticket) => self.committed(ticket),
            News::Encoded(encoded) => self.encoded(encoded),
            News::Trouble(hand, trouble) => self.disk_says(hand, trouble),
            News::Broken(sentence) => return Next::Stop(Err(sentence)),
            News::Stop => return Next::Stop(Ok(())),
        }
        Next::GoOn
    }

    /// Takes one input.
    pub(super) fn take(&mut self, input: Input) {
        match input {
            Input::Submit(new, reply) => {
                self.submit(new, reply);
                self.sites.wake();
            }
            Input::Command(job, wish, reply) => {
                self.command(job, wish, reply);
                self.sites.wake();
            }
            Input::Drain(whom, reply) => {
                let _ = reply.send(self.drain(&whom));
            }
            Input::Ask(query) => self.answer(query),
            Input::Hello(greeting) => self.greet(*greeting),
            Input::Said {
                worker,
                link,
                event,
            } => self.said(worker, link, event),
            Input::Delivering {
                worker,
                epoch,
                link,
                reply,
            } => {
                let _ = reply.send(self.open_delivery(worker, epoch, link));
            }
            Input::Block(arrived) => self.block(arrived),
            Input::DeliveryClosed { worker, link } => {
                if let Some(worker) = self.workers.get_mut(&worker)
                    && worker.delivery.as_ref().is_some_and(|open| open.id == link)
                {
                    worker.delivery = None;
                }
            }
        }
    }

    fn submit(&mut self, new: Box<NewJob>, reply: Reply<proto::Submitted>) {
        let submission = new.submission.clone();
        self.submitting.push_back(Submitting {
            submission: submission.submission,
            formats: new.formats,
            again: self.sched.submitted(submission.submission).is_some(),
            reply,
        });
        self.arriving = Some(new);
        self.feed(Event::Submit(submission));
        // What became no job is removed.
        self.arriving = None;
    }

    fn greet(&mut self, greeting: Greeting) {
        let Greeting {
            worker,
            link,
            protocol,
            revision,
            threads,
            queue,
            held,
            begun,
            about,
        } = greeting;
        tracing::info!(%worker, name = about.name, threads, "a worker says hello");
        let event = Event::WorkerJoined {
            worker,
            link: link.id,
            offer: Offer {
                revision,
                threads,
                memory_bytes: about.memory_bytes,
                labels: about.labels.clone(),
                time_left: about.time_left,
                queue,
            },
            held,
            begun,
        };
        // An older link of the same process is dropped with its streams.
        let draining = self.workers.get(&worker).map(|known| known.draining);
        let draining = draining.unwrap_or_else(|| self.leaving.take(worker));
        let storing = self.workers.get(&worker).map_or(0, |known| known.storing);
        let runs_until = about.time_left.map(|left| self.now() + left);
        self.workers.insert(
            worker,
            Worker {
                about,
                protocol,
                control: Some(link),
                delivery: None,
                draining,
                runs_until,
                storing,
                closing: None,
            },
        );
        self.feed(event);
    }

    fn said(&mut self, id: WorkerId, link: LinkId, event: Event) {
        let Some(worker) = self.workers.get_mut(&id) else {
            return;
        };
        let newest = worker.is_control(link);
        match &event {
            // Told even of a link that was cut here; the scheduler ignores one that was replaced.
            Event::LinkClosed { .. } => {
                if newest {
                    worker.control = None;
                    worker.delivery = None;
                }
                tracing::info!(worker = %id, "a worker's link closed");
                // What it brought before is written first: whoever takes its tiles is not asked for that again.
                let waits = worker.storing > 0;
                if waits {
                    worker.closing = worker.closing.max(Some(link));
                }
                self.tell_jobs_of_closed_link(id);
                if waits {
                    // Meanwhile it gets nothing more.
                    if newest {
                        let (worker, credit) = (id, 0);
                        self.feed(Event::Credit { worker, credit });
                    }
                    return;
                }
            }
            _ if !newest => return,
            Event::TileFailed {
                attempt, reason, ..
            } => {
                tracing::warn!(worker = %id, %attempt, reason, "a tile failed");
                if let Some((_, image, tile)) = self.sched.attempt(*attempt) {
                    let name = self.worker_name(id);
                    self.say(
                        image.job,
                        format!(
                            "frame {}: the tile at {},{} failed on worker {name}: {reason}",
                            image.image, tile.x0, tile.y0
                        ),
                    );
                }
            }
            _ => {}
        }
        self.feed(event);
    }

    /// Does what a user wants of a job; answers with the job as it is then, or was where it is forgotten.
    pub(super) fn command(&mut self, job: JobId, wish: Wish, reply: Reply<proto::JobSummary>) {
        let Some(before) = self.summary(job) else {
            let _ = reply.send(Err(super::views::no_job(job)));
            return;
        };
        let Wish {
            command,
            frames,
            if_over_since,
        } = wish;
        if if_over_since.is_some_and(|since| since != before.finished_unix_ms) {
            let sentence = format!("job {job} goes on again");
            let _ = reply.send(Err(Failure::new(ErrorKind::NotReady, sentence)));
            return;
        }
        self.commanding.push_back(Commanding {
            command,
            frames,
            before,
            reply,
        });
        self.feed(Event::Command { job, command });
    }

    /// Has workers finish what they hold and leave; one whose link is cut is told when it comes back.
    fn drain(&mut self, whom: &Wanderers) -> Result<proto::WorkerList, Failure> {
        let ids: BTreeSet<WorkerId> = match whom {
            Wanderers::All => self.workers.keys().copied().collect(),
            Wanderers::Named(names) if names.len() > DRAINED_MAX => {
                let sentence = format!("at most {DRAINED_MAX} workers can be named at a time");
                return Err(Failure::new(ErrorKind::BadRequest, sentence));
            }
            Wanderers::Named(names) => {
                let mut ids = BTreeSet::new();
                for name in names {
                    let called = self.workers_called(name);
                    if called.is_empty() {
                        return Err(super::views::no_worker(name));
                    }
                    ids.extend(called);
                }
                ids
            }
        };
        for id in &ids {
            if let Some(worker) = self.workers.get_mut(id) {
                worker.draining = Draining::Yes;
                tracing::info!(worker = %id, name = worker.about.name, "a worker is told to leave");
            }
            self.tell(*id, control_down::Message::Drain(proto::Drain {}));
        }
        let told = self
            .sched
            .workers()
            .filter(|view| ids.contains(&view.worker));
        let workers = told
            .map(|view| super::views::worker_status(&view, self.workers.get(&view.worker)))
            .collect();
        Ok(proto::WorkerList { workers })
    }

    /// The workers of this name or id.
    pub(super) fn workers_called(&self, name: &str) -> Vec<WorkerId> {
        let workers = self.workers.iter();
        let called = workers.filter(|(id, worker)| worker.is_called(**id, name));
        called.map(|(id, _)| *id).collect()
    }

    /// A thread of the disk waits, or waits no more. While blocks wait nobody is late.
    fn disk_says(&mut self, hand: Hand, trouble: Option<String>) {
        let said = match &trouble {
            Some(sentence) => {
                tracing::error!(?hand, "the coordinator waits for its disk: {sentence}");
                format!("the coordinator waits for its disk: {sentence}")
            }
            None => {
                tracing::info!(?hand, "the disk is well again");
                "the coordinator's disk is well again".to_owned()
            }
        };
        match trouble {
            Some(sentence) => self.troubles.insert(hand, sentence),
            None => self.troubles.remove(&hand),
        };
        match self.troubles.keys().any(|hand| hand.holds_up_blocks()) {
            true => self.clock.hold(),
            false => self.clock.release(),
        }
        let running: Vec<_> = self
            .sched
            .jobs()
            .filter(|job| job.state == sched::JobState::Running)
            .map(|job| job.job)
            .collect();
        for job in running {
            self.say(job, said.clone());
        }
    }

    fn open_delivery(
        &mut self,
        worker: WorkerId,
        epoch: u64,
        link: Link<proto::DeliverDown>,
    ) -> Result<(), Failure> {
        let ready = self
            .workers
            .get_mut(&worker)
            .filter(|worker| worker.control.is_some())
            .filter(|_| epoch == self.state.epoch().0);
        let Some(worker) = ready else {
            return Err(Failure::later(
                ErrorKind::NotReady,
                "the worker has no open control stream: it must say hello there first",
            ));
        };
        worker.delivery = Some(link);
        let welcome = proto::DeliverWelcome {};
        worker.answer(deliver_down::Message::Welcome(welcome));
        Ok(())
    }

    fn block(&mut self, arrived: Box<Arrived>) {
        let (worker, block) = (arrived.worker, arrived.block);
        match self.sched.accepts(worker, block) {
            Verdict::Accept => match self.jobs.get(block.image.job) {
                Some(job) => {
                    let era = self.era(block.image);
                    if let Some(worker) = self.workers.get_mut(&worker) {
                        worker.storing += 1;
                    }
                    self.storage.store(job.plan.clone(), arrived, era);
                }
                None => tracing::error!(?block, "a block of a job that is not known"),
            },
            Verdict::AlreadyDone => self.feed(Event::BlockStored {
                worker,
                block,
                elapsed: arrived.elapsed,
                pixels: arrived.pixels,
            }),
            Verdict::Refuse(refusal) => self.refuse_block(worker, block, refusal),
        }
    }

    fn stored(&mut self, stored: Stored) {
        let Stored {
            arrived,
            era,
            result,
        } = stored;
        let Arrived {
            worker,
            block,
            elapsed,
            pixels,
            counters,
            ..
        } = arrived;
        let image = block.image;
        if let Err(reason) = result {
            let message = deliver_down::Message::Refused(proto::Refused {
                attempt: Some(block.attempt.into()),
                block: Some(block.rect.into()),
                error: Some(Failure::new(ErrorKind::BadRequest, &*reason).detail()),
            });
            if let Some(worker) = self.workers.get_mut(&worker) {
                worker.answer(message);
            }
            return;
        }
        if era != self.era(image) {
            // Its pixels went with the scratch file that they were written to.
            return self.refuse_block(worker, block, BlockRefusal::AttemptDead);
        }
        let count = |shell: &mut Self, sign| {
            if let Some(job) = shell.jobs.get_mut(image.job) {
                job.count(image.image, elapsed, &counters, sign);
            }
        };
        count(self, Sign::Plus);
        let before = self.blocks_done(image.job);
        self.jobs.touch_image(image);
        self.feed(Event::BlockStored {
            worker,
            block,
            elapsed,
            pixels,
        });
        // Another attempt's had made its pixels durable, or nobody wants them.
        if self.blocks_done(image.job) == before {
            count(self, Sign::Minus);
        }
    }

    /// A worker's block was written, or refused; behind its last one the end of its link is told.
    fn has_stored(&mut self, id: WorkerId) {
        let Some(worker) = self.workers.get_mut(&id) else {
            return;
        };
        worker.storing = worker.storing.saturating_sub(1);
        if worker.storing == 0
            && let Some(link) = worker.closing.take()
        {
            self.feed(Event::LinkClosed { worker: id, link });
        }
    }

    fn blocks_done(&self, job: JobId) -> u64 {
        self.sched.job(job).map_or(0, |view| view.blocks_done)
    }

    fn encoded(&mut self, encoded: Encoded) {
        let Encoded { image, era, result } = encoded;
        if era != self.era(image) {
            return;
        }
        match result {
            Ok(frame) => {
                let files = frame.files.iter().map(super::views::file).collect();
                let film = frame.film_digest;
                if let Some(job) = self.jobs.get_mut(image.job) {
                    job.files.insert(image.image, files);
                    tracing::info!(job = %image.job, image = %image.image, %film, "a frame is finished");
                    self.say(
                        image.job,
                        format!("frame {} is finished, film digest {film}", image.image),
                    );
                }
                self.jobs.touch_image(image);
                self.feed_with(Event::ImageEncoded { image, film }, &frame.files);
            }
            Err(reason) => self.fail_image(image, reason),
        }
    }

    fn fail_image(&mut self, image: ImageRef, reason: String) {
        let reason = convert::sentence(&reason, 2_000);
        self.jobs.touch_image(image);
        self.feed(Event::ImageFailed { image, reason });
    }
}
