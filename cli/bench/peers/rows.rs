//! What is compared, with the budget of each row.

/// One row of the table.
pub(crate) struct Row {
    /// What it is called.
    pub(crate) name: &'static str,
    /// What is timed on either side.
    pub(crate) what: What,
    /// Which ratio is wanted.
    pub(crate) budget: Budget,
}

/// Which ratio of times is wanted.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Budget {
    /// The peer's time over ours, at least.
    Faster(f64),
    /// Our time over the peer's, at most.
    Costs {
        /// More misses the budget.
        most: f64,
        /// What to aim for beyond it.
        aim: Option<f64>,
    },
    /// None: the peer's time over ours, for orientation.
    Open,
}

/// What is timed on either side.
#[derive(Clone, Copy, Debug)]
pub(crate) enum What {
    /// A scene of ours and POV-Ray's twin of it with these declarations.
    PovRay {
        ours: Ours,
        twin: &'static str,
        declarations: &'static [&'static str],
    },
    /// A scene of ours and the same surface in fidget's language.
    Fidget { ours: Ours, shape: Shape },
    /// A scene of ours and another one, which ours is to cost little more than.
    Scenes {
        ours: Ours,
        base: Ours,
        called: &'static str,
    },
    /// Points per second of gradient noise: ours and a library's.
    Noise { octaves: u32, library: Library },
    /// Our noise with its gradient and without.
    Gradient { octaves: u32 },
    /// A row of the thesis's tables: reduced AA with interval optimisation and speculative sphere tracing.
    Guaranteed { thesis: usize },
    /// The same row's surface rendered whole, and speculative sphere tracing of as many rays.
    Tracer { thesis: usize },
    /// An evaluation in reduced AA and one at a point, on the surface of a row of the thesis's tables.
    Reduced { thesis: usize },
    /// A program that this command cannot run: who wants our side alone gets it in rays per second.
    Absent {
        ours: Option<Ours>,
        program: &'static str,
        why: &'static str,
    },
}

/// A scene of ours, embedded so that the installed program needs no other file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ours {
    /// The scene file.
    pub(crate) text: &'static str,
    /// What is changed in it, as `--set` takes it.
    pub(crate) set: &'static [&'static str],
}

/// A surface in fidget's language.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Shape {
    /// Eq. (5.11) with so many layers.
    Sphere { layers: usize },
    /// The twelve soft balls.
    Blob,
}

/// A library of noise.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Library {
    /// The crate fastnoise-lite, f32.
    FastNoiseLite,
    /// The crate noise, f64.
    Noise,
    /// The crate libnoise, f64.
    LibNoise,
}

/// Twin files are ours: comments at their heads say what they hold.
const HYPERSPHERE_POV: &str = include_str!("../../../benches/peers/hypersphere.pov");
const TERRAIN_POV: &str = include_str!("../../../benches/peers/terrain.pov");
const BLOB_POV: &str = include_str!("../../../benches/peers/blob.pov");

/// Three layers of noise on a sphere.
pub(crate) const SPHERE: Ours = Ours::new(include_str!("../../../scenes/pov-sphere.toml"));

const SPHERE_5: Ours = SPHERE.set(&[
    "surface.field=\"length(p) - 1 + 0.3*noise(4*p) + 0.15*noise(8*p) + 0.05*noise(16*p) \
     + 0.025*noise(32*p) + 0.0125*noise(64*p)\"",
]);

/// Ridges from low altitude.
pub(crate) const TERRAIN: Ours = Ours::new(include_str!("../../../scenes/pov-terrain.toml"));

/// The same with shadows.
pub(crate) const TERRAIN_SHADOWS: Ours = TERRAIN.set(&["sun.shadows=true"]);

/// A union of bodies, each with a noise of its own.
pub(crate) const STONES: Ours = Ours::new(include_str!("../../../scenes/stones.toml"));

/// A sphere of five layers of noise.
pub(crate) const LAYERS: Ours = Ours::new(include_str!("../../../scenes/figures/fig-7-08.toml"));

/// The terrain on a planet.
pub(crate) const PLANET: Ours = Ours::new(include_str!("../../../benches/peers/planet.toml"));

/// The same from a moving camera, with many rays per pixel.
pub(crate) const FLIGHT: Ours = Ours::new(include_str!("../../../benches/peers/flight.toml"));

/// Twelve soft balls.
pub(crate) const BLOB: Ours = Ours::new(include_str!("../../../benches/peers/blob.toml"));

impl Ours {
    const fn new(text: &'static str) -> Self {
        Self { text, set: &[] }
    }

    const fn set(self, set: &'static [&'static str]) -> Self {
        Self { set, ..self }
    }
}

const fn most(most: f64) -> Budget {
    Budget::Costs { most, aim: None }
}

const fn povray(
    name: &'static str,
    ours: Ours,
    twin: &'static str,
    declarations: &'static [&'static str],
    faster: f64,
) -> Row {
    Row {
        name,
        what: What::PovRay {
            ours,
            twin,
            declarations,
        },
        budget: Budget::Faster(faster),
    }
}

const fn fidget(name: &'static str, ours: Ours, shape: Shape, faster: f64) -> Row {
    Row {
        name,
        what: What::Fidget { ours, shape },
        budget: Budget::Faster(faster),
    }
}

const fn noise(name: &'static str, octaves: u32, library: Library, budget: Budget) -> Row {
    Row {
        name,
        what: What::Noise { octaves, library },
        budget,
    }
}

const fn row(name: &'static str, what: What, budget: Budget) -> Row {
    Row { name, what, budget }
}

/// Every row. POV-Ray is *tuned* where its slope bound is just above the slopes it met, which
/// proves nothing, and *proven* where it is derived; ours are always proven. Where a budget stands in
/// milliseconds, its ratio is the one to the peer's time measured beside it when it was set.
pub(crate) const ROWS: &[Row] = &[
    povray(
        "sphere-3-proven",
        SPHERE,
        HYPERSPHERE_POV,
        &["LAYERS=3", "SAFE=1"],
        100.0,
    ),
    povray(
        "sphere-3-tuned",
        SPHERE,
        HYPERSPHERE_POV,
        &["LAYERS=3"],
        64.0,
    ),
    // 32 ms against 7.1 s.
    fidget(
        "sphere-3-fidget",
        SPHERE,
        Shape::Sphere { layers: 3 },
        222.0,
    ),
    // 60 ms against 7.12 s.
    povray(
        "sphere-5-proven",
        SPHERE_5,
        HYPERSPHERE_POV,
        &["LAYERS=5", "SAFE=1"],
        119.0,
    ),
    // 60 ms against 3.53 s.
    povray(
        "sphere-5-tuned",
        SPHERE_5,
        HYPERSPHERE_POV,
        &["LAYERS=5"],
        59.0,
    ),
    row(
        "sphere-5-fidget",
        What::Fidget {
            ours: SPHERE_5,
            shape: Shape::Sphere { layers: 5 },
        },
        Budget::Open,
    ),
    // 60 ms against 30.0 s.
    povray("terrain-proven", TERRAIN, TERRAIN_POV, &["SAFE=1"], 500.0),
    // 60 ms against 3.14 s.
    povray("terrain-tuned", TERRAIN, TERRAIN_POV, &[], 52.0),
    // 120 ms against 6.69 s: shadows at most double the time.
    povray(
        "terrain-shadows",
        TERRAIN_SHADOWS,
        TERRAIN_POV,
        &["SHADOWS=1"],
        56.0,
    ),
    row(
        "shadows",
        What::Scenes {
            ours: TERRAIN_SHADOWS,
            base: TERRAIN,
            called: "the terrain without shadows",
        },
        most(2.0),
    ),
    row(
        "terrain-embree",
        What::Absent {
            ours: Some(TERRAIN),
            program: "Embree",
            why: "it is a C++ library, and this program links none and holds no unsafe code; \
                  the budget is 4.0 M rays/s",
        },
        Budget::Open,
    ),
    // 8 ms against 5.35 s.
    povray("blob-tuned", BLOB, BLOB_POV, &[], 669.0),
    // 8 ms against 0.18 s.
    povray("blob-native", BLOB, BLOB_POV, &["NATIVE=1"], 22.0),
    // 8 ms against 71 ms.
    fidget("blob-fidget", BLOB, Shape::Blob, 8.9),
    noise(
        "noise-1-fastnoise-lite",
        1,
        Library::FastNoiseLite,
        Budget::Open,
    ),
    noise(
        "noise-8-fastnoise-lite",
        8,
        Library::FastNoiseLite,
        Budget::Open,
    ),
    noise("noise-1-noise", 1, Library::Noise, Budget::Open),
    noise("noise-8-noise", 8, Library::Noise, Budget::Open),
    noise(
        "noise-1-libnoise",
        1,
        Library::LibNoise,
        Budget::Faster(3.0),
    ),
    noise(
        "noise-8-libnoise",
        8,
        Library::LibNoise,
        Budget::Faster(3.0),
    ),
    row(
        "noise-fastnoise2",
        What::Absent {
            ours: None,
            program: "FastNoise2",
            why: "it is a C++ library, and this program links none and holds no unsafe code; where \
                  the budget was set, 1.3 times its 451 M/s (1 octave) and 53.6 M/s (8) at AVX-512, 223 and 28.3 at AVX2",
        },
        Budget::Open,
    ),
    row("gradient-1", What::Gradient { octaves: 1 }, most(1.6)),
    row("gradient-8", What::Gradient { octaves: 8 }, most(1.6)),
    row(
        "guaranteed-gradient",
        What::Guaranteed { thesis: 0 },
        most(1.0),
    ),
    row(
        "guaranteed-sparse",
        What::Guaranteed { thesis: 1 },
        most(1.0),
    ),
    row(
        "guaranteed-cellular",
        What::Guaranteed { thesis: 2 },
        most(1.0),
    ),
    row("tracer-gradient", What::Tracer { thesis: 0 }, most(1.0)),
    row("tracer-sparse", What::Tracer { thesis: 1 }, most(1.0)),
    row("tracer-cellular", What::Tracer { thesis: 2 }, most(1.0)),
    row("reduced-affine", What::Reduced { thesis: 0 }, most(3.0)),
    row(
        "many-rays",
        What::Scenes {
            ours: FLIGHT,
            base: TERRAIN.set(&["film.resolution=\"256x256\""]),
            called: "one ray per pixel, camera at rest",
        },
        Budget::Costs {
            most: 25.0,
            aim: Some(12.0),
        },
    ),
    row(
        "planet",
        What::Scenes {
            ours: PLANET,
            base: TERRAIN,
            called: "the terrain on a plane",
        },
        most(1.5),
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_names_of_their_own_and_budgets() {
        for (index, row) in ROWS.iter().enumerate() {
            assert!(ROWS[..index].iter().all(|other| other.name != row.name));
            let wanted = match row.budget {
                Budget::Faster(times) => times,
                Budget::Costs { most, aim } => {
                    assert!(aim.is_none_or(|aim| aim < most));
                    most
                }
                Budget::Open => 1.0,
            };
            assert!(wanted > 0.0 && !row.name.is_empty());
            if let What::PovRay { twin, .. } = row.what {
                assert!(twin.contains("isosurface"));
            }
        }
    }
}
