//! Reflectance by height and slope: layers over a ground.

use field::{Interval, NodeId, Points, Program, Scratch, SimdLevel};
use scene::Description;
use scene::description::{Layer, Material};

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
    /// Whether any layer asks for slopes.
    by_slope: bool,
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
            by_slope: material.layers.iter().any(by_slope),
            layers,
            fields,
            roots: roots.len(),
            variation,
        })
    }

    /// Whether slopes matter, or any number will do for them.
    pub(crate) fn is_by_slope(&self) -> bool {
        self.by_slope
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

    /// The reflectance of place `index` of the batch, at a height over the seed and a slope.
    pub(crate) fn albedo(&self, fields: &Fields, index: usize, height: f64, slope: f64) -> Colour {
        let field = |root: Option<usize>| root.map(|root| fields.rows[root][index]);
        let mut albedo = self.ground;
        for coat in &self.layers {
            let height = height + field(coat.height_offset).unwrap_or(0.0);
            let layer = &coat.layer;
            let mut cover = field(coat.cover).map_or(1.0, share);
            cover *= layer.above.map_or(1.0, |edges| rise(height, edges));
            cover *= layer.below.map_or(1.0, |edges| 1.0 - rise(height, edges));
            cover *= layer.steeper.map_or(1.0, |edges| rise(slope, edges));
            cover *= layer.gentler.map_or(1.0, |edges| 1.0 - rise(slope, edges));
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

fn by_slope(layer: &Layer) -> bool {
    layer.steeper.is_some() || layer.gentler.is_some()
}

/// `value`, clamped to 0 … 1; not a number is 0.
fn share(value: f64) -> f64 {
    if value > 0.0 {
        if value < 1.0 { value } else { 1.0 }
    } else {
        0.0
    }
}

/// 0 below the first edge, 1 above the second, smooth between; a step where they coincide.
fn rise(value: f64, [low, high]: [f64; 2]) -> f64 {
    if high <= low {
        return if value < low { 0.0 } else { 1.0 };
    }
    let u = share((value - low) / (high - low));
    u * u * (3.0 - 2.0 * u)
}

#[cfg(test)]
mod tests {
    use super::*;

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
            by_slope: layers.iter().any(by_slope),
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
        assert!(palette.is_by_slope());
        let at = |height, slope| palette.albedo(&Fields::default(), 0, height, slope)[0];
        assert_eq!(at(5.0, 0.0), 0.2);
        assert!((at(25.0, 0.0) - 0.9).abs() < 1e-12);
        assert!((at(15.0, 0.0) - 0.55).abs() < 1e-12);
        assert_eq!(at(25.0, 1.2), 0.2);
    }

    #[test]
    fn edges_that_coincide_are_a_step() {
        assert_eq!(rise(0.999, [1.0, 1.0]), 0.0);
        assert_eq!(rise(1.0, [1.0, 1.0]), 1.0);
        assert_eq!(share(f64::NAN), 0.0);
    }
}
