//! The program's painter: the crate `render`.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use model::{ImageNumber, Rect, Revision};
use render::{EvalSettings, ImageRenderer, SimdLevel};
use scene::Description;

use super::{Assets, Cancelled, Counters, OpenImage, Painter};

/// Renders with the crate `render` at one SIMD level.
#[derive(Clone, Copy, Debug)]
pub struct RenderPainter {
    level: SimdLevel,
}

impl RenderPainter {
    /// A painter at a level that this machine has. The level changes no pixel.
    pub fn new(level: SimdLevel) -> Self {
        Self { level }
    }
}

impl Painter for RenderPainter {
    fn revision(&self) -> Revision {
        Revision(render::REVISION)
    }

    fn simd_level(&self) -> String {
        self.level.to_string()
    }

    fn open(
        &self,
        description: &Description,
        assets: &Assets,
        image: ImageNumber,
    ) -> Result<Arc<dyn OpenImage>, String> {
        let assets = assets
            .iter()
            .map(|(digest, bytes)| (*digest, bytes.clone()))
            .collect();
        let settings = EvalSettings {
            level: self.level,
            ..EvalSettings::default()
        };
        let renderer = ImageRenderer::new(description, &assets, image, settings)
            .map_err(|error| sentence(&error))?;
        Ok(Arc::new(renderer))
    }
}

impl OpenImage for ImageRenderer {
    fn render_block(
        &self,
        rect: Rect,
        cancel: &AtomicBool,
        pixels: &mut Vec<f32>,
    ) -> Result<Counters, Cancelled> {
        match self.render_block(rect, cancel, pixels) {
            Ok(counts) => Ok(counts.named().to_vec()),
            Err(render::Cancelled) => Err(Cancelled),
        }
    }
}

/// An error and what caused it, in one line.
fn sentence(error: &dyn std::error::Error) -> String {
    let mut line = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        line = format!("{line}: {error}");
        cause = error.source();
    }
    line
}
