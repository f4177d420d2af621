//! Render threads: one tile each at a time, block by block.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use model::{AttemptId, Lease, Rect};
use tokio::sync::mpsc;
use wire::BlockHeader;

use crate::RunError;
use crate::images::{Images, said};
use crate::input::{Block, Input, Rendered};
use crate::painter::OpenImage;
use crate::scenes::Scene;

/// The threads and what they share.
pub(crate) struct Pool {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

struct Shared {
    work: Mutex<Work>,
    /// Told whenever `work` changes.
    changed: Condvar,
    images: Images,
    inputs: mpsc::Sender<Input>,
}

#[derive(Default)]
struct Work {
    /// Tiles that no thread has taken up; at most as many as the session has started.
    waiting: VecDeque<Tile>,
    /// How to stop each tile that waits or is being rendered.
    cancels: BTreeMap<AttemptId, Arc<AtomicBool>>,
    paused: bool,
    ended: bool,
}

struct Tile {
    lease: Lease,
    scene: Arc<Scene>,
    cancel: Arc<AtomicBool>,
}

impl Pool {
    /// Starts so many threads; what they have to say goes to `inputs`.
    pub(crate) fn start(
        threads: u32,
        images: Images,
        inputs: mpsc::Sender<Input>,
    ) -> Result<Self, RunError> {
        let shared = Arc::new(Shared {
            work: Mutex::default(),
            changed: Condvar::new(),
            images,
            inputs,
        });
        let start = |number: u32| {
            let shared = shared.clone();
            std::thread::Builder::new()
                .name(format!("render-{number}"))
                .spawn(move || shared.render_tiles())
        };
        let threads = (0..threads).map(start).collect::<Result<_, _>>();
        match threads {
            Ok(threads) => Ok(Self { shared, threads }),
            Err(error) => {
                shared.end();
                Err(RunError::Thread(error))
            }
        }
    }

    /// Has a tile rendered by the next thread that is free.
    pub(crate) fn render(&self, lease: Lease, scene: Arc<Scene>) {
        let cancel = Arc::new(AtomicBool::new(false));
        let mut work = self.shared.work();
        work.cancels.insert(lease.attempt, cancel.clone());
        work.waiting.push_back(Tile {
            lease,
            scene,
            cancel,
        });
        drop(work);
        self.shared.changed.notify_one();
    }

    /// Stops a tile at the next chance, if it is here.
    pub(crate) fn cancel(&self, attempt: AttemptId) {
        let mut work = self.shared.work();
        if let Some(cancel) = work.cancels.remove(&attempt) {
            cancel.store(true, Ordering::Relaxed);
        }
        work.waiting.retain(|tile| tile.lease.attempt != attempt);
        drop(work);
        // One may wait, paused, for its next block.
        self.shared.changed.notify_all();
    }

    /// Has every thread wait before its next block, or go on.
    pub(crate) fn set_paused(&self, paused: Paused) {
        self.shared.work().paused = paused == Paused::Yes;
        self.shared.changed.notify_all();
    }

    /// Stops everything, and waits for the threads.
    pub(crate) fn end(mut self) {
        self.shared.end();
        for thread in std::mem::take(&mut self.threads) {
            if thread.join().is_err() {
                tracing::error!("a render thread died of a mistake in this program");
            }
        }
    }
}

/// Ends the threads at their next chance, without waiting for them.
impl Drop for Pool {
    fn drop(&mut self) {
        self.shared.end();
    }
}

/// Whether render threads wait.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Paused {
    Yes,
    No,
}

/// How a tile ended.
enum Ended {
    /// All of it; this is its last block.
    Rendered(Box<Block>),
    /// Nobody wants it, or nobody listens.
    Dropped,
    Failed(String),
}

impl Shared {
    fn render_tiles(&self) {
        let mut scratch = Scratch::default();
        while let Some(tile) = self.next_tile() {
            let attempt = tile.lease.attempt;
            let ended =
                said(|| self.render_tile(&tile, &mut scratch)).unwrap_or_else(Ended::Failed);
            self.work().cancels.remove(&attempt);
            let report = match ended {
                Ended::Rendered(last) => Rendered::Last(last),
                Ended::Failed(reason) => Rendered::Failed(attempt, reason),
                Ended::Dropped => continue,
            };
            self.say(report);
        }
    }

    /// Waits for a tile; `None` once all is over.
    fn next_tile(&self) -> Option<Tile> {
        let work = self.work();
        let mut work = self
            .changed
            .wait_while(work, |work| !work.ended && work.waiting.is_empty())
            .unwrap_or_else(PoisonError::into_inner);
        if work.ended {
            return None;
        }
        work.waiting.pop_front()
    }

    fn render_tile(&self, tile: &Tile, scratch: &mut Scratch) -> Ended {
        let image = match self.images.open(&tile.scene, tile.lease.image.image) {
            Ok(image) => image,
            Err(reason) => return Ended::Failed(reason),
        };
        let mut left = tile.lease.blocks().peekable();
        while let Some(rect) = left.next() {
            if !self.may_go_on(tile) {
                return Ended::Dropped;
            }
            match render_block(tile, rect, &*image, scratch) {
                Ok(Some(block)) if left.peek().is_none() => {
                    return Ended::Rendered(Box::new(block));
                }
                Ok(Some(block)) => self.say(Rendered::Block(Box::new(block))),
                Ok(None) => return Ended::Dropped,
                Err(reason) => return Ended::Failed(reason),
            }
        }
        Ended::Failed("the lease names no block".to_owned())
    }

    /// Waits while rendering is paused; whether the tile is still wanted then.
    fn may_go_on(&self, tile: &Tile) -> bool {
        let cancelled = || tile.cancel.load(Ordering::Relaxed);
        let work = self.work();
        let work = self
            .changed
            .wait_while(work, |work| work.paused && !work.ended && !cancelled())
            .unwrap_or_else(PoisonError::into_inner);
        !work.ended && !cancelled()
    }

    fn say(&self, rendered: Rendered) {
        // An error says that the loop has ended: nobody listens.
        let _ = self.inputs.blocking_send(Input::Rendered(rendered));
    }

    fn end(&self) {
        let mut work = self.work();
        work.ended = true;
        work.waiting.clear();
        for cancel in work.cancels.values() {
            cancel.store(true, Ordering::Relaxed);
        }
        drop(work);
        self.changed.notify_all();
    }

    fn work(&self) -> MutexGuard<'_, Work> {
        self.work.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Buffers that a thread uses for every block.
#[derive(Default)]
struct Scratch {
    pixels: Vec<f32>,
    payload: Vec<u8>,
}

/// Renders a block and makes its record; `None` if it was cancelled.
fn render_block(
    tile: &Tile,
    rect: Rect,
    image: &dyn OpenImage,
    scratch: &mut Scratch,
) -> Result<Option<Block>, String> {
    let attempt = tile.lease.attempt;
    let header = BlockHeader {
        image: tile.lease.image,
        rect,
        attempt,
    };
    let start = Instant::now();
    let Ok(counters) = image.render_block(rect, &tile.cancel, &mut scratch.pixels) else {
        return Ok(None);
    };
    let render_us = u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX);
    wire::block::payload_of(&scratch.pixels, &mut scratch.payload);
    let record = header
        .record(&scratch.payload)
        .map_err(|error| format!("the renderer made no block: {error}"))?;
    Ok(Some(Block::new(attempt, rect, record, render_us, counters)))
}
