//! Renders a scene in memory on the calling thread and takes the time.

use std::fs;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use model::ImageNumber;
use render::{EvalSettings, ImageRenderer};

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

/// This thread's CPU time where the system tells it, else the time of the wall.
struct Clock {
    started: Instant,
    cpu: Option<u64>,
}

impl Clock {
    fn start() -> Self {
        Self {
            cpu: cpu_nanoseconds(),
            started: Instant::now(),
        }
    }

    fn seconds(&self) -> f64 {
        let cpu = self.cpu.zip(cpu_nanoseconds());
        match cpu {
            Some((start, end)) if end > start => (end - start) as f64 * 1e-9,
            _ => self.started.elapsed().as_secs_f64(),
        }
    }
}

/// Nanoseconds that this thread has been on a processor, as Linux counts them.
fn cpu_nanoseconds() -> Option<u64> {
    let text = fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split_whitespace().next()?.parse().ok()
}
