//! The disk: blocks are written at their place, synced, and noted in the store, many at a time, with whatever
//! else must be durable; finished images are encoded.
//!
//! Three threads: `writer` writes and syncs pixels, `committer` commits behind it, and `encoder` encodes images, which
//! never holds up acknowledgements. Orders are performed in the order in which they were given: nothing is committed before the pixels
//! that were ordered before it are synced, and no file is moved or removed before all of that is committed. What waits here is bounded: blocks by the permits they carry,
//! encodings by the scheduler's images in flight, all of it by [`Storage::is_full`], which its owner asks before it hears anybody.
//!
//! A disk that is full, or fails in another way that may pass, fails nothing: the thread waits and tries again, and
//! the loop is told that it waits (`disk`).

mod committer;
mod disk;
mod encoder;
mod plan;
mod writer;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;

use image::{FinishedFrame, Scratch};
use model::ImageRef;
use store::{Entry, Store};
use tokio::sync::mpsc;

use self::disk::{Disk, Stopping};
use self::writer::Writer;
use crate::inbox::Upload;
use crate::input::{Arrived, Frames, News};
use crate::job::Counters;
use crate::state::JobFolders;

pub(crate) use self::disk::Hand;
pub(crate) use self::plan::Plan;

/// Most orders that wait, but for those that one input of the loop still brings about.
const WAITING_MAX: usize = 16_384;

/// What the disk is asked to do.
#[derive(Debug)]
enum Order {
    Block(Arc<Plan>, Box<Arrived>, Era),
    Adopt(Upload, JobFolders),
    Record(Entry, Option<Ticket>),
    Encode(Arc<Plan>, ImageRef, Counters, Era),
    Drop(ImageRef),
    Forget(JobFolders, Frames),
}

/// How often what there was of an image became void: dropped, finished, or begun again.
pub(crate) type Era = u32;

/// The number of a record; they become durable in order.
pub(crate) type Ticket = u64;

/// Scratch files that are open.
pub(crate) type Open = BTreeMap<ImageRef, Arc<Scratch>>;

/// A block of which the disk has spoken.
#[derive(Debug)]
pub(crate) struct Stored {
    pub(crate) arrived: Arrived,
    /// The era in which it was accepted.
    pub(crate) era: Era,
    /// Or why its pixels are no film's: its worker is to blame.
    pub(crate) result: Result<(), String>,
}

/// An image of which the encoder has spoken.
#[derive(Debug)]
pub(crate) struct Encoded {
    pub(crate) image: ImageRef,
    /// The era in which it was asked for.
    pub(crate) era: Era,
    pub(crate) result: Result<FinishedFrame, String>,
}

/// The loop's end of the threads.
#[derive(Debug)]
pub(crate) struct Storage {
    orders: Sender<Order>,
    /// Orders that the writer has not taken.
    waiting: Arc<AtomicUsize>,
    threads: Vec<JoinHandle<()>>,
    stopping: Arc<Stopping>,
}

impl Storage {
    /// Starts the threads over a store and the scratch files that are there; what they have to say goes to `news`.
    pub(crate) fn start(
        news: mpsc::Sender<News>,
        store: Box<dyn Store>,
        open: Open,
    ) -> std::io::Result<Self> {
        let (orders, taken) = channel();
        let (to_encode, encodings) = channel();
        let (stopping, waiting) = (Arc::<Stopping>::default(), Arc::<AtomicUsize>::default());
        let disk = |hand| Disk::new(hand, news.clone(), stopping.clone());
        let (commits, committer) = committer::committer(store, disk(Hand::Committer));
        let writer = Writer::new(open, commits, to_encode, disk(Hand::Writer));
        let encoders = disk(Hand::Encoder);
        let left = waiting.clone();
        let writer = std::thread::Builder::new()
            .name("blocks".into())
            .spawn(move || writer.run(&taken, &left))?;
        let committer = std::thread::Builder::new()
            .name("store".into())
            .spawn(move || committer.run())?;
        let encoder = std::thread::Builder::new()
            .name("encoder".into())
            .spawn(move || encoder::encode_all(&encodings, &encoders))?;
        Ok(Self {
            orders,
            waiting,
            threads: vec![writer, committer, encoder],
            stopping,
        })
    }

    /// Whether so many orders wait that nobody may bring about another one.
    pub(crate) fn is_full(&self) -> bool {
        self.waiting.load(Ordering::Relaxed) >= WAITING_MAX
    }

    /// Makes a block durable; [`News::Stored`] answers.
    pub(crate) fn store(&self, plan: Arc<Plan>, arrived: Box<Arrived>, era: Era) {
        self.order(Order::Block(plan, arrived, era));
    }

    /// Moves what a submission brought to the job's own folder, and makes that durable.
    pub(crate) fn adopt(&self, upload: Upload, folders: JobFolders) {
        self.order(Order::Adopt(upload, folders));
    }

    /// Makes an entry durable, after everything ordered before; [`News::Committed`] answers for a ticket.
    pub(crate) fn record(&self, entry: Entry, ticket: Option<Ticket>) {
        self.order(Order::Record(entry, ticket));
    }

    /// Encodes a complete image; [`News::Encoded`] answers.
    pub(crate) fn encode(&self, plan: Arc<Plan>, image: ImageRef, counters: Counters, era: Era) {
        self.order(Order::Encode(plan, image, counters, era));
    }

    /// Removes an image's scratch file.
    pub(crate) fn drop_scratch(&self, image: ImageRef) {
        self.order(Order::Drop(image));
    }

    /// Removes all of a job; its frames only where they are to go.
    pub(crate) fn forget(&self, folders: JobFolders, frames: Frames) {
        self.order(Order::Forget(folders, frames));
    }

    fn order(&self, order: Order) {
        self.waiting.fetch_add(1, Ordering::Relaxed);
        self.orders
            .send(order)
            .expect("the writer lives as long as its orders' sender");
    }

    /// Waits until everything ordered is done, but for images: they are encoded at the next start. What a disk
    /// in trouble does not take is not done either, and nobody was told that it was.
    pub(crate) fn finish(self) {
        self.stopping.set();
        drop(self.orders);
        for thread in self.threads {
            if thread.join().is_err() {
                tracing::error!("a storage thread died of a mistake in this program");
            }
        }
    }
}

/// An error and what caused it, in one line.
pub(crate) fn chain(error: &dyn std::error::Error) -> String {
    let mut line = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        line = format!("{line}: {error}");
        cause = error.source();
    }
    line
}
