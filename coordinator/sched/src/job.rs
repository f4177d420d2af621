//! A job: its images in order, those in flight, and what was counted.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

use model::rect::GRID_SQUARE;
use model::{ImageNumber, ImageRef, JobId, Span, Timestamp};

use crate::tiling::TileGrid;
use crate::work::Work;
use crate::{
    Config, ImageCounts, ImageFailure, ImageState, ImageView, JobOutcome, JobState, JobView,
    Submission,
};

/// Pixels of a whole block.
const BLOCK_PIXELS: u64 = (GRID_SQUARE * GRID_SQUARE) as u64;

#[derive(Clone, Debug)]
pub(crate) struct Job {
    pub(crate) id: JobId,
    pub(crate) spec: Submission,
    pub(crate) grid: TileGrid,
    pub(crate) outcome: Option<JobOutcome>,
    /// By place in the frame range.
    images: Vec<ImageState>,
    counts: ImageCounts,
    /// Images from this place on have not been begun.
    next: u32,
    /// Images being rendered, by place in the frame range.
    pub(crate) work: BTreeMap<u32, Work>,
    /// Images being encoded.
    encoding: BTreeSet<u32>,
    pub(crate) failures: Vec<ImageFailure>,
    pub(crate) tally: Tally,
}

/// What a job has counted.
#[derive(Clone, Debug)]
pub(crate) struct Tally {
    pub(crate) pixels_done: u64,
    pub(crate) blocks_done: u64,
    pub(crate) blocks_again: u64,
    pub(crate) pixels_again: u64,
    pub(crate) render_time: Span,
    pub(crate) attempts_live: u32,
    pub(crate) attempts_failed: u64,
    pub(crate) attempts_lost: u64,
    pub(crate) submitted: Timestamp,
    pub(crate) started: Option<Timestamp>,
    pub(crate) ended: Option<Timestamp>,
    /// Pixels whose rendering was timed, and for how long.
    timed: (u64, u64),
}

impl Job {
    pub(crate) fn new(id: JobId, spec: Submission, grid: TileGrid, submitted: Timestamp) -> Self {
        let count = spec.frames.count();
        Self {
            id,
            grid,
            outcome: None,
            images: vec![ImageState::Waiting; count as usize],
            counts: ImageCounts {
                waiting: count,
                ..ImageCounts::default()
            },
            next: 0,
            work: BTreeMap::new(),
            encoding: BTreeSet::new(),
            failures: Vec::new(),
            tally: Tally {
                pixels_done: 0,
                blocks_done: 0,
                blocks_again: 0,
                pixels_again: 0,
                render_time: Span(0),
                attempts_live: 0,
                attempts_failed: 0,
                attempts_lost: 0,
                submitted,
                started: None,
                ended: None,
                timed: (0, 0),
            },
            spec,
        }
    }

    pub(crate) fn is_over(&self) -> bool {
        self.outcome.is_some()
    }

    /// The place of an image in the frame range.
    pub(crate) fn place(&self, image: ImageNumber) -> Option<u32> {
        self.spec.frames.index_of(image)
    }

    pub(crate) fn image_ref(&self, place: u32) -> ImageRef {
        let image = self.spec.frames.nth(place);
        ImageRef {
            job: self.id,
            image: image.expect("places are below the number of images"),
        }
    }

    /// An image's state, whatever became of the job.
    pub(crate) fn state(&self, place: u32) -> ImageState {
        self.images[place as usize]
    }

    pub(crate) fn set_state(&mut self, place: u32, state: ImageState) {
        let slot = &mut self.images[place as usize];
        *self.counts.of(*slot) -= 1;
        *self.counts.of(state) += 1;
        *slot = state;
        if state == ImageState::Encoding {
            self.encoding.insert(place);
        } else {
            self.encoding.remove(&place);
        }
    }

    /// Whether a worker could be given a tile.
    pub(crate) fn has_tiles(&self, config: &Config) -> bool {
        !self.is_over() && (self.may_begin(config) || self.work.values().any(Work::has_open))
    }

    /// The next tile in order, as (place of its image, tile); an image is begun where none in flight has one.
    pub(crate) fn take_tile(&mut self, config: &Config) -> Option<(u32, u32)> {
        let open = self
            .work
            .iter_mut()
            .find_map(|(&place, work)| work.take_open().map(|tile| (place, tile)));
        if open.is_some() || !self.may_begin(config) {
            return open;
        }
        let place = self.next;
        self.next += 1;
        self.set_state(place, ImageState::Rendering);
        let work = self.work.entry(place).or_insert(Work::new(self.grid));
        work.take_open().map(|tile| (place, tile))
    }

    fn may_begin(&self, config: &Config) -> bool {
        let in_flight = self.counts.rendering + self.counts.encoding;
        self.next < self.spec.frames.count() && in_flight < config.images_in_flight_max.max(1)
    }

    /// The places of images that are being rendered or encoded.
    pub(crate) fn in_flight(&self) -> Vec<u32> {
        self.work.keys().chain(&self.encoding).copied().collect()
    }

    /// How the job ends, if no image is left to do.
    pub(crate) fn ends(&self) -> Option<JobOutcome> {
        let counts = self.counts;
        if counts.encoded + counts.failed < self.spec.frames.count() {
            None
        } else if counts.failed > 0 {
            Some(JobOutcome::Failed)
        } else {
            Some(JobOutcome::Finished)
        }
    }

    /// Notes why an image failed.
    pub(crate) fn blame(&mut self, place: u32, reason: String, config: &Config) {
        if self.failures.len() < config.limits.failures_kept_max as usize {
            let image = self.image_ref(place).image;
            self.failures.push(ImageFailure {
                image,
                reason: cut(reason, config.limits.reason_bytes_max),
            });
        }
    }

    /// Notes how long one thread took over some pixels.
    pub(crate) fn time(&mut self, pixels: u64, elapsed: Span) {
        let tally = &mut self.tally;
        tally.render_time = Span(tally.render_time.0.saturating_add(elapsed.0));
        tally.timed.0 = tally.timed.0.saturating_add(pixels);
        tally.timed.1 = tally.timed.1.saturating_add(elapsed.0);
    }

    /// How long one thread is expected to take over some pixels: the mean so far.
    pub(crate) fn expected(&self, pixels: u64) -> Option<Span> {
        let (timed, micros) = self.tally.timed;
        let micros = u128::from(micros) * u128::from(pixels) / u128::from(timed.max(1));
        (timed > 0).then(|| Span(u64::try_from(micros).unwrap_or(u64::MAX)))
    }

    /// How long an attempt may take over one block, after so many others at its tile failed.
    ///
    /// Each failure doubles it: a tile may be slower than the mean of its job by
    /// more than the limit allows for, and must not fail for that.
    pub(crate) fn block_limit(&self, config: &Config, failures: u32) -> Span {
        let limit = match self.expected(BLOCK_PIXELS) {
            Some(block) => block
                .times(config.progress_factor)
                .max(config.progress_least),
            None => config.progress_unmeasured,
        };
        limit.times(1 << failures.min(16))
    }

    pub(crate) fn view(&self) -> JobView<'_> {
        let tally = &self.tally;
        let mut images = self.counts;
        if self.outcome == Some(JobOutcome::Cancelled) {
            images.dropped = images.waiting + images.rendering + images.encoding;
            (images.waiting, images.rendering, images.encoding) = (0, 0, 0);
        }
        JobView {
            job: self.id,
            submission: self.spec.submission,
            name: &self.spec.name,
            scene: self.spec.scene,
            revision: self.spec.revision,
            frames: self.spec.frames,
            window: self.spec.window,
            tile_size: self.grid.size(),
            tiles_per_image: u32::try_from(self.grid.count()).unwrap_or(u32::MAX),
            state: self.outcome.map_or(JobState::Running, JobState::Over),
            images,
            pixels_done: tally.pixels_done,
            pixels: self.spec.window.area() * u64::from(self.spec.frames.count()),
            blocks_done: tally.blocks_done,
            blocks_again: tally.blocks_again,
            pixels_again: tally.pixels_again,
            render_time: tally.render_time,
            attempts_live: tally.attempts_live,
            attempts_failed: tally.attempts_failed,
            attempts_lost: tally.attempts_lost,
            submitted: tally.submitted,
            started: tally.started,
            ended: tally.ended,
        }
    }

    pub(crate) fn image_view(&self, place: u32) -> ImageView {
        let pixels = self.spec.window.area();
        let state = match self.state(place) {
            ImageState::Encoded { film } => ImageState::Encoded { film },
            ImageState::Failed => ImageState::Failed,
            _ if self.outcome == Some(JobOutcome::Cancelled) => ImageState::Dropped,
            state => state,
        };
        let pixels_done = match state {
            ImageState::Encoding | ImageState::Encoded { .. } => pixels,
            _ => self.work.get(&place).map_or(0, |work| work.pixels.count()),
        };
        ImageView {
            image: self.image_ref(place).image,
            state,
            pixels_done,
            pixels,
        }
    }
}

impl ImageCounts {
    fn of(&mut self, state: ImageState) -> &mut u32 {
        match state {
            ImageState::Waiting => &mut self.waiting,
            ImageState::Rendering => &mut self.rendering,
            ImageState::Encoding => &mut self.encoding,
            ImageState::Encoded { .. } => &mut self.encoded,
            ImageState::Failed => &mut self.failed,
            ImageState::Dropped => &mut self.dropped,
        }
    }
}

/// The text, or as much of its start as `bytes_max` allows.
fn cut(mut text: String, bytes_max: usize) -> String {
    if text.len() > bytes_max {
        let end = (0..=bytes_max)
            .rev()
            .find(|&end| text.is_char_boundary(end));
        text.truncate(end.unwrap_or(0));
    }
    text
}
