//! What each technique of the tracer gains: the same image without it, equal to the bit, and by how much more work.

use std::io::{self, Write};
use std::sync::atomic::AtomicBool;

use model::ImageNumber;
use render::{Counts, EvalSettings, ImageRenderer, Technique};
use serde::Serialize;

use crate::bench::peers::clock;
use crate::bench::peers::rows::{BLOB, FLIGHT, Ours, PLANET, SPHERE, TERRAIN};
use crate::error::Error;
use crate::load::Scene;
use crate::output::{Report, columns};

/// The scenes of `bench peers`; `--side` makes them small.
pub(crate) const SCENES: [(&str, Ours); 5] = [
    ("sphere-3", SPHERE),
    ("terrain", TERRAIN),
    ("planet", PLANET),
    ("blob", BLOB),
    ("flight", FLIGHT),
];

/// `bench techniques`.
#[derive(Serialize, Debug)]
pub(crate) struct Techniques {
    /// Pixels along a side.
    pub(crate) side: u32,
    /// The scenes.
    pub(crate) scenes: Vec<Measured>,
}

/// One scene.
#[derive(Serialize, Debug)]
pub(crate) struct Measured {
    /// Its name.
    pub(crate) scene: &'static str,
    /// Evaluations per ray with all techniques.
    pub(crate) evaluations: f64,
    /// CPU seconds with all of them.
    pub(crate) seconds: f64,
    /// Each left out in turn.
    pub(crate) without: Vec<Without>,
}

/// A technique that was left out.
#[derive(Serialize, Debug)]
pub(crate) struct Without {
    /// Its name.
    pub(crate) technique: &'static str,
    /// Evaluations without it over those with all.
    pub(crate) evaluations: f64,
    /// CPU time without it over that with all.
    pub(crate) time: f64,
    /// Whether every value of every pixel is the same.
    pub(crate) is_equal: bool,
}

impl Measured {
    /// Renders a scene with all techniques, then without each.
    pub(crate) fn of(name: &'static str, scene: &Scene) -> Result<Self, Error> {
        let (pixels, counts, seconds) = render(scene, None)?;
        let mut without = Vec::new();
        for technique in Technique::ALL {
            let (other, more, longer) = render(scene, Some(technique))?;
            without.push(Without {
                technique: technique.name(),
                evaluations: more.evaluations as f64 / counts.evaluations as f64,
                time: longer / seconds,
                is_equal: pixels == other,
            });
        }
        Ok(Self {
            scene: name,
            evaluations: counts.evaluations as f64 / (counts.rays + counts.shadow_rays) as f64,
            seconds,
            without,
        })
    }
}

/// The bits of image 0's values, what was counted, and CPU seconds.
fn render(scene: &Scene, without: Option<Technique>) -> Result<(Vec<u32>, Counts, f64), Error> {
    let failed = |error: String| Error::failed("cannot render the scene").because(error);
    let assets = scene.assets();
    let never = AtomicBool::new(false);
    let (mut bits, mut counts) = (Vec::new(), Counts::default());
    let mut block_pixels = Vec::new();
    let seconds = clock::seconds(|| {
        bits.clear();
        counts = Counts::default();
        let image = ImageRenderer::without(
            without,
            scene.description(),
            &assets,
            ImageNumber(0),
            EvalSettings::default(),
        )
        .map_err(|error| failed(error.to_string()))?;
        for block in scene.description().film.window.blocks() {
            counts += image
                .render_block(block, &never, &mut block_pixels)
                .map_err(|error| failed(error.to_string()))?;
            bits.extend(block_pixels.iter().map(|value| value.to_bits()));
        }
        Ok(())
    })?;
    Ok((bits, counts, seconds))
}

impl Report for Techniques {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        for scene in &self.scenes {
            writeln!(
                out,
                "{}, {1}×{1} pixels: {2:.2} evaluations per ray, {3:.1} ms with all techniques",
                scene.scene,
                self.side,
                scene.evaluations,
                1e3 * scene.seconds
            )?;
            let mut table = columns(["without", "evaluations", "CPU time", "pixels"]);
            for without in &scene.without {
                table.add_row([
                    without.technique.to_owned(),
                    format!("{:.2} ×", without.evaluations),
                    format!("{:.2} ×", without.time),
                    if without.is_equal { "equal" } else { "differ" }.to_owned(),
                ]);
            }
            writeln!(out, "{table}\n")?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut all = self
            .scenes
            .iter()
            .flat_map(|scene| scene.without.iter().map(move |one| (scene.scene, one)));
        all.try_for_each(|(scene, one)| {
            writeln!(out, "{scene} {} {:.2}", one.technique, one.evaluations)
        })
    }
}
