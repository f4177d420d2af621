//! A plain model of what the scheduler said, and what must hold of it.

use std::collections::{BTreeMap, BTreeSet};

use model::{AttemptId, Digest, ImageRef, JobId, Lease, Rect, Span, WorkerId};
use sched::{BlockRef, Effect, Event, ImageState, JobState, Sched, Verdict};

/// What a bystander makes of the scheduler's words.
#[derive(Default)]
pub(crate) struct Bystander {
    /// Every lease there ever was.
    pub(crate) leases: BTreeMap<AttemptId, (WorkerId, Lease)>,
    /// Pixels that were acknowledged.
    pub(crate) durable: BTreeMap<ImageRef, BTreeSet<(u32, u32)>>,
    pub(crate) encoding: BTreeSet<ImageRef>,
    begun_encoding: BTreeSet<ImageRef>,
    over: BTreeSet<JobId>,
    drops: BTreeMap<ImageRef, u32>,
}

impl Bystander {
    /// How often the scratch file was dropped of the image that something is reported of.
    pub(crate) fn drops_of(&self, event: &Event) -> u32 {
        let image = match event {
            Event::BlockStored { block, .. } => block.image,
            Event::ImageEncoded { image, .. } | Event::ImageFailed { image, .. } => *image,
            _ => return 0,
        };
        self.drops.get(&image).copied().unwrap_or(0)
    }

    /// Jobs that go on again may be over again.
    pub(crate) fn forget_what_goes_on(&mut self, sched: &Sched) {
        self.over.retain(|&job| {
            let view = sched.job(job);
            view.is_some_and(|view| view.state != JobState::Running)
        });
    }

    pub(crate) fn hear(&mut self, sched: &Sched, effect: Effect) {
        match effect {
            Effect::Lease { worker, lease } => self.hear_lease(sched, worker, lease),
            Effect::Adopted {
                worker, attempt, ..
            } => self.hear_adoption(sched, worker, attempt),
            Effect::Ack { attempt, rect, .. } => {
                // The image is that of the attempt, which a bystander remembers.
                let image = self.leases[&attempt].1.image;
                let pixels = self.durable.entry(image).or_default();
                pixels.extend(pixels_of(rect));
            }
            Effect::Encode { image } => {
                let view = sched.job(image.job).expect("it is known");
                let durable = self.durable[&image].len() as u64;
                assert_eq!(durable, view.window.area(), "every pixel is there");
                assert!(self.begun_encoding.insert(image), "encoded once");
                self.encoding.insert(image);
            }
            Effect::DropScratch { image } => self.drop(image),
            Effect::JobDone { job, .. } => {
                // One that is removed is forgotten at once.
                let known = sched.job(job).is_some();
                assert!(self.over.insert(job) || !known, "over once");
            }
            Effect::ForgetJob { job } => {
                self.over.remove(&job);
                self.durable.retain(|image, _| image.job != job);
            }
            _ => {}
        }
    }

    fn hear_lease(&mut self, sched: &Sched, worker: WorkerId, lease: Lease) {
        let view = sched.worker(worker).expect("it is known");
        assert!(view.attempts <= view.credit, "credit is kept");
        assert_eq!(
            sched.job(lease.image.job).expect("it is known").revision,
            view.revision
        );
        let durable = self.durable.entry(lease.image).or_default();
        let missing = |block: &Rect| pixels_of(*block).any(|pixel| !durable.contains(&pixel));
        let missing: Vec<Rect> = lease.tile.blocks().filter(missing).collect();
        let mut blocks: Vec<Rect> = lease.blocks().collect();
        blocks.sort_by_key(|block| (block.y0, block.x0));
        let all: Vec<Rect> = lease.tile.blocks().collect();
        let is_check = missing.is_empty();
        assert!(
            blocks == missing || is_check && blocks.iter().all(|block| all.contains(block)),
            "exactly what is missing is leased, or some of a tile to check it"
        );
        let before = self.leases.insert(lease.attempt, (worker, lease));
        assert_eq!(before, None, "an attempt is leased once");
    }

    /// A worker goes on with what it had begun in another epoch: it is live, and something of it is missing.
    fn hear_adoption(&mut self, sched: &Sched, worker: WorkerId, attempt: AttemptId) {
        let (whose, image, tile) = sched.attempt(attempt).expect("it is live");
        assert_eq!(whose, worker);
        let durable = self.durable.entry(image).or_default();
        let missing = |block: &Rect| pixels_of(*block).any(|pixel| !durable.contains(&pixel));
        let wanted: Vec<Rect> = tile.blocks().filter(missing).collect();
        assert!(!wanted.is_empty(), "something of it is missing");
        let lease = Lease {
            attempt,
            image,
            scene: Digest::default(),
            tile,
            wanted,
            expected: Span(0),
        };
        self.leases.insert(attempt, (worker, lease));
    }

    fn drop(&mut self, image: ImageRef) {
        self.encoding.remove(&image);
        self.begun_encoding.remove(&image);
        self.durable.remove(&image);
        *self.drops.entry(image).or_default() += 1;
    }

    /// An image that was finished and waits again has no pixels.
    pub(crate) fn drop_what_waits_again(&mut self, sched: &Sched) {
        let images: Vec<ImageRef> = self.durable.keys().copied().collect();
        for image in images {
            let view = sched.image(image);
            let waits = |view: sched::ImageView| {
                let begins = [ImageState::Waiting, ImageState::Rendering].contains(&view.state);
                begins && view.pixels_done == 0
            };
            if view.is_none_or(waits) {
                self.drop(image);
            }
        }
    }

    /// What must hold, whatever happened.
    pub(crate) fn check(&self, sched: &Sched) {
        let mut live: BTreeMap<(ImageRef, Rect), usize> = BTreeMap::new();
        for (&attempt, (worker, lease)) in &self.leases {
            let rect = lease.tile.blocks().next().expect("a tile has a block");
            let image = lease.image;
            let verdict = sched.accepts(
                *worker,
                BlockRef {
                    attempt,
                    image,
                    rect,
                },
            );
            if sched.attempt(attempt).is_some() {
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
        for job in sched.jobs() {
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
}

fn pixels_of(rect: Rect) -> impl Iterator<Item = (u32, u32)> {
    (rect.y0..rect.y1).flat_map(move |y| (rect.x0..rect.x1).map(move |x| (x, y)))
}
