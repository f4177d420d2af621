//! Where the sun stands at an instant.

use crate::description::Sun;
use crate::vector::turn;

impl Sun {
    /// The unit vector towards the sun at an instant.
    pub fn direction(&self, time: f64) -> [f64; 3] {
        let [east, north, up] = self.frame;
        let level = turn(north, east, libm::sincos(self.azimuth.at(time)));
        let (sine, cosine) = libm::sincos(self.elevation.at(time));
        turn(level, up, (sine, cosine))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::Curve;

    #[test]
    fn azimuth_runs_clockwise_from_north() {
        let sun = |azimuth: f64, elevation: f64| Sun {
            frame: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            azimuth: Curve::Constant(azimuth.to_radians()),
            elevation: Curve::Constant(elevation.to_radians()),
            irradiance: [1.0; 3],
            shadows: true,
        };
        let close = |a: [f64; 3], b: [f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-12);
        assert!(close(sun(0.0, 0.0).direction(0.0), [0.0, 1.0, 0.0]));
        assert!(close(sun(90.0, 0.0).direction(0.0), [1.0, 0.0, 0.0]));
        assert!(close(sun(30.0, 90.0).direction(0.0), [0.0, 0.0, 1.0]));
    }
}
