//! Images opened for rendering, shared by the threads and bounded in number.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use model::{Digest, ImageNumber};

use crate::painter::{OpenImage, Painter};
use crate::scenes::Scene;

/// Opens images; each once, as long as it is not pushed out by others.
pub(crate) struct Images {
    painter: Arc<dyn Painter>,
    images_max: usize,
    /// The most recently used last.
    open: Mutex<Vec<Entry>>,
}

type Key = (Digest, ImageNumber);
type Opened = Result<Arc<dyn OpenImage>, String>;

struct Entry {
    key: Key,
    image: Arc<OnceLock<Opened>>,
}

impl Images {
    /// Keeps at most so many images open beside those in use.
    pub(crate) fn new(painter: Arc<dyn Painter>, images_max: usize) -> Self {
        Self {
            painter,
            images_max: images_max.max(1),
            open: Mutex::new(Vec::new()),
        }
    }

    /// An image of a scene. Threads that want the same one wait for the first to open it.
    pub(crate) fn open(&self, scene: &Scene, image: ImageNumber) -> Opened {
        let key = (scene.digest, image);
        let slot = self.slot(key);
        let opened = slot.get_or_init(|| {
            said(|| self.painter.open(&scene.description, &scene.assets, image)).unwrap_or_else(Err)
        });
        if opened.is_err() {
            self.entries().retain(|entry| entry.key != key);
        }
        opened.clone()
    }

    fn slot(&self, key: Key) -> Arc<OnceLock<Opened>> {
        let mut open = self.entries();
        let entry = match open.iter().position(|entry| entry.key == key) {
            Some(place) => open.remove(place),
            None => Entry {
                key,
                image: Arc::default(),
            },
        };
        let image = entry.image.clone();
        open.push(entry);
        let excess = open.len().saturating_sub(self.images_max);
        open.drain(..excess);
        image
    }

    fn entries(&self) -> std::sync::MutexGuard<'_, Vec<Entry>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Runs rendering code; a panic becomes a sentence.
pub(crate) fn said<T>(render: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(render)).map_err(|panic| {
        let text = panic
            .downcast_ref::<&str>()
            .map(|text| (*text).to_owned())
            .or_else(|| panic.downcast_ref::<String>().cloned())
            .unwrap_or_default();
        format!("a mistake in the renderer stopped it: {text}")
    })
}
