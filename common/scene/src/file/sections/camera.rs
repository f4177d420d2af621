//! `[camera]`.

use crate::curve::Curve;
use crate::description::{Camera, GreatCircle, Path, PathKey, Projection, Seed};
use crate::file::mistake::Mistake;
use crate::file::section::Section;

/// Stands in for a view that was refused.
const VIEW: ([f64; 3], [f64; 3], [f64; 3]) = ([0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);

pub(super) fn read(root: &Section<'_>, seed: Seed) -> Camera {
    let section = root.table("camera");
    let otherwise = Path::Fixed {
        eye: VIEW.0,
        target: VIEW.1,
        up: VIEW.2,
    };
    let path = match root
        .has("camera")
        .then(|| section.one_of(&["fixed", "spline", "great_circle"]))
        .flatten()
    {
        Some("fixed") => fixed(&section.table("fixed")),
        Some("spline") => spline(&section.table("spline")).unwrap_or(otherwise),
        Some("great_circle") => {
            Path::GreatCircle(great_circle(&section.table("great_circle"), seed))
        }
        _ => otherwise,
    };
    Camera {
        path,
        projection: projection(&section),
    }
}

fn projection(section: &Section<'_>) -> Projection {
    if section.has("angle") && section.has("width") {
        section.one_of(&["angle", "width"]);
    }
    if section.has("width") {
        let width = section.curve("width").unwrap_or(Curve::Constant(1.0));
        return Projection::Orthographic { width };
    }
    let angle = section.curve("angle");
    Projection::Perspective {
        angle: angle.unwrap_or(Curve::Constant(core::f64::consts::FRAC_PI_3)),
    }
}

fn fixed(section: &Section<'_>) -> Path {
    let parts = ["eye", "target", "up"].map(|name| section.place3(name));
    match parts {
        [Some(eye), Some(target), Some(up)] => Path::Fixed { eye, target, up },
        _ => Path::Fixed {
            eye: VIEW.0,
            target: VIEW.1,
            up: VIEW.2,
        },
    }
}

fn spline(section: &Section<'_>) -> Option<Path> {
    let up = section.place3("up")?;
    let keys: Vec<Option<PathKey>> = section
        .tables("keys")
        .iter()
        .map(|key| {
            let parts = (key.number("time"), key.place3("eye"), key.place3("target"));
            Some(PathKey {
                time: parts.0?,
                eye: parts.1?,
                target: parts.2?,
            })
        })
        .collect();
    if !section.has("keys") {
        return None;
    }
    keys.into_iter()
        .collect::<Option<_>>()
        .map(|keys| Path::Spline { keys, up })
}

fn great_circle(section: &Section<'_>, seed: Seed) -> GreatCircle {
    let number = |name: &str, otherwise: f64| section.number(name).unwrap_or(otherwise);
    let curve = |name: &str| section.curve(name).unwrap_or(Curve::Constant(0.0));
    let radius = match seed {
        Seed::Sphere { radius } => number("radius", radius),
        Seed::Plane => {
            if !section.has("radius") {
                section.reader.add(Mistake {
                    message: "a great circle needs a sphere to fly over".into(),
                    label: "no radius".into(),
                    help: Some("give it a `radius`, or the surface a [surface.sphere]".into()),
                    place: section.place(),
                });
            }
            number("radius", 1.0)
        }
    };
    GreatCircle {
        radius,
        altitude: number("altitude", 0.0),
        speed: number("speed", 0.0),
        latitude: number("latitude", 0.0),
        longitude: number("longitude", 0.0),
        heading: number("heading", 0.0),
        pitch: curve("pitch"),
        yaw: curve("yaw"),
        roll: curve("roll"),
        clearance: number("clearance", 0.0),
    }
}
