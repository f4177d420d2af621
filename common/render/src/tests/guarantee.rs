//! The search finds what a scan over every point of the grid finds, and nothing else.

use core::sync::atomic::AtomicBool;

use field::hash::{hash, unit};
use field::{Interval, Points, Scratch, SimdLevel};
use glam::DVec3;

use super::scenes;
use crate::Counts;
use crate::sample::Sample;
use crate::trace::bracket::{Bracket, End};
use crate::trace::bundle::{Bundles, Span};
use crate::trace::means::{self, Means};
use crate::trace::methods::tests::reference::truth;
use crate::trace::methods::tests::surfaces::surfaces;
use crate::trace::methods::{FieldAlong, Wanted};
use crate::trace::{Goal, Hit, Ray, Surface, Tracer, bound};
use crate::view::View;

/// As wide as an image may be for its grid to be scanned.
fn scannable(mut scene: scene::Description) -> scene::Description {
    scene.film.resolution.width = 400;
    scene.film.window = scene.film.resolution.rect();
    scene
}

/// The field along a ray, as the search evaluates it.
pub(super) struct Values<'a> {
    pub(super) surface: &'a Surface,
    pub(super) ray: &'a Ray,
    pub(super) scratch: &'a mut Scratch,
}

impl Values<'_> {
    /// Values and footprints at some distances.
    pub(super) fn at(&mut self, distances: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let Self {
            surface,
            ray,
            scratch,
        } = self;
        let places: Vec<DVec3> = distances
            .iter()
            .map(|t| ray.origin + ray.direction * *t)
            .collect();
        let axis = |k: usize| places.iter().map(|p| p[k]).collect::<Vec<f64>>();
        let footprint: Vec<f64> = distances
            .iter()
            .map(|t| {
                let square = ray.from_eye.dot(ray.from_eye);
                let along = t * (2.0 * ray.from_eye.dot(ray.direction) + t);
                surface.footprint.at((square + along).sqrt())
            })
            .collect();
        let mut values = vec![0.0; distances.len()];
        surface.program.evaluate(
            SimdLevel::scalar(),
            &Points {
                x: &axis(0),
                y: &axis(1),
                z: &axis(2),
                footprint: &footprint,
                time: &vec![ray.time; distances.len()],
            },
            scratch,
            &mut [&mut values],
        );
        (values, footprint)
    }

    fn one(&mut self, t: f64) -> (f64, f64) {
        let (values, footprint) = self.at(&[t]);
        (values[0], footprint[0])
    }
}

/// Values of the field at every point of a ray's grid, until the first inside.
fn scan(surface: &Surface, ray: &Ray, scratch: &mut Scratch) -> Hit {
    /// Points that are evaluated together.
    const TOGETHER: i64 = 256;
    let Some((start, end)) = bound::clip(&surface.bound, ray.origin, ray.direction) else {
        return Hit::None;
    };
    let mut values = Values {
        surface,
        ray,
        scratch,
    };
    let (first, last) = (ray.grid.first_from(start), ray.grid.first_from(end));
    let within = |t: f64| bound::contains(&surface.bound, ray.origin + ray.direction * t);
    let mut begin = first;
    while begin <= last {
        let indices: Vec<i64> = (begin..=last.min(begin + TOGETHER - 1)).collect();
        begin += TOGETHER;
        let places: Vec<f64> = indices.iter().map(|index| ray.grid.place(*index)).collect();
        let (here, _) = values.at(&places);
        for ((index, far), inside) in indices.into_iter().zip(places).zip(here) {
            if inside > 0.0 || !within(far) {
                continue;
            }
            if index == 0 {
                return Hit::Surface(far);
            }
            let near = ray.grid.place(index - 1);
            let (outside, _) = values.one(near);
            if !within(near) {
                return Hit::Face(far);
            }
            let end = |t, value| End { t, value };
            let mut bracket = Bracket::new(end(near, outside), end(far, inside));
            loop {
                let (middle, footprint) = values.one(bracket.middle);
                if let Some(root) = bracket.narrow(middle, footprint) {
                    return Hit::Surface(root);
                }
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
            surface.ray(&sight)
        })
        .collect()
}

pub(super) fn trace(surface: &Surface, goal: Goal, rays: &[Ray]) -> (Vec<Hit>, Counts) {
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

/// Traces `count` rays at every scene and scans their grids.
fn searched_and_scanned(count: u32) {
    for (name, scene) in scenes::all() {
        let scene = scannable(scene);
        let view = View::new(&scene.camera, &scene.film, 0.0);
        let surface = Surface::new(&scene, &view, SimdLevel::best()).unwrap();
        let rays = rays(&surface, &view, count);
        let (hits, counts) = trace(&surface, Goal::Distance, &rays);
        let mut scratch = Scratch::new();
        for (ray, hit) in rays.iter().zip(&hits) {
            assert_eq!(*hit, scan(&surface, ray, &mut scratch), "{name}: {ray:?}");
        }
        assert!(hits.iter().any(|hit| *hit != Hit::None), "{name}");
        let per_ray = counts.steps / u64::from(count);
        assert!(
            per_ray < 400,
            "{name} took {per_ray} steps a ray: nothing is proven"
        );
    }
}

#[test]
fn the_search_finds_what_a_scan_finds() {
    searched_and_scanned(60);
}

#[test]
#[ignore = "long: tests/run --all"]
fn the_search_finds_what_a_scan_finds_along_10_000_rays() {
    searched_and_scanned(10_000);
}

/// The renderer's tracer at the surfaces that all methods are tried on, against the same reference.
///
/// A hit is the first grid point inside: a stretch of the solid that is longer than a gap of the grid must be met, and what is
/// met must be a root, or a place where the field is within its rounding of 0.
fn held_against_the_reference(count: u32) {
    /// Rays that lie next to each other: a bundle.
    const BUNDLE: u32 = 64;
    for reference in surfaces() {
        // With distance, cascades lose detail that the reference has.
        let Some((graph, root)) = &reference.plain else {
            continue;
        };
        let mut scene = scenes::orthographic(graph.clone(), *root, 3.0);
        scene.film.resolution.width = 400;
        scene.film.resolution.height = 400;
        scene.film.window = scene.film.resolution.rect();
        let view = View::new(&scene.camera, &scene.film, 0.0);
        let surface = Surface::new(&scene, &view, SimdLevel::best()).unwrap();
        let random = |ray: u32, dimension: u32| unit(hash(&[ray, dimension, 98]));
        let rays: Vec<Ray> = (0..count)
            .map(|index| {
                let patch = index / BUNDLE;
                let place = [0, 1].map(|axis| {
                    let within = f64::from((index >> (3 * axis)) & 7) + random(index, axis);
                    395.0 * random(patch, 10 + axis) + within
                });
                let sight = view.sight(&Sample {
                    place,
                    instant: 0.0,
                });
                surface.ray(&sight)
            })
            .collect();
        let (hits, _) = trace(&surface, Goal::Distance, &rays);
        let footprint = surface.footprint.base;
        let mut met = 0;
        for (ray, hit) in rays.iter().zip(&hits) {
            let Some((start, end)) = bound::clip(&surface.bound, ray.origin, ray.direction) else {
                assert_eq!(*hit, Hit::None);
                continue;
            };
            let along = FieldAlong {
                program: &reference.program,
                origin: ray.origin.into(),
                direction: ray.direction.into(),
                time: 0.0,
            };
            // The grid's last point may lie a gap beyond the bound.
            let truth = truth(
                &along,
                Interval::new(start, end + footprint),
                reference.finest,
                Wanted::All,
            );
            let told = || format!("{}: {ray:?} {hit:?} for {truth:?}", reference.name);
            let distance = hit.distance().unwrap_or(f64::INFINITY);
            if truth.begins {
                // Where the bound cuts through the solid.
                assert!((distance - start).abs() <= footprint, "{}", told());
                continue;
            }
            // The first root of a pair that is far enough apart is met at the latest.
            let roots: Vec<Interval> = truth.roots().collect();
            let mut entries = roots.chunks(2);
            let missed = entries.any(|pair| {
                let leaves = pair.get(1).map_or(end, |leave| leave.low);
                leaves - pair[0].high > footprint && pair[0].high + footprint < distance
            });
            assert!(!missed || truth.rough().next().is_some(), "{}", told());
            if hit.distance().is_some() {
                met += 1;
                // Polished within the gap of the grid, half a footprint, in which the side changes.
                let room = 0.5 * footprint;
                let is_root = truth
                    .roots()
                    .chain(truth.rough())
                    .any(|part| part.low - room < distance && distance < part.high + room);
                assert!(is_root, "{}", told());
            }
        }
        assert!(met > count / 20, "{}: {met}", reference.name);
    }
}

#[test]
fn what_the_tracer_meets_is_a_root_and_no_root_is_missed() {
    held_against_the_reference(1_024);
}

#[test]
#[ignore = "long: tests/run --all"]
fn what_the_tracer_meets_is_a_root_along_10_000_rays() {
    held_against_the_reference(10_048);
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
                scan(&surface, ray, &mut Scratch::new()) != Hit::None,
                "{name}"
            );
        }
        assert!(shaded.iter().any(|hit| *hit != Hit::None));
        assert!(shaded.contains(&Hit::None));
    }
}

/// Sixteen patches of some pixels, each a bundle at the start and four at the end.
fn patches(surface: &Surface, view: &View, [width, height]: [u32; 2]) -> Vec<Ray> {
    let random = |ray: u32, dimension: u32| unit(hash(&[ray, dimension, 7]));
    (0..1024)
        .map(|index| {
            let patch = index / 64;
            let place = [0, 1].map(|axis| {
                let side = [width, height];
                let corner = f64::from(side[axis as usize]) * random(patch, 10 + axis);
                let cell = f64::from((index >> (4 + axis)) & 1) + random(index, axis);
                corner + 1.5 * cell
            });
            let instant = random(index, 2);
            let sight = view.sight(&Sample { place, instant });
            surface.ray(&sight)
        })
        .collect()
}

#[test]
fn what_a_ray_shares_with_its_neighbours_cannot_be_seen() {
    for (name, scene) in scenes::all() {
        let view = View::new(&scene.camera, &scene.film, 0.0);
        let surface = Surface::new(&scene, &view, SimdLevel::best()).unwrap();
        let size = scene.film.resolution;
        let rays = patches(&surface, &view, [size.width, size.height]);
        let (hits, counts) = trace(&surface, Goal::Distance, &rays);
        assert!(
            counts.cone_steps > 0 || surface.walks() || surface.ground.is_some(),
            "{name}"
        );
        for (ray, hit) in rays.iter().zip(&hits) {
            let (alone, _) = trace(&surface, Goal::Distance, std::slice::from_ref(ray));
            assert_eq!(alone[0], *hit, "{name}: {ray:?}");
        }
        assert!(hits.iter().any(|hit| *hit != Hit::None), "{name}");
    }
}

#[test]
fn where_bundles_lead_their_rays_the_field_is_positive() {
    let mut gains = 0;
    for (name, scene) in scenes::all()
        .into_iter()
        .chain([("layers", scenes::layers()), ("goursat", scenes::goursat())])
    {
        let view = View::new(&scene.camera, &scene.film, 0.0);
        let surface = Surface::new(&scene, &view, SimdLevel::best()).unwrap();
        let size = scene.film.resolution;
        let rays = patches(&surface, &view, [size.width, size.height]);
        let mut spans = Vec::new();
        for (
            ray,
            Ray {
                origin, direction, ..
            },
        ) in rays.iter().enumerate()
        {
            if let Some((clear, end)) = bound::clip(&surface.bound, *origin, *direction) {
                let steps = 0.0;
                spans.push(Span {
                    ray,
                    clear,
                    end,
                    steps,
                });
            }
        }
        let mut scratch = Scratch::new();
        let mut led = |gradients: bool| {
            let surface = Surface {
                gradients,
                ..surface.clone()
            };
            let mut led = spans.clone();
            let counts = &mut Counts::default();
            Bundles::default().approach(&surface, &rays, &mut led, &mut scratch, counts);
            let mut sum = 0.0;
            for (from, to) in spans.iter().zip(&led) {
                let way = to.clear.min(to.end) - from.clear;
                assert!(way >= 0.0, "{name}: {way}");
                sum += way;
                let distances: Vec<f64> = (0..=200)
                    .map(|i| from.clear + way * f64::from(i) / 200.0)
                    .collect();
                let mut values = Values {
                    surface: &surface,
                    ray: &rays[from.ray],
                    scratch: &mut scratch,
                };
                let (values, _) = values.at(&distances);
                let is_clear = values.iter().all(|value| *value > 0.0);
                assert!(way == 0.0 || is_clear, "{name}: {from:?} to {to:?}");
            }
            sum
        };
        let by_values = led(false);
        if surface.clearances.have_tangents() {
            gains += u32::from(led(true) > by_values);
        }
    }
    assert!(gains > 2, "of {gains} scenes only");
}

#[test]
fn packets_of_any_size_and_order_meet_what_their_rays_meet_alone() {
    let scenes = [("plane", scenes::plane()), ("crags", scenes::crags())];
    for (name, scene) in scenes {
        let view = View::new(&scene.camera, &scene.film, 0.0);
        let rays = |surface: &Surface| rays(surface, &view, 300);
        let best = Surface::new(&scene, &view, SimdLevel::best()).unwrap();
        let all = rays(&best);
        let alone = all.chunks(1).map(|ray| trace(&best, Goal::Distance, ray));
        let alone: Vec<_> = alone.flat_map(|(hits, _)| hits).collect();
        assert!(alone.iter().any(|hit| *hit != Hit::None), "{name}");
        for level in SimdLevel::all_available() {
            let surface = Surface::new(&scene, &view, level).unwrap();
            for size in [5, 37, 129, all.len()] {
                // Every 7th ray, round and round: neighbours are strangers.
                for stride in [1, 7] {
                    let order: Vec<_> = (0..all.len()).map(|i| i * stride % all.len()).collect();
                    let mixed: Vec<_> = order.iter().map(|&i| all[i]).collect();
                    let packets = mixed.chunks(size);
                    let hits = packets.flat_map(|rays| trace(&surface, Goal::Distance, rays).0);
                    for (hit, &i) in hits.zip(&order) {
                        assert_eq!(hit, alone[i], "{name} at {level}, {size} together");
                    }
                }
            }
        }
    }
}

#[test]
fn rays_that_are_tried_by_each_means_end_however_steep_the_field() {
    let scene = scenes::needles();
    let view = View::new(&scene.camera, &scene.film, 0.0);
    let surface = Surface::new(&scene, &view, SimdLevel::best()).unwrap();
    let rays = means::rays(&surface, &view);
    for means in [Means::Values, Means::Tangents, Means::Stretches] {
        let tried = |steps_max| Surface {
            means,
            steps_max,
            ..surface.clone()
        };
        let (hits, counts) = trace(&tried(means::STEPS_MAX), Goal::Distance, &rays);
        assert_eq!(hits.len(), rays.len());
        assert!(counts.exhausted > 0, "{means:?}: {counts:?}");
        assert!(
            counts.steps < rays.len() as u64 * 1_026,
            "{means:?}: {counts:?}"
        );
    }
}
