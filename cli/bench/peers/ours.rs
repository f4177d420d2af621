//! Renders a scene in memory on the calling thread and takes the time.

use std::sync::atomic::AtomicBool;

use model::ImageNumber;
use render::{EvalSettings, ImageRenderer};

use crate::bench::clock::Clock;
use crate::error::Error;
use crate::load::Scene;

/// Renders image 0 block by block; gives the CPU time of this thread, in seconds, the
/// preparation of the image included.
pub(crate) fn render(scene: &Scene) -> Result<f64, Error> {
    let assets = scene.assets();
    let clock = Clock::start();
    let image = ImageRenderer::new(
        scene.description(),
        &assets,
        ImageNumber(0),
        EvalSettings::default(),
    )
    .map_err(|error| Error::failed("cannot render the scene").because(error))?;
    let never = AtomicBool::new(false);
    let mut pixels = Vec::new();
    for block in scene.description().film.window.blocks() {
        image
            .render_block(block, &never, &mut pixels)
            .map_err(|error| Error::failed("cannot render the scene").because(error))?;
    }
    Ok(clock.seconds())
}
