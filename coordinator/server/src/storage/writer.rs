//! The thread that makes things durable, in order.

use std::collections::BTreeSet;
use std::collections::btree_map::Entry as Place;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender};

use image::{ImageError, Scratch};
use store::{Entry, Store};

use super::disk::Disk;
use super::encoder::Encoding;
use super::{Encoded, Open, Order, Plan, Stored, Ticket, chain};
use crate::input::{Arrived, News};

/// Most blocks and records that are made durable together. More would delay the first one's
/// acknowledgement, and save nothing: a sync's cost is spread thin already.
const GROUP_MAX: usize = 256;

/// The thread that owns the store and the scratch files.
pub(super) struct Writer {
    open: Open,
    store: Box<dyn Store>,
    to_encode: Sender<Encoding>,
    disk: Disk,
    /// Whether something was given up: then nothing that was ordered later may be done.
    is_over: bool,
}

/// What is made durable together.
#[derive(Default)]
struct Group {
    stored: Vec<Stored>,
    records: Vec<Entry>,
    ticket: Option<Ticket>,
}

impl Group {
    fn len(&self) -> usize {
        self.stored.len() + self.records.len()
    }
}

impl Writer {
    pub(super) fn new(
        open: Open,
        store: Box<dyn Store>,
        to_encode: Sender<Encoding>,
        disk: Disk,
    ) -> Self {
        Self {
            open,
            store,
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
            while let Some(order) = next.filter(|_| !self.is_over) {
                match order {
                    Order::Block(plan, arrived, era) => match self.write(&plan, &arrived) {
                        Some(result) => group.stored.push(Stored {
                            arrived: *arrived,
                            era,
                            result,
                        }),
                        None => self.is_over = true,
                    },
                    Order::Record(entry, ticket) => {
                        group.records.push(entry);
                        group.ticket = ticket.or(group.ticket);
                    }
                    other => {
                        self.settle(&mut group);
                        // What follows from a commit that failed must not be done.
                        if !self.is_over {
                            self.perform(other);
                        }
                    }
                }
                next = if group.len() < GROUP_MAX {
                    orders.try_recv().ok().map(take)
                } else {
                    None
                };
            }
            self.settle(&mut group);
        }
    }

    /// Writes a block at its place. An error is the block's, not the disk's.
    fn write(&mut self, plan: &Plan, arrived: &Arrived) -> Option<Result<(), String>> {
        let image = arrived.image();
        let open = &mut self.open;
        self.disk.insist(
            || true,
            || {
                let scratch = match open.entry(image) {
                    Place::Occupied(open) => open.into_mut(),
                    Place::Vacant(place) => {
                        let identity = plan.identity_of(image);
                        let path = plan.scratch_path(image);
                        plan.folders.make().map_err(|error| chain(&error))?;
                        let scratch = Scratch::create_bare(path, identity, plan.window);
                        place.insert(Arc::new(scratch.map_err(|error| chain(&error))?))
                    }
                };
                match scratch.write_block(arrived.block.rect, &arrived.payload) {
                    Ok(()) => Ok(Ok(())),
                    Err(
                        error @ (ImageError::NotFinite { .. }
                        | ImageError::NotABlock { .. }
                        | ImageError::PayloadLength { .. }),
                    ) => Ok(Err(chain(&error))),
                    Err(error) => Err(chain(&error)),
                }
            },
        )
    }

    /// Makes a group durable, each scratch file once, then the store, and says so.
    fn settle(&mut self, group: &mut Group) {
        let Group {
            stored,
            records,
            ticket,
        } = std::mem::take(group);
        if self.is_over || (stored.is_empty() && records.is_empty()) {
            return;
        }
        let whole = || stored.iter().filter(|stored| stored.result.is_ok());
        let images: BTreeSet<_> = whole().map(|stored| stored.arrived.image()).collect();
        for image in images {
            let Some(scratch) = self.open.get(&image) else {
                continue;
            };
            let mut has_failed = false;
            let sync = || {
                // After a sync that failed, the next one is silent about what was lost.
                if std::mem::replace(&mut has_failed, true) {
                    for arrived in whole().map(|stored| &stored.arrived) {
                        if arrived.image() == image {
                            scratch
                                .write_again(arrived.block.rect, &arrived.payload)
                                .map_err(|error| chain(&error))?;
                        }
                    }
                }
                scratch.sync().map_err(|error| chain(&error))
            };
            if self.disk.insist(|| true, sync).is_none() {
                self.is_over = true;
                return;
            }
        }
        let entries: Vec<_> = whole()
            .map(|stored| stored.arrived.entry())
            .chain(records)
            .collect();
        let store = &mut self.store;
        let commit = || match store.commit(&entries) {
            Ok(()) => Ok(Ok(())),
            Err(error) if error.is_transient() => Err(chain(&error)),
            Err(error) => Ok(Err(chain(&error))),
        };
        match self.disk.insist(|| true, commit) {
            Some(Ok(())) => {}
            given_up => {
                self.is_over = true;
                if let Some(Err(sentence)) = given_up {
                    self.disk.say(News::Broken(sentence));
                }
                return;
            }
        }
        if !stored.is_empty() {
            self.disk.say(News::Stored(stored));
        }
        if let Some(ticket) = ticket {
            self.disk.say(News::Committed(ticket));
        }
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
