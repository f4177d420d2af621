//! The scratch file of one image: where its blocks come together.
//!
//! One fixed slot per grid square that the window touches, in row order, so that a block is
//! written at its place in whatever order it comes; the file is sparse until then. What is done
//! is counted in pixels, so that the rest of an image may be cut into other tiles at any time.
//! A journal beside the file lets an interrupted render go on; where its caller keeps a journal of its own,
//! there is none ([`Scratch::create_bare`]).

mod coverage;
mod film;
mod grid;
mod header;
mod journal;
mod lock;
mod strip;

use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use model::film::CHANNELS;
use model::rect::{GRID_SQUARE, SIDE_MAX};
use model::{Digest, Rect};

use self::coverage::Coverage;
use self::grid::{Grid, SLOT_BYTES};
use self::header::USED_BYTES;
use self::journal::{Entry, Journal};
use crate::error::ImageError;

pub(crate) use self::film::FilmHasher;
pub use self::header::ScratchIdentity;
pub(crate) use self::strip::{Strip, StripMemory, append_le_bytes};

/// Locks over the slots, so that blocks of one square do not undo each other.
const SLOT_LOCKS: usize = 16;

/// What [`Scratch::open_or_create`] found.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Opened {
    /// Nothing was there.
    New,
    /// This image, interrupted: its pixels that could be read back whole are done.
    Resumed {
        /// Pixels that need not be rendered again.
        pixels_done: u64,
        /// Journalled blocks whose pixels did not outlive the interruption.
        blocks_lost: u64,
    },
    /// The scratch file of another scene, revision, image, size or window: it was begun anew.
    StartedAnew,
}

/// The scratch file of one image, shared by the threads that deliver its blocks.
///
/// While it lives it holds a lock on the file, so that no other process writes to it.
#[derive(Debug)]
pub struct Scratch {
    path: PathBuf,
    file: File,
    identity: ScratchIdentity,
    grid: Grid,
    slots: [Mutex<()>; SLOT_LOCKS],
    state: Mutex<State>,
    /// Whether the folder was synced since the files were opened.
    named: AtomicBool,
}

#[derive(Debug)]
struct State {
    coverage: Coverage,
    /// None where the caller keeps one.
    journal: Option<Journal>,
}

impl Scratch {
    /// Begins the scratch file of an image anew at `path`, whatever an earlier one held, with its
    /// journal at `path` + `.journal`.
    ///
    /// Fails if another process holds it, if a file that is no scratch file is in its place, if
    /// `window` is empty or leaves the image, or if the system refuses.
    pub fn create(
        path: impl Into<PathBuf>,
        identity: ScratchIdentity,
        window: Rect,
    ) -> Result<Self, ImageError> {
        let path = path.into();
        let (file, _) = open(&path, &identity, window)?;
        Self::begin(path, file, identity, window)
    }

    /// Goes on with the scratch file at `path` if it is this image's, else begins it.
    ///
    /// Every block in the journal is read back, and counts as done only if its digest still
    /// holds. Fails like [`Scratch::create`].
    pub fn open_or_create(
        path: impl Into<PathBuf>,
        identity: ScratchIdentity,
        window: Rect,
    ) -> Result<(Self, Opened), ImageError> {
        let path = path.into();
        let (file, found) = open(&path, &identity, window)?;
        if found == Found::This {
            let bytes = Grid::new(window).file_bytes();
            file.set_len(bytes)
                .map_err(|source| ImageError::io("size the scratch file", &path, source))?;
            return Self::resume(path, file, identity, window);
        }
        let opened = match found {
            Found::Nothing | Found::This => Opened::New,
            Found::Other => Opened::StartedAnew,
        };
        Ok((Self::begin(path, file, identity, window)?, opened))
    }

    /// Begins the scratch file of an image anew, without a journal: its caller notes which blocks are durable.
    ///
    /// Fails like [`Scratch::create`].
    pub fn create_bare(
        path: impl Into<PathBuf>,
        identity: ScratchIdentity,
        window: Rect,
    ) -> Result<Self, ImageError> {
        // Nothing was noted, so whatever an earlier one held counts for nothing.
        let (scratch, _) = Self::reopen_bare(path, identity, window, [])?;
        Ok(scratch)
    }

    /// Goes on with a scratch file that was begun by [`Scratch::create_bare`], of which these blocks, with
    /// the digests of their payloads, were noted as durable. Also gives those that do not hold
    /// any more, which are all where the file is gone or another image's.
    ///
    /// Fails like [`Scratch::create`].
    pub fn reopen_bare(
        path: impl Into<PathBuf>,
        identity: ScratchIdentity,
        window: Rect,
        blocks: impl IntoIterator<Item = (Rect, Digest)>,
    ) -> Result<(Self, Vec<Rect>), ImageError> {
        let path = path.into();
        let (file, found) = open(&path, &identity, window)?;
        let grid = Grid::new(window);
        if found == Found::This {
            file.set_len(grid.file_bytes())
                .map_err(|source| ImageError::io("size the scratch file", &path, source))?;
        } else {
            write_header(&file, &path, &identity.header(window), grid)?;
        }
        let mut reader = Reader::new(&file, &path, grid);
        let mut coverage = Coverage::new(grid);
        let mut lost = Vec::new();
        // Square by square, so that each is read once.
        let mut blocks: Vec<_> = blocks.into_iter().collect();
        blocks.sort_by_key(|(block, _)| (block.y0 / GRID_SQUARE, block.x0 / GRID_SQUARE));
        for (block, digest) in blocks {
            let holds = found == Found::This && reader.holds(block, digest)?;
            match holds {
                true => coverage.add(block),
                false => lost.push(block),
            }
        }
        let scratch = Self::assemble(path, file, identity, grid, None);
        scratch.state().coverage = coverage;
        Ok((scratch, lost))
    }

    fn begin(
        path: PathBuf,
        file: File,
        identity: ScratchIdentity,
        window: Rect,
    ) -> Result<Self, ImageError> {
        let grid = Grid::new(window);
        let header = identity.header(window);
        write_header(&file, &path, &header, grid)?;
        let journal = Journal::start(journal_path(&path), header::binding(&header))?;
        Ok(Self::assemble(path, file, identity, grid, Some(journal)))
    }

    fn resume(
        path: PathBuf,
        file: File,
        identity: ScratchIdentity,
        window: Rect,
    ) -> Result<(Self, Opened), ImageError> {
        let grid = Grid::new(window);
        let binding = header::binding(&identity.header(window));
        let mut coverage = Coverage::new(grid);
        let mut blocks_lost = 0;
        let mut reader = Reader::new(&file, &path, grid);
        let journal = Journal::replay(journal_path(&path), binding, |Entry { block, digest }| {
            match reader.holds(block, digest)? {
                true => coverage.add(block),
                false => blocks_lost += 1,
            }
            Ok(())
        })?;
        let Some(journal) = journal else {
            return Ok((Self::begin(path, file, identity, window)?, Opened::New));
        };
        let pixels_done = coverage.done();
        let scratch = Self::assemble(path, file, identity, grid, Some(journal));
        scratch.state().coverage = coverage;
        let opened = Opened::Resumed {
            pixels_done,
            blocks_lost,
        };
        Ok((scratch, opened))
    }

    fn assemble(
        path: PathBuf,
        file: File,
        identity: ScratchIdentity,
        grid: Grid,
        journal: Option<Journal>,
    ) -> Self {
        Self {
            path,
            file,
            identity,
            grid,
            slots: Default::default(),
            state: Mutex::new(State {
                coverage: Coverage::new(grid),
                journal,
            }),
            named: AtomicBool::new(false),
        }
    }

    /// Writes a block at its place and counts its pixels as done.
    ///
    /// `payload` is, for each channel of [`CHANNELS`], for each row, for each column, an `f32`,
    /// little-endian. A block that is done already is not written again; one that overlaps what
    /// is done must agree with it, which is not checked here. May be called from many threads.
    ///
    /// Fails, and counts nothing, if `block` is no block of the window, if the payload has
    /// another length or holds a NaN or an infinity, or if the system refuses. Durable only
    /// after [`Scratch::sync`].
    pub fn write_block(&self, block: Rect, payload: &[u8]) -> Result<(), ImageError> {
        let mut verdicts = self.write_blocks(&[(block, payload)])?;
        verdicts.pop().unwrap_or(Ok(()))
    }

    /// Writes blocks as [`Scratch::write_block`] does, those of a square together, and says of each what is wrong
    /// with it, if anything is; the others are written.
    ///
    /// Fails if the system refuses; what was written until then counts, and all may be written again.
    pub fn write_blocks(
        &self,
        blocks: &[(Rect, &[u8])],
    ) -> Result<Vec<Result<(), ImageError>>, ImageError> {
        let checked = blocks
            .iter()
            .map(|(block, payload)| self.check(*block, payload));
        let verdicts: Vec<_> = checked.collect();
        let whole = blocks.iter().zip(&verdicts);
        let whole = whole.filter_map(|(block, verdict)| verdict.is_ok().then_some(block));
        for (square, mut together) in self.by_square(whole) {
            let mut at = 0;
            // The first to come stays, in this call too.
            while let Some((block, _)) = together.get(at) {
                let earlier = &together[..at];
                let is_done = self.state().coverage.contains(*block)
                    || earlier.iter().any(|(done, _)| done.contains(*block));
                match is_done {
                    true => drop(together.remove(at)),
                    false => at += 1,
                }
            }
            self.write_slot(square, &together)?;
            let mut state = self.state();
            for (block, payload) in together {
                if let Some(journal) = &mut state.journal {
                    let digest = payload_digest(payload);
                    journal.append(Entry { block, digest })?;
                }
                state.coverage.add(block);
            }
        }
        Ok(verdicts)
    }

    /// Writes blocks at their places that [`Scratch::write_blocks`] has taken.
    ///
    /// What was written since the last sync may be gone after one that failed, and the next one does not
    /// say so: the system counts it as written. Whoever goes on must write it again.
    pub fn write_again(&self, blocks: &[(Rect, &[u8])]) -> Result<(), ImageError> {
        for (square, together) in self.by_square(blocks) {
            self.write_slot(square, &together)?;
        }
        Ok(())
    }

    /// Blocks by the squares in which they lie, each square's in their order.
    fn by_square<'b>(
        &self,
        blocks: impl IntoIterator<Item = &'b (Rect, &'b [u8])>,
    ) -> BTreeMap<usize, Vec<(Rect, &'b [u8])>> {
        let mut squares = BTreeMap::<_, Vec<_>>::new();
        for &(block, payload) in blocks {
            let square = self.grid.square_of(block);
            squares.entry(square).or_default().push((block, payload));
        }
        squares
    }

    fn check(&self, block: Rect, payload: &[u8]) -> Result<(), ImageError> {
        let window = self.window();
        if !block.is_block() || !window.contains(block) {
            return Err(ImageError::NotABlock {
                rect: block,
                window,
            });
        }
        let expected = grid::payload_bytes(block);
        if payload.len() != expected {
            return Err(ImageError::PayloadLength {
                rect: block,
                expected,
                found: payload.len(),
            });
        }
        let (words, _) = payload.as_chunks();
        let values = words.iter().map(|bytes| f32::from_le_bytes(*bytes));
        // All of them, which takes less time than ending at the first.
        if values
            .clone()
            .fold(true, |all, value| all & value.is_finite())
        {
            return Ok(());
        }
        match values.enumerate().find(|(_, value)| !value.is_finite()) {
            None => Ok(()),
            Some((index, value)) => Err(not_finite(block, index, value)),
        }
    }

    /// Writes blocks into the slot of their square, the slot as one piece.
    fn write_slot(&self, square: usize, blocks: &[(Rect, &[u8])]) -> Result<(), ImageError> {
        let offset = self.grid.slot_offset(square);
        let _slot = lock(&self.slots[square % SLOT_LOCKS]);
        let write = || match blocks {
            [] => Ok(()),
            [(_, payload)] if payload.len() == SLOT_BYTES => {
                self.file.write_all_at(payload, offset)
            }
            blocks => {
                let mut slot = vec![0; SLOT_BYTES];
                let whole = self.grid.whole_block(square);
                if blocks.iter().all(|(block, _)| *block != whole) {
                    self.file.read_exact_at(&mut slot, offset)?;
                }
                for (block, payload) in blocks {
                    grid::scatter(*block, payload, &mut slot);
                }
                self.file.write_all_at(&slot, offset)
            }
        };
        write().map_err(|source| ImageError::io("write blocks to", &self.path, source))
    }

    /// Makes every block written so far durable: pixels, journal, and the files' names. Blocks may
    /// be written meanwhile. After an error see [`Scratch::write_again`].
    pub fn sync(&self) -> Result<(), ImageError> {
        let journal = self.state().journal.as_ref().map(Journal::file);
        self.file
            .sync_data()
            .and_then(|()| journal.map_or(Ok(()), |journal| journal.sync_data()))
            .map_err(|source| ImageError::io("sync", &self.path, source))?;
        if !self.named.load(Ordering::Relaxed) {
            crate::frame::publish::sync_folder_of(&self.path)?;
            self.named.store(true, Ordering::Relaxed);
        }
        Ok(())
    }

    /// What is not done: whole blocks of the window, or the missing parts of those begun.
    pub fn remaining(&self) -> Vec<Rect> {
        self.state().coverage.missing()
    }

    /// Number of pixels of the window that are done, each counted once.
    pub fn pixels_done(&self) -> u64 {
        self.state().coverage.done()
    }

    /// Whether every pixel of the window is done.
    pub fn is_complete(&self) -> bool {
        self.pixels_done() == self.window().area()
    }

    /// The part of the image that is rendered and stored.
    pub fn window(&self) -> Rect {
        self.grid.window()
    }

    /// What image this is.
    pub fn identity(&self) -> &ScratchIdentity {
        &self.identity
    }

    /// Where the file is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Removes the scratch file and its journal. Whoever still holds it may read it, and nothing else.
    pub fn discard(&self) -> Result<(), ImageError> {
        let state = self.state();
        let journal = state.journal.as_ref().map(Journal::path);
        for path in std::iter::once(self.path.as_path()).chain(journal) {
            std::fs::remove_file(path).map_err(|source| ImageError::io("remove", path, source))?;
        }
        Ok(())
    }

    /// Fails unless every pixel is done.
    pub(crate) fn require_complete(&self) -> Result<(), ImageError> {
        match self.window().area() - self.pixels_done() {
            0 => Ok(()),
            missing => Err(ImageError::Incomplete {
                path: self.path.clone(),
                missing,
            }),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        lock(&self.state)
    }
}

/// What stands at a scratch file's place.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Found {
    Nothing,
    This,
    Other,
}

/// Opens and locks the file and says whose it is, changing nothing of it.
fn open(
    path: &Path,
    identity: &ScratchIdentity,
    window: Rect,
) -> Result<(File, Found), ImageError> {
    let resolution = identity.resolution;
    let sides_fit = resolution.width <= SIDE_MAX && resolution.height <= SIDE_MAX;
    if !sides_fit || window.is_empty() || !resolution.rect().contains(window) {
        return Err(ImageError::BadWindow { window, resolution });
    }
    let file = lock::open_locked(path)?;
    let mut first = [0; USED_BYTES];
    let read = lock::read_up_to(&file, &mut first)
        .map_err(|source| ImageError::io("read", path, source))?;
    if !header::is_ours(&first[..read]) {
        return Err(ImageError::NotAScratch {
            path: path.to_owned(),
        });
    }
    let found = if first == identity.header(window) {
        Found::This
    } else if first[..read].iter().all(|byte| *byte == 0) {
        Found::Nothing
    } else {
        Found::Other
    };
    Ok((file, found))
}

fn write_header(
    file: &File,
    path: &Path,
    header: &[u8; USED_BYTES],
    grid: Grid,
) -> Result<(), ImageError> {
    file.set_len(0)
        .and_then(|()| file.write_all_at(header, 0))
        .and_then(|()| file.set_len(grid.file_bytes()))
        .map_err(|source| ImageError::io("begin the scratch file", path, source))
}

/// Reads blocks back, each square once as long as its blocks follow each other.
struct Reader<'a> {
    file: &'a File,
    path: &'a Path,
    grid: Grid,
    /// The square whose slot was read last.
    square: Option<usize>,
    slot: Vec<u8>,
    payload: Vec<u8>,
}

impl<'a> Reader<'a> {
    fn new(file: &'a File, path: &'a Path, grid: Grid) -> Self {
        Self {
            file,
            path,
            grid,
            square: None,
            slot: vec![0; SLOT_BYTES],
            payload: Vec::new(),
        }
    }

    /// Whether a block of the window is there, and has this digest.
    fn holds(&mut self, block: Rect, digest: Digest) -> Result<bool, ImageError> {
        if !block.is_block() || !self.grid.window().contains(block) {
            return Ok(false);
        }
        let square = self.grid.square_of(block);
        if self.square != Some(square) {
            self.square = None;
            self.file
                .read_exact_at(&mut self.slot, self.grid.slot_offset(square))
                .map_err(|source| ImageError::io("read back", self.path, source))?;
            self.square = Some(square);
        }
        grid::gather(block, &self.slot, &mut self.payload);
        Ok(payload_digest(&self.payload) == digest)
    }
}

fn journal_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".journal");
    name.into()
}

fn payload_digest(payload: &[u8]) -> Digest {
    Digest(*blake3::hash(payload).as_bytes())
}

/// The error for sample `index` of a block's payload.
fn not_finite(block: Rect, index: usize, value: f32) -> ImageError {
    let (width, height) = (block.width() as usize, block.height() as usize);
    let within = |offset: usize| u32::try_from(offset).expect("a block's sides are at most 32");
    ImageError::NotFinite {
        channel: CHANNELS[index / (width * height)].name,
        x: block.x0 + within(index % width),
        y: block.y0 + within(index / width % height),
        value,
    }
}

/// A lock survives a panic elsewhere: what it guards is changed in single steps.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
