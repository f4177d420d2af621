//! Images whose pixels are known in closed form.

use glam::DVec3;
use scene::Description;
use scene::description::Sky;

use super::scenes::{self, image};
use crate::EvalSettings;

/// One sample at the centre of each pixel, no shutter.
fn centres(mut scene: Description) -> Description {
    scene.sampling.rays = 1;
    scene.sampling.filter_order = 0;
    scene
}

/// Every pixel's values, and the direction of its centre in a level view along +y.
fn pixels(scene: &Description) -> Vec<([f64; 8], DVec3, u32)> {
    let (planes, _) = image(scene, EvalSettings::default());
    let resolution = scene.film.resolution;
    let area = planes.len() / 8;
    let pixel =
        2.0 * libm::tan(scene.camera.projection.extent(0.0) / 2.0) / f64::from(resolution.width);
    (0..area)
        .map(|index| {
            let (x, y) = (
                index % resolution.width as usize,
                index / resolution.width as usize,
            );
            let direction = DVec3::new(
                (x as f64 + 0.5 - f64::from(resolution.width) / 2.0) * pixel,
                1.0,
                (f64::from(resolution.height) / 2.0 - y as f64 - 0.5) * pixel,
            );
            let values = core::array::from_fn(|plane| f64::from(planes[plane * area + index]));
            (values, direction.normalize(), u32::try_from(y).unwrap())
        })
        .collect()
}

#[test]
fn a_sphere_has_its_silhouette_depth_and_normal() {
    let eye = DVec3::new(0.0, -4.0, 0.0);
    let mut hits = 0;
    for (values, direction, _) in pixels(&centres(scenes::sphere())) {
        let along = -eye.dot(direction);
        let discriminant = along * along - eye.dot(eye) + 1.0;
        if discriminant < 0.0 {
            assert_eq!(values[3..], [0.0; 5]);
            assert!((values[0] - 0.1).abs() < 1e-7 && (values[2] - 0.4).abs() < 1e-7);
            continue;
        }
        hits += 1;
        assert_eq!(values[3], 1.0);
        let distance = along - discriminant.sqrt();
        // The root is one to a thousandth of a footprint, along the normal.
        let footprint = 2.0 * libm::tan(0.4) / 48.0 * distance;
        let along_ray = footprint / 1000.0 / discriminant.sqrt();
        let tolerance = if along_ray < 1e-3 { along_ray } else { 0.02 };
        assert!(
            (values[4] - distance).abs() < tolerance,
            "{} {distance}",
            values[4]
        );
        let normal = (eye + direction * values[4]).normalize();
        for axis in 0..3 {
            assert!((values[5 + axis] - normal[axis]).abs() < 1e-5);
        }
    }
    // The cone that touches the sphere has tan² = 1/15; a pixel is 2 tan 0.4 / 48 wide.
    let pixel = 2.0 * libm::tan(0.4) / 48.0;
    let expected = core::f64::consts::PI / 15.0 / (pixel * pixel);
    assert!(
        (f64::from(hits) / expected - 1.0).abs() < 0.02,
        "{hits} {expected}"
    );
}

#[test]
fn a_plane_has_its_horizon_and_depth() {
    for (values, direction, row) in pixels(&centres(scenes::plane())) {
        if row < 20 {
            assert_eq!(values[3], 0.0);
            continue;
        }
        assert_eq!(values[3], 1.0);
        let distance = -2.0 / direction.z;
        assert!((values[4] / distance - 1.0).abs() < 1e-6);
        assert_eq!(values[5..], [0.0, 0.0, 1.0]);
    }
}

#[test]
fn a_constant_sky_is_constant_and_light_from_all_around_shows_the_albedo() {
    let mut scene = centres(scenes::sphere());
    scene.sun.irradiance = [0.0; 3];
    scene.sky = Sky::Plain {
        radiance: [1.0; 3],
        ambient: [core::f64::consts::PI; 3],
    };
    for (values, _, _) in pixels(&scene) {
        let expected = if values[3] == 0.0 {
            [1.0; 3]
        } else {
            [0.4, 0.3, 0.2]
        };
        for c in 0..3 {
            assert!((values[c] - expected[c]).abs() < 1e-6);
        }
    }
}

#[test]
fn the_suns_side_is_lit_and_the_other_is_not() {
    let mut scene = centres(scenes::sphere());
    scene.sky = Sky::Plain {
        radiance: [0.0; 3],
        ambient: [0.0; 3],
    };
    let sun = DVec3::from(scene.sun.direction(0.0));
    for (values, _, _) in pixels(&scene) {
        let normal = DVec3::new(values[5], values[6], values[7]);
        let facing = normal.dot(sun);
        if facing > 0.01 {
            assert!(values[0] > 0.0, "lit and not shaded by itself");
        } else if facing < -1e-6 {
            assert_eq!(values[..3], [0.0; 3]);
        }
    }
}

#[test]
fn coverage_of_a_filtered_edge_is_the_filters_share_above_it() {
    // The plane's horizon lies between rows 19 and 20: the tent's reach of one pixel.
    let mut scene = scenes::plane();
    scene.sampling.rays = 16;
    scene.sampling.filter_order = 2;
    for (values, _, row) in pixels(&scene) {
        let expected = match row {
            0..=18 => 0.0,
            19 => 0.125,
            20 => 0.875,
            _ => 1.0,
        };
        assert!(
            (values[3] - expected).abs() < 0.005,
            "row {row}: {}",
            values[3]
        );
    }
}

#[test]
fn a_scene_far_away_melts_into_the_horizon() {
    let mut scene = centres(scenes::plane());
    scene.sky = Sky::Air {
        rayleigh: 1.0,
        haze: 1.0,
        visibility: scene::Curve::Constant(20.0),
        clouds: None,
    };
    let rows = pixels(&scene);
    for x in 0..48 {
        let (above, below) = (&rows[19 * 48 + x].0, &rows[20 * 48 + x].0);
        for c in 0..3 {
            assert!(
                (above[c] / below[c] - 1.0).abs() < 0.05,
                "{} {}",
                above[c],
                below[c]
            );
        }
    }
}
