//! What makes tracing fast, each by name: for measuring what one gains, and for proving that none changes a pixel.
//!
//! No scene and no setting names them: images are rendered with all of them. [`crate::ImageRenderer::without`] leaves one out.

/// A technique of the tracer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Technique {
    /// Rays that stay close to each other are followed together first.
    Bundles,
    /// Bundles are followed by gradients, too, where that is worth its cost.
    Gradients,
    /// A value's derivative along the ray proves a stretch, where it is worth its cost.
    Tangents,
    /// The range of that derivative on the stretch ahead proves one, where that is worth its cost.
    Stretches,
    /// That range is of the stretch behind, too, and proves both.
    Hindsight,
    /// How far ahead that is follows from how far it spread the last time.
    Bends,
    /// Steps reach beyond what is proven, to where the next one will meet them.
    Foresight,
    /// What of the field is a height or a radius is followed exactly, and only the rest is bounded.
    Growth,
    /// Fine octaves count as a range far from the surface, and as a slope near it.
    Levels,
    /// Far from the surface only the coarse noises are evaluated: Worley and Hart's early exit.
    EarlyExit,
    /// Bounds are tabled by the distance from the eye, where footprints cut octaves off.
    Distances,
    /// What of the field cannot matter to the rays of a few pixels is left out of their program.
    Choices,
    /// Rays are led over cells of the ground that were proven clear up to a height.
    Ground,
    /// Rays that search for long, and those towards the sun, go back to these cells.
    Rounds,
    /// Samples are followed along a Morton curve.
    Curve,
    /// Samples are followed by slices of the shutter.
    Slices,
}

impl Technique {
    /// Every technique.
    pub const ALL: [Self; 16] = [
        Self::Bundles,
        Self::Gradients,
        Self::Tangents,
        Self::Stretches,
        Self::Hindsight,
        Self::Bends,
        Self::Foresight,
        Self::Growth,
        Self::Levels,
        Self::EarlyExit,
        Self::Distances,
        Self::Choices,
        Self::Ground,
        Self::Rounds,
        Self::Curve,
        Self::Slices,
    ];

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bundles => "bundles",
            Self::Gradients => "bundles by gradients",
            Self::Tangents => "tangents",
            Self::Stretches => "stretches ahead",
            Self::Hindsight => "hindsight",
            Self::Bends => "seen bends",
            Self::Foresight => "foresight",
            Self::Growth => "known growth",
            Self::Levels => "levels by value",
            Self::EarlyExit => "early exit",
            Self::Distances => "tables by distance",
            Self::Choices => "simplified programs",
            Self::Ground => "clear ground",
            Self::Rounds => "rounds over the ground",
            Self::Curve => "Morton curve",
            Self::Slices => "shutter slices",
        }
    }

    /// Whether it is used where `without` is left out.
    pub(crate) fn is_used(self, without: Option<Self>) -> bool {
        without != Some(self)
    }
}
