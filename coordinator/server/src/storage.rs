//! The disk: blocks are written at their place, synced, and noted in the store, many at a time, with whatever
//! else must be durable; finished images are encoded.
//!
//! Two threads, so that encoding an image never holds up acknowledgements. Orders are performed in
//! the order in which they were given. What waits here is bounded by who gives the orders:
//! blocks by the permits they carry, encodings by the scheduler's images in flight.
//!
//! A disk that is full, or fails in another way that may pass, fails nothing: the thread waits and tries again, and
//! the loop is told that it waits ([`Input::Trouble`]).

use std::collections::btree_map::Entry as Place;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use image::{
    FinishedFrame, Formats, FrameMetadata, FrameRequest, ImageError, Scratch, ScratchIdentity,
    ViewTransform,
};
use model::{ImageNumber, ImageRef, Rect};
use store::{Entry, Sqlite, Store as _};
use tokio::sync::mpsc;

use crate::about::JobAbout;
use crate::inbox::Upload;
use crate::input::{Arrived, Input};
use crate::job::Counters;
use crate::state::JobFolders;

/// Most blocks that are made durable together. More would delay the first one's
/// acknowledgement, and save nothing: a sync's cost is spread thin already.
const GROUP_MAX: usize = 256;

/// How long a disk in trouble is left alone before it is tried again.
const RETRY_INTERVAL: Duration = Duration::from_millis(200);

/// How the images of one job are stored.
#[derive(Debug)]
pub(crate) struct Plan {
    pub(crate) folders: JobFolders,
    /// What file names begin with.
    pub(crate) stem: String,
    pub(crate) formats: Formats,
    /// The image's number in here is replaced by each image's own.
    pub(crate) identity: ScratchIdentity,
    pub(crate) window: Rect,
    /// The statistics in here are replaced by each image's own.
    pub(crate) metadata: FrameMetadata,
    pub(crate) view: ViewTransform,
    /// Set when nobody wants the job's images any more.
    pub(crate) cancelled: AtomicBool,
}

/// What the disk is asked to do.
#[derive(Debug)]
enum Order {
    Block(Arc<Plan>, Box<Arrived>, Era),
    Adopt(Upload, JobFolders),
    Record(Entry, Option<Ticket>),
    Encode(Arc<Plan>, ImageRef, Counters, Era),
    Drop(ImageRef),
    Forget(JobFolders),
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

/// The loop's end of both threads.
#[derive(Debug)]
pub(crate) struct Storage {
    orders: Sender<Order>,
    threads: Vec<JoinHandle<()>>,
    stopping: Arc<AtomicBool>,
}

impl Storage {
    /// Starts the threads over a store and the scratch files that are there; what they have to say goes to `inputs`.
    pub(crate) fn start(
        inputs: mpsc::Sender<Input>,
        store: Sqlite,
        open: Open,
    ) -> std::io::Result<Self> {
        let (orders, taken) = channel();
        let (to_encode, encodings) = channel();
        let stopping = Arc::new(AtomicBool::new(false));
        let disk = Disk {
            inputs,
            stopping: stopping.clone(),
        };
        let encoder_disk = disk.clone();
        let writer = Writer {
            open,
            store,
            to_encode,
            disk,
            is_over: false,
        };
        let writer = std::thread::Builder::new()
            .name("blocks".into())
            .spawn(move || writer.run(&taken))?;
        let encoder = std::thread::Builder::new()
            .name("encoder".into())
            .spawn(move || encode_all(&encodings, &encoder_disk))?;
        Ok(Self {
            orders,
            threads: vec![writer, encoder],
            stopping,
        })
    }

    /// Makes a block durable; [`Input::Stored`] answers.
    pub(crate) fn store(&self, plan: Arc<Plan>, arrived: Box<Arrived>, era: Era) {
        self.order(Order::Block(plan, arrived, era));
    }

    /// Moves what a submission brought to the job's own folder, and makes that durable.
    pub(crate) fn adopt(&self, upload: Upload, folders: JobFolders) {
        self.order(Order::Adopt(upload, folders));
    }

    /// Makes an entry durable, after everything ordered before; [`Input::Committed`] answers for a ticket.
    pub(crate) fn record(&self, entry: Entry, ticket: Option<Ticket>) {
        self.order(Order::Record(entry, ticket));
    }

    /// Encodes a complete image; [`Input::Encoded`] answers.
    pub(crate) fn encode(&self, plan: Arc<Plan>, image: ImageRef, counters: Counters, era: Era) {
        self.order(Order::Encode(plan, image, counters, era));
    }

    /// Removes an image's scratch file.
    pub(crate) fn drop_scratch(&self, image: ImageRef) {
        self.order(Order::Drop(image));
    }

    /// Removes all of a job but its frames.
    pub(crate) fn forget(&self, folders: JobFolders) {
        self.order(Order::Forget(folders));
    }

    fn order(&self, order: Order) {
        self.orders
            .send(order)
            .expect("the writer lives as long as its orders' sender");
    }

    /// Waits until everything ordered is done, but for images: they are encoded at the next start. What a disk
    /// in trouble does not take is not done either, and nobody was told that it was.
    pub(crate) fn finish(self) {
        self.stopping.store(true, Ordering::Relaxed);
        drop(self.orders);
        for thread in self.threads {
            if thread.join().is_err() {
                tracing::error!("a storage thread died of a mistake in this program");
            }
        }
    }
}

/// A thread's way to the loop.
#[derive(Clone, Debug)]
struct Disk {
    inputs: mpsc::Sender<Input>,
    stopping: Arc<AtomicBool>,
}

impl Disk {
    fn say(&self, input: Input) {
        // An error says that the loop has ended: nobody waits for an answer.
        let _ = self.inputs.blocking_send(input);
    }

    /// Tries until it works; `None` where the coordinator stops before, or where `is_wanted` says no more.
    fn insist<T>(
        &self,
        is_wanted: impl Fn() -> bool,
        mut attempt: impl FnMut() -> Result<T, String>,
    ) -> Option<T> {
        let mut told = None;
        let result = loop {
            match attempt() {
                Ok(done) => break Some(done),
                Err(_) if self.stopping.load(Ordering::Relaxed) || !is_wanted() => break None,
                Err(sentence) => {
                    if told.as_ref() != Some(&sentence) {
                        self.say(Input::Trouble(Some(sentence.clone())));
                        told = Some(sentence);
                    }
                    std::thread::sleep(RETRY_INTERVAL);
                }
            }
        };
        if told.is_some() {
            self.say(Input::Trouble(None));
        }
        result
    }
}

impl Plan {
    pub(crate) fn new(
        folders: JobFolders,
        submission: &sched::Submission,
        about: &JobAbout,
        formats: Formats,
    ) -> Self {
        Self {
            folders,
            stem: about.stem.clone(),
            formats,
            identity: ScratchIdentity {
                scene: submission.scene,
                revision: submission.revision.0,
                image: ImageNumber(0),
                resolution: about.resolution(),
            },
            window: submission.window,
            metadata: FrameMetadata {
                scene_digest: submission.scene,
                revision: submission.revision.0,
                settings: about.settings.clone(),
                statistics: String::new(),
                software: about.software.clone(),
                frames_per_second: about.frames_per_second,
                comments: String::new(),
            },
            view: ViewTransform {
                exposure_stops: about.exposure_stops,
            },
            cancelled: AtomicBool::new(false),
        }
    }

    /// Where an image's scratch file stands.
    pub(crate) fn scratch_path(&self, image: ImageRef) -> PathBuf {
        self.folders.scratch.join(image.image.to_string())
    }

    pub(crate) fn identity_of(&self, image: ImageRef) -> ScratchIdentity {
        ScratchIdentity {
            image: image.image,
            ..self.identity
        }
    }
}

/// The thread that owns the store and the scratch files.
struct Writer {
    open: Open,
    store: Sqlite,
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
    fn run(mut self, orders: &Receiver<Order>) {
        let mut group = Group::default();
        while let Ok(first) = orders.recv() {
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
                        self.perform(other);
                    }
                }
                next = if group.len() < GROUP_MAX {
                    orders.try_recv().ok()
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
            mut records,
            ticket,
        } = std::mem::take(group);
        if self.is_over || (stored.is_empty() && records.is_empty()) {
            return;
        }
        let whole = || stored.iter().filter(|stored| stored.result.is_ok());
        let images: BTreeSet<_> = whole().map(|stored| stored.arrived.image()).collect();
        for scratch in images.iter().filter_map(|image| self.open.get(image)) {
            let sync = || scratch.sync().map_err(|error| chain(&error));
            if self.disk.insist(|| true, sync).is_none() {
                self.is_over = true;
                return;
            }
        }
        let entries: Vec<_> = whole()
            .map(|stored| stored.arrived.entry())
            .chain(records.drain(..))
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
                    self.disk.say(Input::Broken(sentence));
                }
                return;
            }
        }
        if !stored.is_empty() {
            self.disk.say(Input::Stored(stored));
        }
        if let Some(ticket) = ticket {
            self.disk.say(Input::Committed(ticket));
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
            Order::Encode(plan, image, counters, era) => {
                if let Some(scratch) = self.open.get(&image) {
                    let encoding = Encoding {
                        plan,
                        image,
                        counters,
                        era,
                        scratch: scratch.clone(),
                    };
                    let _ = self.to_encode.send(encoding);
                }
            }
            Order::Drop(image) => {
                if let Some(scratch) = self.open.remove(&image)
                    && let Err(error) = scratch.discard()
                {
                    tracing::warn!("{}", chain(&error));
                }
            }
            Order::Forget(folders) => {
                if let Err(error) = folders.forget() {
                    tracing::warn!("{}", chain(&error));
                }
            }
        }
    }
}

/// An image on its way to the encoder.
struct Encoding {
    plan: Arc<Plan>,
    image: ImageRef,
    counters: Counters,
    era: Era,
    scratch: Arc<Scratch>,
}

fn encode_all(work: &Receiver<Encoding>, disk: &Disk) {
    while let Ok(encoding) = work.recv() {
        if !disk.stopping.load(Ordering::Relaxed)
            && let Some(encoded) = encoding.perform(disk)
        {
            disk.say(Input::Encoded(encoded));
        }
    }
}

impl Encoding {
    /// Encodes the image. Its scratch file stays until the store knows.
    fn perform(self, disk: &Disk) -> Option<Encoded> {
        let Self {
            plan,
            image,
            counters,
            era,
            scratch,
        } = self;
        let is_wanted = || !plan.cancelled.load(Ordering::Relaxed);
        let request = FrameRequest {
            folder: plan.folders.frames.clone(),
            stem: plan.stem.clone(),
            number: image.image,
            formats: plan.formats,
            metadata: FrameMetadata {
                statistics: serde_json::to_string(&counters).expect("names and numbers are JSON"),
                ..plan.metadata.clone()
            },
            view: plan.view,
            threads: 1,
        };
        let finish = || match image::finish(&scratch, &request) {
            Ok(frame) => Ok(Ok(frame)),
            Err(error @ (ImageError::Io { .. } | ImageError::DiskFull { .. })) => {
                Err(chain(&error))
            }
            Err(error) => Ok(Err(chain(&error))),
        };
        let cancelled = || Err("its job was cancelled".to_owned());
        let result = match is_wanted() {
            false => cancelled(),
            true => match disk.insist(is_wanted, finish) {
                Some(result) => result,
                None if is_wanted() => return None,
                None => cancelled(),
            },
        };
        Some(Encoded { image, era, result })
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
