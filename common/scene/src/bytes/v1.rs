//! The forms of version 1, field by field in the order written. Never changed, only replaced.

use std::marker::PhantomData;

use field::graph::{KEYS_MAX, NODES_MAX};
use field::{Graph, NodeId, Op};
use model::{Digest, Rect, Resolution};
use serde::de::{Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::NotAScene;
use crate::curve;
use crate::description as d;
use crate::rules::{ASSETS_MAX, LAYERS_MAX, PATH_KEYS_MAX};

/// A finite number, written as the eight bytes of its double; there is no −0.
#[derive(Clone, Copy)]
struct Real(f64);

impl Serialize for Real {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // −0 + 0 is +0; every other number stays itself.
        serializer.serialize_f64(self.0 + 0.0)
    }
}

impl<'de> Deserialize<'de> for Real {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = f64::deserialize(deserializer)?;
        if value.is_finite() {
            Ok(Self(value))
        } else {
            Err(D::Error::custom("a number is not finite"))
        }
    }
}

/// A list that refuses to be longer than `MAX`, before it takes memory.
struct List<T, const MAX: usize>(Vec<T>);

impl<T: Serialize, const MAX: usize> Serialize for List<T, MAX> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<'de, T: Deserialize<'de>, const MAX: usize> Deserialize<'de> for List<T, MAX> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Elements<T, const MAX: usize>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>, const MAX: usize> Visitor<'de> for Elements<T, MAX> {
            type Value = Vec<T>;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "at most {MAX} elements")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Vec<T>, A::Error> {
                let mut elements = Vec::new();
                while let Some(element) = seq.next_element()? {
                    if elements.len() == MAX {
                        return Err(A::Error::custom("a list is too long"));
                    }
                    elements.push(element);
                }
                Ok(elements)
            }
        }

        deserializer
            .deserialize_seq(Elements::<T, MAX>(PhantomData))
            .map(Self)
    }
}

type Place = [Real; 3];
type Colour = [Real; 3];
type Range = [Real; 2];

#[derive(Serialize, Deserialize)]
pub(super) struct Scene {
    name: String,
    key: u32,
    film: Film,
    rays: u32,
    filter_order: u32,
    path: Path,
    projection: Projection,
    nodes: List<Node, NODES_MAX>,
    field: u32,
    seed: Seed,
    bound: Bound,
    albedo: Colour,
    variation: Option<u32>,
    layers: List<Layer, LAYERS_MAX>,
    sun: Sun,
    sky: Sky,
    assets: List<Asset, ASSETS_MAX>,
}

#[derive(Serialize, Deserialize)]
struct Film {
    resolution: [u32; 2],
    window: [u32; 4],
    images: u32,
    fps: Real,
    shutter: Real,
    exposure: Real,
}

#[derive(Serialize, Deserialize)]
enum Curve {
    Constant(Real),
    Linear(List<Range, KEYS_MAX>),
    Smooth(List<Range, KEYS_MAX>),
}

#[derive(Serialize, Deserialize)]
enum Path {
    Fixed {
        eye: Place,
        target: Place,
        up: Place,
    },
    Spline {
        keys: List<(Real, Place, Place), PATH_KEYS_MAX>,
        up: Place,
    },
    GreatCircle {
        radius: Real,
        altitude: Real,
        speed: Real,
        latitude: Real,
        longitude: Real,
        heading: Real,
        pitch: Curve,
        yaw: Curve,
        roll: Curve,
        clearance: Real,
    },
}

#[derive(Serialize, Deserialize)]
enum Projection {
    Perspective(Curve),
    Orthographic(Curve),
}

#[derive(Serialize, Deserialize)]
struct Node {
    op: u16,
    args: List<u32, 16>,
    params: List<Real, { 2 * KEYS_MAX }>,
}

#[derive(Serialize, Deserialize)]
enum Seed {
    Plane,
    Sphere(Real),
}

#[derive(Serialize, Deserialize)]
enum Bound {
    Shell(Range),
    Slab(Range),
    Box(Place, Place),
}

#[derive(Serialize, Deserialize)]
struct Layer {
    albedo: Colour,
    above: Option<Range>,
    below: Option<Range>,
    steeper: Option<Range>,
    gentler: Option<Range>,
    cover: Option<u32>,
    height_offset: Option<u32>,
    ramp: Option<(u32, Range)>,
}

#[derive(Serialize, Deserialize)]
struct Sun {
    frame: [Place; 3],
    azimuth: Curve,
    elevation: Curve,
    irradiance: Colour,
    shadows: bool,
}

#[derive(Serialize, Deserialize)]
enum Sky {
    Plain {
        radiance: Colour,
        ambient: Colour,
    },
    Air {
        rayleigh: Real,
        haze: Real,
        visibility: Curve,
    },
    Clouded {
        rayleigh: Real,
        haze: Real,
        visibility: Curve,
        height: Real,
        thickness: Real,
        depth: u32,
    },
}

#[derive(Serialize, Deserialize)]
struct Asset {
    name: String,
    digest: [u8; 32],
    bytes: u64,
}

impl From<&d::Description> for Scene {
    fn from(scene: &d::Description) -> Self {
        let surface = &scene.surface;
        let material = &surface.material;
        Self {
            name: scene.name.clone(),
            key: scene.key,
            film: Film::from(&scene.film),
            rays: scene.sampling.rays,
            filter_order: scene.sampling.filter_order,
            path: Path::from(&scene.camera.path),
            projection: match &scene.camera.projection {
                d::Projection::Perspective { angle } => Projection::Perspective(angle.into()),
                d::Projection::Orthographic { width } => Projection::Orthographic(width.into()),
            },
            nodes: List(surface.graph.nodes().iter().map(Node::from).collect()),
            field: surface.field.0,
            seed: match surface.seed {
                d::Seed::Plane => Seed::Plane,
                d::Seed::Sphere { radius } => Seed::Sphere(Real(radius)),
            },
            bound: match surface.bound {
                d::Bound::Shell { inner, outer } => Bound::Shell([inner, outer].map(Real)),
                d::Bound::Slab { low, high } => Bound::Slab([low, high].map(Real)),
                d::Bound::Box { min, max } => Bound::Box(min.map(Real), max.map(Real)),
            },
            albedo: material.albedo.map(Real),
            variation: material.variation.map(|id| id.0),
            layers: List(material.layers.iter().map(Layer::from).collect()),
            sun: Sun::from(&scene.sun),
            sky: Sky::from(&scene.sky),
            assets: List(scene.assets.iter().map(Asset::from).collect()),
        }
    }
}

impl Scene {
    /// The description; the graph is rebuilt node by node, so that its own rules hold.
    pub(super) fn into_description(self) -> Result<d::Description, NotAScene> {
        let [width, height] = self.film.resolution;
        let [x0, y0, x1, y1] = self.film.window;
        Ok(d::Description {
            name: self.name,
            key: self.key,
            film: d::Film {
                resolution: Resolution { width, height },
                window: Rect { x0, y0, x1, y1 },
                images: self.film.images,
                fps: self.film.fps.0,
                shutter: self.film.shutter.0,
                exposure: self.film.exposure.0,
            },
            sampling: d::Sampling {
                rays: self.rays,
                filter_order: self.filter_order,
            },
            camera: d::Camera {
                path: self.path.into(),
                projection: match self.projection {
                    Projection::Perspective(angle) => d::Projection::Perspective {
                        angle: angle.into(),
                    },
                    Projection::Orthographic(width) => d::Projection::Orthographic {
                        width: width.into(),
                    },
                },
            },
            surface: d::Surface {
                graph: graph(self.nodes.0)?,
                field: NodeId(self.field),
                seed: match self.seed {
                    Seed::Plane => d::Seed::Plane,
                    Seed::Sphere(radius) => d::Seed::Sphere { radius: radius.0 },
                },
                bound: match self.bound {
                    Bound::Shell([inner, outer]) => d::Bound::Shell {
                        inner: inner.0,
                        outer: outer.0,
                    },
                    Bound::Slab([low, high]) => d::Bound::Slab {
                        low: low.0,
                        high: high.0,
                    },
                    Bound::Box(min, max) => d::Bound::Box {
                        min: numbers(min),
                        max: numbers(max),
                    },
                },
                material: d::Material {
                    albedo: numbers(self.albedo),
                    variation: self.variation.map(NodeId),
                    layers: self.layers.0.into_iter().map(d::Layer::from).collect(),
                },
            },
            sun: self.sun.into(),
            sky: self.sky.into(),
            assets: self.assets.0.into_iter().map(d::AssetRef::from).collect(),
        })
    }
}

fn graph(nodes: Vec<Node>) -> Result<Graph, NotAScene> {
    let mut graph = Graph::new();
    for (index, node) in nodes.into_iter().enumerate() {
        let op = Op::from_code(node.op)
            .ok_or_else(|| NotAScene::Damaged(format!("{} is no operation", node.op)))?;
        let args: Vec<_> = node.args.0.into_iter().map(NodeId).collect();
        let params: Vec<_> = node.params.0.into_iter().map(|real| real.0).collect();
        let id = graph
            .push(op, &args, &params)
            .map_err(|cause| NotAScene::Damaged(cause.to_string()))?;
        if id.index() != index {
            return Err(NotAScene::NotCanonical);
        }
    }
    Ok(graph)
}

fn numbers<const N: usize>(reals: [Real; N]) -> [f64; N] {
    reals.map(|real| real.0)
}

impl From<&d::Film> for Film {
    fn from(film: &d::Film) -> Self {
        let window = film.window;
        Self {
            resolution: [film.resolution.width, film.resolution.height],
            window: [window.x0, window.y0, window.x1, window.y1],
            images: film.images,
            fps: Real(film.fps),
            shutter: Real(film.shutter),
            exposure: Real(film.exposure),
        }
    }
}

impl From<&curve::Curve> for Curve {
    fn from(curve: &curve::Curve) -> Self {
        let keys = || {
            List(
                curve
                    .keys()
                    .iter()
                    .map(|&(t, v)| [Real(t), Real(v)])
                    .collect(),
            )
        };
        match curve {
            curve::Curve::Constant(value) => Self::Constant(Real(*value)),
            curve::Curve::Linear(_) => Self::Linear(keys()),
            curve::Curve::Smooth(_) => Self::Smooth(keys()),
        }
    }
}

impl From<Curve> for curve::Curve {
    fn from(curve: Curve) -> Self {
        let keys = |keys: List<Range, KEYS_MAX>| {
            keys.0
                .into_iter()
                .map(|[time, value]| (time.0, value.0))
                .collect()
        };
        match curve {
            Curve::Constant(value) => Self::Constant(value.0),
            Curve::Linear(list) => Self::Linear(keys(list)),
            Curve::Smooth(list) => Self::Smooth(keys(list)),
        }
    }
}

impl From<&d::Path> for Path {
    fn from(path: &d::Path) -> Self {
        match path {
            d::Path::Fixed { eye, target, up } => Self::Fixed {
                eye: eye.map(Real),
                target: target.map(Real),
                up: up.map(Real),
            },
            d::Path::Spline { keys, up } => Self::Spline {
                keys: List(
                    keys.iter()
                        .map(|key| (Real(key.time), key.eye.map(Real), key.target.map(Real)))
                        .collect(),
                ),
                up: up.map(Real),
            },
            d::Path::GreatCircle(circle) => Self::GreatCircle {
                radius: Real(circle.radius),
                altitude: Real(circle.altitude),
                speed: Real(circle.speed),
                latitude: Real(circle.latitude),
                longitude: Real(circle.longitude),
                heading: Real(circle.heading),
                pitch: (&circle.pitch).into(),
                yaw: (&circle.yaw).into(),
                roll: (&circle.roll).into(),
                clearance: Real(circle.clearance),
            },
        }
    }
}

impl From<Path> for d::Path {
    fn from(path: Path) -> Self {
        match path {
            Path::Fixed { eye, target, up } => Self::Fixed {
                eye: numbers(eye),
                target: numbers(target),
                up: numbers(up),
            },
            Path::Spline { keys, up } => Self::Spline {
                keys: keys
                    .0
                    .into_iter()
                    .map(|(time, eye, target)| d::PathKey {
                        time: time.0,
                        eye: numbers(eye),
                        target: numbers(target),
                    })
                    .collect(),
                up: numbers(up),
            },
            Path::GreatCircle {
                radius,
                altitude,
                speed,
                latitude,
                longitude,
                heading,
                pitch,
                yaw,
                roll,
                clearance,
            } => Self::GreatCircle(d::GreatCircle {
                radius: radius.0,
                altitude: altitude.0,
                speed: speed.0,
                latitude: latitude.0,
                longitude: longitude.0,
                heading: heading.0,
                pitch: pitch.into(),
                yaw: yaw.into(),
                roll: roll.into(),
                clearance: clearance.0,
            }),
        }
    }
}

impl From<&field::graph::Node> for Node {
    fn from(node: &field::graph::Node) -> Self {
        Self {
            op: node.op.code(),
            args: List(node.args.iter().map(|id| id.0).collect()),
            params: List(node.params.iter().copied().map(Real).collect()),
        }
    }
}

impl From<&d::Layer> for Layer {
    fn from(layer: &d::Layer) -> Self {
        let range = |ends: Option<[f64; 2]>| ends.map(|ends| ends.map(Real));
        Self {
            albedo: layer.albedo.map(Real),
            above: range(layer.above),
            below: range(layer.below),
            steeper: range(layer.steeper),
            gentler: range(layer.gentler),
            cover: layer.cover.map(|id| id.0),
            height_offset: layer.height_offset.map(|id| id.0),
            ramp: layer
                .ramp
                .map(|ramp| (ramp.asset, [ramp.low, ramp.high].map(Real))),
        }
    }
}

impl From<Layer> for d::Layer {
    fn from(layer: Layer) -> Self {
        Self {
            albedo: numbers(layer.albedo),
            above: layer.above.map(numbers),
            below: layer.below.map(numbers),
            steeper: layer.steeper.map(numbers),
            gentler: layer.gentler.map(numbers),
            cover: layer.cover.map(NodeId),
            height_offset: layer.height_offset.map(NodeId),
            ramp: layer.ramp.map(|(asset, [low, high])| d::Ramp {
                asset,
                low: low.0,
                high: high.0,
            }),
        }
    }
}

impl From<&d::Sun> for Sun {
    fn from(sun: &d::Sun) -> Self {
        Self {
            frame: sun.frame.map(|axis| axis.map(Real)),
            azimuth: (&sun.azimuth).into(),
            elevation: (&sun.elevation).into(),
            irradiance: sun.irradiance.map(Real),
            shadows: sun.shadows,
        }
    }
}

impl From<Sun> for d::Sun {
    fn from(sun: Sun) -> Self {
        Self {
            frame: sun.frame.map(numbers),
            azimuth: sun.azimuth.into(),
            elevation: sun.elevation.into(),
            irradiance: numbers(sun.irradiance),
            shadows: sun.shadows,
        }
    }
}

impl From<&d::Sky> for Sky {
    fn from(sky: &d::Sky) -> Self {
        match sky {
            d::Sky::Plain { radiance, ambient } => Self::Plain {
                radiance: radiance.map(Real),
                ambient: ambient.map(Real),
            },
            d::Sky::Air {
                rayleigh,
                haze,
                visibility,
                clouds: None,
            } => Self::Air {
                rayleigh: Real(*rayleigh),
                haze: Real(*haze),
                visibility: visibility.into(),
            },
            d::Sky::Air {
                rayleigh,
                haze,
                visibility,
                clouds: Some(clouds),
            } => Self::Clouded {
                rayleigh: Real(*rayleigh),
                haze: Real(*haze),
                visibility: visibility.into(),
                height: Real(clouds.height),
                thickness: Real(clouds.thickness),
                depth: clouds.depth.0,
            },
        }
    }
}

impl From<Sky> for d::Sky {
    fn from(sky: Sky) -> Self {
        match sky {
            Sky::Plain { radiance, ambient } => Self::Plain {
                radiance: numbers(radiance),
                ambient: numbers(ambient),
            },
            Sky::Air {
                rayleigh,
                haze,
                visibility,
            } => Self::Air {
                rayleigh: rayleigh.0,
                haze: haze.0,
                visibility: visibility.into(),
                clouds: None,
            },
            Sky::Clouded {
                rayleigh,
                haze,
                visibility,
                height,
                thickness,
                depth,
            } => Self::Air {
                rayleigh: rayleigh.0,
                haze: haze.0,
                visibility: visibility.into(),
                clouds: Some(d::Clouds {
                    height: height.0,
                    thickness: thickness.0,
                    depth: NodeId(depth),
                }),
            },
        }
    }
}

impl From<&d::AssetRef> for Asset {
    fn from(asset: &d::AssetRef) -> Self {
        Self {
            name: asset.name.clone(),
            digest: asset.digest.0,
            bytes: asset.bytes,
        }
    }
}

impl From<Asset> for d::AssetRef {
    fn from(asset: Asset) -> Self {
        Self {
            name: asset.name,
            digest: Digest(asset.digest),
            bytes: asset.bytes,
        }
    }
}
