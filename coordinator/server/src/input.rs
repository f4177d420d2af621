//! Everything that reaches the loop.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bytes::Bytes;
use model::{AttemptId, Digest, ImageNumber, ImageRef, JobId, Rect, Revision, Span, WorkerId};
use sched::{BlockRef, Command, Event, LinkId, Offer};
use store::Entry;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, broadcast, mpsc, oneshot};
use tonic::Status;
use wire::Failure;
use wire::proto;

use crate::about::counters_bytes;
use crate::inbox::NewJob;
use crate::storage::{Encoded, Hand, Stored, Ticket};

/// Where an answer goes; whoever asked may have left.
pub(crate) type Reply<T> = oneshot::Sender<Result<T, Failure>>;

/// What others bring to the loop. Each is small, or carries what its sender's limits bound.
#[derive(Debug)]
pub(crate) enum Input {
    /// A submission has arrived whole.
    Submit(Box<NewJob>, Reply<proto::Submitted>),
    /// A user wants something of a job.
    Command(JobId, Wish, Reply<proto::JobSummary>),
    /// A user wants workers to leave: these, by name or id.
    Drain(Wanderers, Reply<proto::WorkerList>),
    /// A question; changes nothing.
    Ask(Query),
    /// A worker said hello.
    Hello(Box<Greeting>),
    /// A worker said something on a control stream.
    Said {
        /// Which worker.
        worker: WorkerId,
        /// On which stream; counts only if it is the worker's newest.
        link: LinkId,
        /// What.
        event: Event,
    },
    /// A worker's delivery stream opened.
    Delivering {
        /// Which worker.
        worker: WorkerId,
        /// In which epoch it was welcomed.
        epoch: u64,
        /// The stream.
        link: Link<proto::DeliverDown>,
        /// Whether it may.
        reply: Reply<()>,
    },
    /// A block arrived.
    Block(Box<Arrived>),
    /// A delivery stream ended.
    DeliveryClosed {
        /// Which worker.
        worker: WorkerId,
        /// Which stream.
        link: LinkId,
    },
}

/// What the loop is told by the coordinator itself; heard before anything else, and even when others must wait.
#[derive(Debug)]
pub(crate) enum News {
    /// Blocks are durable, or no film's.
    Stored(Vec<Stored>),
    /// Every record up to this one is durable.
    Committed(Ticket),
    /// An image is encoded, or could not be.
    Encoded(Encoded),
    /// A thread of the disk waits for it to be tried again, or waits no more.
    Trouble(Hand, Option<String>),
    /// The store can be used no more.
    Broken(String),
    /// End: tell everybody, and leave the loop.
    Stop,
}

/// A question that changes nothing.
#[derive(Debug)]
pub(crate) enum Query {
    /// All jobs.
    Jobs(Reply<proto::JobList>),
    /// One job and, from then on, its changes.
    Job(JobId, Reply<Snapshot>),
    /// A job's log.
    Log(JobId, Reply<proto::JobLogReply>),
    /// Where a finished file is.
    Frame(
        JobId,
        ImageNumber,
        image::Format,
        Reply<(PathBuf, proto::FrameFile)>,
    ),
    /// Where a scene's or an asset's bytes may be; the first that is there will do.
    Bytes(Digest, Wanted, Reply<Vec<PathBuf>>),
    /// All workers.
    Workers(Reply<proto::WorkerList>),
    /// Why something is not finished, or has nothing to do.
    Why(WhyOf, Reply<proto::WhyReply>),
    /// The farm.
    Info(Reply<proto::FarmInfo>),
    /// Which blocks of a worker's tiles are not durable; of a tile that is not its own nothing is said.
    Missing(WorkerId, Vec<AttemptId>, Reply<Vec<(AttemptId, Vec<Rect>)>>),
    /// What is left to do for workers of a site, that offer so much and have this label.
    Wanted(Offer, String, Reply<cluster::pilot::Wanted>),
}

/// What a user wants of a job.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wish {
    pub(crate) command: Command,
    /// Whether a job that is forgotten leaves no frames.
    pub(crate) frames: Frames,
    /// Only where the job was over at this time, in milliseconds since 1970, and still is.
    pub(crate) if_over_since: Option<u64>,
}

/// What becomes of the finished frames of a job that is forgotten.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Frames {
    Stay,
    Go,
}

/// Which workers are to leave.
#[derive(Clone, Debug)]
pub(crate) enum Wanderers {
    All,
    /// By name or id.
    Named(Vec<String>),
}

/// What a question why is about.
#[derive(Clone, Debug)]
pub(crate) enum WhyOf {
    Job(JobId),
    Image(ImageRef),
    /// The pixel at a column and a row.
    Pixel(ImageRef, u32, u32),
    /// By name or id.
    Worker(String),
}

/// What is fetched by digest.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Wanted {
    /// A scene description.
    Scene,
    /// An asset.
    Asset,
}

/// A job at one instant, and what follows; nothing follows where it is over.
#[derive(Debug)]
pub(crate) struct Snapshot {
    /// Its parts, in order.
    pub(crate) parts: Vec<proto::JobUpdate>,
    /// Its changes from then on.
    pub(crate) changes: Option<broadcast::Receiver<Arc<proto::JobUpdate>>>,
}

/// The loop's end of a stream to a worker. Dropping it ends both directions.
#[derive(Debug)]
pub(crate) struct Link<T> {
    /// Which stream; a newer one has a larger number.
    pub(crate) id: LinkId,
    /// What the worker is told.
    pub(crate) down: mpsc::Sender<Result<T, Status>>,
    /// Dropped with the link: whoever reads the other direction then stops.
    pub(crate) _alive: oneshot::Sender<()>,
}

/// What whoever brings blocks and opens links must pass, wherever it comes from.
#[derive(Clone, Debug)]
pub(crate) struct Gates {
    /// A permit for each block that is not durable yet.
    pub(crate) blocks: Arc<Semaphore>,
    links: Arc<AtomicU64>,
}

impl Gates {
    pub(crate) fn new(blocks_max: usize) -> Self {
        Self {
            blocks: Arc::new(Semaphore::new(blocks_max)),
            links: Arc::new(AtomicU64::new(1)),
        }
    }

    pub(crate) fn next_link(&self) -> LinkId {
        LinkId(self.links.fetch_add(1, Ordering::Relaxed))
    }
}

/// A worker's hello, checked.
#[derive(Debug)]
pub(crate) struct Greeting {
    pub(crate) worker: WorkerId,
    pub(crate) link: Link<proto::ControlDown>,
    pub(crate) protocol: u32,
    pub(crate) revision: Revision,
    pub(crate) threads: u32,
    /// How it takes tiles where it stands for a cluster's queue.
    pub(crate) queue: Option<sched::Queue>,
    pub(crate) held: Vec<AttemptId>,
    pub(crate) begun: Vec<model::Begun>,
    pub(crate) about: AboutWorker,
}

/// What a worker says of itself, for people.
#[derive(Clone, Debug)]
pub(crate) struct AboutWorker {
    pub(crate) name: String,
    pub(crate) build: String,
    pub(crate) simd_level: String,
    pub(crate) memory_bytes: u64,
    pub(crate) labels: BTreeSet<String>,
    /// How long it may still run, when it said so.
    pub(crate) time_left: Option<Span>,
}

/// A block whose record is whole.
#[derive(Debug)]
pub(crate) struct Arrived {
    pub(crate) worker: WorkerId,
    pub(crate) block: BlockRef,
    /// The record's payload.
    pub(crate) payload: Bytes,
    /// The digest of the payload.
    pub(crate) pixels: Digest,
    /// How long one thread took.
    pub(crate) elapsed: Span,
    /// What was counted.
    pub(crate) counters: Vec<(String, u64)>,
    /// Held until the block is durable or refused, so that only so many are under way.
    pub(crate) _permit: OwnedSemaphorePermit,
}

impl Arrived {
    pub(crate) fn image(&self) -> ImageRef {
        self.block.image
    }

    /// What the store is told when it is synced.
    pub(crate) fn entry(&self) -> Entry {
        Entry::Block {
            image: self.block.image,
            rect: self.block.rect,
            elapsed: self.elapsed,
            pixels: self.pixels,
            about: counters_bytes(&self.counters),
        }
    }
}
