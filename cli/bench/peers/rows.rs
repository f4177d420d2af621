//! What is compared, with the budget of each row: how many times faster than the peer we want to be.

/// One row of the table.
pub(crate) struct Row {
    /// What it is called.
    pub(crate) name: &'static str,
    /// Our scene.
    pub(crate) scene: &'static Twin,
    /// What is changed in it, as `--set` takes it.
    pub(crate) set: &'static [&'static str],
    /// Against whom.
    pub(crate) peer: Peer,
    /// The least ratio of times wanted: the peer's over ours.
    pub(crate) budget: f64,
}

/// A scene of ours and the peer's, embedded so that the installed program needs no other file.
pub(crate) struct Twin {
    pub(crate) ours: &'static str,
    pub(crate) povray: &'static str,
}

/// How the peer renders its scene.
pub(crate) enum Peer {
    /// POV-Ray with these declarations.
    PovRay(&'static [&'static str]),
    /// Rays that cost less together: our own scene with one ray per pixel, whose time for as many
    /// rays is the peer's.
    OneRay {
        /// N of the N × N rays of our side.
        rays: u32,
    },
    /// A program that this command cannot run.
    Absent(&'static str),
}

const SPHERE: Twin = Twin {
    ours: include_str!("../../../scenes/pov-sphere.toml"),
    povray: include_str!("../../../benches/peers/hypersphere.pov"),
};

const TERRAIN: Twin = Twin {
    ours: include_str!("../../../scenes/pov-terrain.toml"),
    povray: include_str!("../../../benches/peers/terrain.pov"),
};

const BLOB: Twin = Twin {
    ours: include_str!("../../../benches/peers/blob.toml"),
    povray: include_str!("../../../benches/peers/blob.pov"),
};

const FIVE_LAYERS: &str = "surface.field=\"length(p) - 1 + 0.3*noise(4*p) + 0.15*noise(8*p) + 0.05*noise(16*p) \
                           + 0.025*noise(32*p) + 0.0125*noise(64*p)\"";

/// Every row. A peer is *tuned* where its slope bound is just above the slopes it met, which
/// proves nothing, and *proven* where it is derived; ours are always proven.
pub(crate) const ROWS: &[Row] = &[
    Row {
        name: "sphere-3-proven",
        scene: &SPHERE,
        set: &[],
        peer: Peer::PovRay(&["LAYERS=3", "SAFE=1"]),
        budget: 100.0,
    },
    Row {
        name: "sphere-3-tuned",
        scene: &SPHERE,
        set: &[],
        peer: Peer::PovRay(&["LAYERS=3"]),
        budget: 64.0,
    },
    Row {
        name: "sphere-5-proven",
        scene: &SPHERE,
        set: &[FIVE_LAYERS],
        peer: Peer::PovRay(&["LAYERS=5", "SAFE=1"]),
        // 60 ms against 7.12 s.
        budget: 119.0,
    },
    Row {
        name: "sphere-5-tuned",
        scene: &SPHERE,
        set: &[FIVE_LAYERS],
        peer: Peer::PovRay(&["LAYERS=5"]),
        // 60 ms against 3.53 s.
        budget: 59.0,
    },
    Row {
        name: "terrain-proven",
        scene: &TERRAIN,
        set: &[],
        peer: Peer::PovRay(&["SAFE=1"]),
        // 60 ms against 30.0 s.
        budget: 500.0,
    },
    Row {
        name: "terrain-tuned",
        scene: &TERRAIN,
        set: &[],
        peer: Peer::PovRay(&[]),
        // 60 ms against 3.14 s.
        budget: 52.0,
    },
    Row {
        name: "terrain-shadows",
        scene: &TERRAIN,
        set: &["sun.shadows=true"],
        peer: Peer::PovRay(&["SHADOWS=1"]),
        // 120 ms against 6.69 s: shadows at most double the time.
        budget: 56.0,
    },
    Row {
        name: "blob-tuned",
        scene: &BLOB,
        set: &[],
        peer: Peer::PovRay(&[]),
        // 8 ms against 5.35 s.
        budget: 669.0,
    },
    Row {
        name: "blob-native",
        scene: &BLOB,
        set: &[],
        peer: Peer::PovRay(&["NATIVE=1"]),
        // 8 ms against 0.18 s.
        budget: 22.0,
    },
    Row {
        name: "many-rays",
        scene: &TERRAIN,
        set: &["sampling.filter_order=4", "film.resolution=\"128x128\""],
        // 100 rays in the time of 25.
        peer: Peer::OneRay { rays: 10 },
        budget: 4.0,
    },
    Row {
        name: "terrain-embree",
        scene: &TERRAIN,
        set: &[],
        peer: Peer::Absent("Embree on the terrain's mesh"),
        budget: 0.8,
    },
    Row {
        name: "noise-fastnoise2",
        scene: &SPHERE,
        set: &[],
        peer: Peer::Absent("FastNoise2, a library of points and not of pictures"),
        budget: 1.3,
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_names_of_their_own_and_budgets() {
        for (index, row) in ROWS.iter().enumerate() {
            assert!(row.budget > 0.0 && !row.name.is_empty());
            assert!(ROWS[..index].iter().all(|other| other.name != row.name));
            assert!(row.scene.povray.contains("isosurface"));
        }
    }
}
