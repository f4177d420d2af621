//! The journal beside a scratch file: which blocks were written, with the digest of each.
//!
//! A head and then records of the same 64 bytes, only ever added to. A record says no more than
//! "this block was handed to the system": whether its pixels outlived a crash is found out by
//! reading them back, so nothing here has to be synced before anything else.

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use model::{Digest, Rect};

use crate::error::ImageError;

/// Bytes of the head and of every record.
const RECORD_BYTES: usize = 64;
const MAGIC: &[u8; 8] = b"FLYBYJNL";

/// One block that was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    /// Which.
    pub(super) block: Rect,
    /// BLAKE3 of its payload.
    pub(super) digest: Digest,
}

/// The journal of one scratch file, open for adding.
#[derive(Debug)]
pub(super) struct Journal {
    file: Arc<File>,
    path: PathBuf,
    /// Binds every record to its scratch file's header.
    binding: Digest,
    /// Where the next record goes. A record that failed half-way is written over.
    end: u64,
}

impl Journal {
    /// Begins an empty journal, whatever was at `path`.
    pub(super) fn start(path: PathBuf, binding: Digest) -> Result<Self, ImageError> {
        let file = open(&path)?;
        file.set_len(0)
            .and_then(|()| file.write_all_at(&head(binding), 0))
            .map_err(|source| ImageError::io("begin the journal", &path, source))?;
        Ok(Self {
            file: Arc::new(file),
            path,
            binding,
            end: RECORD_BYTES as u64,
        })
    }

    /// Opens the journal at `path` and hands every entry to `each`, oldest first. What follows
    /// the first record that is torn or damaged is cut off. `None`: the file is no journal of
    /// this scratch file.
    pub(super) fn replay(
        path: PathBuf,
        binding: Digest,
        mut each: impl FnMut(Entry) -> Result<(), ImageError>,
    ) -> Result<Option<Self>, ImageError> {
        let failed = |source| ImageError::io("read the journal", &path, source);
        let file = open(&path)?;
        let mut reader = BufReader::with_capacity(64 * 1024, &file);
        reader.seek(SeekFrom::Start(0)).map_err(failed)?;
        let mut record = [0; RECORD_BYTES];
        if !read_record(&mut reader, &mut record).map_err(failed)? || record != head(binding) {
            return Ok(None);
        }
        let mut end = RECORD_BYTES as u64;
        while read_record(&mut reader, &mut record).map_err(failed)? {
            let Some(entry) = decode(&record, binding) else {
                break;
            };
            each(entry)?;
            end += RECORD_BYTES as u64;
        }
        file.set_len(end)
            .map_err(|source| ImageError::io("cut the journal", &path, source))?;
        Ok(Some(Self {
            file: Arc::new(file),
            path,
            binding,
            end,
        }))
    }

    /// Adds a record.
    pub(super) fn append(&mut self, entry: Entry) -> Result<(), ImageError> {
        self.file
            .write_all_at(&encode(entry, self.binding), self.end)
            .map_err(|source| ImageError::io("add to the journal", &self.path, source))?;
        self.end += RECORD_BYTES as u64;
        Ok(())
    }

    /// The file, to be synced while others go on adding.
    pub(super) fn file(&self) -> Arc<File> {
        Arc::clone(&self.file)
    }

    /// Where it is.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

fn open(path: &Path) -> Result<File, ImageError> {
    File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(path)
        .map_err(|source| ImageError::io("open the journal", path, source))
}

/// Reads one record; `false` where less than one is left.
fn read_record(from: &mut impl Read, record: &mut [u8; RECORD_BYTES]) -> std::io::Result<bool> {
    match from.read_exact(record) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

fn head(binding: Digest) -> [u8; RECORD_BYTES] {
    let mut head = [0; RECORD_BYTES];
    head[..8].copy_from_slice(MAGIC);
    head[8..40].copy_from_slice(&binding.0);
    seal(&mut head, binding);
    head
}

fn encode(entry: Entry, binding: Digest) -> [u8; RECORD_BYTES] {
    let Rect { x0, y0, x1, y1 } = entry.block;
    let mut record = [0; RECORD_BYTES];
    for (bytes, corner) in record.chunks_exact_mut(4).zip([x0, y0, x1, y1]) {
        bytes.copy_from_slice(&corner.to_le_bytes());
    }
    record[16..48].copy_from_slice(&entry.digest.0);
    seal(&mut record, binding);
    record
}

fn decode(record: &[u8; RECORD_BYTES], binding: Digest) -> Option<Entry> {
    let mut sealed = *record;
    seal(&mut sealed, binding);
    if sealed != *record {
        return None;
    }
    let corner = |index: usize| {
        let bytes = &record[index * 4..index * 4 + 4];
        u32::from_le_bytes(bytes.try_into().expect("four bytes"))
    };
    Some(Entry {
        block: Rect {
            x0: corner(0),
            y0: corner(1),
            x1: corner(2),
            y1: corner(3),
        },
        digest: Digest(record[16..48].try_into().expect("32 bytes")),
    })
}

/// Puts the checksum of the first 48 bytes and the binding into the last 16.
fn seal(record: &mut [u8; RECORD_BYTES], binding: Digest) {
    let mut hasher = blake3::Hasher::new_derive_key("flyby scratch journal v1");
    hasher.update(&binding.0).update(&record[..48]);
    record[48..].copy_from_slice(&hasher.finalize().as_bytes()[..16]);
}
