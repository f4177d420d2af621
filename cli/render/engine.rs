//! Renders images in this process, on threads of its own.
//!
//! Blocks go into each image's scratch file as they are done, so that an interrupted
//! render goes on where it was. Rows that are done are encoded by whoever rendered the last of them, and what is left of an image
//! by the thread that rendered its last block, while the others render the next image.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{LockResult, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use image::{
    Encoding, FinishedFrame, Formats, FrameMetadata, FrameRequest, Opened, Scratch,
    ScratchIdentity, ViewTransform,
};
use model::{Digest, ImageNumber, Rect, Resolution};
use render::{Assets, Counts, EvalSettings, ImageRenderer, Means};
use scene::Description;

use super::crew::Threads;
use super::line::{Line, Next, last};
use super::statistics::{Spent, clock, told};
use crate::error::Error;
use crate::stop::Stop;

/// How often whoever watches is told about progress.
const REPORT_INTERVAL: Duration = Duration::from_millis(100);

/// The last blocks are cut into so many parts of what a thread works on together: smaller ones take longer for a pixel, but all
/// threads end at about the same time.
const LAST_PARTS: u64 = 8;

/// What to render, and how.
pub(crate) struct Plan<'a> {
    /// The scene.
    pub(crate) description: &'a Description,
    /// Its digest.
    pub(crate) digest: Digest,
    /// The files that it names.
    pub(crate) assets: &'a Assets,
    /// Which images, in order.
    pub(crate) images: Vec<ImageNumber>,
    /// Where the frames go; it exists.
    pub(crate) folder: PathBuf,
    /// What the frames' names begin with.
    pub(crate) stem: String,
    /// Which files each image becomes.
    pub(crate) formats: Formats,
    /// The order of the work: images are cut into tiles of this size.
    pub(crate) tile: Option<Resolution>,
    /// Render threads, at least 1.
    pub(crate) threads: usize,
    /// How fields are evaluated.
    pub(crate) settings: EvalSettings,
    /// What frames say about themselves, but for their statistics.
    pub(crate) metadata: FrameMetadata,
}

/// How far a render is.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub(crate) struct Done {
    /// Pixels in scratch files or frames, those found there included.
    pub(crate) pixels: u64,
    /// Pixels that were found in scratch files.
    pub(crate) pixels_found: u64,
    /// Camera rays cast.
    pub(crate) rays: u64,
}

/// What happened.
pub(crate) enum News {
    /// An image was begun, and its scratch file held something.
    Found(ImageNumber, Opened),
    /// A frame is finished.
    Frame,
    /// Some blocks are done.
    Progress,
}

/// What a render that ran to its end leaves.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// The frames, in the order of their images.
    pub(crate) frames: Vec<(ImageNumber, FinishedFrame)>,
    /// Work done in this run.
    pub(crate) counts: Counts,
    /// How many images were traced by each method.
    pub(crate) methods: BTreeMap<&'static str, usize>,
    /// Where its time went.
    pub(crate) spent: Spent,
    /// Blocks rendered in this run.
    pub(crate) blocks: u64,
    /// Whole blocks found in scratch files.
    pub(crate) blocks_found: u64,
    /// Pixels found in scratch files.
    pub(crate) pixels_found: u64,
    /// How long it took.
    pub(crate) wall: Duration,
}

/// An image that is being rendered.
struct Work {
    image: ImageNumber,
    renderer: ImageRenderer,
    scratch: Scratch,
    encoding: Encoding,
    counts: Mutex<Counts>,
}

enum Event {
    Found(ImageNumber, Opened),
    Finished(ImageNumber, FinishedFrame, Counts, Means),
    Failed(Error),
}

/// What the threads share.
struct Shared<'a> {
    plan: &'a Plan<'a>,
    line: Line<Work>,
    halt: AtomicBool,
    pixels: AtomicU64,
    pixels_found: AtomicU64,
    blocks: AtomicU64,
    blocks_found: AtomicU64,
    rays: AtomicU64,
    spent: Mutex<Spent>,
}

/// Renders what the plan says; `tell` hears of it on the calling thread.
///
/// Fails with the first error of any thread, or as interrupted once `stop` is set;
/// frames finished until then stay, and scratch files of the others too.
pub(crate) fn render(
    plan: &Plan<'_>,
    stop: &Stop,
    mut tell: impl FnMut(Done, News),
) -> Result<Outcome, Error> {
    let started = Instant::now();
    let shared = Shared {
        plan,
        line: Line::new(plan.images.iter().copied(), plan.threads),
        halt: AtomicBool::new(false),
        pixels: AtomicU64::new(0),
        pixels_found: AtomicU64::new(0),
        blocks: AtomicU64::new(0),
        blocks_found: AtomicU64::new(0),
        rays: AtomicU64::new(0),
        spent: Mutex::default(),
    };
    let mut outcome = Outcome {
        frames: Vec::new(),
        counts: Counts::default(),
        methods: BTreeMap::new(),
        spent: Spent::default(),
        blocks: 0,
        blocks_found: 0,
        pixels_found: 0,
        wall: Duration::ZERO,
    };
    let mut failure = None;
    thread::scope(|scope| {
        let (events, heard) = mpsc::channel();
        for number in 0..plan.threads.max(1) {
            let (shared, events) = (&shared, events.clone());
            let thread = thread::Builder::new().name(format!("render-{number}"));
            let spawned = thread.spawn_scoped(scope, move || {
                let mut spent = Spent::default();
                shared.work(&events, &mut spent);
                *unpoisoned(shared.spent.lock()) += spent;
            });
            if let Err(error) = spawned {
                shared.end();
                failure = Some(Error::failed("cannot start a render thread").because(error));
            }
        }
        drop(events);
        listen(&shared, &heard, stop, &mut outcome, &mut failure, &mut tell);
    });
    if let Some(error) = failure {
        return Err(error);
    }
    if outcome.frames.len() < plan.images.len() {
        return Err(Error::interrupted(
            "interrupted before every frame was done",
        ));
    }
    outcome.frames.sort_by_key(|(image, _)| *image);
    outcome.wall = started.elapsed();
    outcome.spent = unpoisoned(shared.spent.into_inner());
    outcome.pixels_found = shared.pixels_found.into_inner();
    outcome.blocks = shared.blocks.into_inner();
    outcome.blocks_found = shared.blocks_found.into_inner();
    Ok(outcome)
}

/// Passes on what the threads say until the last one has ended.
fn listen(
    shared: &Shared<'_>,
    heard: &Receiver<Event>,
    stop: &Stop,
    outcome: &mut Outcome,
    failure: &mut Option<Error>,
    tell: &mut impl FnMut(Done, News),
) {
    loop {
        if stop.is_set() {
            shared.end();
        }
        match heard.recv_timeout(REPORT_INTERVAL) {
            Err(RecvTimeoutError::Timeout) => tell(shared.done(), News::Progress),
            Err(RecvTimeoutError::Disconnected) => return,
            Ok(Event::Found(image, opened)) => tell(shared.done(), News::Found(image, opened)),
            Ok(Event::Finished(image, frame, counts, means)) => {
                tell(shared.done(), News::Frame);
                outcome.counts += counts;
                *outcome.methods.entry(means.name()).or_default() += 1;
                outcome.frames.push((image, frame));
            }
            Ok(Event::Failed(error)) => {
                shared.end();
                failure.get_or_insert(error);
            }
        }
    }
}

impl Shared<'_> {
    /// Asks every thread to end.
    fn end(&self) {
        self.halt.store(true, Ordering::Release);
        self.line.close();
    }

    fn done(&self) -> Done {
        Done {
            pixels: self.pixels.load(Ordering::Relaxed),
            pixels_found: self.pixels_found.load(Ordering::Relaxed),
            rays: self.rays.load(Ordering::Relaxed),
        }
    }

    fn view(&self) -> ViewTransform {
        ViewTransform {
            exposure_stops: self.plan.description.film.exposure,
        }
    }

    /// One thread's life, and where its time went.
    fn work(&self, events: &Sender<Event>, spent: &mut Spent) {
        let mut buffers = Buffers::default();
        loop {
            let done = match self.line.next() {
                Next::End => return,
                Next::Open(image) => timed(&mut spent.preparation, || self.open(image, events)),
                Next::Block(work, block) => self
                    .block(&work, block, &mut buffers, spent)
                    .map(|()| last(work).filter(|work| work.scratch.is_complete())),
            };
            let finished = done.and_then(|work| {
                work.map(|work| timed(&mut spent.encoding, || self.finish(work)))
                    .transpose()
            });
            let told = match finished {
                Ok(None) => Ok(()),
                Ok(Some(event)) => events.send(event),
                Err(error) => {
                    self.end();
                    events.send(Event::Failed(error))
                }
            };
            if told.is_err() {
                return;
            }
        }
    }

    /// Compiles an image and opens its scratch file; returns it where nothing is left to render.
    fn open(&self, image: ImageNumber, events: &Sender<Event>) -> Result<Option<Work>, Error> {
        let plan = self.plan;
        // Where there is nothing to render beside it, the other threads only wait for this.
        let crew = Threads(if self.line.is_idle() { plan.threads } else { 1 });
        let renderer =
            ImageRenderer::by(&crew, plan.description, plan.assets, image, plan.settings).map_err(
                |error| Error::failed(format!("cannot render frame {image}")).because(error),
            )?;
        let film = &plan.description.film;
        let identity = ScratchIdentity {
            scene: plan.digest,
            revision: plan.metadata.revision,
            image,
            resolution: film.resolution,
        };
        let path = plan
            .folder
            .join(format!(".{}_{:04}.scratch", plan.stem, image.0));
        let (scratch, opened) = Scratch::open_or_create(path, identity, film.window)
            .map_err(|error| Error::failed(format!("cannot begin frame {image}")).because(error))?;
        let found = scratch.pixels_done();
        self.pixels.fetch_add(found, Ordering::Relaxed);
        self.pixels_found.fetch_add(found, Ordering::Relaxed);
        if opened != Opened::New {
            // Whoever listens ends only after this thread.
            let _ = events.send(Event::Found(image, opened));
        }
        let remaining = scratch.remaining();
        let squares = film.window.blocks().count().saturating_sub(remaining.len());
        self.blocks_found
            .fetch_add(squares as u64, Ordering::Relaxed);
        let blocks = in_tiles(remaining, film.window, plan.tile);
        self.blocks
            .fetch_add(blocks.len() as u64, Ordering::Relaxed);
        let least = (renderer.together() / LAST_PARTS).max(1);
        let work = Work {
            image,
            renderer,
            encoding: Encoding::new(&scratch, plan.formats, self.view()),
            scratch,
            counts: Mutex::default(),
        };
        Ok(self.line.opened(work, blocks, least))
    }

    /// Renders one block into its place; one that was cancelled leaves nothing.
    fn block(
        &self,
        work: &Work,
        block: Rect,
        buffers: &mut Buffers,
        spent: &mut Spent,
    ) -> Result<(), Error> {
        let Buffers { pixels, payload } = buffers;
        let renderer = &work.renderer;
        let rendered = renderer.render_block_timed(block, &self.halt, pixels, clock);
        let Ok((counts, times)) = rendered else {
            return Ok(());
        };
        spent.blocks += times;
        let stored = timed(&mut spent.storing, || {
            payload.resize(pixels.len() * 4, 0);
            let (words, _) = payload.as_chunks_mut();
            for (bytes, value) in words.iter_mut().zip(&*pixels) {
                *bytes = value.to_le_bytes();
            }
            work.scratch.write_block(block, payload)
        });
        stored.map_err(|error| {
            Error::failed(format!("cannot keep a part of frame {}", work.image)).because(error)
        })?;
        timed(&mut spent.encoding, || work.encoding.go_on(&work.scratch))
            .map_err(|error| cannot_write(work.image).because(error))?;
        self.pixels.fetch_add(block.area(), Ordering::Relaxed);
        self.rays.fetch_add(counts.rays, Ordering::Relaxed);
        *unpoisoned(work.counts.lock()) += counts;
        Ok(())
    }

    /// Encodes an image whose last block is done.
    fn finish(&self, work: Work) -> Result<Event, Error> {
        let plan = self.plan;
        let Work {
            image,
            renderer,
            scratch,
            encoding,
            counts,
        } = work;
        let counts = unpoisoned(counts.into_inner());
        let means = renderer.means();
        let request = FrameRequest {
            folder: plan.folder.clone(),
            stem: plan.stem.clone(),
            number: image,
            formats: plan.formats,
            metadata: FrameMetadata {
                statistics: told(&counts, means),
                ..plan.metadata.clone()
            },
            view: self.view(),
            // The other threads have nothing else to do where nothing is left to start.
            threads: if self.line.is_empty() {
                plan.threads
            } else {
                1
            },
        };
        let failed = |error| cannot_write(image).because(error);
        let frame = thread::scope(|scope| {
            if request.threads > 1 {
                // Thousands of small tables take milliseconds to give back. A thread that the system refuses drops them, too.
                let _ = thread::Builder::new().spawn_scoped(scope, move || drop(renderer));
            }
            encoding.finish(&scratch, &request)
        });
        let frame = frame.map_err(failed)?;
        scratch.discard().map_err(failed)?;
        Ok(Event::Finished(image, frame, counts, means))
    }
}

fn cannot_write(image: ImageNumber) -> Error {
    Error::failed(format!("cannot write frame {image}"))
}

/// A thread's memory between blocks.
#[derive(Default)]
struct Buffers {
    pixels: Vec<f32>,
    payload: Vec<u8>,
}

/// Does something and adds how long it took.
fn timed<T>(spent: &mut Duration, what: impl FnOnce() -> T) -> T {
    let started = Instant::now();
    let done = what();
    *spent += started.elapsed();
    done
}

/// What a lock holds: sums, which a thread that panicked leaves whole.
fn unpoisoned<T>(locked: LockResult<T>) -> T {
    locked.unwrap_or_else(PoisonError::into_inner)
}

/// Cuts what is left of a window along tiles, and puts it into their order.
fn in_tiles(blocks: Vec<Rect>, window: Rect, tile: Option<Resolution>) -> Vec<Rect> {
    let Some(Resolution { width, height }) = tile else {
        return blocks;
    };
    let mut pieces = Vec::new();
    for block in blocks {
        let columns = (block.x0 - window.x0) / width..=(block.x1 - 1 - window.x0) / width;
        let rows = (block.y0 - window.y0) / height..=(block.y1 - 1 - window.y0) / height;
        for (row, column) in rows.flat_map(|row| columns.clone().map(move |column| (row, column))) {
            let (x0, y0) = (window.x0 + column * width, window.y0 + row * height);
            let tile = Rect {
                x0,
                y0,
                x1: x0.saturating_add(width),
                y1: y0.saturating_add(height),
            };
            pieces.extend(block.intersection(tile).map(|piece| ((row, column), piece)));
        }
    }
    // Stable: inside a tile the blocks keep their order.
    pieces.sort_by_key(|(place, _)| *place);
    pieces.into_iter().map(|(_, piece)| piece).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cut_what_is_left_without_loss() {
        let window = Rect {
            x0: 3,
            y0: 5,
            x1: 203,
            y1: 155,
        };
        let blocks: Vec<Rect> = window.blocks().skip(3).collect();
        for (width, height) in [(64, 64), (40, 60), (200, 25), (1000, 1)] {
            let tile = Some(Resolution { width, height });
            let cut = in_tiles(blocks.clone(), window, tile);
            assert!(cut.iter().all(|block| block.is_block()));
            assert_eq!(
                cut.iter().map(|block| block.area()).sum::<u64>(),
                blocks.iter().map(|block| block.area()).sum::<u64>()
            );
        }
        assert_eq!(in_tiles(blocks.clone(), window, None), blocks);
    }
}
