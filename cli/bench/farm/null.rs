//! A renderer that renders nothing: blocks at once, every pixel the same.
//!
//! Its pixels have a revision of their own, so that no coordinator but one that was started for it takes them, that one
//! takes no others, and no frame of it passes for a real one. Such a coordinator runs only over a state folder that
//! [`mark`] made.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

use agent::{Assets, Cancelled, Counters, OpenImage, Painter};
use model::film::CHANNEL_COUNT;
use model::{ImageNumber, Rect, Revision};
use scene::Description;
use tokio::sync::Notify;

use crate::error::Error;

/// The revision of its pixels; the renderer's own count from 1.
pub(crate) const REVISION: Revision = Revision(u32::MAX);

/// The file that says that a state folder is a measurement's.
const MARK: &str = "only-for-measuring";

/// Every value of every pixel.
const VALUE: f32 = 0.5;

/// How often a tile that is held back looks whether it is still wanted: a cancellation wakes nobody.
const LOOK: Duration = Duration::from_millis(20);

/// Makes a state folder a measurement's.
pub(crate) fn mark(state: &Path) -> Result<(), Error> {
    fs::write(state.join(MARK), "flyby bench farm\n")
        .map_err(|error| Error::failed("cannot write into the temporary folder").because(error))
}

/// The revision that a coordinator over a measurement's state folder takes; any other folder is refused.
pub(crate) fn revision_over(state: &Path) -> Result<Revision, Error> {
    match state.join(MARK).is_file() {
        true => Ok(REVISION),
        false => Err(Error::usage(format!(
            "`{}` is no state folder of `flyby bench farm`, so that no coordinator may take its pixels there",
            state.display()
        ))),
    }
}

/// The renderer; clones share what it counts.
#[derive(Clone, Default)]
pub(crate) struct Null {
    told: Arc<Told>,
}

#[derive(Default)]
struct Told {
    first: OnceLock<Instant>,
    /// Woken when that is known.
    begun: Notify,
    /// Whether the first pixel of every image is held back.
    holds: AtomicBool,
}

impl Null {
    /// One that holds the first pixel of every image back, so that none is finished, until it [lets go](Self::let_go).
    pub(crate) fn holding() -> Self {
        let null = Self::default();
        null.told.holds.store(true, Ordering::Relaxed);
        null
    }

    /// Holds nothing back any more.
    pub(crate) fn let_go(&self) {
        self.told.holds.store(false, Ordering::Relaxed);
    }

    /// Waits until it was asked for its first block; answers when that was.
    pub(crate) async fn first(&self) -> Instant {
        loop {
            match self.told.first.get() {
                Some(first) => return *first,
                // Whoever wakes before this waits leaves it a permit.
                None => self.told.begun.notified().await,
            }
        }
    }
}

impl Painter for Null {
    fn revision(&self) -> Revision {
        REVISION
    }

    fn simd_level(&self) -> String {
        "none".to_owned()
    }

    fn open(
        &self,
        _: &Description,
        _: &Assets,
        _: ImageNumber,
    ) -> Result<Arc<dyn OpenImage>, String> {
        Ok(Arc::new(self.clone()))
    }
}

impl OpenImage for Null {
    fn render_block(
        &self,
        rect: Rect,
        cancelled: &AtomicBool,
        pixels: &mut Vec<f32>,
    ) -> Result<Counters, Cancelled> {
        if self.told.first.get().is_none() && self.told.first.set(Instant::now()).is_ok() {
            self.told.begun.notify_one();
        }
        while (rect.x0, rect.y0) == (0, 0) && self.told.holds.load(Ordering::Relaxed) {
            if cancelled.load(Ordering::Relaxed) {
                return Err(Cancelled);
            }
            thread::park_timeout(LOOK);
        }
        pixels.clear();
        let (width, height) = (rect.width() as usize, rect.height() as usize);
        pixels.resize(CHANNEL_COUNT * width * height, VALUE);
        Ok(Counters::new())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_measurement_s_folder_is_taken() {
        let state = tempfile::tempdir().unwrap();
        let refused = revision_over(state.path()).unwrap_err();
        assert!(refused.to_string().contains("bench farm"), "{refused}");
        mark(state.path()).unwrap();
        assert_eq!(revision_over(state.path()).unwrap(), REVISION);
        assert_ne!(REVISION, Revision(render::REVISION));
    }
}
