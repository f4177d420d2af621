//! Why something is not taken, each as a value with its sentence.

use core::fmt;

use model::{ImageNumber, JobId, Revision};

/// What to do with a block that a worker sent.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Verdict {
    /// Write it, make it durable, then feed [`crate::Event::BlockStored`].
    Accept,
    /// Its pixels are durable already: feed [`crate::Event::BlockStored`] without writing.
    AlreadyDone,
    /// Tell the worker so; nothing else.
    Refuse(BlockRefusal),
}

/// Why a block counts for nothing. None of them is worth sending the block again.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BlockRefusal {
    /// The attempt is not live.
    AttemptDead,
    /// The attempt belongs to another worker.
    NotYours,
    /// The attempt is for another image.
    OtherImage,
    /// The rectangle is not a block of the attempt's tile.
    NotABlock,
}

impl fmt::Display for BlockRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::AttemptDead => {
                "the attempt is no longer live: its tile is done, given away or not wanted"
            }
            Self::NotYours => "the attempt belongs to another worker",
            Self::OtherImage => "the attempt is for another image",
            Self::NotABlock => "the rectangle is not a block of the tile that was leased",
        })
    }
}

impl core::error::Error for BlockRefusal {}

/// Why a worker is not taken.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum WorkerRefusal {
    /// Its renderer makes other pixels.
    WrongRevision {
        /// The worker's.
        theirs: Revision,
        /// The one that is wanted.
        wanted: Revision,
    },
    /// As many workers as there may be are here already.
    TooMany {
        /// How many that is.
        max: u32,
    },
    /// It says that it has no render thread.
    NoThreads,
    /// It has too many labels, or one that is too long.
    TooManyLabels {
        /// Most labels there may be.
        labels_max: u32,
        /// Most bytes of a label.
        bytes_max: usize,
    },
}

impl WorkerRefusal {
    /// Whether the same worker may be taken later.
    pub fn is_retryable(self) -> bool {
        matches!(self, Self::TooMany { .. })
    }
}

impl fmt::Display for WorkerRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WrongRevision { theirs, wanted } => write!(
                f,
                "the worker renders with revision {theirs}, this farm with revision {wanted}: \
                 start a worker of the coordinator's version"
            ),
            Self::TooMany { max } => write!(
                f,
                "the farm has its {max} workers already; try again when one has left"
            ),
            Self::NoThreads => f.write_str("a worker needs at least one render thread"),
            Self::TooManyLabels {
                labels_max,
                bytes_max,
            } => write!(
                f,
                "a worker can have at most {labels_max} labels of at most {bytes_max} bytes each"
            ),
        }
    }
}

impl core::error::Error for WorkerRefusal {}

/// Why a submission is not taken.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SubmitRefusal {
    /// The submission id was used for another job.
    SubmissionReused,
    /// As many jobs as there may be are waiting.
    TooManyJobs {
        /// How many that is.
        max: u32,
    },
    /// The images of all jobs together would be too many.
    TooManyImages {
        /// Images that the job asks for.
        asked: u32,
        /// Images that there is room for.
        left: u32,
    },
    /// The window holds no pixel.
    EmptyWindow,
    /// The window ends beyond the largest image.
    WindowOutside {
        /// Most pixels along a side.
        side_max: u32,
    },
    /// The window has too many pixels.
    WindowTooLarge {
        /// Pixels asked for.
        pixels: u64,
        /// Most there may be.
        max: u64,
    },
    /// The tiles have no pixel.
    EmptyTile,
    /// The tiles have too many pixels each.
    TileTooLarge {
        /// Pixels asked for.
        pixels: u64,
        /// Most there may be.
        max: u64,
    },
    /// An image would be cut into too many tiles.
    TooManyTiles {
        /// Tiles of one image.
        tiles: u64,
        /// Most there may be.
        max: u64,
    },
    /// A job that this one is to begin after is not known.
    UnknownJob {
        /// Which.
        job: JobId,
    },
    /// The job is to begin after too many others.
    TooManyAfter {
        /// Most there may be.
        max: u32,
    },
    /// The share is 0 or too large.
    ShareOutside {
        /// The largest.
        max: u32,
    },
    /// The job asks for too many labels, or for one that is too long.
    TooManyLabels {
        /// Most labels there may be.
        labels_max: u32,
        /// Most bytes of a label.
        bytes_max: usize,
    },
    /// Jobs ask for too many different things of workers.
    TooManyKinds {
        /// How many there may be at a time.
        max: u32,
    },
    /// The name is too long.
    NameTooLong {
        /// Most bytes there may be.
        bytes_max: usize,
    },
}

impl SubmitRefusal {
    /// Whether the same submission may be taken later.
    pub fn is_retryable(self) -> bool {
        matches!(
            self,
            Self::TooManyJobs { .. } | Self::TooManyImages { .. } | Self::TooManyKinds { .. }
        )
    }
}

impl fmt::Display for SubmitRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SubmissionReused => {
                f.write_str("the submission id was used for another job; draw a new one")
            }
            Self::TooManyJobs { max } => write!(
                f,
                "{max} jobs are waiting, which is the most there may be; try again when one is over"
            ),
            Self::TooManyImages { asked, left } => write!(
                f,
                "the job asks for {asked} images and there is room for {left}; ask for fewer"
            ),
            Self::EmptyWindow => f.write_str("the window to render holds no pixel"),
            Self::WindowOutside { side_max } => write!(
                f,
                "the window ends beyond the largest image, {side_max} pixels along a side"
            ),
            Self::WindowTooLarge { pixels, max } => write!(
                f,
                "an image of {pixels} pixels is too large; at most {max} are taken"
            ),
            Self::EmptyTile => f.write_str("a tile needs at least one column and one row"),
            Self::TileTooLarge { pixels, max } => write!(
                f,
                "a tile of {pixels} pixels is too large; at most {max} are taken"
            ),
            Self::TooManyTiles { tiles, max } => write!(
                f,
                "an image would be cut into {tiles} tiles, at most {max} are taken; ask for larger tiles"
            ),
            Self::UnknownJob { job } => {
                write!(f, "there is no job {job} that this one could begin after")
            }
            Self::TooManyAfter { max } => {
                write!(f, "a job can begin after at most {max} others")
            }
            Self::ShareOutside { max } => write!(f, "a job's share is a number from 1 to {max}"),
            Self::TooManyLabels {
                labels_max,
                bytes_max,
            } => write!(
                f,
                "a job can ask for at most {labels_max} labels of at most {bytes_max} bytes each"
            ),
            Self::TooManyKinds { max } => write!(
                f,
                "jobs ask for {max} different things of workers, which is the most there may be; \
                 ask for what another job asks for, or try again when one is forgotten"
            ),
            Self::NameTooLong { bytes_max } => {
                write!(f, "the job's name is longer than {bytes_max} bytes")
            }
        }
    }
}

impl core::error::Error for SubmitRefusal {}

/// Why a command is not followed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CommandRefusal {
    /// There is no such job.
    UnknownJob,
    /// The job is over.
    JobOver,
    /// The job was cancelled: its scene and scratch files are gone.
    JobCancelled,
    /// No image of the job has failed.
    NothingFailed,
    /// The job has no such image.
    UnknownImage {
        /// Which.
        image: ImageNumber,
    },
    /// Another job waits for this one to be finished.
    WaitedFor {
        /// Which.
        by: JobId,
    },
    /// The share is 0 or too large.
    ShareOutside {
        /// The largest.
        max: u32,
    },
    /// As many jobs as there may be are waiting.
    TooManyJobs {
        /// How many that is.
        max: u32,
    },
}

impl fmt::Display for CommandRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownJob => f.write_str("there is no such job"),
            Self::JobOver => f.write_str("the job is over"),
            Self::JobCancelled => f.write_str("the job was cancelled: submit it again"),
            Self::NothingFailed => f.write_str("no frame of the job has failed"),
            Self::UnknownImage { image } => write!(f, "the job has no frame {image}"),
            Self::WaitedFor { by } => {
                write!(f, "job {by} waits for this one: cancel it first")
            }
            Self::ShareOutside { max } => write!(f, "a job's share is a number from 1 to {max}"),
            Self::TooManyJobs { max } => write!(
                f,
                "{max} jobs are waiting, which is the most there may be; try again when one is over"
            ),
        }
    }
}

impl core::error::Error for CommandRefusal {}
