//! From messages into `model`'s types, and back.
//!
//! What comes out of here needs no further check: rectangles are not empty and
//! lie inside the limits, digests have 32 bytes, texts are short and printable.

use model::rect::SIDE_MAX;
use model::{
    AttemptId, Begun, Digest, Epoch, FrameRange, ImageNumber, ImageRef, JobId, Lease, Rect,
    Running, Span, SubmissionId, WorkerId,
};

use crate::proto;

/// Why a message says nothing that can be acted upon; each is a sentence with the field's name.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum BadMessage {
    /// A needed field is not there.
    #[error("the message lacks `{0}`")]
    Missing(&'static str),
    /// Bytes of a fixed length have another.
    #[error("`{field}` has {have} bytes; it must have {need}")]
    Length {
        /// The field.
        field: &'static str,
        /// Bytes there are.
        have: usize,
        /// Bytes there must be.
        need: usize,
    },
    /// A rectangle is empty, inside out, or larger than an image may be.
    #[error(
        "{x0},{y0} to {x1},{y1} is no rectangle of pixels (at most {SIDE_MAX} along each side)"
    )]
    Rect {
        /// First column.
        x0: u32,
        /// First row.
        y0: u32,
        /// One past the last column.
        x1: u32,
        /// One past the last row.
        y1: u32,
    },
    /// A range of frames is none.
    #[error("{0}")]
    Frames(model::frames::BadFrameRange),
    /// A text is too long, empty, or not printable.
    #[error("`{field}` must be {min} to {max} bytes without control characters")]
    Text {
        /// The field.
        field: &'static str,
        /// Fewest bytes.
        min: usize,
        /// Most bytes.
        max: usize,
    },
    /// A number leaves its range.
    #[error("`{field}` is {have}; it must be {min} to {max}")]
    Number {
        /// The field.
        field: &'static str,
        /// The number.
        have: u64,
        /// Smallest.
        min: u64,
        /// Largest.
        max: u64,
    },
    /// A list is too long.
    #[error("`{field}` has {have} entries; at most {max} are taken")]
    TooMany {
        /// The field.
        field: &'static str,
        /// Entries there are.
        have: usize,
        /// Most entries.
        max: usize,
    },
}

/// A field that must be there.
pub fn require<T>(field: Option<T>, name: &'static str) -> Result<T, BadMessage> {
    field.ok_or(BadMessage::Missing(name))
}

/// A text of `min` to `max` bytes that can be shown on one line.
pub fn text(
    text: String,
    field: &'static str,
    length: core::ops::RangeInclusive<usize>,
) -> Result<String, BadMessage> {
    if length.contains(&text.len()) && !text.chars().any(char::is_control) {
        Ok(text)
    } else {
        Err(BadMessage::Text {
            field,
            min: *length.start(),
            max: *length.end(),
        })
    }
}

/// A sentence from the other side, for a log: cut to `max` bytes, control characters as spaces.
pub fn sentence(text: &str, max: usize) -> String {
    let mut cut = String::new();
    for character in text.chars() {
        let character = if character.is_control() {
            ' '
        } else {
            character
        };
        if cut.len() + character.len_utf8() > max {
            break;
        }
        cut.push(character);
    }
    cut
}

/// A number inside its range.
pub fn number<T: Copy + PartialOrd + Into<u64>>(
    have: T,
    field: &'static str,
    range: core::ops::RangeInclusive<T>,
) -> Result<T, BadMessage> {
    if range.contains(&have) {
        Ok(have)
    } else {
        Err(BadMessage::Number {
            field,
            have: have.into(),
            min: (*range.start()).into(),
            max: (*range.end()).into(),
        })
    }
}

/// A list of at most `max` entries, each converted.
pub fn list<From, To: TryFrom<From, Error = BadMessage>>(
    entries: Vec<From>,
    field: &'static str,
    max: usize,
) -> Result<Vec<To>, BadMessage> {
    if entries.len() > max {
        return Err(BadMessage::TooMany {
            field,
            have: entries.len(),
            max,
        });
    }
    entries.into_iter().map(To::try_from).collect()
}

/// A digest's bytes.
pub fn digest(bytes: &[u8], field: &'static str) -> Result<Digest, BadMessage> {
    fixed(bytes, field).map(Digest)
}

/// A submission id's bytes.
pub fn submission(bytes: &[u8]) -> Result<SubmissionId, BadMessage> {
    fixed(bytes, "submission").map(|bytes| SubmissionId(u128::from_be_bytes(bytes)))
}

/// A submission id as a message holds it.
pub fn submission_bytes(id: SubmissionId) -> Vec<u8> {
    id.0.to_be_bytes().to_vec()
}

fn fixed<const N: usize>(bytes: &[u8], field: &'static str) -> Result<[u8; N], BadMessage> {
    bytes.try_into().map_err(|_| BadMessage::Length {
        field,
        have: bytes.len(),
        need: N,
    })
}

impl From<Rect> for proto::Rect {
    fn from(rect: Rect) -> Self {
        let Rect { x0, y0, x1, y1 } = rect;
        Self { x0, y0, x1, y1 }
    }
}

impl TryFrom<proto::Rect> for Rect {
    type Error = BadMessage;

    fn try_from(rect: proto::Rect) -> Result<Self, BadMessage> {
        let proto::Rect { x0, y0, x1, y1 } = rect;
        if x0 < x1 && y0 < y1 && x1 <= SIDE_MAX && y1 <= SIDE_MAX {
            Ok(Self { x0, y0, x1, y1 })
        } else {
            Err(BadMessage::Rect { x0, y0, x1, y1 })
        }
    }
}

impl From<AttemptId> for proto::Attempt {
    fn from(attempt: AttemptId) -> Self {
        Self {
            epoch: attempt.epoch.0,
            number: attempt.number,
        }
    }
}

impl TryFrom<proto::Attempt> for AttemptId {
    type Error = BadMessage;

    fn try_from(attempt: proto::Attempt) -> Result<Self, BadMessage> {
        Ok(Self {
            epoch: Epoch(attempt.epoch),
            number: number(attempt.number, "attempt.number", 1..=u64::MAX)?,
        })
    }
}

impl From<WorkerId> for proto::WorkerIdentity {
    fn from(worker: WorkerId) -> Self {
        Self {
            id: worker.id,
            incarnation: worker.incarnation,
        }
    }
}

impl From<proto::WorkerIdentity> for WorkerId {
    fn from(worker: proto::WorkerIdentity) -> Self {
        Self {
            id: worker.id,
            incarnation: worker.incarnation,
        }
    }
}

impl From<FrameRange> for proto::FrameRange {
    fn from(frames: FrameRange) -> Self {
        Self {
            start: frames.start(),
            end: frames.end(),
            step: frames.step(),
        }
    }
}

impl TryFrom<proto::FrameRange> for FrameRange {
    type Error = BadMessage;

    fn try_from(frames: proto::FrameRange) -> Result<Self, BadMessage> {
        Self::new(frames.start, frames.end, frames.step).map_err(BadMessage::Frames)
    }
}

/// Most blocks that a lease may name: those of the largest tile.
const WANTED_MAX: usize = 1 << 20;

impl From<Lease> for proto::Lease {
    fn from(lease: Lease) -> Self {
        Self {
            attempt: Some(lease.attempt.into()),
            job: lease.image.job.0,
            image: lease.image.image.0,
            tile: Some(lease.tile.into()),
            blocks: lease.wanted.into_iter().map(Into::into).collect(),
            description_digest: lease.scene.0.to_vec(),
            expected_us: lease.expected.0,
        }
    }
}

impl TryFrom<proto::Lease> for Lease {
    type Error = BadMessage;

    fn try_from(lease: proto::Lease) -> Result<Self, BadMessage> {
        Ok(Self {
            attempt: require(lease.attempt, "lease.attempt")?.try_into()?,
            image: ImageRef {
                job: JobId(lease.job),
                image: ImageNumber(lease.image),
            },
            scene: digest(&lease.description_digest, "lease.description_digest")?,
            tile: require(lease.tile, "lease.tile")?.try_into()?,
            wanted: list(lease.blocks, "lease.blocks", WANTED_MAX)?,
            expected: Span(lease.expected_us),
        })
    }
}

impl From<Begun> for proto::Begun {
    fn from(begun: Begun) -> Self {
        Self {
            attempt: Some(begun.attempt.into()),
            job: begun.image.job.0,
            image: begun.image.image.0,
            tile: Some(begun.tile.into()),
        }
    }
}

impl TryFrom<proto::Begun> for Begun {
    type Error = BadMessage;

    fn try_from(begun: proto::Begun) -> Result<Self, BadMessage> {
        Ok(Self {
            attempt: require(begun.attempt, "begun.attempt")?.try_into()?,
            image: ImageRef {
                job: JobId(begun.job),
                image: ImageNumber(begun.image),
            },
            tile: require(begun.tile, "begun.tile")?.try_into()?,
        })
    }
}

impl From<Running> for proto::Running {
    fn from(running: Running) -> Self {
        Self {
            attempt: Some(running.attempt.into()),
            blocks: running.blocks,
        }
    }
}

impl TryFrom<proto::Running> for Running {
    type Error = BadMessage;

    fn try_from(running: proto::Running) -> Result<Self, BadMessage> {
        Ok(Self {
            attempt: require(running.attempt, "running.attempt")?.try_into()?,
            blocks: running.blocks,
        })
    }
}

/// A counter's name and value, both checked.
pub fn counter(counter: proto::Counter) -> Result<(String, u64), BadMessage> {
    let printable = |byte: u8| matches!(byte, b'a'..=b'z' | b'0'..=b'9' | b'_');
    if (1..=64).contains(&counter.name.len()) && counter.name.bytes().all(printable) {
        Ok((counter.name, counter.value))
    } else {
        Err(BadMessage::Text {
            field: "counter.name",
            min: 1,
            max: 64,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_and_back() {
        let rect = Rect {
            x0: 1,
            y0: 2,
            x1: 3,
            y1: SIDE_MAX,
        };
        assert_eq!(Rect::try_from(proto::Rect::from(rect)), Ok(rect));
        let frames = FrameRange::new(4, 30, 7).unwrap();
        assert_eq!(
            FrameRange::try_from(proto::FrameRange::from(frames)),
            Ok(frames)
        );
        let id = SubmissionId(u128::MAX - 5);
        assert_eq!(submission(&submission_bytes(id)), Ok(id));
    }

    #[test]
    fn nonsense_is_named() {
        let said = |result: Result<String, BadMessage>| result.unwrap_err().to_string();
        for (x0, x1, y1) in [(3, 3, 4), (4, 3, 4), (0, SIDE_MAX + 1, 4), (0, 1, 0)] {
            let rect = proto::Rect { x0, y0: 0, x1, y1 };
            assert!(matches!(Rect::try_from(rect), Err(BadMessage::Rect { .. })));
        }
        assert_eq!(
            digest(&[0; 31], "digest").unwrap_err().to_string(),
            "`digest` has 31 bytes; it must have 32"
        );
        assert_eq!(
            said(text("a\nb".into(), "name", 1..=200)),
            "`name` must be 1 to 200 bytes without control characters"
        );
        assert!(AttemptId::try_from(proto::Attempt::default()).is_err());
        assert!(list::<_, AttemptId>(vec![proto::Attempt::default(); 3], "held", 2).is_err());
        assert!(
            counter(proto::Counter {
                name: "Rays".into(),
                value: 1
            })
            .is_err()
        );
    }

    #[test]
    fn sentences_are_cut_between_characters() {
        assert_eq!(sentence("aé\nb", 3), "aé");
        assert_eq!(sentence("a\nb", 30), "a b");
    }
}
