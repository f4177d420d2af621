//! Small scenes, built without a scene file.

use core::sync::atomic::AtomicBool;

use field::{Basis, Graph, NodeId, Op};
use model::{ImageNumber, Rect, Resolution};
use scene::description::{
    Bound, Camera, Clouds, Film, GreatCircle, Layer, Material, Path, Projection, Sampling, Seed,
    Sky, Sun, Surface,
};
use scene::{Curve, Description};

use crate::{Assets, Counts, EvalSettings, ImageRenderer};

pub(super) const EARTH: f64 = 6_371_000.0;

/// A graph under construction.
pub(super) struct Fields(pub(super) Graph);

impl Fields {
    pub(super) fn new() -> Self {
        Self(Graph::new())
    }

    pub(super) fn op(&mut self, op: Op, args: &[NodeId], params: &[f64]) -> NodeId {
        self.0.push(op, args, params).unwrap()
    }

    pub(super) fn position(&mut self) -> NodeId {
        self.op(Op::Position, &[], &[])
    }

    pub(super) fn number(&mut self, value: f64) -> NodeId {
        self.0.constant(value).unwrap()
    }

    /// ‖p‖ − radius.
    pub(super) fn sphere(&mut self, radius: f64) -> NodeId {
        let p = self.position();
        let length = self.op(Op::Length, &[p], &[]);
        let radius = self.number(radius);
        self.op(Op::Sub, &[length, radius], &[])
    }

    /// `amplitude` · basis cascade of (`place` · `frequency`).
    pub(super) fn cascade(
        &mut self,
        place: NodeId,
        frequency: f64,
        amplitude: f64,
        params: [f64; 7],
    ) -> NodeId {
        let frequency = self.number(frequency);
        let scaled = self.op(Op::Scale, &[place, frequency], &[]);
        let noise = self.op(Op::Sum, &[scaled], &params);
        let amplitude = self.number(amplitude);
        self.op(Op::Mul, &[noise, amplitude], &[])
    }
}

/// The thesis's hypertextured sphere (5.11).
pub(super) fn hypertexture() -> Description {
    under(&[(0.3, 4.0), (0.15, 8.0), (0.05, 16.0)])
}

/// A sphere under five layers, each half as high and as wide as the one before.
pub(super) fn layers() -> Description {
    under(&[0.2, 0.1, 0.05, 0.025, 0.0125].map(|amplitude| (amplitude, 0.8 / amplitude)))
}

/// A sphere under layers of noise of these amplitudes and frequencies.
fn under(layers: &[(f64, f64)]) -> Description {
    let mut fields = Fields::new();
    let mut field = fields.sphere(1.0);
    let p = fields.position();
    for &(amplitude, frequency) in layers {
        let factor = fields.number(frequency);
        let scaled = fields.op(Op::Scale, &[p, factor], &[]);
        let noise = fields.op(Op::Noise, &[scaled], &[3.0]);
        let amplitude = fields.number(amplitude);
        let bump = fields.op(Op::Mul, &[noise, amplitude], &[]);
        field = fields.op(Op::Add, &[field, bump], &[]);
    }
    let bound = Bound::Shell {
        inner: 0.4,
        outer: 1.6,
    };
    let mut scene = standing(fields.0, field, bound, [0.0, -4.0, 0.6]);
    scene.surface.seed = Seed::Sphere { radius: 1.0 };
    scene
}

/// A sphere under noise of a micrometre's cells that is seen in so many pixels that its rays have some ten thousand points.
pub(super) fn needles() -> Description {
    let mut fields = Fields::new();
    let sphere = fields.sphere(1.0);
    let p = fields.position();
    let plain = [Basis::Plain.number(), 3.0, 2.0, 1.0, 1.0, 0.0, 0.0];
    let noise = fields.cascade(p, 1e6, 0.3, plain);
    let field = fields.op(Op::Add, &[sphere, noise], &[]);
    let bound = Bound::Shell {
        inner: 0.4,
        outer: 1.6,
    };
    let mut scene = standing(fields.0, field, bound, [0.0, -4.0, 0.6]);
    scene.film.resolution.width = 20_000;
    scene.film.window = scene.film.resolution.rect();
    scene
}

/// Five balls beside each other, each with a noise of its own that is held back on its lower half.
pub(super) fn bodies() -> Description {
    let mut fields = Fields::new();
    let p = fields.position();
    let z = fields.op(Op::Z, &[p], &[]);
    let share = fields.op(Op::SmoothStep, &[z], &[0.0, 0.2]);
    let mut all = None;
    for (i, key) in (-2..=2).map(f64::from).zip([1.0, 2.0, 3.0, 4.0, 5.0]) {
        let parts = [0.55 * i, 0.0, 0.0].map(|part| fields.number(part));
        let centre = fields.op(Op::Vector, &parts, &[]);
        let from = fields.op(Op::VectorSub, &[p, centre], &[]);
        let length = fields.op(Op::Length, &[from], &[]);
        let radius = fields.number(0.25);
        let ball = fields.op(Op::Sub, &[length, radius], &[]);
        let plain = [Basis::Plain.number(), key, 2.0, 1.0, 4.0, 0.0, 0.0];
        let bumps = fields.cascade(p, 6.0, 0.08, plain);
        let bumps = fields.op(Op::Mul, &[share, bumps], &[]);
        let body = fields.op(Op::Add, &[ball, bumps], &[]);
        all = Some(match all {
            None => body,
            Some(before) => fields.op(Op::Min, &[before, body], &[]),
        });
    }
    let bound = Bound::Box {
        min: [-1.6, -0.6, -0.6],
        max: [1.6, 0.6, 0.6],
    };
    let field = all.expect("there are five");
    standing(fields.0, field, bound, [0.0, -4.0, 0.3])
}

/// A sphere of radius 1 about the origin, seen from 4 m.
pub(super) fn sphere() -> Description {
    let mut fields = Fields::new();
    let field = fields.sphere(1.0);
    let bound = Bound::Shell {
        inner: 0.5,
        outer: 1.5,
    };
    let mut scene = standing(fields.0, field, bound, [0.0, -4.0, 0.0]);
    scene.surface.seed = Seed::Sphere { radius: 1.0 };
    scene
}

/// Goursat's rounded cube x⁴ + y⁴ + z⁴ = 1, whose field is steep far from it and flat inside.
pub(super) fn goursat() -> Description {
    let mut fields = Fields::new();
    let p = fields.position();
    let fourth = [Op::X, Op::Y, Op::Z].map(|axis| {
        let part = fields.op(axis, &[p], &[]);
        let square = fields.op(Op::Mul, &[part, part], &[]);
        fields.op(Op::Mul, &[square, square], &[])
    });
    let [x, y, z] = fourth;
    let two = fields.op(Op::Add, &[x, y], &[]);
    let three = fields.op(Op::Add, &[two, z], &[]);
    let one = fields.number(1.0);
    let field = fields.op(Op::Sub, &[three, one], &[]);
    orthographic(fields.0, field, 1.5)
}

/// The plane z = 0, seen from a height of 2 m in a level view.
pub(super) fn plane() -> Description {
    let mut fields = Fields::new();
    let p = fields.position();
    let field = fields.op(Op::Z, &[p], &[]);
    let bound = Bound::Slab {
        low: -1.0,
        high: 1.0,
    };
    standing(fields.0, field, bound, [0.0, 0.0, 2.0])
}

/// A plane with ridges of half a metre and level of detail, low sun, air, clouds and shadows.
pub(super) fn ridges() -> Description {
    let mut fields = Fields::new();
    let p = fields.position();
    let z = fields.op(Op::Z, &[p], &[]);
    let ground = fields.op(Op::OntoPlane, &[p], &[]);
    let ridged = [Basis::Ridged.number(), 5.0, 2.0, 0.8, 7.0, 0.0, 2.0];
    let height = fields.cascade(ground, 0.7, 0.4, ridged);
    let field = fields.op(Op::Sub, &[z, height], &[]);
    let plain = [Basis::Plain.number(), 8.0, 2.0, 0.5, 5.0, 0.0, 2.0];
    let variation = fields.cascade(ground, 3.0, 0.3, plain);
    let clouds = Clouds {
        height: 40.0,
        thickness: 3.0,
        depth: fields.cascade(p, 0.05, 2.0, plain),
    };
    let bound = Bound::Slab {
        low: -1.0,
        high: 1.0,
    };
    let mut scene = standing(fields.0, field, bound, [0.0, -3.0, 1.2]);
    scene.surface.material.variation = Some(variation);
    scene.surface.material.layers = vec![Layer {
        albedo: [0.8; 3],
        above: Some([0.4, 0.6]),
        below: None,
        steeper: None,
        gentler: Some([0.6, 0.9]),
        cover: None,
        height_offset: Some(variation),
        ramp: None,
    }];
    air(&mut scene, 60.0);
    if let Sky::Air { clouds: in_sky, .. } = &mut scene.sky {
        *in_sky = Some(clouds);
    }
    scene
}

/// Musgrave's ridges from low above them, every octave everywhere: their bound is far steeper than they are.
pub(super) fn crags() -> Description {
    let mut fields = Fields::new();
    let p = fields.position();
    let z = fields.op(Op::Z, &[p], &[]);
    let ground = fields.op(Op::OntoPlane, &[p], &[]);
    let frequency = fields.number(0.125);
    let place = fields.op(Op::Scale, &[ground, frequency], &[]);
    let ridged = [7.0, 2.0, 1.0, 8.0, 1.0, 2.0, 0.0];
    let ridged = fields.op(Op::RidgedMultifractal, &[place], &ridged);
    let height = fields.number(1.6);
    let height = fields.op(Op::Mul, &[ridged, height], &[]);
    let field = fields.op(Op::Sub, &[z, height], &[]);
    let bound = Bound::Box {
        min: [-80.0, -2.0, -0.05],
        max: [80.0, 130.0, 3.2],
    };
    standing(fields.0, field, bound, [0.0, 0.0, 2.6])
}

/// Mountains of a few metres on a planet of the Earth's radius, from 15 m above it, in flight.
pub(super) fn planet() -> Description {
    let mut fields = Fields::new();
    let seed = fields.sphere(EARTH);
    let p = fields.position();
    let ground = fields.op(Op::OntoSphere, &[p], &[EARTH]);
    let plain = [Basis::Plain.number(), 5.0, 2.0, 0.8, 10.0, 0.0, 2.0];
    let height = fields.cascade(ground, 0.02, 4.0, plain);
    let field = fields.op(Op::Sub, &[seed, height], &[]);
    let bound = Bound::Shell {
        inner: EARTH - 12.0,
        outer: EARTH + 12.0,
    };
    let mut scene = standing(fields.0, field, bound, [0.0; 3]);
    scene.surface.seed = Seed::Sphere { radius: EARTH };
    scene.camera.path = Path::GreatCircle(GreatCircle {
        radius: EARTH,
        altitude: 15.0,
        speed: 60.0 / 3.6,
        latitude: 0.4,
        longitude: 0.3,
        heading: 0.6,
        pitch: Curve::Constant(-0.08),
        yaw: Curve::Constant(0.0),
        roll: Curve::Constant(0.1),
        clearance: 0.0,
    });
    let (sine, cosine) = (libm::sin(0.4), libm::cos(0.4));
    let (east_y, east_x) = (libm::cos(0.3), -libm::sin(0.3));
    let up = [cosine * east_y, -cosine * east_x, sine];
    scene.sun.frame = [
        [east_x, east_y, 0.0],
        [-sine * east_y, sine * east_x, cosine],
        up,
    ];
    scene.film.shutter = 0.02;
    air(&mut scene, 3_000.0);
    scene
}

/// Noise in a box, cut off at its faces, in parallel rays.
pub(super) fn cube() -> Description {
    let mut fields = Fields::new();
    let p = fields.position();
    let factor = fields.number(3.0);
    let scaled = fields.op(Op::Scale, &[p, factor], &[]);
    let field = fields.op(Op::Noise, &[scaled], &[4.0]);
    let bound = Bound::Box {
        min: [-1.0; 3],
        max: [1.0; 3],
    };
    let mut scene = standing(fields.0, field, bound, [2.0, -4.0, 1.5]);
    scene.camera.path = Path::Fixed {
        eye: [2.0, -4.0, 1.5],
        target: [0.0; 3],
        up: [0.0, 0.0, 1.0],
    };
    scene.camera.projection = Projection::Orthographic {
        width: Curve::Constant(5.0),
    };
    scene
}

/// Soft balls of two signs, turned and stretched, in perspective with shadows.
pub(super) fn blobs() -> Description {
    let mut fields = Fields::new();
    let p = fields.position();
    let factor = fields.number(1.25);
    let scaled = fields.op(Op::Scale, &[p, factor], &[]);
    let mut params = vec![3.0, 0.4, 1.0];
    for (place, radius, weight) in [
        ([0.0, 0.0, 0.0], 1.0, 1.0),
        ([0.9, 0.2, 0.3], 0.7, 1.0),
        ([-0.6, -0.5, 0.5], 0.8, 0.9),
        ([0.1, -0.8, 0.2], 0.5, -0.7),
        ([-0.3, 0.4, -0.9], 0.9, 1.2),
    ] {
        params.extend(place);
        params.extend([radius, weight]);
    }
    let field = fields.op(Op::Blobs, &[scaled], &params);
    let bound = Bound::Shell {
        inner: 0.0,
        outer: 1.8,
    };
    let mut scene = standing(fields.0, field, bound, [0.0, -4.0, 0.0]);
    scene.surface.seed = Seed::Sphere { radius: 1.0 };
    scene
}

/// A surface within a distance of the origin, seen by parallel rays from aside.
pub(super) fn orthographic(graph: Graph, field: NodeId, outer: f64) -> Description {
    let bound = Bound::Shell { inner: 0.0, outer };
    let mut scene = standing(graph, field, bound, [0.0; 3]);
    scene.surface.seed = Seed::Sphere { radius: 1.0 };
    scene.camera.path = Path::Fixed {
        eye: [2.0, -4.0, 1.5],
        target: [0.0; 3],
        up: [0.0, 0.0, 1.0],
    };
    scene.camera.projection = Projection::Orthographic {
        width: Curve::Constant(2.6),
    };
    scene
}

/// Every small scene, by name.
pub(super) fn all() -> [(&'static str, Description); 8] {
    [
        ("sphere", sphere()),
        ("plane", plane()),
        ("hypertexture", hypertexture()),
        ("ridges", ridges()),
        ("planet", planet()),
        ("cube", cube()),
        ("bodies", bodies()),
        ("blobs", blobs()),
    ]
}

fn air(scene: &mut Description, visibility: f64) {
    scene.sky = Sky::Air {
        rayleigh: 1.0,
        haze: 1.5,
        visibility: Curve::Constant(visibility),
        clouds: None,
    };
}

/// A scene seen along +y from a place at rest, 48 × 40 pixels, 2 × 2 rays.
fn standing(graph: Graph, field: NodeId, bound: Bound, eye: [f64; 3]) -> Description {
    let resolution = Resolution {
        width: 48,
        height: 40,
    };
    Description {
        name: "test".to_owned(),
        key: 17,
        film: Film {
            resolution,
            window: resolution.rect(),
            images: 3,
            fps: 25.0,
            shutter: 0.0,
            exposure: 0.0,
        },
        sampling: Sampling {
            rays: 2,
            filter_order: 4,
        },
        camera: Camera {
            path: Path::Fixed {
                eye,
                target: [eye[0], eye[1] + 10.0, eye[2]],
                up: [0.0, 0.0, 1.0],
            },
            projection: Projection::Perspective {
                angle: Curve::Constant(0.8),
            },
        },
        surface: Surface {
            graph,
            field,
            seed: Seed::Plane,
            bound,
            material: Material {
                albedo: [0.4, 0.3, 0.2],
                variation: None,
                layers: Vec::new(),
            },
        },
        sun: Sun {
            frame: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            azimuth: Curve::Constant(1.9),
            elevation: Curve::Constant(0.35),
            irradiance: [3.0, 3.0, 3.0],
            shadows: true,
        },
        sky: Sky::Plain {
            radiance: [0.1, 0.2, 0.4],
            ambient: [0.3, 0.3, 0.3],
        },
        assets: Vec::new(),
    }
}

/// The renderer of image 1.
pub(super) fn renderer(scene: &Description, settings: EvalSettings) -> ImageRenderer {
    ImageRenderer::new(scene, &Assets::new(), ImageNumber(1), settings).unwrap()
}

/// A whole image: its planes and what it took.
pub(super) fn image(scene: &Description, settings: EvalSettings) -> (Vec<f32>, Counts) {
    block(&renderer(scene, settings), scene.film.resolution.rect())
}

/// The planes of one rectangle.
pub(super) fn block(renderer: &ImageRenderer, rect: Rect) -> (Vec<f32>, Counts) {
    let mut pixels = Vec::new();
    let counts = renderer
        .render_block(rect, &AtomicBool::new(false), &mut pixels)
        .unwrap();
    (pixels, counts)
}
