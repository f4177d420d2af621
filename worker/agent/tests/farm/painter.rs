//! A painter whose pixels are a function of their place, and which can be held up.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use agent::{Assets, Cancelled, Counters, OpenImage, Painter};
use model::film::CHANNEL_COUNT;
use model::{ImageNumber, Rect, Revision};
use scene::Description;

pub(crate) const REVISION: Revision = Revision(77);

/// Paints [`value`] everywhere.
#[derive(Clone, Default)]
pub(crate) struct Ramp {
    pub(crate) shared: Arc<Shared>,
    pub(crate) foreign: bool,
    /// Panics when it is to render this image.
    pub(crate) panics_at: Option<u32>,
}

#[derive(Default)]
pub(crate) struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// Blocks that may still be rendered; `None`: all.
    allowed: Option<u32>,
    /// How often each block was rendered.
    rendered: BTreeMap<(u32, Rect), u32>,
    /// Bytes of the assets of the images that were opened.
    asset_bytes: usize,
}

impl Ramp {
    /// A painter that stops after so many blocks, until it is released.
    pub(crate) fn held_after(blocks: u32) -> Self {
        let ramp = Self::default();
        ramp.shared.state.lock().unwrap().allowed = Some(blocks);
        ramp
    }

    pub(crate) fn release(&self) {
        self.shared.state.lock().unwrap().allowed = None;
        self.shared.changed.notify_all();
    }

    /// Blocks that were rendered, those rendered again counted each time.
    pub(crate) fn rendered(&self) -> u32 {
        self.shared.state.lock().unwrap().rendered.values().sum()
    }

    pub(crate) fn asset_bytes(&self) -> usize {
        self.shared.state.lock().unwrap().asset_bytes
    }
}

/// The value of a channel at a pixel.
pub(crate) fn value(image: u32, channel: usize, x: u32, y: u32) -> f32 {
    let mixed = (x * 31 + y * 1_009 + image * 65_537) % 4_096;
    f32::from(u16::try_from(mixed).unwrap()) / 4_096.0 + f32::from(u8::try_from(channel).unwrap())
}

/// The pixels of a block.
pub(crate) fn paint(image: u32, rect: Rect, pixels: &mut Vec<f32>) {
    pixels.clear();
    for channel in 0..CHANNEL_COUNT {
        for y in rect.y0..rect.y1 {
            pixels.extend((rect.x0..rect.x1).map(|x| value(image, channel, x, y)));
        }
    }
}

struct RampImage {
    ramp: Ramp,
    image: u32,
}

impl Painter for Ramp {
    fn revision(&self) -> Revision {
        if self.foreign {
            Revision(REVISION.0 + 1)
        } else {
            REVISION
        }
    }

    fn simd_level(&self) -> String {
        "none".to_owned()
    }

    fn open(
        &self,
        _: &Description,
        assets: &Assets,
        image: ImageNumber,
    ) -> Result<Arc<dyn OpenImage>, String> {
        let bytes = assets.values().map(|bytes| bytes.len()).sum();
        self.shared.state.lock().unwrap().asset_bytes = bytes;
        Ok(Arc::new(RampImage {
            ramp: self.clone(),
            image: image.0,
        }))
    }
}

impl OpenImage for RampImage {
    fn render_block(
        &self,
        rect: Rect,
        cancel: &AtomicBool,
        pixels: &mut Vec<f32>,
    ) -> Result<Counters, Cancelled> {
        assert!(self.ramp.panics_at != Some(self.image), "the paint ran out");
        let shared = &self.ramp.shared;
        let mut state = shared.state.lock().unwrap();
        while state.allowed == Some(0) {
            if cancel.load(Ordering::Relaxed) {
                return Err(Cancelled);
            }
            // Cancelling wakes nobody here.
            let wait = Duration::from_millis(5);
            state = shared.changed.wait_timeout(state, wait).unwrap().0;
        }
        state.allowed = state.allowed.map(|blocks| blocks - 1);
        *state.rendered.entry((self.image, rect)).or_default() += 1;
        drop(state);
        paint(self.image, rect, pixels);
        Ok(vec![("pixels", rect.area()), ("blocks", 1)])
    }
}
