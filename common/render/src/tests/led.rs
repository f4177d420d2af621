//! What leads rays and how they look along themselves changes what it costs to find a hit, never the hit.

use core::sync::atomic::AtomicBool;
use std::sync::Arc;

use field::SimdLevel;
use glam::DVec3;

use super::ground::ground;
use super::guarantee::trace;
use super::scenes;
use crate::Counts;
use crate::sample::Sample;
use crate::trace::surface::Looks;
use crate::trace::{Goal, Hit, Means, Ray, Surface, Technique, Tracer};
use crate::view::View;

/// Rays through a square of pixels in the middle of a large image of a scene, and its surface without a ground.
fn square(mut scene: scene::Description, width: u32, side: u32) -> (Surface, View, Vec<Ray>) {
    scene.film.resolution.width = width;
    scene.film.resolution.height = width;
    scene.film.window = scene.film.resolution.rect();
    let view = View::new(&scene.camera, &scene.film, 0.0);
    let surface = Surface {
        ground: None,
        ..Surface::new(&scene, &view, SimdLevel::best()).unwrap()
    };
    let rays = (0..side * side).map(|i| {
        let place = [i % side, i / side].map(|k| f64::from(width / 2 + k) + 0.5);
        let sight = view.sight(&Sample {
            place,
            instant: 0.0,
        });
        surface.ray(&sight)
    });
    let rays = rays.collect();
    (surface, view, rays)
}

/// Rays towards a low sun from where others met the surface.
fn towards_the_sun(surface: &Surface, rays: &[Ray], hits: &[Hit]) -> Vec<Ray> {
    let sun = DVec3::new(0.6, -0.76, 0.25).normalize();
    let lifted = rays.iter().zip(hits).filter_map(|(ray, hit)| {
        let distance = hit.distance()?;
        let from_eye = ray.direction * distance + DVec3::Z * surface.footprint.at(distance);
        Some(Ray {
            origin: ray.origin + from_eye,
            direction: sun,
            from_eye,
            grid: surface.shadow_grid(distance),
            ..*ray
        })
    });
    lifted.collect()
}

#[test]
fn led_rays_meet_what_others_meet_and_those_that_go_back_need_least() {
    for (name, scene, nearest) in [
        ("ridges", scenes::ridges(), 0.1),
        ("crags", scenes::crags(), 0.1),
        ("planet", scenes::planet(), 2.0),
    ] {
        let (plain, view, rays) = square(scene, 500, 40);
        let plain = Surface {
            means: Means::Values,
            ..plain
        };
        let ground = ground(&plain, &view, nearest, 250_000.0);
        let rounds = Surface {
            ground: Some(Arc::new(ground)),
            ..plain.clone()
        };
        let once = Surface {
            without: Some(Technique::Rounds),
            ..rounds.clone()
        };
        let (hits, unled) = trace(&plain, Goal::Distance, &rays);
        let shadows = towards_the_sun(&plain, &rays, &hits);
        let (shaded, in_sun) = trace(&plain, Goal::Occlusion, &shadows);
        let lit = shaded.iter().filter(|hit| **hit == Hit::None).count();
        assert!(lit > 0 && shadows.len() > 100, "{name}: {lit}");
        let mut needed = Vec::new();
        for surface in [&once, &rounds] {
            let (led, counts) = trace(surface, Goal::Distance, &rays);
            assert_eq!(led, hits, "{name}");
            assert!(
                2 * counts.evaluations < unled.evaluations,
                "{name}: {counts:?}"
            );
            let (led, counts) = trace(surface, Goal::Occlusion, &shadows);
            // Where a ray is in shadow, any point will do.
            for (led, plain) in led.iter().zip(&shaded) {
                assert_eq!(*led == Hit::None, *plain == Hit::None, "{name}");
            }
            needed.push(counts.evaluations);
        }
        assert!(
            3 * needed[1] < 2 * needed[0],
            "{name}: {needed:?} of {in_sun:?}"
        );
    }
}

#[test]
fn looking_behind_and_as_far_as_bends_say_need_fewer_evaluations() {
    let (surface, _, rays) = square(scenes::crags(), 2_000, 40);
    let by = |back, bends| {
        let looks = Looks { back, bends };
        let surface = Surface {
            means: Means::Stretches,
            looks,
            ..surface.clone()
        };
        trace(&surface, Goal::Distance, &rays)
    };
    let (hits, neither) = by(false, false);
    assert!(hits.iter().any(|hit| *hit != Hit::None));
    let (with_both, both) = by(true, true);
    assert_eq!(with_both, hits);
    for (what, looks) in [("behind", [false, true]), ("bends", [true, false])] {
        let [back, bends] = looks;
        let (others, counts) = by(back, bends);
        assert_eq!(others, hits, "without {what}");
        assert!(
            counts.evaluations > both.evaluations,
            "without {what} {}, with both {}, with neither {}",
            counts.evaluations,
            both.evaluations,
            neither.evaluations
        );
    }
}

#[test]
fn rays_far_from_the_surface_need_fewer_noises() {
    let (surface, _, rays) = square(scenes::layers(), 100, 48);
    assert!(surface.coarse.is_some());
    let whole = Surface {
        coarse: None,
        ..surface.clone()
    };
    for goal in [Goal::Distance, Goal::Occlusion] {
        let [(hits, coarse), (others, without)] = [&surface, &whole].map(|surface| {
            let (mut tracer, mut counts, mut hits) = <(Tracer, Counts, Vec<Hit>)>::default();
            let never = AtomicBool::new(false);
            let done = tracer.trace(surface, goal, &rays, &never, &mut counts, &mut hits);
            assert!(done.is_ok());
            (hits, tracer.scratch.noise_evaluations)
        });
        // Where a ray is in shadow, any point will do.
        let is_same = |(hit, other): (&Hit, &Hit)| match goal {
            Goal::Distance => hit == other,
            Goal::Occlusion => (*hit == Hit::None) == (*other == Hit::None),
        };
        assert!(hits.iter().zip(&others).all(is_same));
        assert!(5 * coarse < 4 * without, "{goal:?}: {coarse} of {without}");
    }
}
