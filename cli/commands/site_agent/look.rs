//! `flyby site-agent ls` and `get`: how everything stands, and blocks that are finished.
//!
//! The queue is asked before files are read: of a task that has ended all blocks are there then.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, BufWriter, Read as _, Seek as _, SeekFrom, Write};
use std::path::Path;

use cluster::orders::{
    End, FETCH_BLOCKS_MAX, FETCH_BYTES_MAX, Frame, Look, Seen, SeenArray, SeenTask, Stands, Wants,
    edges,
};
use cluster::{Camp, ClusterError, Task, TaskState};
use wire::block::BlockRecord;
use wire::spool::{self, Entry};

use super::folder::{Folder, cannot};
use super::queue;
use crate::error::Error;

/// What the queue shows of an array: its tasks by number.
type Shown = BTreeMap<u32, Stands>;

/// Answers a look on standard output.
pub(super) fn look(folder: &Folder, request: Look) -> Result<(), Error> {
    let camp = request.there.camp(folder.root());
    let shown = camp.queue.list(&camp.prefix());
    let shown = by_array(shown.map_err(queue("cannot ask the queue"))?);
    let known: BTreeSet<_> = request.known.iter().map(String::as_str).collect();
    let mut arrays = Vec::new();
    for name in names(&folder.arrays())? {
        arrays.push(array(folder, &name, &known, shown.get(&name))?);
    }
    // What the queue has of ours that has no folder is nobody's.
    for (name, tasks) in &shown {
        let is_there = arrays.iter().any(|array| array.name == *name);
        let is_live = tasks.values().any(|stands| stands.is_live());
        if !is_there && is_live {
            arrays.push(SeenArray {
                name: name.clone(),
                is_submitted: true,
                order: None,
                tasks: numbered(tasks, tasks.keys().max().copied().unwrap_or(0)),
            });
        }
    }
    let seen = Seen {
        arrays,
        files: names(&folder.scenes())?,
        full: request.room.then(|| full(&camp)).flatten(),
    };
    answer(folder, &seen, &request.wants)
        .map_err(|error| Error::failed("cannot answer").because(error))
}

/// What is said to whoever would write more; nothing where there is room. Other trouble tells by itself what it is.
fn full(camp: &Camp) -> Option<String> {
    match camp.has_room() {
        Err(ClusterError::Full { said, .. }) => Some(said),
        _ => None,
    }
}

fn by_array(tasks: Vec<Task>) -> BTreeMap<String, Shown> {
    let mut arrays = BTreeMap::<String, Shown>::new();
    for task in tasks {
        let stands = match task.state {
            TaskState::Waiting { .. } | TaskState::Held { .. } => Stands::Waits,
            TaskState::Running { .. } | TaskState::Ending => Stands::Runs,
            TaskState::Away { .. } => Stands::Away,
            _ => Stands::Ended,
        };
        let number = task.id.task.unwrap_or(1);
        arrays.entry(task.name).or_default().insert(number, stands);
    }
    arrays
}

/// Tasks in order; those that the queue shows no more have ended.
fn numbered(shown: &Shown, count: u32) -> Vec<SeenTask> {
    let stands = |number: u32| shown.get(&number).copied().unwrap_or(Stands::Ended);
    (1..=count)
        .map(|number| SeenTask(stands(number), 0))
        .collect()
}

fn array(
    folder: &Folder,
    name: &str,
    known: &BTreeSet<&str>,
    shown: Option<&Shown>,
) -> Result<SeenArray, Error> {
    let order = folder.order(name).ok();
    let count = order.as_ref().map_or(0, |order| order.tasks.len());
    let count = u32::try_from(count).unwrap_or(u32::MAX);
    let nothing = Shown::new();
    let mut tasks = numbered(shown.unwrap_or(&nothing), count);
    let place = folder.array(name)?;
    for (file, length) in entries(&place)? {
        let Some((number, kind)) = file.split_once('.') else {
            continue;
        };
        let task = match number.parse::<usize>() {
            Ok(number @ 1..) => tasks.get_mut(number - 1),
            _ => None,
        };
        match (task, kind) {
            (Some(task), "blocks") => task.1 = length,
            (Some(task), "full") if !task.0.is_live() => task.0 = Stands::Full,
            _ => {}
        }
    }
    let order = order.filter(|_| !known.contains(name));
    Ok(SeenArray {
        name: name.to_owned(),
        is_submitted: shown.is_some() || folder.id(name)?.is_some(),
        order,
        tasks,
    })
}

/// What is in a folder, with its length. One that is gone is empty.
fn entries(path: &Path) -> Result<Vec<(String, u64)>, Error> {
    let read = match fs::read_dir(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        read => read.map_err(cannot("read", path))?,
    };
    let mut entries = Vec::new();
    for entry in read {
        let entry = entry.map_err(cannot("read", path))?;
        let length = entry.metadata().map_or(0, |about| about.len());
        if let Ok(name) = entry.file_name().into_string() {
            entries.push((name, length));
        }
    }
    Ok(entries)
}

/// The names in a folder, but for those that are not in their place yet.
fn names(path: &Path) -> Result<Vec<String>, Error> {
    let names = entries(path)?.into_iter().map(|(name, _)| name);
    let whole = names.filter(|name| !name.starts_with('.') && !name.contains(".part."));
    Ok(whole.collect())
}

fn answer(folder: &Folder, seen: &Seen, wants: &[Wants]) -> io::Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    serde_json::to_writer(&mut out, seen)?;
    out.write_all(b"\n")?;
    let mut room = Room {
        bytes: FETCH_BYTES_MAX,
        blocks: FETCH_BLOCKS_MAX,
    };
    let mut end = End::Whole;
    'all: for (place, wants) in (0..).zip(wants) {
        let mut but = wants.but.iter();
        for (task, offset) in (1..).zip(&wants.offsets) {
            let but = but.next().map_or(&[][..], Vec::as_slice);
            let Some(offset) = *offset else { continue };
            let Ok(path) = folder.blocks(&wants.array, task) else {
                continue;
            };
            if send(&path, (offset, but), (place, task), &mut room, &mut out)? == End::More {
                end = End::More;
                break 'all;
            }
        }
    }
    out.write_all(&end.bytes())?;
    out.flush()
}

/// How much may still be sent.
struct Room {
    bytes: u64,
    blocks: u32,
}

/// Sends the whole blocks of a task's file beyond an offset, as far as there is room. Of those that are not wanted only where they
/// end is said: however many there are, whoever asks comes past them.
fn send(
    path: &Path,
    (offset, but): (u64, &[[u32; 4]]),
    (array, task): (u32, u32),
    room: &mut Room,
    out: &mut impl Write,
) -> io::Result<End> {
    // One that has written nothing has no file.
    let Ok(mut file) = File::open(path) else {
        return Ok(End::Whole);
    };
    let length = file.metadata()?.len();
    if length <= offset {
        return Ok(End::Whole);
    }
    file.seek(SeekFrom::Start(offset))?;
    let mut bytes = Vec::new();
    file.take(room.bytes).read_to_end(&mut bytes)?;
    let (mut rest, mut at) = (&bytes[..], offset);
    while let Some(length) = spool::length(rest) {
        if room.blocks == 0 {
            return Ok(End::More);
        }
        let (entry, after) = rest.split_at(length);
        at += length as u64;
        rest = after;
        let entry = match is_one_of(entry, but) {
            true => &[],
            false => entry,
        };
        let sent = u32::try_from(entry.len()).unwrap_or(u32::MAX);
        out.write_all(&Frame::head(array, task, at, sent))?;
        out.write_all(entry)?;
        room.bytes -= entry.len() as u64;
        room.blocks -= 1;
    }
    // What was read ends where the room did.
    Ok(match offset + (bytes.len() as u64) < length {
        true => End::More,
        false => End::Whole,
    })
}

/// Whether an entry holds one of these blocks.
fn is_one_of(entry: &[u8], blocks: &[[u32; 4]]) -> bool {
    // Nothing is read where nothing is asked.
    if blocks.is_empty() {
        return false;
    }
    let Entry::Block(delivery, _) = spool::read(entry) else {
        return false;
    };
    let record = BlockRecord::only(&delivery.record);
    record.is_ok_and(|record| blocks.contains(&edges(record.header.rect)))
}

#[cfg(test)]
mod tests {
    use model::{AttemptId, Epoch, ImageNumber, ImageRef, JobId, Rect};
    use wire::BlockHeader;
    use wire::proto::Delivery;

    use super::*;

    fn rect(number: u32) -> Rect {
        Rect {
            x0: number,
            y0: 0,
            x1: number + 1,
            y1: 1,
        }
    }

    fn entry(number: u32) -> Vec<u8> {
        let header = BlockHeader {
            image: ImageRef {
                job: JobId(1),
                image: ImageNumber(2),
            },
            rect: rect(number),
            attempt: AttemptId {
                epoch: Epoch(3),
                number: 4,
            },
        };
        spool::entry(&Delivery {
            record: header.record(&[1; 32]).unwrap().into(),
            render_us: 17,
            counters: Vec::new(),
        })
    }

    #[test]
    fn whoever_asks_comes_past_more_than_one_answer_holds_of_what_is_not_wanted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("1.blocks");
        let entries: Vec<_> = (0..5).map(entry).collect();
        fs::write(&path, entries.concat()).unwrap();
        let but: Vec<_> = (0..4).map(|number| edges(rect(number))).collect();
        // Room for two blocks at a time, of which the first four are not wanted.
        let bytes = 2 * entries[0].len() as u64 + 10;
        let (mut offset, mut brought, mut asked) = (0, Vec::new(), 0);
        loop {
            let mut room = Room { bytes, blocks: 100 };
            let mut out = Vec::new();
            let end = send(&path, (offset, &but), (0, 1), &mut room, &mut out).unwrap();
            let mut rest = &out[..];
            while let Some((frame, after)) = Frame::read(rest) {
                rest = after;
                assert!(frame.end > offset, "it goes on");
                offset = frame.end;
                brought.extend_from_slice(frame.entry);
            }
            asked += 1;
            assert!(asked < 10, "it ends");
            if end == End::Whole {
                break;
            }
        }
        assert_eq!(brought, entries[4]);
        assert_eq!(offset, entries.concat().len() as u64);
    }
}
