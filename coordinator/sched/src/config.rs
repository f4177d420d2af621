//! Every limit of the scheduler, in one value.

use model::{Epoch, Revision, Span};

/// How a scheduler decides; fixed for its life.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Config {
    /// The coordinator's epoch; every attempt of this scheduler carries it.
    pub epoch: Epoch,
    /// Where given, jobs and workers of any other renderer revision are refused.
    /// Where not, all are taken and leases go to workers of the job's revision.
    pub revision: Option<Revision>,
    /// A worker of which nothing is heard for so long is lost, and its attempts with it.
    pub liveness_limit: Span,
    /// An attempt that renders no block for so many times as long as one of its
    /// job's blocks is expected to take is ended…
    pub progress_factor: u64,
    /// …but never sooner than this.
    pub progress_least: Span,
    /// The progress limit of a job of which no block has arrived yet, so that nothing is expected.
    pub progress_unmeasured: Span,
    /// A tile that failed on so many attempts fails its image.
    pub tile_failures_max: u32,
    /// A tile whose worker was lost while rendering it so many times, with no
    /// block stored in between, fails its image: it may be what kills them.
    pub tile_losses_max: u32,
    /// Fewest pixels of a tile where the job leaves the shape to the rule of thesis C.3.2.
    pub min_tile_pixels: u64,
    /// Most tiles of one image, whoever chooses their shape.
    pub max_array_size: u64,
    /// Images of one job that are rendered or encoded at a time.
    pub images_in_flight_max: u32,
    /// What may be asked for.
    pub limits: Limits,
}

/// Sizes beyond which a submission, a worker or a text is refused or cut off.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Limits {
    /// Jobs that are not over.
    pub jobs_max: u32,
    /// Jobs that are over and still remembered; beyond it the oldest is forgotten.
    pub jobs_kept_max: u32,
    /// Images of all jobs together that are remembered, those of jobs that are over included.
    pub images_max: u32,
    /// Pixels of one image's window.
    pub image_pixels_max: u64,
    /// Pixels of one tile.
    pub tile_pixels_max: u64,
    /// Bytes of a job's name.
    pub name_bytes_max: usize,
    /// Bytes kept of the reason of a failure.
    pub reason_bytes_max: usize,
    /// Failed images of one job whose reasons are kept.
    pub failures_kept_max: u32,
    /// Workers known at a time.
    pub workers_max: u32,
    /// Tiles that one worker may hold, whatever credit it asks for.
    pub credit_max: u32,
}

impl Config {
    /// The farm's usual limits, for a coordinator in its `epoch`.
    pub fn new(epoch: Epoch) -> Self {
        Self {
            epoch,
            revision: None,
            liveness_limit: Span::from_secs(4),
            progress_factor: 10,
            progress_least: Span::from_secs(30),
            progress_unmeasured: Span::from_secs(300),
            tile_failures_max: 3,
            tile_losses_max: 10,
            min_tile_pixels: 2_500,
            max_array_size: 75_000,
            images_in_flight_max: 8,
            limits: Limits::default(),
        }
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            jobs_max: 1_000,
            jobs_kept_max: 1_000,
            images_max: 1_000_000,
            image_pixels_max: 1 << 28,
            tile_pixels_max: 1 << 22,
            name_bytes_max: 200,
            reason_bytes_max: 2_000,
            failures_kept_max: 1_000,
            workers_max: 10_000,
            credit_max: 1_024,
        }
    }
}
