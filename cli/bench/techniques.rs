//! What each technique of the tracer gains: the same image without it, and by each method; equal to the bit, and by how much more work.

use std::io::{self, Write};
use std::sync::atomic::AtomicBool;

use model::ImageNumber;
use render::{Counts, EvalSettings, ImageRenderer, Means, Technique};
use serde::Serialize;

use crate::bench::peers::clock;
use crate::bench::peers::rows::{BLOB, FLIGHT, LAYERS, Ours, PLANET, SPHERE, STONES, TERRAIN};
use crate::error::Error;
use crate::load::Scene;
use crate::output::{Report, columns};

/// The scenes of `bench peers`, one of many bodies and one of many layers; `--side` makes them small.
pub(crate) const SCENES: [(&str, Ours); 7] = [
    ("sphere-3", SPHERE),
    ("terrain", TERRAIN),
    ("planet", PLANET),
    ("blob", BLOB),
    ("stones", STONES),
    ("flight", FLIGHT),
    ("layers", LAYERS),
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
    /// The method that this image finds cheapest.
    pub(crate) method: &'static str,
    /// Each technique left out in turn.
    pub(crate) without: Vec<Other>,
    /// By each method in turn.
    pub(crate) by: Vec<Other>,
}

/// The same image in another way.
#[derive(Serialize, Debug)]
pub(crate) struct Other {
    /// The technique that was left out, or the method.
    pub(crate) name: &'static str,
    /// Evaluations over those with all techniques by the cheapest method.
    pub(crate) evaluations: f64,
    /// CPU time over that.
    pub(crate) time: f64,
    /// Whether every value of every pixel is the same.
    pub(crate) is_equal: bool,
}

impl Measured {
    /// Renders a scene with all techniques, then without each, then by each method.
    pub(crate) fn of(name: &'static str, scene: &Scene) -> Result<Self, Error> {
        let (reference, method) = render(scene, None, None)?;
        let other = |name, technique, means| {
            let (image, _) = render(scene, technique, means)?;
            Ok(Other {
                name,
                evaluations: image.counts.evaluations as f64 / reference.counts.evaluations as f64,
                time: image.seconds / reference.seconds,
                is_equal: image.bits == reference.bits,
            })
        };
        let without = Technique::ALL.into_iter();
        let without = without.map(|technique| other(technique.name(), Some(technique), None));
        let without = without.collect::<Result<_, Error>>()?;
        let by = Means::ALL.into_iter();
        let by = by.map(|means| other(means.name(), None, Some(means)));
        let by = by.collect::<Result<_, Error>>()?;
        let counts = &reference.counts;
        Ok(Self {
            scene: name,
            evaluations: counts.evaluations as f64 / (counts.rays + counts.shadow_rays) as f64,
            seconds: reference.seconds,
            method: method.name(),
            without,
            by,
        })
    }

    /// Every other way.
    pub(crate) fn others(&self) -> impl Iterator<Item = &Other> {
        self.without.iter().chain(&self.by)
    }
}

/// An image as it was rendered.
struct Rendered {
    /// The bits of its values.
    bits: Vec<u32>,
    counts: Counts,
    /// CPU seconds.
    seconds: f64,
}

/// Image 0 without a technique, by a method or the one that it finds cheapest; and which that was.
fn render(
    scene: &Scene,
    without: Option<Technique>,
    means: Option<Means>,
) -> Result<(Rendered, Means), Error> {
    let settings = EvalSettings {
        means,
        ..EvalSettings::default()
    };
    let mut taken = Means::Values;
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
            settings,
        )
        .map_err(|error| failed(error.to_string()))?;
        taken = image.means();
        for block in scene.description().film.window.blocks() {
            counts += image
                .render_block(block, &never, &mut block_pixels)
                .map_err(|error| failed(error.to_string()))?;
            bits.extend(block_pixels.iter().map(|value| value.to_bits()));
        }
        Ok(())
    })?;
    let rendered = Rendered {
        bits,
        counts,
        seconds,
    };
    Ok((rendered, taken))
}

impl Report for Techniques {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        for scene in &self.scenes {
            writeln!(
                out,
                "{}, {1}×{1} pixels: {2:.2} evaluations per ray, {3:.1} ms with all techniques, by {4}",
                scene.scene,
                self.side,
                scene.evaluations,
                1e3 * scene.seconds,
                scene.method,
            )?;
            for (title, others) in [("without", &scene.without), ("by", &scene.by)] {
                let mut table = columns([title, "evaluations", "CPU time", "pixels"]);
                for other in others {
                    table.add_row([
                        other.name.to_owned(),
                        format!("{:.2} ×", other.evaluations),
                        format!("{:.2} ×", other.time),
                        if other.is_equal { "equal" } else { "differ" }.to_owned(),
                    ]);
                }
                writeln!(out, "{table}")?;
            }
            writeln!(out)?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut all = self
            .scenes
            .iter()
            .flat_map(|scene| scene.others().map(move |one| (scene.scene, one)));
        all.try_for_each(|(scene, one)| {
            writeln!(out, "{scene} {} {:.2}", one.name, one.evaluations)
        })
    }
}
