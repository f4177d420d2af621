//! Who gets the next tile, of which job, and how large.

use alloc::vec::Vec;

use model::{AttemptId, ImageRef, JobId, Lease, Rect, Span, Timestamp};

use crate::attempt::{Attempt, Start};
use crate::job::Job;
use crate::market::Stage;
use crate::needs::{Kind, KindSet, Queue};
use crate::pace::{cost_of, time_of};
use crate::roster::Place;
use crate::tiling::{TileGrid, TileRule};
use crate::work::{Amount, Ask, OfQueue};
use crate::worker::Worker;
use crate::{Effect, Sched};

/// While pixels are measured but not mapped, a tile by time has at most so many times the pixels
/// of one of which nothing is known.
const UNMAPPED_FACTOR: u64 = 4;

/// Workers of one group that are looked at for a tile. Of those that are alike, a tile suits all
/// but those that failed at it, which are fewer than this before its image fails.
const SEATS_LOOKED_AT: usize = 8;

/// Most workers that are helped out with somebody else's work at one event.
const HELPS_MAX: usize = 64;

/// Why a tile is leased.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Purpose {
    /// Nobody who can be reached renders it.
    First,
    /// Somebody does, and is expected to take long.
    Second,
}

impl Sched {
    /// Leases tiles while a worker wants one that it may have, and helps where jobs are about to end.
    pub(crate) fn lease_all(&mut self, out: &mut Vec<Effect>) {
        for helped in 0.. {
            while let Some(kind) = self.market.touched() {
                let goes_on = match self.match_kind(kind) {
                    // Where all that waited turns out to be durable, others of its kind are next.
                    Some((worker, job, ask)) => {
                        self.lease(worker, job, &ask, out) || self.may_take(worker, job).is_none()
                    }
                    None => false,
                };
                if !goes_on {
                    self.market.settled(kind);
                }
            }
            if helped == HELPS_MAX || !self.help_to_end(out) {
                break;
            }
        }
        // A check that was called back waits for whoever it was called back for.
        self.unlooked.clear();
    }

    /// A worker that serves a kind of which a job has tiles, and the job that its next tile comes from.
    ///
    /// Looks at the first few workers of each group: where none of them finds a job, none of the group does.
    fn match_kind(&self, kind: Kind) -> Option<(Place, JobId, Ask)> {
        self.market.jobs(Stage::Open, kind).next()?;
        let groups = self.market.wanting(kind);
        let first = groups.filter_map(|(kinds, seats)| {
            seats.iter().take(SEATS_LOOKED_AT).find_map(|&seat| {
                let (job, ask) = self.next_job(seat.worker, kinds)?;
                Some((seat, job, ask))
            })
        });
        let first = first.min_by_key(|&(seat, ..)| seat);
        first.map(|(seat, job, ask)| (seat.worker, job, ask))
    }

    /// The first job in order that has a tile for a worker.
    fn next_job(&self, worker: Place, kinds: KindSet) -> Option<(JobId, Ask)> {
        let first = kinds.iter().filter_map(|kind| {
            let mut jobs = self.market.jobs(Stage::Open, kind);
            jobs.find_map(|rank| Some((rank, self.may_take(worker, rank.job)?)))
        });
        let first = first.min_by_key(|&(rank, _)| rank);
        first.map(|(rank, ask)| (rank.job, ask))
    }

    /// How large a tile of a job a worker should have, if there is one for it.
    pub(crate) fn may_take(&self, worker: Place, job: JobId) -> Option<Ask> {
        let (worker, job) = (&self.workers[worker], &self.jobs[&job]);
        let ask = match (worker.aside.job(job.id), worker.offer.queue) {
            (None, None) => self.ask(worker, job),
            (None, Some(queue)) => Some(self.ask_of_queue(worker, queue, job)),
            (Some(_), _) => None,
        };
        ask.filter(|ask| job.has_for(ask, &self.config))
    }

    /// How large a tile of a job a worker should have; `None` where its time is too short for any.
    pub(crate) fn ask(&self, worker: &Worker, job: &Job) -> Option<Ask> {
        let speed = worker.pace.speed();
        let left = worker.time_left(self.now);
        let fits = match left {
            Some(left) if job.costs.mean_square().is_none() => {
                (left >= self.config.unmeasured_needs).then_some(None)?
            }
            Some(left) => {
                // What is expected is not promised: a fifth is kept back.
                let cost = cost_of(left, speed) / 5 * 4;
                let pixels = job.costs.pixels_for(cost).unwrap_or(0);
                Some(Amount { pixels, cost })
            }
            None => None,
        };
        let left = job
            .open_cost()
            .map(|cost| time_of(cost, self.total_speed()));
        let most = job
            .shape
            .aim
            .map(|aim| self.tile_by_time(job, (aim, left), speed));
        Some(Ask {
            worker: worker.id,
            able: self.able_beside_queues(job),
            most,
            fits,
            lasts: left.map(|left| cost_of(left + self.config.tile_time, speed)),
            queue: None,
        })
    }

    /// What a worker that stands for a queue should have of a job: every tile of an image is a cell.
    fn ask_of_queue(&self, worker: &Worker, queue: Queue, job: &Job) -> Ask {
        Ask {
            worker: worker.id,
            able: self.able_for(job),
            most: None,
            fits: None,
            lasts: None,
            queue: Some(OfQueue {
                grid: self.grid_for(queue, job.spec.window),
                has_room: worker.has_room(),
                is_last: self.able_beside_queues(job) == 0,
            }),
        }
    }

    /// How an image is cut for a queue.
    pub(crate) fn grid_for(&self, queue: Queue, window: Rect) -> TileGrid {
        let cut = |max_array_size: u64| {
            let rule = TileRule {
                min_tile_pixels: queue.min_tile_pixels,
                max_array_size: max_array_size.clamp(1, self.config.max_array_size),
            };
            TileGrid::new(window, rule.tile_size(window))
        };
        let grid = cut(queue.max_array_size);
        // So few tiles that one of them is larger than tiles may be are more than an array.
        match grid.tile(0).area() > self.config.limits.tile_pixels_max {
            true => cut(window.area().div_ceil(self.config.limits.tile_pixels_max) * 4),
            false => grid,
        }
    }

    /// Workers that take tiles of a job.
    pub(crate) fn able_for(&self, job: &Job) -> u32 {
        self.kinds.able(job.kind) - job.aside_able
    }

    /// Those that may have what others than a queue have begun: what failed on all of them waits for nobody else.
    pub(crate) fn able_beside_queues(&self, job: &Job) -> u32 {
        let queues = self.queues.iter().filter(|&&place| {
            let counts = self.workers[place].counted.as_ref();
            counts.is_some_and(|counts| {
                counts.kinds.contains(job.kind) && !counts.aside.contains(&job.id)
            })
        });
        let queues = u32::try_from(queues.count()).unwrap_or(u32::MAX);
        self.able_for(job).saturating_sub(queues)
    }

    /// The speed of all threads of workers that take tiles.
    fn total_speed(&self) -> u32 {
        u32::try_from(self.capacity).unwrap_or(u32::MAX).max(1)
    }

    /// A tile that takes `aim` at a speed, or less where a job of which so much is left is near its end.
    fn tile_by_time(&self, job: &Job, (aim, left): (Span, Option<Span>), speed: u32) -> Amount {
        let unknown = self.config.min_tile_pixels;
        let parts = self.config.tail_parts;
        let most = left.filter(|_| parts > 0).map(|left| Span(left.0 / parts));
        let time = most.map_or(aim, |most| aim.min(most));
        let cost = cost_of(time, speed);
        let pixels = job.costs.pixels_for(cost);
        Amount {
            cost,
            pixels: pixels.map_or(unknown, |pixels| pixels.min(UNMAPPED_FACTOR * unknown)),
        }
    }

    /// Leases a worker the next tile of a job, if there still is one.
    pub(crate) fn lease(
        &mut self,
        worker: Place,
        job_id: JobId,
        ask: &Ask,
        out: &mut Vec<Effect>,
    ) -> bool {
        let job = self
            .jobs
            .get_mut(&job_id)
            .expect("a job in the market is known");
        let tile = job.take_tile(ask, &self.config);
        if let Some((place, tile)) = tile {
            let image = job.image_ref(place);
            self.lease_tile(worker, (image, tile), Purpose::First, out);
        }
        self.job_changed(job_id);
        self.settle_job(job_id);
        tile.is_some()
    }

    /// Leases a tile that has room for an attempt.
    pub(crate) fn lease_tile(
        &mut self,
        place: Place,
        tile: (ImageRef, u32),
        purpose: Purpose,
        out: &mut Vec<Effect>,
    ) {
        let lease = self.begin_attempt(place, tile, purpose);
        let worker = self.workers[place].id;
        out.push(Effect::Lease { worker, lease });
    }

    /// Begins an attempt at a tile that has room for one; what its worker should know of it.
    pub(crate) fn begin_attempt(
        &mut self,
        place: Place,
        (image, number): (ImageRef, u32),
        purpose: Purpose,
    ) -> Lease {
        self.attempts_made += 1;
        let attempt = self.attempts_made;
        let worker = &mut self.workers[place];
        let speed = worker.pace.speed();
        let job = self
            .jobs
            .get_mut(&image.job)
            .expect("a tile's job is known");
        let index = job.place(image.image).expect("a tile's image is its job's");
        let work = job
            .work
            .get_mut(&index)
            .expect("a tile's image is in flight");
        let tile = work
            .tiles
            .get(number)
            .expect("a tile that is leased is there");
        let mut wanted = work.wanted(tile, worker.id);
        let rect = tile.rect;
        let cost = match wanted.is_empty() {
            true => job.costs.of_blocks(rect.blocks()),
            false => job.costs.of_blocks(wanted.iter().copied()),
        };
        let blocks = match wanted.len() {
            0 => rect.blocks().count(),
            some => some,
        };
        if purpose == Purpose::Second {
            // From the other end: the two attempts meet.
            if wanted.is_empty() {
                wanted = rect.blocks().collect::<Vec<Rect>>();
            }
            wanted.reverse();
            job.tally.seconds += 1;
        }
        let tile = work.tiles.get_mut(number).expect("it was just there");
        tile.begins(attempt);
        tile.trouble.on_purpose |= purpose == Purpose::Second;
        let failures = tile.trouble.failures;
        job.tally.attempts_live += 1;
        job.tally.started.get_or_insert(self.now);
        let block_cost = cost.unwrap_or(0) / blocks.max(1) as u64;
        let limit = job.block_limit(&self.config, (block_cost, speed), failures);
        let expected = cost.map(|cost| time_of(cost, speed));
        let finish = expected.map(|expected| worker.begins_next(self.now) + expected);
        let lease = Lease {
            attempt: AttemptId {
                epoch: self.config.epoch,
                number: attempt,
            },
            image,
            scene: job.spec.scene,
            tile: rect,
            wanted,
            expected: expected.unwrap_or_default(),
        };
        let start = Start {
            worker: place,
            image,
            tile: number,
            rect,
            leased: self.now,
            wanted: u32::try_from(blocks).unwrap_or(u32::MAX),
            cost: cost.unwrap_or(0),
            // Nobody knows: it is looked at first, and expected anew.
            finish: finish.unwrap_or(Timestamp(u64::MAX)),
            limit,
        };
        self.attempts.insert(attempt, Attempt::new(start));

        if worker.live.is_empty() {
            worker.moved = self.now;
        }
        worker.live.push(attempt);
        worker.takes(image);
        worker.idle += 1;
        worker.backlog = worker.backlog.saturating_add(cost.unwrap_or(0));
        worker.patience = limit;
        if worker.waiting.due().is_none() {
            self.rearm_waiting(place);
        }
        self.worker_changed(place);
        self.reconsider(image, number);
        lease
    }
}
