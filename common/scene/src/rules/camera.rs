//! Rules of `[camera]`.

use super::{LENGTH_MAX, Problems, TIME_MAX, Wanted};
use crate::camera::sideways;
use crate::description::{Camera, GreatCircle, Path, Projection};
use crate::vector::{direction, sub};

/// Most keys of a spline path.
pub const PATH_KEYS_MAX: usize = 4096;

pub(super) fn check(camera: &Camera, found: &mut Problems) {
    match &camera.projection {
        Projection::Perspective { angle } => {
            let wanted = Wanted::angle(0.001, 179.0, "the angle of view");
            found.curve("camera.angle", angle, wanted);
        }
        Projection::Orthographic { width } => {
            let wanted = Wanted::length(1e-6, LENGTH_MAX, "the width of view");
            found.curve("camera.width", width, wanted);
        }
    }
    match &camera.path {
        Path::Fixed { eye, target, up } => {
            found.place("camera.fixed.eye", *eye);
            found.place("camera.fixed.target", *target);
            found.place("camera.fixed.up", *up);
            view("camera.fixed", [*eye, *target, *up], found);
        }
        Path::Spline { keys, up } => {
            found.place("camera.spline.up", *up);
            if !(2..=PATH_KEYS_MAX).contains(&keys.len()) {
                found.add(
                    "camera.spline.keys",
                    format!("a spline has 2 to {PATH_KEYS_MAX} keys, not {}", keys.len()),
                );
            }
            for (index, key) in keys.iter().enumerate() {
                let name = format!("camera.spline.keys[{index}]");
                let time = Wanted::time(-TIME_MAX, TIME_MAX, "a key's instant");
                found.range(&format!("{name}.time"), key.time, time);
                found.place(&format!("{name}.eye"), key.eye);
                found.place(&format!("{name}.target"), key.target);
                view(&name, [key.eye, key.target, *up], found);
                if index > 0 && !(keys[index - 1].time < key.time) {
                    found.add(
                        format!("{name}.time"),
                        format!(
                            "instants of keys must rise, but {} s follows {} s",
                            key.time,
                            keys[index - 1].time
                        ),
                    );
                }
            }
        }
        Path::GreatCircle(circle) => great_circle(circle, found),
    }
}

fn great_circle(circle: &GreatCircle, found: &mut Problems) {
    let key = |name: &str| format!("camera.great_circle.{name}");
    let numbers = [
        (
            "radius",
            circle.radius,
            Wanted::length(1e-3, LENGTH_MAX, "the radius"),
        ),
        (
            "altitude",
            circle.altitude,
            Wanted::length(0.0, LENGTH_MAX, "the altitude"),
        ),
        (
            "clearance",
            circle.clearance,
            Wanted::length(0.0, LENGTH_MAX, "the clearance"),
        ),
        ("speed", circle.speed, Wanted::speed(0.0, 1e6, "the speed")),
        (
            "latitude",
            circle.latitude,
            Wanted::angle(-90.0, 90.0, "the latitude"),
        ),
        (
            "longitude",
            circle.longitude,
            Wanted::angle(-360.0, 360.0, "the longitude"),
        ),
        (
            "heading",
            circle.heading,
            Wanted::angle(-360.0, 360.0, "the heading"),
        ),
    ];
    for (name, value, wanted) in numbers {
        found.range(&key(name), value, wanted);
    }
    let turn = |what| Wanted::angle(-36000.0, 36000.0, what);
    let pitch = Wanted::angle(-90.0, 90.0, "the pitch");
    found.curve(&key("pitch"), &circle.pitch, pitch);
    found.curve(&key("yaw"), &circle.yaw, turn("the yaw"));
    found.curve(&key("roll"), &circle.roll, turn("the roll"));
}

fn view(key: &str, [eye, target, up]: [[f64; 3]; 3], found: &mut Problems) {
    let Some(forward) = direction(sub(target, eye)) else {
        found.add(
            format!("{key}.target"),
            "the camera looks at the place where it stands, so its view has no direction",
        );
        return;
    };
    if sideways(forward, up).is_none() {
        found.add_with_help(
            format!("{key}.up"),
            "the camera looks along its own up, so it cannot tell left from right",
            "give another `up`, for example [0, 1, 0]",
        );
    }
}
