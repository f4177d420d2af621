//! A thin layer of clouds at one height, lit by the sun through itself.
//!
//! Their optical depth is a field of the scene, evaluated where a ray crosses
//! the layer, with the footprint that a pixel has there: along the ray it is
//! far longer than across, so the field fades into its mean towards the horizon
//! by its own level of detail. A second value, a thickness nearer to the sun,
//! says how much light is left to it. Clouds hide no surface and shade none.

use core::f64::consts::{FRAC_1_PI, PI};

use field::{Interval, Program, Scratch, SimdLevel};
use glam::DVec3;
use scene::Description;
use scene::description::{Clouds as Layer, Seed};

use super::air::{Air, Colour, Depth, GROUND};
use crate::error::RenderError;
use crate::places::Places;
use crate::view::Sight;

/// Share of sunlight that droplets scatter forwards, and how sharply: the silver lining.
const FORWARD_SHARE: f64 = 0.35;
const FORWARDS: f64 = 0.8;

/// Detail of the clouds' own shade, as a share of their thickness.
const SOFTNESS: f64 = 0.25;

/// How much of a cloud's depth towards the sun dims it: light scattered forwards is not lost.
const DIMMING: f64 = 0.55;

/// What rays see of one scene's clouds.
pub(crate) struct Clouds {
    program: Program,
    layer: Layer,
    /// Centre and radius of the sphere that the layer lies on.
    centre: DVec3,
    radius: f64,
    air: Air,
    /// That of the air before the layer.
    density: Depth,
}

/// What a layer of clouds does to the sky behind it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Veil {
    /// Share of the light from behind that it lets through.
    pub(crate) left: f64,
    /// Light it sends instead.
    pub(crate) light: Colour,
    /// Share of its light, and of what it takes, that the air before it lets through.
    pub(crate) seen: Colour,
}

/// The light that falls on clouds.
#[derive(Clone, Copy)]
pub(crate) struct Light {
    /// Unit vector towards the sun.
    pub(crate) sun: DVec3,
    /// Irradiance of a surface facing it.
    pub(crate) sunlight: Colour,
    /// Irradiance from everywhere else.
    pub(crate) ambient: Colour,
}

/// Memory of one batch.
#[derive(Default)]
pub(crate) struct Scanned {
    places: Places,
    depths: Vec<f64>,
}

impl Clouds {
    /// Compiles the clouds of a scene for instants of one image, seen from about `eye`.
    pub(crate) fn new(
        description: &Description,
        eye: DVec3,
        time: Interval,
    ) -> Result<Option<Self>, RenderError> {
        let scene::description::Sky::Air {
            rayleigh,
            haze,
            clouds: Some(layer),
            ..
        } = &description.sky
        else {
            return Ok(None);
        };
        let surface = &description.surface;
        let program = Program::compile(&surface.graph, &[layer.depth], time).map_err(|source| {
            RenderError::Field {
                what: "clouds' depth",
                source,
            }
        })?;
        let (centre, radius) = match surface.seed {
            // A plane's clouds bend like the Earth's, or they would have no end.
            Seed::Plane => (DVec3::new(eye.x, eye.y, -GROUND), GROUND),
            Seed::Sphere { radius } => (DVec3::ZERO, radius),
        };
        Ok(Some(Self {
            program,
            radius: radius + layer.height,
            density: Depth::density(layer.height / 2.0),
            layer: layer.clone(),
            centre,
            air: Air {
                rayleigh: *rayleigh,
                haze: *haze,
            },
        }))
    }

    /// How far a ray from below the layer goes to it, and the sine of its elevation there.
    fn crossing(&self, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
        let from = origin - self.centre;
        let along = from.dot(direction);
        // (R − |o|)(R + |o|), which keeps its digits where both are a planet's.
        let distance = from.dot(from).sqrt();
        let room = (self.radius - distance) * (self.radius + distance);
        if room <= 0.0 {
            return None;
        }
        let root = (along * along + room).sqrt();
        // Without cancellation for both signs.
        let way = if along > 0.0 {
            room / (along + root)
        } else {
            root - along
        };
        Some((way, root / self.radius))
    }

    /// Gathers where rays cross the layer: each asks for two values.
    pub(crate) fn meet(
        &self,
        sun: DVec3,
        sight: &Sight,
        angle: f64,
        scanned: &mut Scanned,
    ) -> Option<Crossing> {
        let (way, rise) = self.crossing(sight.origin, sight.direction)?;
        let place = sight.origin + sight.direction * way;
        // A pixel's long side over the layer: what is finer along the ray than that is not seen.
        let footprint = angle * way / if rise > 0.02 { rise } else { 0.02 };
        let index = scanned.places.len();
        scanned.places.push(place, footprint, sight.time);
        // The depth nearer to the sun is a mean over a good part of the thickness.
        let blurred = SOFTNESS * self.layer.thickness;
        let blurred = if blurred > footprint {
            blurred
        } else {
            footprint
        };
        let lit_from = place + sun * self.layer.thickness;
        scanned.places.push(lit_from, blurred, sight.time);
        Some(Crossing { index, way, rise })
    }

    /// Evaluates the depths that were asked for.
    pub(crate) fn scan(&self, level: SimdLevel, scratch: &mut Scratch, scanned: &mut Scanned) {
        let n = scanned.places.len();
        scanned.depths.clear();
        scanned.depths.resize(n, 0.0);
        self.program.evaluate(
            level,
            &scanned.places.batch(0, n),
            scratch,
            &mut [&mut scanned.depths],
        );
    }

    /// What a ray sees of the layer.
    pub(crate) fn veil(
        &self,
        crossing: Crossing,
        direction: DVec3,
        light: &Light,
        scanned: &Scanned,
    ) -> Veil {
        let depth = |index: usize| {
            let depth = scanned.depths[index];
            // Not a number is no cloud; a field that ran away is an opaque one.
            if depth > 0.0 {
                if depth < 50.0 { depth } else { 50.0 }
            } else {
                0.0
            }
        };
        let slant = if crossing.rise > 0.1 {
            crossing.rise
        } else {
            0.1
        };
        let left = libm::exp(-depth(crossing.index) / slant);
        let dimmed = libm::exp(-DIMMING * depth(crossing.index + 1));
        let phase = phase(direction.dot(light.sun));
        let air = Depth::default().and(self.density, crossing.way);
        Veil {
            left,
            light: [0, 1, 2].map(|c| {
                let direct = light.sunlight[c] * dimmed * phase * 2.0;
                (1.0 - left) * (direct + light.ambient[c] * FRAC_1_PI)
            }),
            seen: self.air.transmitted(air),
        }
    }
}

/// Where a ray crosses the layer.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Crossing {
    /// Its first place in the batch.
    index: usize,
    /// How far from the eye, metres.
    way: f64,
    /// Sine of the ray's elevation over the layer.
    rise: f64,
}

impl Scanned {
    /// Forgets the places of the batch before.
    pub(crate) fn clear(&mut self) {
        self.places.clear();
    }
}

impl Veil {
    /// The sky's light through the clouds.
    ///
    /// What the air before them scatters is part of `sky` already.
    pub(crate) fn over(self, sky: Colour) -> Colour {
        [0, 1, 2].map(|c| {
            let behind = sky[c] * self.left + self.light[c];
            sky[c] + (behind - sky[c]) * self.seen[c]
        })
    }
}

/// Scattering by droplets, per steradian: mostly even after many turns, with a forward peak.
fn phase(cosine: f64) -> f64 {
    const G: f64 = FORWARDS;
    let base = 1.0 + G * G - 2.0 * G * cosine;
    let peak = (1.0 - G * G) / (base * base.sqrt());
    (1.0 - FORWARD_SHARE + FORWARD_SHARE * peak) / (4.0 * PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clouds() -> Clouds {
        let mut graph = field::Graph::new();
        let depth = graph.constant(1.0).unwrap();
        Clouds {
            program: Program::compile(&graph, &[depth], Interval::new(0.0, 0.0)).unwrap(),
            layer: Layer {
                height: 2_000.0,
                thickness: 100.0,
                depth,
            },
            centre: DVec3::new(0.0, 0.0, -GROUND),
            radius: GROUND + 2_000.0,
            air: Air {
                rayleigh: 1.0,
                haze: 1.0,
            },
            density: Depth::density(1_000.0),
        }
    }

    #[test]
    fn rays_cross_the_layer_where_it_is_and_only_from_below() {
        let clouds = clouds();
        let eye = DVec3::new(0.0, 0.0, 25.0);
        for rise in [0.0f64, 1e-6, 0.01, 0.3, 1.0] {
            let direction = DVec3::new(0.0, (1.0 - rise * rise).sqrt(), rise);
            let (way, there) = clouds.crossing(eye, direction).unwrap();
            let place = eye + direction * way - clouds.centre;
            assert!((place.length() - clouds.radius).abs() < 1e-6);
            assert!((there - place.normalize().dot(direction)).abs() < 1e-9);
        }
        let above = DVec3::new(0.0, 0.0, 2_001.0);
        assert_eq!(clouds.crossing(above, DVec3::new(0.0, 0.6, -0.8)), None);
    }

    #[test]
    fn no_cloud_changes_nothing_and_far_clouds_fade_into_the_sky() {
        let sky = [0.2, 0.4, 0.8];
        let none = Veil {
            left: 1.0,
            light: [0.0; 3],
            seen: [0.9; 3],
        };
        assert_eq!(none.over(sky), sky);
        let far = Veil {
            left: 0.0,
            light: [9.0; 3],
            seen: [0.0; 3],
        };
        assert_eq!(far.over(sky), sky);
    }

    #[test]
    fn droplets_scatter_all_light() {
        const STEPS: i32 = 20_000;
        let total: f64 = (0..STEPS)
            .map(|i| phase((f64::from(i) + 0.5) / f64::from(STEPS) * 2.0 - 1.0))
            .sum();
        assert!((total * 4.0 * PI / f64::from(STEPS) - 1.0).abs() < 1e-4);
    }
}
