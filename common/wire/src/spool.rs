//! Finished blocks in a file, one after the other: each a length of four bytes, little-endian, and the delivery as it
//! would travel. The record inside bears the checksum.

use prost::Message as _;

use crate::block::{BlockRecord, RECORD_BYTES_MAX};
use crate::proto::Delivery;

/// Bytes of a delivery that is no record.
const BESIDE_MAX: usize = 8 << 10;

/// What stands at the front of some bytes of such a file.
#[derive(Clone, PartialEq, Debug)]
pub enum Entry {
    /// A block, and how many bytes its entry has.
    Block(Box<Delivery>, usize),
    /// An entry of so many bytes that was damaged; others may follow.
    Damaged(usize),
    /// Nothing more that is whole.
    End,
}

/// The entry of a block.
pub fn entry(delivery: &Delivery) -> Vec<u8> {
    let mut bytes = vec![0; 4];
    delivery
        .encode(&mut bytes)
        .expect("a vector grows as far as it must");
    let length = u32::try_from(bytes.len() - 4).expect("a block is at most 32 KiB");
    bytes[..4].copy_from_slice(&length.to_le_bytes());
    bytes
}

/// How many bytes the entry at the front has; `None` where it is not whole, or no entry.
pub fn length(bytes: &[u8]) -> Option<usize> {
    let (head, rest) = bytes.split_first_chunk::<4>()?;
    let length = u32::from_le_bytes(*head) as usize;
    let may_be = (1..=RECORD_BYTES_MAX + BESIDE_MAX).contains(&length);
    (may_be && rest.len() >= length).then_some(4 + length)
}

/// Reads the entry at the front.
pub fn read(bytes: &[u8]) -> Entry {
    let Some(length) = length(bytes) else {
        return Entry::End;
    };
    match Delivery::decode(&bytes[4..length]) {
        Ok(delivery) if BlockRecord::only(&delivery.record).is_ok() => {
            Entry::Block(Box::new(delivery), length)
        }
        _ => Entry::Damaged(length),
    }
}

#[cfg(test)]
mod tests {
    use model::{AttemptId, Epoch, ImageNumber, ImageRef, JobId, Rect};

    use super::*;
    use crate::BlockHeader;

    fn delivery(number: u64) -> Delivery {
        let header = BlockHeader {
            image: ImageRef {
                job: JobId(1),
                image: ImageNumber(2),
            },
            rect: Rect {
                x0: 0,
                y0: 0,
                x1: 1,
                y1: 1,
            },
            attempt: AttemptId {
                epoch: Epoch(3),
                number,
            },
        };
        Delivery {
            record: header.record(&[1; 32]).unwrap().into(),
            render_us: 17,
            counters: Vec::new(),
        }
    }

    #[test]
    fn what_is_written_is_read_and_a_damaged_one_costs_itself_alone() {
        let (first, second) = (entry(&delivery(1)), entry(&delivery(2)));
        let mut file = [first.clone(), second.clone()].concat();
        assert_eq!(
            read(&file),
            Entry::Block(Box::new(delivery(1)), first.len())
        );
        file[40] ^= 1;
        assert_eq!(read(&file), Entry::Damaged(first.len()));
        let rest = &file[first.len()..];
        assert_eq!(
            read(rest),
            Entry::Block(Box::new(delivery(2)), second.len())
        );
        for cut in 0..second.len() {
            assert_eq!(read(&second[..cut]), Entry::End);
        }
        assert_eq!(read(&[0xff; 100]), Entry::End);
    }
}
