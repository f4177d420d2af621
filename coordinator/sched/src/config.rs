//! Every limit of the scheduler, in one value.

use alloc::collections::BTreeSet;
use alloc::string::String;

use model::{Epoch, Revision, Span};

/// How a scheduler decides; fixed for its life.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Config {
    /// The coordinator's epoch; every attempt of this scheduler carries it.
    pub epoch: Epoch,
    /// Where given, workers of any other renderer revision are refused, but for those that a job which
    /// is not over is pinned to: one that was submitted before an upgrade goes on with the workers of then.
    /// Leases go to workers of the job's revision in any case.
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
    /// Fewest pixels of a tile where the job leaves the shape to the rule of thesis C.3.2; and
    /// most pixels of one that is to take some time, while it is not known how long pixels take.
    pub min_tile_pixels: u64,
    /// How long one thread should take over a tile where the job asks for tiles by time and says no more.
    pub tile_time: Span,
    /// A tile by time takes no more than this fraction, one of so many parts, of the time that the
    /// farm still needs for what waits, so that workers finish together; 0 is no such limit.
    pub tail_parts: u64,
    /// A tile is leased a second time, or called back for another worker, only where
    /// that is expected to gain so much.
    pub tail_gain: TailGain,
    /// A worker that failed so many tiles of a job in a row at which others then succeeded is set aside for that job…
    pub faults_max: u32,
    /// …and for the farm where it is set aside for so many jobs.
    pub jobs_aside_max: u32,
    /// …for so long.
    pub aside: Span,
    /// A worker whose time is limited gets a tile of a job of which nothing is measured only where it has so much left.
    pub unmeasured_needs: Span,
    /// Of a million tiles, so many are rendered once more by another worker, and compared. 0 is none.
    pub verify: u32,
    /// After so long in which nobody could do it, a tile is not rendered once more after all.
    pub verify_wait: Span,
    /// Most tiles of one image, whoever chooses their shape.
    pub max_array_size: u64,
    /// Images of one job that are rendered or encoded at a time, at most…
    pub images_in_flight_max: u32,
    /// …and at most as many as have so many pixels together, but for the first [`IMAGES_IN_FLIGHT_LEAST`].
    pub pixels_in_flight_max: u64,
    /// What may be asked for.
    pub limits: Limits,
}

/// What makes it worth touching tiles that are leased already.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TailGain {
    /// For calling back a lease that was not started; absent: never.
    pub call_back: Option<Span>,
    /// For leasing a tile that runs a second time; absent: never.
    pub second: Option<Span>,
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
    /// Workers that were expelled and are remembered; beyond it the one that was first is forgotten.
    pub expelled_max: usize,
    /// Tiles that one worker may hold, whatever credit it asks for.
    pub credit_max: u32,
    /// Largest share of the farm that a job may have.
    pub share_max: u32,
    /// Jobs that one job may wait for.
    pub after_max: u32,
    /// Labels that a job may ask for or a worker may have.
    pub labels_max: u32,
    /// Bytes of a label.
    pub label_bytes_max: usize,
}

/// Images of one job that may be in flight however large they are.
pub const IMAGES_IN_FLIGHT_LEAST: u32 = 8;

impl Config {
    /// How many images of so many pixels each may be rendered or encoded at a time: small ones are
    /// a tile each, and many workers want many of them.
    pub fn images_in_flight(&self, pixels: u64) -> u32 {
        let together = self.pixels_in_flight_max / pixels.max(1);
        let together = u32::try_from(together).unwrap_or(u32::MAX);
        let most = self.images_in_flight_max.max(1);
        together.max(IMAGES_IN_FLIGHT_LEAST).min(most)
    }

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
            tile_time: Span::from_secs(1),
            tail_parts: 4,
            tail_gain: TailGain {
                call_back: Some(Span::from_millis(500)),
                second: Some(Span::from_millis(500)),
            },
            faults_max: 3,
            jobs_aside_max: 2,
            aside: Span::from_secs(300),
            unmeasured_needs: Span::from_secs(30),
            verify: 0,
            verify_wait: Span::from_secs(300),
            max_array_size: 75_000,
            images_in_flight_max: 256,
            pixels_in_flight_max: 1 << 26,
            limits: Limits::default(),
        }
    }
}

impl Limits {
    /// Whether there may be such labels.
    pub(crate) fn allow_labels(&self, labels: &BTreeSet<String>) -> bool {
        labels.len() <= self.labels_max as usize
            && labels
                .iter()
                .all(|label| label.len() <= self.label_bytes_max)
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
            expelled_max: 1_000,
            credit_max: 1_024,
            share_max: 1_000,
            after_max: 16,
            labels_max: 16,
            label_bytes_max: 64,
        }
    }
}
