//! `[sun]` and `[sky]`.

use super::{Making, NOWHERE};
use crate::curve::Curve;
use crate::description::{Camera, Clouds, Path, Sky, Sun};
use crate::file::section::Section;
use crate::vector::local_frame;

/// East, north and up of the world itself.
const WORLD: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

pub(super) fn sun(section: &Section<'_>, camera: &Camera) -> Sun {
    let curve = |name: &str| section.curve(name).unwrap_or(Curve::Constant(0.0));
    let place = section.table("place");
    let frame = match (&camera.path, section.has("place")) {
        (_, true) => {
            let angle = |name: &str| place.number(name).unwrap_or(0.0);
            local_frame(angle("latitude"), angle("longitude"))
        }
        (Path::GreatCircle(circle), false) => local_frame(circle.latitude, circle.longitude),
        _ => WORLD,
    };
    Sun {
        frame,
        azimuth: curve("azimuth"),
        elevation: curve("elevation"),
        irradiance: section.colour("irradiance").unwrap_or([1.0; 3]),
        shadows: section.flag("shadows").unwrap_or(true),
    }
}

pub(super) fn sky(root: &Section<'_>, making: &Making<'_>) -> Sky {
    let section = root.table("sky");
    let kind = if root.has("sky") {
        section.one_of(&["plain", "air"])
    } else {
        Some("plain")
    };
    if kind == Some("air") {
        let air = section.table("air");
        return Sky::Air {
            rayleigh: air.number("rayleigh").unwrap_or(1.0),
            haze: air.number("haze").unwrap_or(1.0),
            visibility: air.curve("visibility").unwrap_or(Curve::Constant(1.0)),
            clouds: air
                .has("clouds")
                .then(|| clouds(&air.table("clouds"), making)),
        };
    }
    let plain = section.table("plain");
    Sky::Plain {
        radiance: plain.colour("radiance").unwrap_or([0.0; 3]),
        ambient: plain.colour("ambient").unwrap_or([0.0; 3]),
    }
}

fn clouds(section: &Section<'_>, making: &Making<'_>) -> Clouds {
    Clouds {
        height: section.number("height").unwrap_or(1.0),
        thickness: section.number("thickness").unwrap_or(1.0),
        depth: making.field(section, "depth").unwrap_or(NOWHERE),
    }
}
