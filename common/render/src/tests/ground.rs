//! Where cells of the ground lead rays, the field is positive.

use core::sync::atomic::AtomicBool;

use field::hash::{hash, unit};
use field::{Interval, Op, Scratch, SimdLevel};
use glam::DVec3;
use scene::description::{Bound, Path};

use super::guarantee::{Values, trace};
use super::scenes::{self, Fields};
use crate::sample::Sample;
use crate::trace::bundle::Span;
use crate::trace::ground::{Bounds, Ground, Site};
use crate::trace::{Goal, Ray, Surface, bound};
use crate::view::View;

/// The ground of a surface, made for so many rays.
pub(super) fn ground(surface: &Surface, view: &View, nearest: f64, rays: f64) -> Ground {
    let (open, close) = view.instants();
    let site = Site {
        field: &surface.program,
        level: surface.level,
        time: Interval::new(open, close),
        bound: &surface.bound,
        footprint: surface.footprint,
        eye: view.eye(),
        travel: view.travel(),
        nearest,
        rays,
    };
    Ground::new(&site).unwrap()
}

/// From where and how far a ray is led.
fn led(ground: &Ground, surface: &Surface, ray: &Ray, scratch: &mut Scratch) -> Option<(f64, f64)> {
    let (clear, end) = bound::clip(&surface.bound, ray.origin, ray.direction)?;
    let mut spans = [Span {
        ray: 0,
        clear,
        end,
        steps: 0.0,
    }];
    let bounds = Bounds {
        field: &surface.program,
        level: surface.level,
        scratch,
    };
    let never = AtomicBool::new(false);
    let rays = std::slice::from_ref(ray);
    ground.lead(bounds, rays, &mut spans, &never).unwrap();
    let far = spans[0].clear;
    assert!((clear..=end).contains(&far));
    Some((clear, far))
}

#[test]
fn where_the_ground_is_clear_the_field_is_positive() {
    ground_is_clear(scenes::ridges(), 0.1, [0.2, 0.4, 0.5]);
    ground_is_clear(scenes::planet(), 2.0, [0.2, 0.4, 0.5]);
}

/// Rays over grounds made for few rays and for many, and what share of their ways to the surface they must at least be led.
fn ground_is_clear(mut scene: scene::Description, nearest: f64, least: [f64; 3]) {
    scene.film.resolution.width = 400;
    let view = View::new(&scene.camera, &scene.film, 0.0);
    let surface = Surface::new(&scene, &view, SimdLevel::best()).unwrap();
    let mut scratch = Scratch::new();
    for (rays, least) in [1.0, 1e4, 1e7].into_iter().zip(least) {
        let ground = ground(&surface, &view, nearest, rays);
        let (mut way, mut gained) = (0.0, 0.0);
        for index in 0..400u32 {
            let random = |dimension| unit(hash(&[index, dimension, 11]));
            let sight = view.sight(&Sample {
                place: [400.0 * random(0), 300.0 * random(1)],
                instant: random(2),
            });
            let ray = surface.ray(&sight);
            let Some((clear, far)) = led(&ground, &surface, &ray, &mut scratch) else {
                continue;
            };
            let distances: Vec<f64> = (0..=500)
                .map(|i| clear + (far - clear) * f64::from(i) / 500.0)
                .collect();
            let mut values = Values {
                surface: &surface,
                ray: &ray,
                scratch: &mut scratch,
            };
            let (values, _) = values.at(&distances);
            assert!(
                far == clear || values.iter().all(|value| *value > 0.0),
                "{ray:?}"
            );
            let (hits, _) = trace(&surface, Goal::Distance, std::slice::from_ref(&ray));
            if let Some(hit) = hits[0].distance() {
                way += hit - clear;
                gained += far - clear;
            }
        }
        assert!(gained > least * way, "{rays} rays: {gained} of {way}");
    }
}

/// Over a plane a cell's function is the field itself, so that nothing but the caution of 32 bits keeps rays above it.
#[test]
fn rays_over_a_tilted_plane_are_led_as_far_as_it_and_no_farther() {
    let mut fields = Fields::new();
    let p = fields.position();
    let mut field = fields.op(Op::Z, &[p], &[]);
    for (axis, slope) in [(Op::X, -0.05), (Op::Y, 0.03)] {
        let along = fields.op(axis, &[p], &[]);
        let slope = fields.number(slope);
        let rise = fields.op(Op::Mul, &[along, slope], &[]);
        field = fields.op(Op::Add, &[field, rise], &[]);
    }
    let mut scene = scenes::plane();
    (scene.surface.graph, scene.surface.field) = (fields.0, field);
    scene.surface.bound = Bound::Slab {
        low: -2e3,
        high: 2e3,
    };
    let height = |x: f64, y: f64| 0.05 * x - 0.03 * y;
    // Far from the origin of the world, too.
    for [x, y] in [[0.0, 0.0], [20_000.0, 15_000.0]] {
        let eye = DVec3::new(x, y, height(x, y) + 1.7);
        scene.camera.path = Path::Fixed {
            eye: eye.to_array(),
            target: [x, y + 10.0, eye.z],
            up: [0.0, 0.0, 1.0],
        };
        let view = View::new(&scene.camera, &scene.film, 0.0);
        let surface = Surface::new(&scene, &view, SimdLevel::best()).unwrap();
        let ground = ground(&surface, &view, 1.7, 1e6);
        let mut scratch = Scratch::new();
        let (mut falls, mut close) = (0, 0);
        for index in 0..20_000u32 {
            let random = |dimension| unit(hash(&[index, dimension, 23]));
            // From the eye, and from up to ten kilometres away from it, low over the ground.
            let away = if index % 3 == 0 {
                0.0
            } else {
                libm::exp(random(0) * libm::log(1e4))
            };
            let (turn, heading) = (6.3 * random(1), 6.3 * random(2));
            let mut origin = eye + DVec3::new(libm::cos(turn), libm::sin(turn), 0.0) * away;
            origin.z = height(origin.x, origin.y) + 2.0 * random(3);
            let direction = DVec3::new(
                libm::cos(heading),
                libm::sin(heading),
                0.4 * random(4) - 0.2,
            );
            let ray = Ray {
                origin,
                direction: direction.normalize(),
                from_eye: origin - eye,
                time: 0.0,
                grid: surface.shadow_grid(origin.distance(eye)),
            };
            let Some((clear, far)) = led(&ground, &surface, &ray, &mut scratch) else {
                continue;
            };
            let mut values = Values {
                surface: &surface,
                ray: &ray,
                scratch: &mut scratch,
            };
            let (values, _) = values.at(&[clear, far]);
            let (start, end) = (values[0], values[1]);
            assert!(far == clear || end > 0.0, "{ray:?}: {end} at {far}");
            if end < start {
                falls += 1;
                close += u32::from(end < 1e-3 * start);
            }
        }
        assert!(falls > 5_000 && 2 * close > falls, "{close} of {falls}");
    }
}
