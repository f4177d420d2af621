//! `[surface]` and `[material]`.

use field::Graph;

use super::{ANYWHERE, Making, NOWHERE};
use crate::description::{Bound, Layer, Material, Ramp, Seed, Surface};
use crate::file::mistake::Mistake;
use crate::file::quantity::{Dimension, quantity};
use crate::file::section::Section;
use crate::file::tree::Value;

pub(super) struct Read {
    pub(super) surface: Surface,
    pub(super) bound_given: bool,
}

/// What the terrain grows on: expressions need it before anything else.
///
/// Says nothing of mistakes: [`read`] does, when it comes to the same keys.
pub(super) fn seed(root: &Section<'_>) -> Seed {
    let part = |value: &Value, name: &str| match value {
        Value::Table(entries) => entries.get(name).map(|entry| entry.item.value.clone()),
        _ => None,
    };
    let surface = root.entry("surface").map(|entry| entry.item.value.clone());
    let sphere = surface.and_then(|surface| part(&surface, "sphere"));
    let Some(sphere) = sphere else {
        return Seed::Plane;
    };
    let radius = part(&sphere, "radius").and_then(|value| quantity(&value, Dimension::Length).ok());
    Seed::Sphere {
        radius: radius.unwrap_or(1.0),
    }
}

pub(super) fn read(root: &Section<'_>, seed: Seed, making: &mut Making<'_>) -> Read {
    let section = root.table("surface");
    if root.has("surface") {
        section.one_of(&["plane", "sphere"]);
        section.table("plane");
        section.table("sphere").number("radius");
    }
    let bound_given = section.has("bound");
    Read {
        surface: Surface {
            // Replaced by the fields' graph once all are read.
            graph: Graph::new(),
            field: making.field(&section, "field").unwrap_or(NOWHERE),
            seed,
            bound: bound(&section),
            material: material(&root.table("material"), making),
        },
        bound_given,
    }
}

fn bound(section: &Section<'_>) -> Bound {
    if !section.has("bound") {
        return ANYWHERE;
    }
    let section = section.table("bound");
    let read = match section.one_of(&["shell", "slab", "box"]) {
        Some("shell") => section
            .range("shell")
            .map(|[inner, outer]| Bound::Shell { inner, outer }),
        Some("slab") => section
            .range("slab")
            .map(|[low, high]| Bound::Slab { low, high }),
        Some(_) => {
            let corners = section.table("box");
            let corners = (corners.place3("min"), corners.place3("max"));
            match corners {
                (Some(min), Some(max)) => Some(Bound::Box { min, max }),
                _ => None,
            }
        }
        None => None,
    };
    read.unwrap_or(ANYWHERE)
}

fn material(section: &Section<'_>, making: &mut Making<'_>) -> Material {
    Material {
        albedo: section.colour("albedo").unwrap_or([0.5; 3]),
        variation: making.field(section, "variation"),
        layers: section
            .tables("layer")
            .iter()
            .map(|each| layer(each, making))
            .collect(),
    }
}

fn layer(section: &Section<'_>, making: &mut Making<'_>) -> Layer {
    if !section.has("albedo") && !section.has("ramp") {
        section.reader.add(Mistake {
            message: "the layer has no colour".into(),
            label: "needs `albedo` or `ramp`".into(),
            help: Some("for example albedo = [0.9, 0.9, 0.95]".into()),
            place: section.place(),
        });
    }
    Layer {
        albedo: section.colour("albedo").unwrap_or([1.0; 3]),
        above: section.range("above"),
        below: section.range("below"),
        steeper: section.range("steeper"),
        gentler: section.range("gentler"),
        cover: making.field(section, "cover"),
        height_offset: making.field(section, "height_offset"),
        ramp: section
            .has("ramp")
            .then(|| ramp(&section.table("ramp"), making))
            .flatten(),
    }
}

fn ramp(section: &Section<'_>, making: &mut Making<'_>) -> Option<Ramp> {
    let heights = section.range("heights");
    let file = section.text("file")?;
    let asset = making.asset(&file)?;
    let [low, high] = heights?;
    Some(Ramp { asset, low, high })
}
