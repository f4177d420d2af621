//! The disk: blocks are written at their place and made durable, many at a time;
//! finished images are encoded.
//!
//! Two threads, so that encoding an image never holds up acknowledgements. Orders are performed in
//! the order in which they were given. What waits here is bounded by who gives the orders:
//! blocks by the permits they carry, encodings by the scheduler's images in flight.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use image::{
    FinishedFrame, Formats, FrameMetadata, FrameRequest, ImageError, Scratch, ScratchIdentity,
    ViewTransform,
};
use model::{ImageRef, Rect};
use tokio::sync::mpsc;

use crate::inbox::Upload;
use crate::input::{Arrived, Input};
use crate::job::Counters;
use crate::state::JobFolders;

/// Most blocks that are made durable together. More would delay the first one's
/// acknowledgement, and save nothing: a sync's cost is spread thin already.
const GROUP_MAX: usize = 256;

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
    Block(Arc<Plan>, Box<Arrived>),
    Encode(Arc<Plan>, ImageRef, Counters),
    Drop(ImageRef, PathBuf),
    Clear(JobFolders),
    Remove(Upload),
}

/// A block of which the disk has spoken.
#[derive(Debug)]
pub(crate) struct Stored {
    pub(crate) arrived: Arrived,
    pub(crate) result: Result<(), Refusal>,
}

/// Why a block was not stored.
#[derive(Debug)]
pub(crate) enum Refusal {
    /// Its pixels are no film's: its worker is to blame.
    Pixels(String),
    /// The disk would not take it.
    Disk(String),
}

/// An image of which the encoder has spoken.
#[derive(Debug)]
pub(crate) struct Encoded {
    pub(crate) image: ImageRef,
    pub(crate) result: Result<FinishedFrame, String>,
}

/// The loop's end of both threads.
#[derive(Debug)]
pub(crate) struct Storage {
    orders: Sender<Order>,
    threads: Vec<JoinHandle<()>>,
}

impl Storage {
    /// Starts the threads; what they have to say goes to `inputs`.
    pub(crate) fn start(inputs: mpsc::Sender<Input>) -> std::io::Result<Self> {
        let (orders, taken) = channel();
        let (to_encode, encodings) = channel();
        let encoder_inputs = inputs.clone();
        let writer = std::thread::Builder::new()
            .name("blocks".into())
            .spawn(move || Writer::new(to_encode, inputs).run(&taken))?;
        let encoder = std::thread::Builder::new()
            .name("encoder".into())
            .spawn(move || encode_all(&encodings, &encoder_inputs))?;
        Ok(Self {
            orders,
            threads: vec![writer, encoder],
        })
    }

    /// Makes a block durable; [`Input::Stored`] answers.
    pub(crate) fn store(&self, plan: Arc<Plan>, arrived: Box<Arrived>) {
        self.order(Order::Block(plan, arrived));
    }

    /// Encodes a complete image and removes its scratch file; [`Input::Encoded`] answers.
    pub(crate) fn encode(&self, plan: Arc<Plan>, image: ImageRef, counters: Counters) {
        self.order(Order::Encode(plan, image, counters));
    }

    /// Removes an image's scratch file.
    pub(crate) fn drop_scratch(&self, plan: &Plan, image: ImageRef) {
        self.order(Order::Drop(image, plan.scratch_path(image)));
    }

    /// Removes what a job leaves beside its frames.
    pub(crate) fn clear(&self, folders: JobFolders) {
        self.order(Order::Clear(folders));
    }

    /// Removes the scene and assets of a job that is over.
    pub(crate) fn remove(&self, upload: Upload) {
        self.order(Order::Remove(upload));
    }

    fn order(&self, order: Order) {
        self.orders
            .send(order)
            .expect("the writer lives as long as its orders' sender");
    }

    /// Waits until everything ordered is done.
    pub(crate) fn finish(self) {
        drop(self.orders);
        for thread in self.threads {
            if thread.join().is_err() {
                tracing::error!("a storage thread died of a mistake in this program");
            }
        }
    }
}

impl Plan {
    /// Where an image's scratch file stands.
    fn scratch_path(&self, image: ImageRef) -> PathBuf {
        self.folders.scratch.join(image.image.to_string())
    }

    fn identity_of(&self, image: ImageRef) -> ScratchIdentity {
        ScratchIdentity {
            image: image.image,
            ..self.identity
        }
    }
}

/// The thread that owns the scratch files.
struct Writer {
    open: BTreeMap<ImageRef, Scratch>,
    to_encode: Sender<Finishing>,
    inputs: mpsc::Sender<Input>,
}

impl Writer {
    fn new(to_encode: Sender<Finishing>, inputs: mpsc::Sender<Input>) -> Self {
        Self {
            open: BTreeMap::new(),
            to_encode,
            inputs,
        }
    }

    fn run(mut self, orders: &Receiver<Order>) {
        let mut group = Vec::new();
        while let Ok(first) = orders.recv() {
            let mut next = Some(first);
            while let Some(order) = next {
                match order {
                    Order::Block(plan, arrived) => {
                        let result = self.write(&plan, &arrived);
                        group.push(Stored {
                            arrived: *arrived,
                            result: result.map_err(Refusal::from),
                        });
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

    fn write(&mut self, plan: &Plan, arrived: &Arrived) -> Result<(), ImageError> {
        let image = arrived.image();
        let scratch = match self.open.entry(image) {
            Entry::Occupied(open) => open.into_mut(),
            Entry::Vacant(place) => {
                let identity = plan.identity_of(image);
                let path = plan.scratch_path(image);
                place.insert(Scratch::create(path, identity, plan.window)?)
            }
        };
        scratch.write_block(arrived.block.rect, &arrived.payload)
    }

    /// Makes a group durable, each file once, and says so.
    fn settle(&mut self, group: &mut Vec<Stored>) {
        if group.is_empty() {
            return;
        }
        let mut synced = BTreeMap::new();
        for stored in group.iter_mut().filter(|stored| stored.result.is_ok()) {
            let image = stored.arrived.image();
            let result: &Result<(), String> = synced.entry(image).or_insert_with(|| {
                let scratch = self.open.get(&image);
                let synced = scratch.map_or(Ok(()), Scratch::sync);
                synced.map_err(|error| chain(&error))
            });
            stored.result = result.clone().map_err(Refusal::Disk);
        }
        let _ = self
            .inputs
            .blocking_send(Input::Stored(std::mem::take(group)));
    }

    fn perform(&mut self, order: Order) {
        match order {
            Order::Block(..) => {}
            Order::Encode(plan, image, counters) => {
                // Where there is none, the order came twice.
                if let Some(scratch) = self.open.remove(&image) {
                    let encoding = Encoding {
                        plan,
                        image,
                        counters,
                        scratch,
                    };
                    let _ = self.to_encode.send(Finishing::Encode(Box::new(encoding)));
                }
            }
            Order::Drop(image, path) => {
                let dropped = match self.open.remove(&image) {
                    Some(scratch) => scratch.discard().map_err(|error| chain(&error)),
                    None => Ok(()),
                };
                if let Err(sentence) = dropped {
                    tracing::warn!(path = %path.display(), "{sentence}");
                }
            }
            Order::Clear(folders) => {
                let _ = self.to_encode.send(Finishing::Clear(folders));
            }
            Order::Remove(upload) => drop(upload),
        }
    }
}

/// What the encoder does next.
enum Finishing {
    Encode(Box<Encoding>),
    Clear(JobFolders),
}

/// An image on its way to the encoder.
struct Encoding {
    plan: Arc<Plan>,
    image: ImageRef,
    counters: Counters,
    scratch: Scratch,
}

fn encode_all(work: &Receiver<Finishing>, inputs: &mpsc::Sender<Input>) {
    while let Ok(next) = work.recv() {
        match next {
            Finishing::Clear(folders) => {
                if let Err(error) = folders.clear() {
                    tracing::warn!("{}", chain(&error));
                }
            }
            Finishing::Encode(encoding) => {
                let encoded = encoding.perform();
                // An error says that the loop has ended: nobody waits for an answer.
                let _ = inputs.blocking_send(Input::Encoded(encoded));
            }
        }
    }
}

impl Encoding {
    /// Encodes the image, and removes its scratch file whatever became of it.
    fn perform(self) -> Encoded {
        let Self {
            plan,
            image,
            counters,
            scratch,
        } = self;
        let result = if plan.cancelled.load(Ordering::Relaxed) {
            Err("its job was cancelled".to_owned())
        } else {
            let request = FrameRequest {
                folder: plan.folders.frames.clone(),
                stem: plan.stem.clone(),
                number: image.image,
                formats: plan.formats,
                metadata: FrameMetadata {
                    statistics: serde_json::to_string(&counters)
                        .expect("names and numbers are JSON"),
                    ..plan.metadata.clone()
                },
                view: plan.view,
                threads: 1,
            };
            image::finish(&scratch, &request).map_err(|error| chain(&error))
        };
        if let Err(error) = scratch.discard() {
            tracing::warn!("{}", chain(&error));
        }
        Encoded { image, result }
    }
}

impl From<ImageError> for Refusal {
    fn from(error: ImageError) -> Self {
        let sentence = chain(&error);
        match error {
            ImageError::NotFinite { .. }
            | ImageError::NotABlock { .. }
            | ImageError::PayloadLength { .. } => Self::Pixels(sentence),
            _ => Self::Disk(sentence),
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
