//! Reflectance by height and slope: layers over a ground.

use field::{Interval, NodeId, Points, Program, Scratch, SimdLevel};
use scene::Description;
use scene::description::{Layer, Material};

use super::patch::Patch;
use super::ramp::Colours;
use crate::assets::Assets;
use crate::error::RenderError;
use crate::sky::Colour;

/// A material with its fields compiled and its ramps decoded.
pub(crate) struct Palette {
    ground: Colour,
    layers: Vec<Coat>,
    /// The fields of all layers, one root for each.
    fields: Option<Program>,
    roots: usize,
    /// Which root varies the whole.
    variation: Option<usize>,
}

struct Coat {
    layer: Layer,
    ramp: Option<Colours>,
    cover: Option<usize>,
    height_offset: Option<usize>,
}

/// Values of a material's fields at a batch of places, one row for each field.
#[derive(Default)]
pub(crate) struct Fields {
    rows: Vec<Vec<f64>>,
}

impl Palette {
    /// Compiles the material of a scene for instants of one image.
    pub(crate) fn new(
        description: &Description,
        assets: &Assets,
        time: Interval,
    ) -> Result<Self, RenderError> {
        let material = &description.surface.material;
        let mut roots: Vec<NodeId> = Vec::new();
        let mut root = |id: Option<NodeId>| {
            id.map(|id| {
                roots.push(id);
                roots.len() - 1
            })
        };
        let variation = root(material.variation);
        let mut layers = Vec::new();
        for layer in &material.layers {
            layers.push(Coat {
                layer: layer.clone(),
                ramp: match &layer.ramp {
                    Some(ramp) => Some(Colours::load(ramp, description, assets)?),
                    None => None,
                },
                cover: root(layer.cover),
                height_offset: root(layer.height_offset),
            });
        }
        let fields = if roots.is_empty() {
            None
        } else {
            let graph = &description.surface.graph;
            Some(
                Program::compile(graph, &roots, time).map_err(|source| RenderError::Field {
                    what: "material's fields",
                    source,
                })?,
            )
        };
        Ok(Self {
            ground: material.albedo,
            layers,
            fields,
            roots: roots.len(),
            variation,
        })
    }

    /// Whether it has fields of its own.
    pub(crate) fn has_fields(&self) -> bool {
        self.fields.is_some()
    }

    /// Evaluates the material's fields at a batch of places.
    pub(crate) fn evaluate(
        &self,
        level: SimdLevel,
        points: &Points<'_>,
        scratch: &mut Scratch,
        fields: &mut Fields,
    ) {
        fields.rows.resize_with(self.roots, Vec::new);
        for row in &mut fields.rows {
            row.resize(points.len(), 0.0);
        }
        if let Some(program) = &self.fields {
            let mut rows: Vec<&mut [f64]> =
                fields.rows.iter_mut().map(|row| &mut row[..]).collect();
            program.evaluate(level, points, scratch, &mut rows);
        }
    }

    /// The mean reflectance of a patch around place `index` of the batch.
    pub(crate) fn albedo(&self, fields: &Fields, index: usize, patch: &Patch) -> Colour {
        let field = |root: Option<usize>| root.map(|root| fields.rows[root][index]);
        let mut albedo = self.ground;
        if self.layers.is_empty() && self.variation.is_none() {
            return albedo.map(share);
        }
        let (height_spread, slope, slope_spread) =
            (patch.height_spread(), patch.slope(), patch.slope_spread());
        for coat in &self.layers {
            let height = patch.height + field(coat.height_offset).unwrap_or(0.0);
            let by_height = |edges| mean_rise(height, height_spread, edges);
            let by_slope = |edges| mean_rise(slope, slope_spread, edges);
            let layer = &coat.layer;
            let mut cover = field(coat.cover).map_or(1.0, share);
            cover *= layer.above.map_or(1.0, by_height);
            cover *= layer.below.map_or(1.0, |edges| 1.0 - by_height(edges));
            cover *= layer.steeper.map_or(1.0, by_slope);
            cover *= layer.gentler.map_or(1.0, |edges| 1.0 - by_slope(edges));
            let ramp = coat.ramp.as_ref().map_or([1.0; 3], |ramp| ramp.at(height));
            for c in 0..3 {
                albedo[c] += (layer.albedo[c] * ramp[c] - albedo[c]) * cover;
            }
        }
        let variation = 1.0 + field(self.variation).unwrap_or(0.0);
        albedo.map(|albedo| share(albedo * variation))
    }
}

/// The mean reflectance of a material, roughly: what lights a surface from below.
pub(crate) fn mean_albedo(material: &Material) -> Colour {
    let count = 1.0 + material.layers.len() as f64;
    [0, 1, 2].map(|c| {
        let sum: f64 = material.layers.iter().map(|layer| layer.albedo[c]).sum();
        share((material.albedo[c] + sum) / count)
    })
}

/// `value`, clamped to 0 … 1; not a number is 0.
fn share(value: f64) -> f64 {
    if value > 0.0 {
        if value < 1.0 { value } else { 1.0 }
    } else {
        0.0
    }
}

/// The mean of a smooth rise over values spread evenly about `value`.
///
/// The rise is 0 below the first edge, 1 above the second, a cubic between; a step where they
/// coincide.
fn mean_rise(value: f64, spread: f64, [low, high]: [f64; 2]) -> f64 {
    /// Spreads below this share of the rise change it by less than 10⁻⁶ and have too few digits.
    const NARROW: f64 = 1e-3;
    let width = high - low;
    if width <= 0.0 {
        return if spread > 0.0 {
            share((value - low) / spread + 0.5)
        } else if value < low {
            0.0
        } else {
            1.0
        };
    }
    let u = (value - low) / width;
    let half = spread / width / 2.0;
    if half > NARROW {
        (risen(u + half) - risen(u - half)) / (2.0 * half)
    } else {
        let u = share(u);
        u * u * (3.0 - 2.0 * u)
    }
}

/// The integral of the rise from 0 to 1, up to `u`.
fn risen(u: f64) -> f64 {
    let within = share(u);
    let beyond = if u > 1.0 { u - 1.0 } else { 0.0 };
    within * within * within * (1.0 - 0.5 * within) + beyond
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn layer(albedo: f64) -> Layer {
        Layer {
            albedo: [albedo; 3],
            above: None,
            below: None,
            steeper: None,
            gentler: None,
            cover: None,
            height_offset: None,
            ramp: None,
        }
    }

    fn palette(layers: Vec<Layer>) -> Palette {
        Palette {
            ground: [0.5; 3],
            layers: layers
                .into_iter()
                .map(|layer| Coat {
                    layer,
                    ramp: None,
                    cover: None,
                    height_offset: None,
                })
                .collect(),
            fields: None,
            roots: 0,
            variation: None,
        }
    }

    #[test]
    fn a_layer_covers_between_its_edges_and_upper_layers_cover_lower_ones() {
        let snow = Layer {
            above: Some([10.0, 20.0]),
            gentler: Some([0.5, 1.0]),
            ..layer(0.9)
        };
        let palette = palette(vec![layer(0.2), snow]);
        let at = |height, slope| {
            // Seen straight on, by a pixel without width: nothing varies.
            let normal = DVec3::new(libm::sin(slope), 0.0, libm::cos(slope));
            let patch = Patch::new(normal, -normal, DVec3::Z, height, 0.0);
            palette.albedo(&Fields::default(), 0, &patch)[0]
        };
        assert_eq!(at(5.0, 0.0), 0.2);
        assert!((at(25.0, 0.0) - 0.9).abs() < 1e-12);
        assert!((at(15.0, 0.0) - 0.55).abs() < 1e-12);
        assert_eq!(at(25.0, 1.2), 0.2);
    }

    #[test]
    fn edges_that_coincide_are_a_step() {
        assert_eq!(mean_rise(0.999, 0.0, [1.0, 1.0]), 0.0);
        assert_eq!(mean_rise(1.0, 0.0, [1.0, 1.0]), 1.0);
        assert_eq!(mean_rise(1.25, 1.0, [1.0, 1.0]), 0.75);
        assert_eq!(share(f64::NAN), 0.0);
    }

    #[test]
    fn a_spread_takes_the_mean_of_the_rise() {
        const STEPS: i32 = 4_000;
        for (value, spread) in [(1.2, 0.5), (2.0, 9.0), (0.0, 3.0), (5.0, 1.0), (1.9, 0.004)] {
            let sum: f64 = (0..STEPS)
                .map(|i| {
                    let share = (f64::from(i) + 0.5) / f64::from(STEPS) - 0.5;
                    mean_rise(value + share * spread, 0.0, [1.0, 2.0])
                })
                .sum();
            let mean = mean_rise(value, spread, [1.0, 2.0]);
            assert!(
                (mean - sum / f64::from(STEPS)).abs() < 1e-5,
                "{value} {spread}"
            );
        }
    }
}
