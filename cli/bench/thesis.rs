//! The experiment of thesis §5.2.3 and §5.4.3, and what the thesis found.
//!
//! What is cast is fixed in `scenes/bench`: camera, bounds and fields in a scene file each, ε, η and the λ_N in
//! `thesis.toml`. Each ray is searched between its ends on the bounding sphere, and averages are over the rays that meet it.

use field::Program;
use scene::description::{Bound, Projection};
use scene::{Description, Overrides, Source};
use serde::Deserialize;

/// `scenes/bench/thesis.toml`.
#[derive(Deserialize, Debug)]
#[serde(deny_unknown_fields)]
pub(crate) struct Experiment {
    /// ε, metres.
    pub(crate) epsilon: f64,
    /// η of thesis §5.2.2.
    pub(crate) overshoot: f64,
    /// In the order of the tables.
    #[serde(rename = "noise")]
    pub(crate) noises: Vec<Noise>,
}

/// A noise under eq. (5.11).
#[derive(Deserialize, Debug)]
#[serde(deny_unknown_fields)]
pub(crate) struct Noise {
    /// What `--noise` calls it.
    pub(crate) name: String,
    /// Its scene file, beside the list.
    scene: String,
    /// The λ_N that sphere tracing is given, the thesis's first.
    pub(crate) lambda: Vec<f64>,
    /// How its values are normalised, and which λ_N is a bound.
    pub(crate) normalisation: String,
    /// Whether its lattice's cells say how steep it is.
    #[serde(default)]
    pub(crate) cells: bool,
}

/// The experiment, embedded so that the installed program needs no other file.
const EXPERIMENT: &str = include_str!("../../scenes/bench/thesis.toml");

/// Its scenes.
const SCENES: [(&str, &str); 3] = [
    (
        "gradient.toml",
        include_str!("../../scenes/bench/gradient.toml"),
    ),
    (
        "sparse.toml",
        include_str!("../../scenes/bench/sparse.toml"),
    ),
    (
        "cellular.toml",
        include_str!("../../scenes/bench/cellular.toml"),
    ),
];

/// The names of the noises, for `--noise`.
pub(crate) const NAMES: [&str; 3] = ["gradient", "sparse", "cellular"];

impl Experiment {
    /// The one of the repository.
    pub(crate) fn embedded() -> Result<Self, String> {
        toml::from_str(EXPERIMENT).map_err(|error| error.to_string())
    }
}

impl Noise {
    /// Its surface and camera.
    pub(crate) fn setting(&self) -> Result<Setting, String> {
        let (name, text) = SCENES
            .into_iter()
            .find(|(name, _)| *name == self.scene)
            .ok_or_else(|| format!("there is no scene `{}`", self.scene))?;
        let source = Source {
            name: name.to_owned(),
            text: text.to_owned(),
        };
        let folder = std::path::Path::new(".");
        let loaded = scene::parse(source, &self.name, folder, &Overrides::default())
            .map_err(|error| error.to_string())?;
        Setting::new(&loaded.description, field(text))
    }

    /// What the thesis found.
    pub(crate) fn found(&self) -> Option<&'static Found> {
        FOUND.iter().find(|found| found.noise == self.name)
    }
}

/// The field's expression in the text of a scene, for people.
fn field(text: &str) -> String {
    let line = text.lines().find_map(|line| line.strip_prefix("field = "));
    line.unwrap_or_default().trim_matches('"').to_owned()
}

/// What rays are cast at, and from where.
pub(crate) struct Setting {
    /// The field.
    pub(crate) program: Program,
    /// Its expression, for people.
    pub(crate) field: String,
    /// Where it can be: ‖x‖ is at most this, metres.
    pub(crate) radius: f64,
    /// The eye, and the directions in which the image extends, as long as the image is wide.
    eye: [f64; 3],
    forward: [f64; 3],
    across: [f64; 3],
    up: [f64; 3],
}

impl Setting {
    fn new(scene: &Description, field: String) -> Result<Self, String> {
        let surface = &scene.surface;
        let time = field::Interval::point(0.0);
        let program = Program::compile(&surface.graph, &[surface.field], time)
            .map_err(|error| error.to_string())?;
        let Bound::Shell { outer, .. } = surface.bound else {
            return Err("its bound is no shell".to_owned());
        };
        let Projection::Orthographic { width } = &scene.camera.projection else {
            return Err("its rays are not parallel".to_owned());
        };
        let pose = scene.camera.pose(0.0);
        let wide = |v: [f64; 3]| v.map(|part| part * width.at(0.0));
        Ok(Self {
            program,
            field,
            radius: outer,
            eye: pose.eye,
            forward: pose.forward,
            across: wide(pose.right),
            up: wide(pose.up),
        })
    }

    /// Origin and direction of the ray through a place of the image, from −½ to ½ to the right and up.
    pub(crate) fn ray(&self, [x, y]: [f64; 2]) -> ([f64; 3], [f64; 3]) {
        let origin = [0, 1, 2].map(|k| self.eye[k] + x * self.across[k] + y * self.up[k]);
        (origin, self.forward)
    }
}

/// Eq. (5.12): λ = 1 + 3.2 λ_N.
pub(crate) fn lipschitz(noise: f64) -> f64 {
    1.0 + 3.2 * noise
}

/// A row of tables 5.1 to 5.5.
#[derive(Debug)]
pub(crate) struct Found {
    noise: &'static str,
    /// Table 5.1: steps of sphere tracing, of speculative sphere tracing, and steps taken back.
    pub(crate) steps: [f64; 3],
    /// Tables 5.2 to 5.4: evaluations of IA, standard AA, reduced AA, and reduced AA with interval optimisation.
    pub(crate) evaluations: [f64; 4],
    /// The same, seconds.
    pub(crate) seconds: [f64; 4],
    /// Table 5.1: seconds of sphere tracing and of speculative sphere tracing.
    pub(crate) tracing: [f64; 2],
}

/// The thesis's numbers.
const FOUND: [Found; 3] = [
    Found {
        noise: "gradient",
        steps: [78.19, 55.37, 0.78],
        evaluations: [116.57, 61.69, 61.69, 46.39],
        seconds: [455.0, 2441.0, 403.0, 304.0],
        tracing: [86.0, 60.0],
    },
    Found {
        noise: "sparse",
        steps: [77.71, 54.27, 0.71],
        evaluations: [87.65, 47.99, 47.99, 30.92],
        seconds: [1606.0, 2287.0, 780.0, 478.0],
        tracing: [823.0, 577.0],
    },
    Found {
        noise: "cellular",
        steps: [30.77, 26.51, 4.05],
        evaluations: [45.80, 34.16, 42.48, 30.03],
        seconds: [1851.0, 10257.0, 1876.0, 1441.0],
        tracing: [607.0, 525.0],
    },
];
