//! Blocks are written, synced and committed, and then told and acknowledged; other entries are committed in between.

use model::{ImageRef, Span, Timestamp, WorkerId};
use sched::{BlockRef, Event};
use session::BlockVerdict;
use store::{Entry, Store as _};

use super::{Coordinator, Later, Wish};
use crate::disk::Pixels;
use crate::plan::Bug;

/// Blocks that wait for the disk; who sends more is asked to come again.
pub(super) const BLOCKS_MAX: usize = 16;

/// Entries of users and of images that wait for the disk; more than there are users and images.
const RECORDS_MAX: usize = 200;

/// Orders that are performed together.
const GROUP_MAX: usize = 8;

/// What the writer does next.
#[derive(Debug)]
pub(super) enum Order {
    Block {
        worker: WorkerId,
        block: BlockRef,
        elapsed: Span,
        pixels: Pixels,
        era: u32,
    },
    /// An entry, and the effects that wait for it.
    Record(Box<Entry>, Option<u64>),
    Remove(ImageRef),
}

/// Orders that the writer has in hand.
#[derive(Debug)]
pub(super) struct Group {
    orders: Vec<Order>,
    pub(super) is_synced: bool,
}

impl Coordinator {
    pub(super) fn blocks_waiting(&self) -> usize {
        let in_hand = self.group.iter().flat_map(|group| &group.orders);
        let all = self.orders.iter().chain(in_hand);
        all.filter(|order| matches!(order, Order::Block { .. }))
            .count()
    }

    pub(super) fn order(&mut self, order: Order) {
        self.orders.push_back(order);
        let blocks = self.blocks_waiting();
        assert!(blocks <= BLOCKS_MAX, "blocks that wait are bounded");
        assert!(self.orders.len() - blocks.min(self.orders.len()) <= RECORDS_MAX);
        self.plan_writing(Span(100));
    }

    fn plan_writing(&mut self, after: Span) {
        if !self.is_writing_planned && self.group.is_none() {
            self.is_writing_planned = true;
            self.wishes.push(Wish::Disk(Later::Write, after));
        }
    }

    /// The next orders: blocks go to their places.
    pub(super) fn write(&mut self) {
        self.is_writing_planned = false;
        while let Some(&Order::Remove(image)) = self.orders.front() {
            self.orders.pop_front();
            self.disk.remove(image);
        }
        if self.orders.is_empty() {
            return;
        }
        if self.disk.is_full {
            // Held, and tried again: nothing fails.
            return self.plan_writing(Span::from_millis(200));
        }
        let mut orders = Vec::new();
        while orders.len() < GROUP_MAX {
            match self.orders.pop_front() {
                None => break,
                Some(remove @ Order::Remove(_)) => {
                    self.orders.push_front(remove);
                    break;
                }
                Some(order) => orders.push(order),
            }
        }
        for order in &orders {
            if let Order::Block { block, pixels, .. } = order {
                self.disk.write(block.image, block.rect, *pixels);
            }
        }
        self.group = Some(Group {
            orders,
            is_synced: false,
        });
        self.wishes
            .push(Wish::Disk(Later::Synced, Span::from_millis(3)));
    }

    pub(super) fn synced(&mut self) {
        let Some(group) = &mut self.group else {
            return;
        };
        for order in &group.orders {
            if let Order::Block { block, .. } = order
                && self.plan.bug != Some(Bug::MissingSync)
            {
                self.disk.sync(block.image);
            }
        }
        group.is_synced = true;
        self.wishes
            .push(Wish::Disk(Later::Committed, Span::from_millis(2)));
    }

    pub(super) fn commit(&mut self, now: Timestamp) {
        if self.disk.is_full {
            self.store.refuse(1);
        }
        if let Err(error) = self.store.commit(&self.entries()) {
            assert!(error.is_transient(), "{error}");
            let later = Span::from_millis(200);
            return self.wishes.push(Wish::Disk(Later::Committed, later));
        }
        let group = self.group.take();
        for order in group.into_iter().flat_map(|group| group.orders) {
            match order {
                Order::Block {
                    worker,
                    block,
                    elapsed,
                    pixels,
                    era,
                } if era == self.era(block.image) => {
                    self.witness.hears_of(worker, now);
                    let pixels = pixels.digest();
                    self.tell(
                        now,
                        Event::BlockStored {
                            worker,
                            block,
                            elapsed,
                            pixels,
                        },
                    );
                }
                Order::Block { worker, block, .. } => {
                    self.refuse(worker, block, BlockVerdict::AttemptDead);
                }
                Order::Record(_, Some(number)) => {
                    self.committed.insert(number);
                    self.flush(now);
                }
                Order::Record(_, None) | Order::Remove(_) => {}
            }
        }
        if !self.orders.is_empty() {
            self.plan_writing(Span(100));
        }
    }

    pub(super) fn entries(&self) -> Vec<Entry> {
        let orders = self.group.iter().flat_map(|group| &group.orders);
        orders.filter_map(|order| self.entry(order)).collect()
    }

    fn entry(&self, order: &Order) -> Option<Entry> {
        match order {
            Order::Block {
                block,
                elapsed,
                pixels,
                ..
            } => {
                let loses = self.plan.bug == Some(Bug::LostAcknowledgement);
                (!loses || block.rect.x0 >= 64).then(|| Entry::Block {
                    image: block.image,
                    rect: block.rect,
                    elapsed: *elapsed,
                    pixels: pixels.digest(),
                    about: Vec::new(),
                })
            }
            Order::Record(entry, _) => Some(Entry::clone(entry)),
            Order::Remove(_) => None,
        }
    }
}
