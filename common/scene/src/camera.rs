//! Where the camera is at an instant: poses from angles and keys, never from accumulation.
//!
//! A pose is a function of the description and the instant alone, the same to
//! the bit on every machine.

use crate::description::{Camera, GreatCircle, Path, Projection};
use crate::spline::Spline;
use crate::vector::{Vector, cross, direction, local_frame, scale, sub, turn};

/// Where the camera is and how it is turned; the three directions are orthonormal.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pose {
    /// The eye, in world metres.
    pub eye: [f64; 3],
    /// Where the middle of the image looks.
    pub forward: [f64; 3],
    /// Towards larger columns; forward × up.
    pub right: [f64; 3],
    /// Towards smaller rows.
    pub up: [f64; 3],
}

/// A camera made ready for many poses: keys solved, angles resolved.
#[derive(Clone, Debug)]
pub struct Flight {
    track: Track,
}

#[derive(Clone, Debug)]
enum Track {
    Fixed(Pose),
    Spline {
        eye: Spline,
        target: Spline,
        up: Vector,
    },
    GreatCircle {
        circle: Box<GreatCircle>,
        /// Distance of the eye from the sphere's centre.
        distance: f64,
        /// From the centre to the eye at instant 0, and the way it heads from there.
        start: Vector,
        ahead: Vector,
    },
}

impl Camera {
    /// The pose at an instant. For many instants make a [`Camera::flight`] first.
    pub fn pose(&self, time: f64) -> Pose {
        self.flight().pose(time)
    }

    /// The camera made ready for many poses. Costs O(keys).
    pub fn flight(&self) -> Flight {
        let track = match &self.path {
            Path::Fixed { eye, target, up } => Track::Fixed(looking(*eye, *target, *up)),
            Path::Spline { keys, up } => Track::Spline {
                eye: Spline::new(keys.iter().map(|key| (key.time, key.eye))),
                target: Spline::new(keys.iter().map(|key| (key.time, key.target))),
                up: *up,
            },
            Path::GreatCircle(circle) => {
                let [east, north, up] = local_frame(circle.latitude, circle.longitude);
                Track::GreatCircle {
                    distance: circle.radius + circle.altitude,
                    start: up,
                    ahead: turn(north, east, libm::sincos(circle.heading)),
                    circle: Box::new(circle.clone()),
                }
            }
        };
        Flight { track }
    }
}

impl Projection {
    /// What sets the width of the view at an instant: the angle or the distance between its edges.
    pub fn extent(&self, time: f64) -> f64 {
        match self {
            Self::Perspective { angle } => angle.at(time),
            Self::Orthographic { width } => width.at(time),
        }
    }
}

impl Flight {
    /// The pose at an instant, seconds from image 0.
    pub fn pose(&self, time: f64) -> Pose {
        match &self.track {
            Track::Fixed(pose) => *pose,
            Track::Spline { eye, target, up } => looking(eye.at(time), target.at(time), *up),
            Track::GreatCircle {
                circle,
                distance,
                start,
                ahead,
            } => {
                let along = libm::sincos(circle.speed * time / distance);
                let up = turn(*start, *ahead, along);
                let forward = turn(*ahead, scale(*start, -1.0), along);
                let level = Pose {
                    eye: scale(up, *distance),
                    forward,
                    right: cross(forward, up),
                    up,
                };
                level
                    .yawed(circle.yaw.at(time))
                    .pitched(circle.pitch.at(time))
                    .rolled(circle.roll.at(time))
            }
        }
    }
}

impl Pose {
    /// Turned to the right about its up.
    fn yawed(self, angle: f64) -> Self {
        let by = libm::sincos(angle);
        Self {
            forward: turn(self.forward, self.right, by),
            right: turn(self.right, scale(self.forward, -1.0), by),
            ..self
        }
    }

    /// Turned up about its right.
    fn pitched(self, angle: f64) -> Self {
        let by = libm::sincos(angle);
        Self {
            forward: turn(self.forward, self.up, by),
            up: turn(self.up, scale(self.forward, -1.0), by),
            ..self
        }
    }

    /// Leaned to the right about its forward.
    fn rolled(self, angle: f64) -> Self {
        let by = libm::sincos(angle);
        Self {
            up: turn(self.up, self.right, by),
            right: turn(self.right, scale(self.up, -1.0), by),
            ..self
        }
    }
}

/// Looking from one place at another.
///
/// A view without direction looks along +y, one along `up` takes +y or +x for
/// up: validation refuses both at keys, but between keys a spline may touch them.
fn looking(eye: Vector, target: Vector, up: Vector) -> Pose {
    let forward = direction(sub(target, eye)).unwrap_or([0.0, 1.0, 0.0]);
    let right = [up, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
        .into_iter()
        .find_map(|up| sideways(forward, up))
        .expect("of three ways, +y and +x among them, one is not along the view");
    Pose {
        eye,
        forward,
        right,
        up: cross(right, forward),
    }
}

/// The unit vector to the right of a view; `None` where the view is along `up`.
pub(crate) fn sideways(forward: Vector, up: Vector) -> Option<Vector> {
    /// Sine of the least angle between view and up: below it the right is mostly rounding.
    const LEAST: f64 = 1e-6;
    let right = cross(forward, direction(up)?);
    (crate::vector::length(right) > LEAST)
        .then(|| direction(right))
        .flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::Curve;
    use crate::description::PathKey;
    use crate::vector::{dot, length};
    use proptest::prelude::*;

    const EARTH: f64 = 6_371_000.0;

    fn circle() -> GreatCircle {
        GreatCircle {
            radius: EARTH,
            altitude: 25.0,
            speed: 60.0 / 3.6,
            latitude: 0.8,
            longitude: 0.3,
            heading: 0.6,
            pitch: Curve::Constant(0.0),
            yaw: Curve::Constant(0.0),
            roll: Curve::Constant(0.0),
            clearance: 0.0,
        }
    }

    fn camera(path: Path) -> Camera {
        Camera {
            path,
            projection: Projection::Perspective {
                angle: Curve::Constant(1.0),
            },
        }
    }

    fn assert_orthonormal(pose: &Pose) {
        let axes = [pose.right, pose.up, pose.forward];
        for (i, a) in axes.iter().enumerate() {
            for (j, b) in axes.iter().enumerate() {
                let want = if i == j { 1.0 } else { 0.0 };
                assert!((dot(*a, *b) - want).abs() < 1e-14, "{pose:?}");
            }
        }
        assert!(length(sub(cross(pose.forward, pose.up), pose.right)) < 1e-14);
    }

    #[test]
    fn a_fixed_camera_looks_at_its_target_with_up_up() {
        let pose = camera(Path::Fixed {
            eye: [0.0, -4.0, 0.0],
            target: [0.0; 3],
            up: [0.0, 0.3, 1.0],
        })
        .pose(3.0);
        assert_eq!(pose.forward, [0.0, 1.0, 0.0]);
        assert_eq!(pose.right, [1.0, 0.0, 0.0]);
        assert_eq!(pose.up, [0.0, 0.0, 1.0]);
    }

    #[test]
    fn a_great_circle_flight_keeps_altitude_speed_and_neither_drifts_nor_wobbles() {
        let flight = camera(Path::GreatCircle(circle())).flight();
        let eyes: Vec<_> = (0..500)
            .map(|image| flight.pose(f64::from(image) / 25.0).eye)
            .collect();
        let step = 60.0 / 3.6 / 25.0;
        for eye in &eyes {
            assert!((length(*eye) - (EARTH + 25.0)).abs() < 1e-8);
        }
        for three in eyes.windows(3) {
            assert!((length(sub(three[1], three[0])) - step).abs() < 1e-8);
            let bend = sub(sub(three[2], three[1]), sub(three[1], three[0]));
            // Only the curvature of the circle is left: step²/r = 7·10⁻⁸ m.
            assert!(length(bend) < 1e-7, "{bend:?}");
        }
        let last = flight.pose(499.0 / 25.0);
        let way = circle().speed * 499.0 / 25.0;
        assert!((length(sub(last.eye, eyes[0])) - way).abs() < 1e-6);
    }

    #[test]
    fn a_whole_turn_ends_where_it_began() {
        let circle = circle();
        let time = core::f64::consts::TAU * (EARTH + 25.0) / circle.speed;
        let flight = camera(Path::GreatCircle(circle)).flight();
        assert!(length(sub(flight.pose(time).eye, flight.pose(0.0).eye)) < 1e-6);
    }

    #[test]
    fn heading_pitch_yaw_and_roll_turn_the_way_their_names_say() {
        let mut north = circle();
        (north.latitude, north.longitude, north.heading) = (0.0, 0.0, 0.0);
        let pose = |circle: &GreatCircle| camera(Path::GreatCircle(circle.clone())).pose(0.0);
        let close = |a: Vector, b: Vector| length(sub(a, b)) < 1e-12;
        let (up, ahead, east) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]);
        let level = pose(&north);
        assert!(close(level.up, up) && close(level.forward, ahead) && close(level.right, east));
        let quarter = Curve::Constant(core::f64::consts::FRAC_PI_2);
        let mut yawed = north.clone();
        yawed.yaw = quarter.clone();
        assert!(close(pose(&yawed).forward, east));
        let mut pitched = north.clone();
        pitched.pitch = quarter.clone();
        assert!(close(pose(&pitched).forward, up));
        let mut rolled = north.clone();
        rolled.roll = quarter;
        assert!(close(pose(&rolled).up, east));
        north.heading = core::f64::consts::FRAC_PI_2;
        assert!(close(pose(&north).forward, east));
    }

    #[test]
    fn a_spline_flight_passes_its_keys() {
        let key = |time, x| PathKey {
            time,
            eye: [x, 0.0, 10.0],
            target: [x, 50.0, 0.0],
        };
        let keys = vec![key(0.0, 0.0), key(1.0, 5.0), key(3.0, 6.0)];
        let flight = camera(Path::Spline {
            keys: keys.clone(),
            up: [0.0, 0.0, 1.0],
        })
        .flight();
        for key in keys {
            assert_eq!(flight.pose(key.time).eye, key.eye);
        }
    }

    proptest! {
        #[test]
        fn poses_are_orthonormal(
            angles in prop::array::uniform5(-1.5f64..1.5),
            time in 0.0f64..1e5,
            eye in prop::array::uniform3(-9.0f64..9.0),
            target in prop::array::uniform3(-9.0f64..9.0),
            up in prop::array::uniform3(-1.0f64..1.0),
        ) {
            let circle = GreatCircle {
                latitude: angles[0],
                heading: angles[1],
                pitch: Curve::Constant(angles[2]),
                yaw: Curve::Constant(angles[3]),
                roll: Curve::Constant(angles[4]),
                ..circle()
            };
            assert_orthonormal(&camera(Path::GreatCircle(circle)).pose(time));
            assert_orthonormal(&camera(Path::Fixed { eye, target, up }).pose(time));
        }
    }

    #[test]
    fn degenerate_views_still_give_a_pose() {
        for (target, up) in [
            ([0.0; 3], [0.0, 0.0, 1.0]),
            ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]),
            ([0.0, 1.0, 0.0], [0.0; 3]),
            ([0.0, 1.0, 0.0], [0.0, -2.0, 0.0]),
        ] {
            assert_orthonormal(&looking([0.0; 3], target, up));
        }
    }
}
