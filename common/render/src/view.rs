//! The camera of one image: poses over the shutter, and the ray of every sample.

use field::{BATCH, SimdLevel};
use glam::DVec3;
use scene::Pose;
use scene::description::{Camera, Film, Projection};

use crate::sample::Sample;
use crate::trace::batch::Lanes;

/// Spans of the shutter: within each the camera moves along straight lines.
const SPANS: usize = 256;

/// How wide a pixel is at a distance from the eye: `base` + `angle` · distance, in metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Footprint {
    /// Metres; 0 in perspective.
    pub(crate) base: f64,
    /// Radians, at the middle of the image; 0 for parallel rays.
    pub(crate) angle: f64,
}

impl Footprint {
    /// The width at a distance from the eye.
    #[inline]
    pub(crate) fn at(self, distance: f64) -> f64 {
        self.base + self.angle * distance
    }
}

/// A ray of sight.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Sight {
    /// Where it begins: the eye, or with parallel rays a place beside it. World metres.
    pub(crate) origin: DVec3,
    /// Unit vector.
    pub(crate) direction: DVec3,
    /// Seconds from image 0.
    pub(crate) time: f64,
}

/// Memory in which rays of sight are computed, lane by lane.
#[repr(align(64))]
pub(crate) struct Rows {
    x: Lanes,
    y: Lanes,
    share: Lanes,
    origin: [Lanes; 3],
    direction: [Lanes; 3],
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            x: [0.0; BATCH],
            y: [0.0; BATCH],
            share: [0.0; BATCH],
            origin: [[0.0; BATCH]; 3],
            direction: [[0.0; BATCH]; 3],
        }
    }
}

/// How the places of one image become rays.
#[derive(Clone, Debug)]
pub(crate) struct View {
    /// The pose at both ends of every span, with the width of a pixel: per metre of distance in
    /// perspective, in metres otherwise.
    poses: Vec<(Pose, f64)>,
    parallel: bool,
    start: f64,
    shutter: f64,
    /// Half of the image's sides, pixels.
    middle: [f64; 2],
}

impl View {
    /// The view of the image that opens its shutter at `start`, seconds from image 0.
    pub(crate) fn new(camera: &Camera, film: &Film, start: f64) -> Self {
        let flight = camera.flight();
        let width = f64::from(film.resolution.width);
        let parallel = matches!(camera.projection, Projection::Orthographic { .. });
        let spans = if film.shutter > 0.0 { SPANS } else { 1 };
        let poses = (0..=spans)
            .map(|i| {
                let time = start + film.shutter * (i as f64 / spans as f64);
                let extent = camera.projection.extent(time);
                let edges = if parallel {
                    extent
                } else {
                    2.0 * libm::tan(extent / 2.0)
                };
                (flight.pose(time), edges / width)
            })
            .collect();
        Self {
            poses,
            parallel,
            start,
            shutter: film.shutter,
            middle: [width / 2.0, f64::from(film.resolution.height) / 2.0],
        }
    }

    /// How wide a pixel is, one law for the whole image: that of its first instant.
    pub(crate) fn footprint(&self) -> Footprint {
        let pixel = self.poses[0].1;
        if self.parallel {
            Footprint {
                base: pixel,
                angle: 0.0,
            }
        } else {
            Footprint {
                base: 0.0,
                angle: pixel,
            }
        }
    }

    /// The eye when the shutter opens.
    pub(crate) fn eye(&self) -> DVec3 {
        self.poses[0].0.eye.into()
    }

    /// How far the eye moves while the shutter is open, metres.
    pub(crate) fn travel(&self) -> f64 {
        let eye = self.eye();
        self.poses
            .iter()
            .map(|(pose, _)| (DVec3::from(pose.eye) - eye).length())
            .fold(0.0, |most, way| if way > most { way } else { most })
    }

    /// The image's sides, pixels.
    pub(crate) fn size(&self) -> [f64; 2] {
        self.middle.map(|half| 2.0 * half)
    }

    /// Instants that occur, seconds from image 0.
    pub(crate) fn instants(&self) -> (f64, f64) {
        (self.start, self.start + self.shutter)
    }

    /// The ray of a sample.
    pub(crate) fn sight(&self, sample: &Sample) -> Sight {
        let spans = (self.poses.len() - 1) as f64;
        let along = sample.instant * spans;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "an instant is between 0 and 1"
        )]
        let span = (along as usize).min(self.poses.len() - 2);
        let ends = [&self.poses[span], &self.poses[span + 1]];
        let share = along - span as f64;
        let (origin, direction) = self.line(ends, share, sample.place);
        Sight {
            origin,
            direction,
            time: self.time(sample),
        }
    }

    /// The rays of samples, one after the other.
    pub(crate) fn sights(
        &self,
        level: SimdLevel,
        samples: &[Sample],
        rows: &mut Rows,
        mut see: impl FnMut(Sight),
    ) {
        let [first, last] = &self.poses[..] else {
            samples.iter().for_each(|sample| see(self.sight(sample)));
            return;
        };
        // Within one span all rays have the same poses: they are computed together.
        for samples in samples.chunks(BATCH) {
            for (i, sample) in samples.iter().enumerate() {
                [rows.x[i], rows.y[i]] = sample.place;
                rows.share[i] = sample.instant;
            }
            level.vectorize(
                #[inline(always)]
                || {
                    for i in 0..BATCH {
                        let place = [rows.x[i], rows.y[i]];
                        let (origin, direction) = self.line([first, last], rows.share[i], place);
                        for axis in 0..3 {
                            rows.origin[axis][i] = origin[axis];
                            rows.direction[axis][i] = direction[axis];
                        }
                    }
                },
            );
            for (i, sample) in samples.iter().enumerate() {
                see(Sight {
                    origin: [0, 1, 2].map(|axis| rows.origin[axis][i]).into(),
                    direction: [0, 1, 2].map(|axis| rows.direction[axis][i]).into(),
                    time: self.time(sample),
                });
            }
        }
    }

    fn time(&self, sample: &Sample) -> f64 {
        self.start + self.shutter * sample.instant
    }

    /// Where the ray through a place of the image begins, and its direction, a share of the way from one pose to another.
    #[inline(always)]
    fn line(&self, [a, b]: [&(Pose, f64); 2], share: f64, place: [f64; 2]) -> (DVec3, DVec3) {
        let between = |a: [f64; 3], b: [f64; 3]| {
            let (a, b) = (DVec3::from(a), DVec3::from(b));
            a + (b - a) * share
        };
        let pixel = a.1 + (b.1 - a.1) * share;
        let across = (place[0] - self.middle[0]) * pixel;
        let up = (self.middle[1] - place[1]) * pixel;
        let sideways = between(a.0.right, b.0.right) * across + between(a.0.up, b.0.up) * up;
        let eye = between(a.0.eye, b.0.eye);
        let forward = between(a.0.forward, b.0.forward);
        let (origin, towards) = if self.parallel {
            (eye + sideways, forward)
        } else {
            (eye, forward + sideways)
        };
        (origin, towards * (1.0 / towards.dot(towards).sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use model::Resolution;
    use scene::Curve;
    use scene::description::{Path, PathKey};

    fn film(shutter: f64) -> Film {
        let resolution = Resolution {
            width: 40,
            height: 30,
        };
        Film {
            resolution,
            window: resolution.rect(),
            images: 1,
            fps: 25.0,
            shutter,
            exposure: 0.0,
        }
    }

    fn moving(projection: Projection) -> Camera {
        let key = |time, x| PathKey {
            time,
            eye: [x, 0.0, 0.0],
            target: [x, 10.0, 0.0],
        };
        Camera {
            path: Path::Spline {
                keys: vec![key(0.0, 0.0), key(1.0, 8.0)],
                up: [0.0, 0.0, 1.0],
            },
            projection,
        }
    }

    #[test]
    fn edges_of_the_image_are_at_the_edges_of_the_angle() {
        let angle = 1.2;
        let view = View::new(
            &moving(Projection::Perspective {
                angle: Curve::Constant(angle),
            }),
            &film(0.0),
            0.0,
        );
        let right = view.sight(&Sample {
            place: [40.0, 15.0],
            instant: 0.0,
        });
        assert!((libm::atan2(right.direction.x, right.direction.y) - angle / 2.0).abs() < 1e-12);
        let top = view.sight(&Sample {
            place: [20.0, 0.0],
            instant: 0.0,
        });
        assert!(top.direction.z > 0.0 && top.direction.x.abs() < 1e-12);
        assert!((view.footprint().angle * 40.0 - 2.0 * libm::tan(angle / 2.0)).abs() < 1e-12);
    }

    #[test]
    fn the_eye_moves_while_the_shutter_is_open() {
        let view = View::new(
            &moving(Projection::Orthographic {
                width: Curve::Constant(4.0),
            }),
            &film(1.0),
            0.0,
        );
        for instant in [0.0, 0.3, 0.999, 1.0] {
            let sight = view.sight(&Sample {
                place: [20.0, 15.0],
                instant,
            });
            let pose = moving(Projection::Orthographic {
                width: Curve::Constant(4.0),
            })
            .pose(instant);
            assert!((sight.origin - DVec3::from(pose.eye)).length() < 1e-4);
            assert_eq!(sight.time, instant);
        }
    }
}
