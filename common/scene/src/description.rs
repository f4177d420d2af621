//! What a scene is once its file has been read: a plain value, the same for every worker.

use field::{Graph, NodeId};
use model::{Digest, Rect, Resolution};

use crate::curve::Curve;

/// A whole scene. Lengths are metres, angles radians, instants seconds from image 0, colours
/// linear BT.709; +z is up.
#[derive(Clone, PartialEq, Debug)]
pub struct Description {
    /// What the scene calls itself; also the stem of its frames' names.
    pub name: String,
    /// From which all of the scene's random numbers start.
    pub key: u32,
    /// What is recorded.
    pub film: Film,
    /// How densely.
    pub sampling: Sampling,
    /// From where.
    pub camera: Camera,
    /// What is seen.
    pub surface: Surface,
    /// By which light.
    pub sun: Sun,
    /// Before and through what.
    pub sky: Sky,
    /// Files that the scene names; others refer to them by place in this list.
    pub assets: Vec<AssetRef>,
}

/// The film: size, timing and the view transform's exposure.
#[derive(Clone, PartialEq, Debug)]
pub struct Film {
    /// Pixels of the whole image.
    pub resolution: Resolution,
    /// The part of it that is rendered and stored.
    pub window: Rect,
    /// Images 0 to `images` − 1 exist.
    pub images: u32,
    /// Images per second.
    pub fps: f64,
    /// How long the shutter stays open, from the image's instant on; 0 is an instant.
    pub shutter: f64,
    /// Stops added before the fixed view transform of PNG and PPM; EXR is untouched.
    pub exposure: f64,
}

/// Stratified B-spline sampling, thesis eqs. (6.13)–(6.20).
#[derive(Clone, PartialEq, Debug)]
pub struct Sampling {
    /// N of the N × N rays of a pixel.
    pub rays: u32,
    /// Order m of the B-spline filter, degree m − 1 (cubic: 4); 0 samples pixel centres alone.
    pub filter_order: u32,
}

/// The camera.
#[derive(Clone, PartialEq, Debug)]
pub struct Camera {
    /// Where it is and where it looks.
    pub path: Path,
    /// How places become pixels.
    pub projection: Projection,
}

/// How places become pixels; pixels are square.
#[derive(Clone, PartialEq, Debug)]
pub enum Projection {
    /// Rays from one eye; the angle between the left and right edges of the image.
    Perspective {
        /// Horizontal angle of view.
        angle: Curve,
    },
    /// Parallel rays; the distance between the left and right edges of the image.
    Orthographic {
        /// Width of the view.
        width: Curve,
    },
}

/// Where the camera is over time.
#[derive(Clone, PartialEq, Debug)]
pub enum Path {
    /// It stands and looks at a place.
    Fixed {
        /// Where it stands.
        eye: [f64; 3],
        /// What it looks at.
        target: [f64; 3],
        /// Which way is up; need not be square to the view.
        up: [f64; 3],
    },
    /// A C² spline through places, each with what is looked at from there.
    Spline {
        /// At least two, instants rising.
        keys: Vec<PathKey>,
        /// Which way is up.
        up: [f64; 3],
    },
    /// Constant altitude and speed along a great circle of a sphere about the origin.
    GreatCircle(GreatCircle),
}

/// One key of a spline path.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PathKey {
    /// When.
    pub time: f64,
    /// Where the camera is.
    pub eye: [f64; 3],
    /// What it looks at.
    pub target: [f64; 3],
}

/// A flight along a great circle, as in thesis §C.4.
#[derive(Clone, PartialEq, Debug)]
pub struct GreatCircle {
    /// Radius of the sphere flown over.
    pub radius: f64,
    /// Altitude over that sphere.
    pub altitude: f64,
    /// Speed of the camera itself along its circle.
    pub speed: f64,
    /// Latitude at instant 0.
    pub latitude: f64,
    /// Longitude at instant 0.
    pub longitude: f64,
    /// Heading at instant 0, clockwise from north.
    pub heading: f64,
    /// Looking up (positive) or down from the horizontal.
    pub pitch: Curve,
    /// Looking to the right of the heading.
    pub yaw: Curve,
    /// Leaning to the right.
    pub roll: Curve,
    /// Least height over the ground below that the path must keep.
    pub clearance: f64,
}

/// The surface: f < 0 inside.
#[derive(Clone, PartialEq, Debug)]
pub struct Surface {
    /// Every field of the scene.
    pub graph: Graph,
    /// The surface's own.
    pub field: NodeId,
    /// What heights and slopes are measured from.
    pub seed: Seed,
    /// Outside of it f > 0 everywhere, or rays need not look there.
    pub bound: Bound,
    /// What it is made of.
    pub material: Material,
}

/// The shape that a terrain grows on, thesis §2.4.2.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Seed {
    /// z = 0; heights are z, the vertical is +z. Thesis eq. (2.19).
    Plane,
    /// A sphere about the origin; heights are ‖x‖ − radius. Thesis eq. (2.21).
    Sphere {
        /// Its radius.
        radius: f64,
    },
}

/// Where the surface can be.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Bound {
    /// inner ≤ ‖x‖ ≤ outer.
    Shell {
        /// Inside of it f < 0 (or 0 where the seed is hollow).
        inner: f64,
        /// Outside of it f > 0.
        outer: f64,
    },
    /// low ≤ z ≤ high.
    Slab {
        /// Below it f < 0.
        low: f64,
        /// Above it f > 0.
        high: f64,
    },
    /// A box; the surface is cut off at its faces.
    Box {
        /// Least x, y, z.
        min: [f64; 3],
        /// Largest x, y, z.
        max: [f64; 3],
    },
}

/// Colours by height and slope: layers over a ground, each covering what lies below it.
#[derive(Clone, PartialEq, Debug)]
pub struct Material {
    /// Diffuse reflectance where no layer covers.
    pub albedo: [f64; 3],
    /// The reflectance is multiplied by 1 + this field's value, if there is one.
    pub variation: Option<NodeId>,
    /// From bottom to top.
    pub layers: Vec<Layer>,
}

/// One layer of a material. What is absent does not limit it; what is present multiplies.
#[derive(Clone, PartialEq, Debug)]
pub struct Layer {
    /// Diffuse reflectance; multiplied with the ramp's, if there is one.
    pub albedo: [f64; 3],
    /// Cover rises from 0 at the first height to 1 at the second.
    pub above: Option<[f64; 2]>,
    /// Cover falls from 1 at the first height to 0 at the second.
    pub below: Option<[f64; 2]>,
    /// Cover rises from 0 to 1 between these slopes, angles from the horizontal.
    pub steeper: Option<[f64; 2]>,
    /// Cover falls from 1 to 0 between these slopes.
    pub gentler: Option<[f64; 2]>,
    /// Cover is multiplied by this field, clamped to 0…1.
    pub cover: Option<NodeId>,
    /// Added to the height before it is compared: breaks up straight edges.
    pub height_offset: Option<NodeId>,
    /// Colours by height from the first row of an image.
    pub ramp: Option<Ramp>,
}

/// The first row of a PNG image (sRGB), spread over a range of heights.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ramp {
    /// Which of the scene's assets.
    pub asset: u32,
    /// Height of the row's left end.
    pub low: f64,
    /// Height of its right end.
    pub high: f64,
}

/// The sun, at infinity.
#[derive(Clone, PartialEq, Debug)]
pub struct Sun {
    /// East, north and up, unit vectors: what azimuth and elevation are measured in.
    pub frame: [[f64; 3]; 3],
    /// Clockwise from north.
    pub azimuth: Curve,
    /// Above the horizontal.
    pub elevation: Curve,
    /// Irradiance of a surface facing it, above the atmosphere.
    pub irradiance: [f64; 3],
    /// Whether terrain shades terrain.
    pub shadows: bool,
}

/// What is seen where no surface is, and what lies between.
#[derive(Clone, PartialEq, Debug)]
pub enum Sky {
    /// One radiance everywhere, no air.
    Plain {
        /// Radiance of the background.
        radiance: [f64; 3],
        /// Irradiance that every surface receives from all around.
        ambient: [f64; 3],
    },
    /// Air that scatters sunlight: a blue sky, a pale horizon, aerial perspective.
    Air {
        /// Rayleigh scattering, 1 for the Earth's.
        rayleigh: f64,
        /// Haze (Mie scattering), 1 for a clear day.
        haze: f64,
        /// Distance at which black terrain keeps 2 % of its contrast; sets aerial perspective.
        visibility: Curve,
        /// A layer of clouds, if there is one.
        clouds: Option<Clouds>,
    },
}

/// A thin layer of clouds, seen from below and behind every surface.
#[derive(Clone, PartialEq, Debug)]
pub struct Clouds {
    /// Height over the seed.
    pub height: f64,
    /// How thick they are: how far sunlight goes through them, and how softly they shade themselves.
    pub thickness: f64,
    /// Their optical depth along the vertical, a field over world places; below 0 there are none.
    pub depth: NodeId,
}

/// A file that the scene names, by content.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct AssetRef {
    /// The path as the scene file gives it.
    pub name: String,
    /// BLAKE3 of its bytes.
    pub digest: Digest,
    /// Its size.
    pub bytes: u64,
}
