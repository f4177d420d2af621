//! The search finds what a scan over every point of the grid finds, and nothing else.

use core::sync::atomic::AtomicBool;

use field::hash::{hash, unit};
use field::{Points, Scratch, SimdLevel};
use glam::DVec3;

use super::scenes;
use crate::Counts;
use crate::sample::Sample;
use crate::trace::bracket::{Bracket, End};
use crate::trace::{Goal, Hit, Ray, Surface, Tracer, bound};
use crate::view::View;

/// As wide as an image may be for its grid to be scanned.
fn scannable(mut scene: scene::Description) -> scene::Description {
    scene.film.resolution.width = 400;
    scene.film.window = scene.film.resolution.rect();
    scene
}

/// Values of the field at every point of a ray's grid, until the first inside.
fn scan(surface: &Surface, ray: &Ray) -> Hit {
    let Some((start, end)) = bound::clip(&surface.bound, ray.origin, ray.direction) else {
        return Hit::None;
    };
    let (first, last) = (ray.grid.first_from(start), ray.grid.first_from(end));
    let value = |t: f64| {
        let place = ray.origin + ray.direction * t;
        let distance = {
            let square = ray.from_eye.dot(ray.from_eye);
            (square + t * (2.0 * ray.from_eye.dot(ray.direction) + t)).sqrt()
        };
        let mut value = [0.0];
        surface.program.evaluate(
            SimdLevel::scalar(),
            &Points {
                x: &[place.x],
                y: &[place.y],
                z: &[place.z],
                footprint: &[surface.footprint.at(distance)],
                time: &[ray.time],
            },
            &mut Scratch::new(),
            &mut [&mut value],
        );
        (value[0], surface.footprint.at(distance))
    };
    let within = |t: f64| bound::contains(&surface.bound, ray.origin + ray.direction * t);
    for index in first..=last {
        let far = ray.grid.place(index);
        let (inside, _) = value(far);
        if inside > 0.0 || !within(far) {
            continue;
        }
        if index == 0 {
            return Hit::Surface(far);
        }
        let near = ray.grid.place(index - 1);
        let (outside, _) = value(near);
        if !within(near) {
            return Hit::Face(far);
        }
        let end = |t, value| End { t, value };
        let mut bracket = Bracket::new(end(near, outside), end(far, inside));
        loop {
            let (middle, footprint) = value(bracket.middle);
            if let Some(root) = bracket.narrow(middle, footprint) {
                return Hit::Surface(root);
            }
        }
    }
    Hit::None
}

fn rays(surface: &Surface, view: &View, count: u32) -> Vec<Ray> {
    let random = |ray: u32, dimension: u32| unit(hash(&[ray, dimension, 99]));
    (0..count)
        .map(|index| {
            let sight = view.sight(&Sample {
                place: [400.0 * random(index, 0), 40.0 * random(index, 1)],
                instant: random(index, 2),
            });
            Ray {
                origin: sight.origin,
                direction: sight.direction,
                from_eye: DVec3::ZERO,
                time: sight.time,
                grid: surface.sight,
            }
        })
        .collect()
}

fn trace(surface: &Surface, goal: Goal, rays: &[Ray]) -> (Vec<Hit>, Counts) {
    let mut hits = Vec::new();
    let mut counts = Counts::default();
    Tracer::default()
        .trace(
            surface,
            goal,
            rays,
            &AtomicBool::new(false),
            &mut counts,
            &mut hits,
        )
        .unwrap();
    (hits, counts)
}

#[test]
fn the_search_finds_what_a_scan_finds() {
    for (name, scene) in scenes::all() {
        let scene = scannable(scene);
        let view = View::new(&scene.camera, &scene.film, 0.0);
        let surface = Surface::new(&scene, &view, SimdLevel::best()).unwrap();
        let rays = rays(&surface, &view, 60);
        let (hits, counts) = trace(&surface, Goal::Distance, &rays);
        for (ray, hit) in rays.iter().zip(&hits) {
            assert_eq!(*hit, scan(&surface, ray), "{name}: {ray:?}");
        }
        assert!(hits.iter().any(|hit| *hit != Hit::None), "{name}");
        let per_ray = counts.steps / 60;
        assert!(
            per_ray < 400,
            "{name} took {per_ray} steps a ray: nothing is proven"
        );
    }
}

#[test]
fn rays_from_the_surface_are_found_to_be_in_shadow_by_the_scan_too() {
    for (name, scene) in [("ridges", scenes::ridges()), ("cube", scenes::cube())] {
        let scene = scannable(scene);
        let view = View::new(&scene.camera, &scene.film, 0.0);
        let surface = Surface::new(&scene, &view, SimdLevel::best()).unwrap();
        let sights = rays(&surface, &view, 80);
        let (hits, _) = trace(&surface, Goal::Distance, &sights);
        let sun = DVec3::from(scene.sun.direction(0.0));
        let shadows: Vec<Ray> = sights
            .iter()
            .zip(&hits)
            .filter_map(|(ray, hit)| {
                let distance = hit.distance()?;
                let from_eye = ray.direction * distance + sun * 0.01;
                Some(Ray {
                    origin: ray.origin + from_eye,
                    direction: sun,
                    from_eye,
                    grid: surface.shadow_grid(distance),
                    ..*ray
                })
            })
            .collect();
        let (shaded, _) = trace(&surface, Goal::Occlusion, &shadows);
        for (ray, hit) in shadows.iter().zip(&shaded) {
            assert_eq!(
                *hit != Hit::None,
                scan(&surface, ray) != Hit::None,
                "{name}"
            );
        }
        assert!(shaded.iter().any(|hit| *hit != Hit::None));
        assert!(shaded.contains(&Hit::None));
    }
}

#[test]
fn what_a_ray_shares_with_its_neighbours_cannot_be_seen() {
    for (name, scene) in scenes::all() {
        let view = View::new(&scene.camera, &scene.film, 0.0);
        let surface = Surface::new(&scene, &view, SimdLevel::best()).unwrap();
        let random = |ray: u32, dimension: u32| unit(hash(&[ray, dimension, 7]));
        // Sixteen patches of some pixels, each a bundle at the start and four at the end.
        let rays: Vec<Ray> = (0..1024)
            .map(|index| {
                let patch = index / 64;
                let place = [0, 1].map(|axis| {
                    let side = [scene.film.resolution.width, scene.film.resolution.height];
                    let corner = f64::from(side[axis as usize]) * random(patch, 10 + axis);
                    let cell = f64::from((index >> (4 + axis)) & 1) + random(index, axis);
                    corner + 1.5 * cell
                });
                let instant = random(index, 2);
                let sight = view.sight(&Sample { place, instant });
                Ray {
                    origin: sight.origin,
                    direction: sight.direction,
                    from_eye: DVec3::ZERO,
                    time: sight.time,
                    grid: surface.sight,
                }
            })
            .collect();
        let (hits, counts) = trace(&surface, Goal::Distance, &rays);
        assert!(counts.cone_steps > 0, "{name}");
        for (ray, hit) in rays.iter().zip(&hits) {
            let (alone, _) = trace(&surface, Goal::Distance, std::slice::from_ref(ray));
            assert_eq!(alone[0], *hit, "{name}: {ray:?}");
        }
        assert!(hits.iter().any(|hit| *hit != Hit::None), "{name}");
    }
}
