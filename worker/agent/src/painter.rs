//! The door to rendering: what turns a scene and an image's number into pixels.

mod real;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use model::{Digest, ImageNumber, Rect, Revision};
use scene::Description;

pub use real::RenderPainter;

/// The bytes of a scene's assets, by digest; each was compared with it.
pub type Assets = BTreeMap<Digest, Arc<[u8]>>;

/// What was counted while a block was rendered: names of `a`-`z`, `0`-`9` and `_`, at most 32.
pub type Counters = Vec<(&'static str, u64)>;

/// Rendering was stopped because nobody wants the block any more.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Cancelled;

/// What turns a scene and an image's number into pixels; the program uses `render`, tests may
/// use another.
pub trait Painter: Send + Sync + 'static {
    /// The revision of its pixels: two revisions make different ones.
    fn revision(&self) -> Revision;

    /// Which SIMD level it uses, for people. It changes no pixel.
    fn simd_level(&self) -> String;

    /// Makes an image ready to be rendered. Fails with a sentence for the user.
    fn open(
        &self,
        description: &Description,
        assets: &Assets,
        image: ImageNumber,
    ) -> Result<Arc<dyn OpenImage>, String>;
}

/// One image, ready to be rendered by many threads.
pub trait OpenImage: Send + Sync {
    /// Renders one block: `pixels` is emptied, then holds for each channel of the film, each
    /// row, each column, a finite `f32`.
    ///
    /// Once `cancel` is true it may stop at any moment.
    fn render_block(
        &self,
        rect: Rect,
        cancel: &AtomicBool,
        pixels: &mut Vec<f32>,
    ) -> Result<Counters, Cancelled>;
}
