//! Rules of `[surface]` and `[material]`.

use field::{Graph, Kind, NodeId};

use super::{LAYERS_MAX, LENGTH_MAX, Problems, Wanted};
use crate::description::{Bound, Layer, Material, Seed, Surface};

pub(super) fn check(surface: &Surface, assets: usize, found: &mut Problems) {
    let length = |low, what| Wanted::length(low, LENGTH_MAX, what);
    if let Seed::Sphere { radius } = surface.seed {
        found.range("surface.sphere.radius", radius, length(1e-3, "the radius"));
    }
    scalar("surface.field", &surface.graph, surface.field, found);
    match surface.bound {
        Bound::Shell { inner, outer } => {
            let fits = found.range("surface.bound.shell", inner, length(0.0, "a radius"))
                && found.range("surface.bound.shell", outer, length(0.0, "a radius"));
            if fits {
                found.rising("surface.bound.shell", [inner, outer]);
            }
        }
        Bound::Slab { low, high } => {
            let fits = [low, high].into_iter().all(|height| {
                found.range(
                    "surface.bound.slab",
                    height,
                    length(-LENGTH_MAX, "a height"),
                )
            });
            if fits {
                found.rising("surface.bound.slab", [low, high]);
            }
        }
        Bound::Box { min, max } => {
            found.place("surface.bound.box", min);
            found.place("surface.bound.box", max);
            for k in 0..3 {
                found.rising("surface.bound.box", [min[k], max[k]]);
            }
        }
    }
    material(&surface.material, &surface.graph, assets, found);
    let files = surface.graph.files_needed();
    if files.iter().any(|file| *file as usize >= assets) {
        found.add(
            "surface.field",
            "a grid refers to a file that the scene does not name",
        );
    }
}

fn material(material: &Material, graph: &Graph, assets: usize, found: &mut Problems) {
    found.colour("material.albedo", material.albedo, 1.0);
    if let Some(field) = material.variation {
        scalar("material.variation", graph, field, found);
    }
    if material.layers.len() > LAYERS_MAX {
        found.add(
            "material.layer",
            format!(
                "the material has {} layers; {LAYERS_MAX} are the most",
                material.layers.len()
            ),
        );
    }
    for (index, each) in material.layers.iter().enumerate() {
        layer(
            &format!("material.layer[{index}]"),
            each,
            graph,
            assets,
            found,
        );
    }
}

fn layer(key: &str, layer: &Layer, graph: &Graph, assets: usize, found: &mut Problems) {
    let name = |part: &str| format!("{key}.{part}");
    found.colour(&name("albedo"), layer.albedo, 1.0);
    let heights = Wanted::length(-LENGTH_MAX, LENGTH_MAX, "a height");
    let slopes = Wanted::angle(0.0, 180.0, "a slope");
    for (part, range, wanted) in [
        ("above", layer.above, heights),
        ("below", layer.below, heights),
        ("steeper", layer.steeper, slopes),
        ("gentler", layer.gentler, slopes),
    ] {
        let Some(range) = range else { continue };
        if range
            .into_iter()
            .all(|end| found.range(&name(part), end, wanted))
        {
            found.rising(&name(part), range);
        }
    }
    for (part, field) in [
        ("cover", layer.cover),
        ("height_offset", layer.height_offset),
    ] {
        if let Some(field) = field {
            scalar(&name(part), graph, field, found);
        }
    }
    if let Some(ramp) = layer.ramp {
        let ends = [ramp.low, ramp.high];
        if ends
            .into_iter()
            .all(|end| found.range(&name("ramp.heights"), end, heights))
        {
            found.rising(&name("ramp.heights"), ends);
        }
        if ramp.asset as usize >= assets {
            found.add(
                name("ramp.file"),
                "the ramp refers to a file that the scene does not name",
            );
        }
    }
}

pub(super) fn scalar(key: &str, graph: &Graph, field: NodeId, found: &mut Problems) {
    let is_scalar = field.index() < graph.nodes().len() && graph.kind(field) == Kind::Scalar;
    if !is_scalar {
        found.add(key, "the field is not a number at every point");
    }
}
