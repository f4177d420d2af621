//! What coordinators did, by their own logs: which block was acknowledged when, and which was leased when.
//!
//! A coordinator logs every effect as it performs it, in the order in which the scheduler decided. So whether
//! it leases what it has acknowledged can be read there without any room for what was on its way meanwhile.

use std::collections::{BTreeMap, BTreeSet};

use model::Rect;

use crate::harness::Process;

/// With this option a coordinator's log says what is read here.
pub(super) const LOG: [&str; 2] = ["--log", "info,server::shell::hold=debug"];

/// An attempt's epoch and number.
type Attempt = [u64; 2];

/// The job and number of an image.
type Image = [u64; 2];

/// The corners of a block.
type Block = [u64; 4];

/// All that the coordinators of one farm have logged.
#[derive(Default)]
pub(super) struct Witness {
    /// Who delivered a block first.
    stored: BTreeMap<(Image, Block), Attempt>,
    /// The images of attempts that have delivered something.
    images: BTreeMap<Attempt, Image>,
    delivered: BTreeSet<(Attempt, Block)>,
    acknowledged: BTreeSet<(Image, Block)>,
    /// How much of the present coordinator's log is read.
    read: usize,
    /// Tiles that were leased.
    pub(super) leases: u64,
    /// Those of them that workers gave back.
    pub(super) given_back: u64,
    /// Blocks that were delivered by another attempt than the first: each was leased to both before it was there.
    pub(super) rendered_twice: u64,
}

impl Witness {
    /// Reads on in the log of the present coordinator.
    #[track_caller]
    pub(super) fn read(&mut self, coordinator: &Process) {
        let log = coordinator.stderr();
        let new = &log[self.read..];
        // Of a line that is being written the rest is read later, or never where its writer was killed.
        let whole = new.rfind('\n').map_or(0, |end| end + 1);
        self.read += whole;
        for line in new[..whole].lines() {
            if let Some((_, event)) = line.split_once(": event event=BlockStored ") {
                self.stored(event);
            } else if let Some((_, ack)) = line.split_once(": effect effect=Ack ") {
                self.acknowledged(ack);
            } else if let Some((_, lease)) = line.split_once(": effect effect=Lease ") {
                self.leased(lease);
            } else if let Some((_, event)) = line.split_once(": event event=GivenBack ") {
                self.given_back += event.matches("AttemptId").count() as u64;
            }
        }
    }

    /// From now on another coordinator is read.
    pub(super) fn another(&mut self) {
        self.read = 0;
    }

    /// How many blocks were acknowledged.
    pub(super) fn acknowledged_count(&self) -> usize {
        self.acknowledged.len()
    }

    fn stored(&mut self, event: &str) {
        let attempt = numbers(event, "attempt: AttemptId ");
        let image = numbers(event, "image: ImageRef ");
        let block = numbers(event, "rect: Rect ");
        self.images.insert(attempt, image);
        // One that is sent again was not rendered again.
        if self.delivered.insert((attempt, block)) {
            let first = *self.stored.entry((image, block)).or_insert(attempt);
            self.rendered_twice += u64::from(first != attempt);
        }
    }

    fn acknowledged(&mut self, ack: &str) {
        let attempt = numbers(ack, "attempt: AttemptId ");
        let image = self.images[&attempt];
        self.acknowledged
            .insert((image, numbers(ack, "rect: Rect ")));
    }

    #[track_caller]
    fn leased(&mut self, lease: &str) {
        self.leases += 1;
        let image = numbers(lease, "image: ImageRef ");
        let tile = numbers(lease, "tile: Rect ");
        let (_, wanted) = lease.split_once("wanted: [").unwrap();
        let wanted: Vec<Block> = wanted
            .split("Rect ")
            .skip(1)
            .map(|rect| numbers(rect, ""))
            .collect();
        let all = || {
            let [x0, y0, x1, y1] = tile.map(|side| u32::try_from(side).unwrap());
            let blocks = Rect { x0, y0, x1, y1 }.blocks();
            blocks
                .map(|Rect { x0, y0, x1, y1 }| [x0, y0, x1, y1].map(u64::from))
                .collect()
        };
        let wanted = if wanted.is_empty() { all() } else { wanted };
        for block in wanted {
            assert!(
                !self.acknowledged.contains(&(image, block)),
                "block {block:?} of image {image:?} was acknowledged, and leased again: {lease}"
            );
        }
    }
}

/// The first numbers behind a word.
#[track_caller]
fn numbers<const COUNT: usize>(text: &str, word: &str) -> [u64; COUNT] {
    let behind = text.find(word).map(|start| &text[start + word.len()..]);
    let behind = behind.unwrap_or_else(|| panic!("no `{word}` in {text}"));
    let words = behind.split(|letter: char| !letter.is_ascii_alphanumeric());
    let numbers: Vec<u64> = words
        .filter_map(|word| word.parse().ok())
        .take(COUNT)
        .collect();
    numbers
        .try_into()
        .unwrap_or_else(|_| panic!("no {COUNT} numbers behind `{word}` in {text}"))
}
