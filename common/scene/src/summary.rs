//! What a scene holds, in numbers, for whoever asks `flyby scene show`.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::bytes::NotWritable;
use crate::description::{Bound, Description, Path, Projection, Seed, Sky};
use crate::{digest_of, show};

/// A scene in numbers. Lengths are metres, instants seconds; its fields never change their names.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Summary {
    /// What the scene calls itself.
    pub name: String,
    /// Digest of its canonical bytes, hexadecimal.
    pub digest: String,
    /// How many canonical bytes it has.
    pub bytes: usize,
    /// From which its random numbers start.
    pub key: u32,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// The part that is rendered: x0, y0, x1, y1.
    pub window: [u32; 4],
    /// How many images it has.
    pub images: u32,
    /// Images per second.
    pub fps: f64,
    /// How long all images take.
    pub seconds: f64,
    /// How long the shutter stays open.
    pub shutter_seconds: f64,
    /// Rays of one pixel, N × N.
    pub rays_per_pixel: u32,
    /// Order of the B-spline filter.
    pub filter_order: u32,
    /// The camera in a sentence.
    pub camera: String,
    /// The seed in a sentence.
    pub seed: String,
    /// Where the surface can be, in a sentence.
    pub bound: String,
    /// The surface's field, shortened.
    pub field: String,
    /// Nodes of the graph.
    pub nodes: usize,
    /// How often each operation occurs, by name.
    pub operations: BTreeMap<&'static str, usize>,
    /// How many layers the material has.
    pub layers: usize,
    /// The sky's kind.
    pub sky: &'static str,
    /// Files that the scene names.
    pub assets: Vec<AssetSummary>,
}

/// A file that a scene names.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct AssetSummary {
    /// Its path as the scene gives it.
    pub name: String,
    /// Digest of its bytes, hexadecimal.
    pub digest: String,
    /// Its size.
    pub bytes: u64,
}

/// A scene in numbers.
///
/// # Errors
///
/// If the scene is not valid: it has no bytes then, and no digest.
pub fn describe(scene: &Description) -> Result<Summary, NotWritable> {
    let bytes = scene.to_bytes()?;
    let scene = scene.clone().canonical();
    let film = &scene.film;
    let window = film.window;
    let surface = &scene.surface;
    let mut operations = BTreeMap::new();
    for node in surface.graph.nodes() {
        *operations.entry(node.op.signature().name).or_insert(0) += 1;
    }
    Ok(Summary {
        digest: digest_of(&bytes).to_string(),
        bytes: bytes.len(),
        key: scene.key,
        resolution: [film.resolution.width, film.resolution.height],
        window: [window.x0, window.y0, window.x1, window.y1],
        images: film.images,
        fps: film.fps,
        seconds: f64::from(film.images) / film.fps,
        shutter_seconds: film.shutter,
        rays_per_pixel: scene.sampling.rays * scene.sampling.rays,
        filter_order: scene.sampling.filter_order,
        camera: camera(&scene),
        seed: match surface.seed {
            Seed::Plane => "the plane z = 0".into(),
            Seed::Sphere { radius } => format!("a sphere of {radius} m"),
        },
        bound: bound(surface.bound),
        field: show::node(&surface.graph, surface.field, 200),
        nodes: surface.graph.nodes().len(),
        operations,
        layers: surface.material.layers.len(),
        sky: match scene.sky {
            Sky::Plain { .. } => "plain",
            Sky::Air { clouds: None, .. } => "air",
            Sky::Air { .. } => "air with clouds",
        },
        assets: scene
            .assets
            .iter()
            .map(|asset| AssetSummary {
                name: asset.name.clone(),
                digest: asset.digest.to_string(),
                bytes: asset.bytes,
            })
            .collect(),
        name: scene.name,
    })
}

fn camera(scene: &Description) -> String {
    let view = match &scene.camera.projection {
        Projection::Perspective { angle } => {
            format!("{:.1}° wide", angle.at(0.0).to_degrees())
        }
        Projection::Orthographic { width } => format!("{} m wide", width.at(0.0)),
    };
    match &scene.camera.path {
        Path::Fixed { eye, .. } => format!("stands at {eye:?}, {view}"),
        Path::Spline { keys, .. } => format!("moves through {} places, {view}", keys.len()),
        Path::GreatCircle(circle) => format!(
            "flies at {} m and {:.1} km/h over a sphere of {} m, {view}",
            circle.altitude,
            circle.speed * 3.6,
            circle.radius
        ),
    }
}

fn bound(bound: Bound) -> String {
    match bound {
        Bound::Shell { inner, outer } => {
            format!("between {inner} m and {outer} m from the origin")
        }
        Bound::Slab { low, high } => format!("between the heights {low} m and {high} m"),
        Bound::Box { min, max } => format!("in the box from {min:?} to {max:?}"),
    }
}
