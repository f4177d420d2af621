//! The thread that performs orders, in order: it writes and syncs pixels, and hands over what is to be committed.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry as Place;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender};
use std::time::{Duration, Instant};

use image::Scratch;
use model::ImageRef;
use store::Entry;

use super::committer::{Batch, Commits};
use super::disk::Disk;
use super::encoder::Encoding;
use super::{Encoded, Open, Order, Plan, Stored, Ticket, chain};
use crate::input::News;

/// Most blocks and records that are made durable together, and bytes of pixels. More would delay the first one's
/// acknowledgement, and save little: a sync's cost is spread thin already, even where a disk takes a tenth of a second.
pub(super) const GROUP_MAX: usize = 2_048;
const GROUP_BYTES_MAX: usize = 8 << 20;

/// From so many blocks and records on, or so many bytes of pixels, a group is written while the one before it is
/// committed. Less waits for that, and for what comes meanwhile: a sync for little costs as much as one for all.
const PIPELINED_MIN: usize = 64;
const PIPELINED_BYTES_MIN: usize = 256 << 10;

/// How long a group that is worth no sync of its own waits for more blocks. Two syncs and a handful of wake-ups cost a
/// processor a millisecond; workers hold tiles ahead for as long as acknowledgements take.
const LINGER: Duration = Duration::from_millis(50);

/// The thread that owns the scratch files.
pub(super) struct Writer {
    open: Open,
    commits: Commits,
    to_encode: Sender<Encoding>,
    disk: Disk,
    /// Whether something was given up: then nothing that was ordered later may be done.
    is_over: bool,
}

/// What is made durable together.
#[derive(Default)]
struct Group {
    blocks: Vec<(Arc<Plan>, Stored)>,
    /// Of their pixels.
    bytes: usize,
    records: Vec<Entry>,
    ticket: Option<Ticket>,
}

impl Group {
    fn len(&self) -> usize {
        self.blocks.len() + self.records.len()
    }

    /// Whether it may wait for more: for records somebody waits.
    fn may_linger(&self) -> bool {
        self.records.is_empty() && !self.blocks.is_empty() && !self.is_worth_a_sync()
    }

    fn is_worth_a_sync(&self) -> bool {
        self.len() >= PIPELINED_MIN || self.bytes >= PIPELINED_BYTES_MIN
    }

    fn is_full(&self) -> bool {
        self.len() >= GROUP_MAX || self.bytes >= GROUP_BYTES_MAX
    }
}

impl Writer {
    pub(super) fn new(
        open: Open,
        commits: Commits,
        to_encode: Sender<Encoding>,
        disk: Disk,
    ) -> Self {
        Self {
            open,
            commits,
            to_encode,
            disk,
            is_over: false,
        }
    }

    /// Performs orders until nobody gives any; `waiting` counts those that were not taken.
    pub(super) fn run(mut self, orders: &Receiver<Order>, waiting: &AtomicUsize) {
        let mut group = Group::default();
        let take = |order: Order| {
            waiting.fetch_sub(1, Ordering::Relaxed);
            order
        };
        while let Ok(first) = orders.recv().map(take) {
            let mut next = Some(first);
            let settled_by = Instant::now() + LINGER;
            while let Some(order) = next.filter(|_| !self.is_over) {
                match order {
                    Order::Block(plan, arrived, era) => {
                        let stored = Stored {
                            arrived: *arrived,
                            era,
                            result: Ok(()),
                        };
                        group.bytes += stored.arrived.payload.len();
                        group.blocks.push((plan, stored));
                    }
                    Order::Record(entry, ticket) => {
                        group.records.push(entry);
                        group.ticket = ticket.or(group.ticket);
                    }
                    other => {
                        self.settle(&mut group);
                        self.settle_commits();
                        // What follows from a commit that failed must not be done.
                        if !self.is_over {
                            self.perform(other);
                        }
                    }
                }
                let more = || orders.try_recv().ok().map(take);
                next = (!group.is_full()).then(more).flatten();
                if next.is_none() && !group.is_worth_a_sync() && self.commits.are_ahead() {
                    self.settle_commits();
                    next = more();
                }
                if next.is_none() && group.may_linger() {
                    let left = settled_by.saturating_duration_since(Instant::now());
                    next = orders.recv_timeout(left).ok().map(take);
                }
            }
            self.settle(&mut group);
        }
    }

    /// Writes an image's blocks at their places and syncs them; what is wrong with a block is noted of it. Nothing
    /// where the disk was given up.
    fn write(&mut self, image: ImageRef, blocks: &mut [&mut (Arc<Plan>, Stored)]) -> Option<()> {
        let (plan, _) = blocks.first()?;
        let open = &mut self.open;
        let scratch = self.disk.insist(
            || true,
            || match open.entry(image) {
                Place::Occupied(open) => Ok(open.get().clone()),
                Place::Vacant(place) => {
                    let identity = plan.identity_of(image);
                    let path = plan.scratch_path(image);
                    plan.folders.make().map_err(|error| chain(&error))?;
                    let scratch = Scratch::create_bare(path, identity, plan.window);
                    let scratch = Arc::new(scratch.map_err(|error| chain(&error))?);
                    Ok(place.insert(scratch).clone())
                }
            },
        )?;
        let payloads: Vec<_> = blocks
            .iter()
            .map(|(_, stored)| (stored.arrived.block.rect, &*stored.arrived.payload))
            .collect();
        let write = || {
            scratch
                .write_blocks(&payloads)
                .map_err(|error| chain(&error))
        };
        let verdicts = self.disk.insist(|| true, write)?;
        let mut has_failed = false;
        let sync = || {
            // After a sync that failed, the next one is silent about what was lost.
            if std::mem::replace(&mut has_failed, true) {
                let taken = payloads.iter().zip(&verdicts);
                let taken = taken.filter_map(|(block, verdict)| verdict.is_ok().then_some(*block));
                scratch
                    .write_again(&taken.collect::<Vec<_>>())
                    .map_err(|error| chain(&error))?;
            }
            scratch.sync().map_err(|error| chain(&error))
        };
        self.disk.insist(|| true, sync)?;
        for ((_, stored), verdict) in blocks.iter_mut().zip(verdicts) {
            stored.result = verdict.map_err(|error| chain(&error));
        }
        Some(())
    }

    /// Makes the pixels of a group durable, each scratch file once, and has the rest committed.
    fn settle(&mut self, group: &mut Group) {
        let Group {
            mut blocks,
            records,
            ticket,
            ..
        } = std::mem::take(group);
        if self.is_over || (blocks.is_empty() && records.is_empty()) {
            return;
        }
        let mut images = BTreeMap::<_, Vec<_>>::new();
        for block in &mut blocks {
            let image = block.1.arrived.image();
            images.entry(image).or_default().push(block);
        }
        for (image, mut blocks) in images {
            if self.write(image, &mut blocks).is_none() {
                self.is_over = true;
                return;
            }
        }
        let stored: Vec<_> = blocks.into_iter().map(|(_, stored)| stored).collect();
        let whole = stored.iter().filter(|stored| stored.result.is_ok());
        let entries: Vec<_> = whole
            .map(|stored| stored.arrived.entry())
            .chain(records)
            .collect();
        self.commits.hand_over(Batch {
            entries,
            stored,
            ticket,
        });
        self.is_over |= self.commits.is_over();
    }

    fn settle_commits(&mut self) {
        self.commits.settle();
        self.is_over |= self.commits.is_over();
    }

    fn perform(&mut self, order: Order) {
        match order {
            Order::Block(..) | Order::Record(..) => {}
            Order::Adopt(upload, folders) => {
                let adopt = || {
                    folders.make().map_err(|error| chain(&error))?;
                    upload
                        .move_to(&folders.scene)
                        .map_err(|error| format!("cannot keep a scene: {error}"))
                };
                self.is_over = self.disk.insist(|| true, adopt).is_none();
            }
            Order::Encode(plan, image, counters, era) => match self.open.get(&image) {
                Some(scratch) => {
                    let _ = self.to_encode.send(Encoding {
                        plan,
                        image,
                        counters,
                        era,
                        scratch: scratch.clone(),
                    });
                }
                None => self.disk.say(News::Encoded(Encoded {
                    image,
                    era,
                    result: Err("its scratch file is gone".to_owned()),
                })),
            },
            Order::Drop(image) => {
                if let Some(scratch) = self.open.remove(&image)
                    && let Err(error) = scratch.discard()
                {
                    tracing::warn!("{}", chain(&error));
                }
            }
            Order::Forget(folders, frames) => {
                if let Err(error) = folders.forget(frames) {
                    tracing::warn!("{}", chain(&error));
                }
            }
        }
    }
}
