//! Rules of `[sun]` and `[sky]`.

use super::{LENGTH_MAX, Problems, Wanted};
use field::Graph;

use crate::description::{Clouds, Sky, Sun};
use crate::vector::dot;

/// Largest irradiance or radiance: far beyond any use, far below overflow in half floats' sums.
const LIGHT_MAX: f64 = 1e4;

pub(super) fn check_sun(sun: &Sun, found: &mut Problems) {
    let square = sun.frame.iter().enumerate().all(|(i, a)| {
        sun.frame
            .iter()
            .enumerate()
            .all(|(j, b)| (dot(*a, *b) - f64::from(u8::from(i == j))).abs() < 1e-9)
    });
    if !square {
        found.add(
            "sun.frame",
            "east, north and up must be unit vectors at right angles",
        );
    }
    let turn = Wanted::angle(-36000.0, 36000.0, "the azimuth");
    found.curve("sun.azimuth", &sun.azimuth, turn);
    let height = Wanted::angle(-90.0, 90.0, "the elevation");
    found.curve("sun.elevation", &sun.elevation, height);
    found.colour("sun.irradiance", sun.irradiance, LIGHT_MAX);
}

pub(super) fn check_sky(sky: &Sky, graph: &Graph, found: &mut Problems) {
    match sky {
        Sky::Plain { radiance, ambient } => {
            found.colour("sky.plain.radiance", *radiance, LIGHT_MAX);
            found.colour("sky.plain.ambient", *ambient, LIGHT_MAX);
        }
        Sky::Air {
            rayleigh,
            haze,
            visibility,
            clouds,
        } => {
            let amount = |what| Wanted::number(0.0, 100.0, what);
            found.range("sky.air.rayleigh", *rayleigh, amount("the amount of air"));
            found.range("sky.air.haze", *haze, amount("the amount of haze"));
            let wanted = Wanted::length(1e-3, LENGTH_MAX, "the visibility");
            found.curve("sky.air.visibility", visibility, wanted);
            if let Some(clouds) = clouds {
                check_clouds(clouds, graph, found);
            }
        }
    }
}

fn check_clouds(clouds: &Clouds, graph: &Graph, found: &mut Problems) {
    let wanted = |what| Wanted::length(1e-3, LENGTH_MAX, what);
    found.range(
        "sky.air.clouds.height",
        clouds.height,
        wanted("the height of clouds"),
    );
    found.range(
        "sky.air.clouds.thickness",
        clouds.thickness,
        wanted("the thickness of clouds"),
    );
    super::surface::scalar("sky.air.clouds.depth", graph, clouds.depth, found);
}
