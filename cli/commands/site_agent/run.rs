//! `flyby site-agent run`: what each task of an array runs. It renders the blocks of its tile that are wanted and not in
//! its file yet, writes each as it is finished, durably, and ends before its time is over.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Read as _, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use agent::{Assets, OpenImage, Painter as _, RenderPainter};
use cluster::orders::Order;
use model::{Lease, Rect, Span};
use render::SimdLevel;
use scene::Description;
use wire::BlockHeader;
use wire::block::BlockRecord;
use wire::proto::{Counter, Delivery};
use wire::spool::{self, Entry};

use super::folder::{Folder, cannot};
use crate::error::Error;

/// So long before its limit a task begins nothing more; queues warn by signals that end it half a minute before…
const SPARE: Duration = Duration::from_secs(40);

/// …where the limit is no shorter than this; else it is a tenth of it.
const SPARE_FROM: Duration = Duration::from_secs(300);

/// Renders the tile of a task.
pub(super) fn run(folder: &Folder, array: &str, task: u32) -> Result<(), Error> {
    let begun = Instant::now();
    let order = folder.order(array)?;
    let lease = order
        .lease(task)
        .ok_or_else(|| Error::usage(format!("the array {array} has no task {task}")))?;
    let painter = RenderPainter::new(SimdLevel::best());
    if painter.revision() != order.revision() {
        return Err(Error::failed(format!(
            "this program makes pixels of renderer revision {}, and revision {} is wanted",
            painter.revision(),
            order.revision()
        ))
        .next("bring the coordinator's program here: `flyby site install SITE`"));
    }
    let path = folder.blocks(array, task)?;
    let (file, have) = open(&path)?;
    let wanted: Vec<Rect> = lease
        .blocks()
        .filter(|block| !have.contains(block))
        .collect();
    if wanted.is_empty() {
        return Ok(());
    }
    let (description, assets) = scene_of(folder, &order.scene)?;
    let image = painter
        .open(&description, &assets, lease.image.image)
        .map_err(|reason| Error::failed("cannot render the image").because(reason))?;
    let work = Work {
        lease: &lease,
        image: &*image,
        wanted: &wanted,
        next: AtomicUsize::new(0),
        path: &path,
        file: Mutex::new(file),
        until: until(&order, begun),
        failed: AtomicBool::new(false),
    };
    let results: Vec<_> = thread::scope(|scope| {
        let threads: Vec<_> = (0..order.threads.max(1))
            .map(|_| scope.spawn(|| work.render()))
            .collect();
        threads
            .into_iter()
            .map(thread::ScopedJoinHandle::join)
            .collect()
    });
    for result in results {
        result.unwrap_or_else(|_| Err(Error::failed("a mistake in the renderer stopped it")))?;
    }
    Ok(())
}

/// Until when blocks are begun.
fn until(order: &Order, begun: Instant) -> Option<Instant> {
    let Span(limit) = order.time_limit?;
    let limit = Duration::from_micros(limit);
    let spare = match limit >= SPARE_FROM {
        true => SPARE,
        false => limit / 10,
    };
    Some(begun + (limit - spare))
}

/// What the threads share.
struct Work<'a> {
    lease: &'a Lease,
    image: &'a dyn OpenImage,
    wanted: &'a [Rect],
    next: AtomicUsize,
    path: &'a Path,
    file: Mutex<File>,
    until: Option<Instant>,
    failed: AtomicBool,
}

impl Work<'_> {
    /// Renders blocks as long as there are any, and time for one that takes as long as the longest before.
    fn render(&self) -> Result<(), Error> {
        let never = AtomicBool::new(false);
        let (mut pixels, mut payload) = (Vec::new(), Vec::new());
        let mut longest = Duration::ZERO;
        loop {
            let is_late = self
                .until
                .is_some_and(|until| Instant::now() + longest > until);
            if self.failed.load(Ordering::Relaxed) || (is_late && longest > Duration::ZERO) {
                return Ok(());
            }
            let Some(&rect) = self.wanted.get(self.next.fetch_add(1, Ordering::Relaxed)) else {
                return Ok(());
            };
            let start = Instant::now();
            let Ok(counters) = self.image.render_block(rect, &never, &mut pixels) else {
                return Ok(());
            };
            let took = start.elapsed();
            longest = longest.max(took);
            wire::block::payload_of(&pixels, &mut payload);
            let header = BlockHeader {
                image: self.lease.image,
                rect,
                attempt: self.lease.attempt,
            };
            let record = header
                .record(&payload)
                .map_err(|error| Error::failed("the renderer made no block").because(error))?;
            let counters = counters.into_iter().map(|(name, value)| Counter {
                name: name.to_owned(),
                value,
            });
            let entry = spool::entry(&Delivery {
                record: record.into(),
                render_us: u64::try_from(took.as_micros()).unwrap_or(u64::MAX),
                counters: counters.collect(),
            });
            if let Err(error) = self.write(&entry) {
                self.failed.store(true, Ordering::Relaxed);
                note_full(self.path, &error);
                return Err(Error::failed("cannot write a finished block").because(error));
            }
        }
    }

    /// Writes an entry at the end of the file, durably, or leaves the file as it was.
    fn write(&self, entry: &[u8]) -> io::Result<()> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let before = file.metadata()?.len();
        let written = file.write_all(entry).and_then(|()| file.sync_data());
        if written.is_err() {
            file.set_len(before)?;
        }
        written
    }
}

/// Notes by an empty file, for which there may be room, that a task came to nothing for lack of it.
fn note_full(path: &Path, error: &io::Error) {
    if matches!(
        error.kind(),
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded
    ) {
        // Without it the task counts as one that failed, unless the folder is still full when it is looked at.
        let _ = File::create(path.with_extension("full"));
    }
}

/// A task's file, and the blocks that are whole in it; what an earlier run left half-written is cut off.
fn open(path: &Path) -> Result<(File, BTreeSet<Rect>), Error> {
    let cannot = cannot("use", path);
    let mut options = OpenOptions::new();
    let options = options.read(true).append(true).create(true);
    let file = options
        .open(path)
        .inspect_err(|error| note_full(path, error));
    let mut file = file.map_err(&cannot)?;
    match file.try_lock() {
        // A file system that knows no locks has no two runs of a task either, as far as anybody can tell.
        Ok(()) | Err(TryLockError::Error(_)) => {}
        Err(TryLockError::WouldBlock) => {
            return Err(Error::failed(format!(
                "another process renders into `{}`",
                path.display()
            )));
        }
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(&cannot)?;
    let (mut rest, mut whole, mut have) = (&bytes[..], 0_u64, BTreeSet::new());
    loop {
        let length = match spool::read(rest) {
            Entry::Block(delivery, length) => {
                if let Ok(record) = BlockRecord::only(&delivery.record) {
                    have.insert(record.header.rect);
                }
                length
            }
            Entry::Damaged(length) => length,
            Entry::End => break,
        };
        rest = &rest[length..];
        whole += length as u64;
    }
    if !rest.is_empty() {
        file.set_len(whole).map_err(&cannot)?;
    }
    Ok((file, have))
}

/// A scene and its assets, each compared with its digest.
fn scene_of(folder: &Folder, digest: &str) -> Result<(Description, Assets), Error> {
    let read = |digest: &str| {
        let path = folder.scene(digest)?;
        fs::read(&path).map_err(cannot("read", &path))
    };
    let damaged =
        |what: &str| Error::failed(format!("the file of the scene or asset {what} is damaged"));
    let bytes = read(digest)?;
    if scene::digest_of(&bytes).to_string() != digest {
        return Err(damaged(digest));
    }
    let description = Description::from_bytes(&bytes)
        .map_err(|error| Error::failed("cannot read the scene").because(error))?;
    let mut assets = Assets::new();
    for asset in &description.assets {
        let name = asset.digest.to_string();
        let bytes = read(&name)?;
        if *blake3::hash(&bytes).as_bytes() != asset.digest.0 {
            return Err(damaged(&name));
        }
        assets.insert(asset.digest, bytes.into());
    }
    Ok((description, assets))
}
