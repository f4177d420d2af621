//! A pixel depends on scene, image and place alone.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use model::{ImageNumber, Rect};

use super::scenes::{self, block, image, renderer};
use crate::{
    Assets, Cancelled, Crew, EvalSettings, ImageRenderer, Means, RenderError, SimdLevel, Technique,
};

#[test]
fn every_level_gives_the_same_bytes_and_counts() {
    for (name, scene) in scenes::all() {
        let reference = image(
            &scene,
            EvalSettings {
                level: SimdLevel::scalar(),
                ..EvalSettings::default()
            },
        );
        for level in SimdLevel::all_available() {
            assert!(
                image(
                    &scene,
                    EvalSettings {
                        level,
                        ..EvalSettings::default()
                    }
                ) == reference,
                "{name} differs at level {level}"
            );
        }
    }
}

#[test]
fn any_rectangle_holds_the_pixels_of_the_whole_and_its_results_add_up() {
    for (name, scene) in scenes::all() {
        let renderer = renderer(&scene, EvalSettings::default());
        let whole = scene.film.resolution.rect();
        let (reference, counts) = block(&renderer, whole);
        for side in [7, 13, 32] {
            let mut total = crate::Counts::default();
            let mut pixels = vec![f32::NAN; reference.len()];
            for y0 in (0..whole.y1).step_by(side) {
                for x0 in (0..whole.x1).step_by(side) {
                    let step = u32::try_from(side).unwrap();
                    let rect = Rect {
                        x0,
                        y0,
                        x1: (x0 + step).min(whole.x1),
                        y1: (y0 + step).min(whole.y1),
                    };
                    let (part, counts) = block(&renderer, rect);
                    total += counts;
                    paste(&part, rect, &mut pixels, whole);
                }
            }
            let equal = pixels
                .iter()
                .zip(&reference)
                .all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(equal, "{name} differs when cut into squares of {side}");
            assert_eq!(results(total), results(counts), "{name}, squares of {side}");
        }
    }
}

/// The counts of what was found. How much work that took depends on which rays were followed together.
fn results(counts: crate::Counts) -> [u64; 7] {
    [
        counts.pixels,
        counts.samples,
        counts.rays,
        counts.shadow_rays,
        counts.hits,
        counts.shadows,
        counts.not_finite,
    ]
}

fn paste(part: &[f32], rect: Rect, pixels: &mut [f32], whole: Rect) {
    let (width, height) = (rect.width() as usize, rect.height() as usize);
    let full = pixels.len() / 8;
    for (index, value) in part.iter().enumerate() {
        let (plane, rest) = (index / (width * height), index % (width * height));
        let (x, y) = (
            rect.x0 as usize + rest % width,
            rect.y0 as usize + rest / width,
        );
        pixels[plane * full + y * whole.width() as usize + x] = *value;
    }
}

#[test]
fn parts_of_a_block_take_the_work_of_the_block() {
    let mut cut = 0;
    for (name, mut scene) in scenes::all() {
        if scene.sampling.filter_order > 0 {
            scene.sampling.rays = 5;
        }
        let renderer = renderer(&scene, EvalSettings::default());
        let mut whole = scene.film.resolution.rect();
        (whole.x1, whole.y1) = (whole.x1.min(32), whole.y1.min(24));
        let (reference, counts) = block(&renderer, whole);
        let mut total = crate::Counts::default();
        let mut pixels = vec![f32::NAN; reference.len()];
        let mut parts = vec![whole];
        while let Some(part) = parts.pop() {
            if part.area() > renderer.together() {
                parts.extend(part.halves());
                cut += 1;
                continue;
            }
            let (values, counts) = block(&renderer, part);
            total += counts;
            paste(&values, part, &mut pixels, whole);
        }
        assert!(pixels == reference, "{name} differs when cut");
        assert_eq!(total, counts, "{name}");
    }
    assert!(cut > 0, "no scene has enough samples to be cut");
}

#[test]
fn a_crew_prepares_the_same_image() {
    /// A thread for every piece.
    struct Many(AtomicU64);
    impl Crew for Many {
        fn each(&self, count: usize, piece: &(dyn Fn(usize) + Sync)) {
            std::thread::scope(|scope| {
                for index in (0..count).rev() {
                    self.0.fetch_add(1, Ordering::Relaxed);
                    scope.spawn(move || piece(index));
                }
            });
        }
    }
    for (name, scene) in scenes::all() {
        let (crew, settings) = (Many(AtomicU64::new(0)), EvalSettings::default());
        let image = ImageNumber(1);
        let by = ImageRenderer::by(&crew, &scene, &Assets::new(), image, settings).unwrap();
        let alone = renderer(&scene, settings);
        assert_eq!(by.means(), alone.means(), "{name}");
        let whole = scene.film.resolution.rect();
        assert!(block(&by, whole) == block(&alone, whole), "{name}");
        assert!(crew.0.into_inner() > 1, "{name}: nothing is shared");
    }
}

#[test]
fn images_differ_and_nothing_is_lost_on_the_way() {
    let scene = scenes::planet();
    let (pixels, counts) = image(&scene, EvalSettings::default());
    assert!(pixels.iter().all(|value| value.is_finite()));
    assert_eq!(counts.samples, scene.film.resolution.rect().area() * 4);
    assert_eq!(counts.rays, counts.samples);
    assert!(counts.hits > 0 && counts.hits < counts.rays && counts.shadow_rays <= counts.hits);
    assert_eq!((counts.not_finite, counts.exhausted), (0, 0));
    let other = ImageRenderer::new(
        &scene,
        &Assets::new(),
        ImageNumber(2),
        EvalSettings::default(),
    )
    .unwrap();
    assert!(block(&other, scene.film.resolution.rect()).0 != pixels);
}

#[test]
fn a_clock_changes_neither_pixels_nor_counts() {
    /// A clock on which every reading is later than the last.
    fn clock() -> u64 {
        static NOW: AtomicU64 = AtomicU64::new(0);
        NOW.fetch_add(1, Ordering::Relaxed)
    }
    let scene = scenes::planet();
    let renderer = renderer(&scene, EvalSettings::default());
    let whole = scene.film.resolution.rect();
    let (reference, counts) = block(&renderer, whole);
    let mut pixels = Vec::new();
    let (counted, times) = renderer
        .render_block_timed(whole, &AtomicBool::new(false), &mut pixels, clock)
        .unwrap();
    assert!(pixels == reference && counted == counts);
    for (part, time) in times.parts() {
        assert!(time > 0, "{} took no time", part.name());
    }
}

#[test]
fn no_technique_of_the_tracer_changes_a_pixel() {
    for technique in Technique::ALL {
        let mut is_of_use = false;
        for (name, scene) in scenes::all().into_iter().chain([
            ("crags", scenes::crags()),
            ("layers", scenes::layers()),
            ("goursat", scenes::goursat()),
        ]) {
            let settings = EvalSettings::default();
            let (reference, counts) = image(&scene, settings);
            let without = ImageRenderer::without(
                Some(technique),
                &scene,
                &Assets::new(),
                ImageNumber(1),
                settings,
            )
            .unwrap();
            let (pixels, more) = block(&without, scene.film.resolution.rect());
            let equal = pixels
                .iter()
                .zip(&reference)
                .all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(equal, "{name} differs without {}", technique.name());
            assert_eq!(results(more), results(counts), "{name}");
            is_of_use |= more.evaluations > counts.evaluations
                || more.noise_evaluations > counts.noise_evaluations;
        }
        // Of no scene here: their shutters are as short as their images are small, whose rays look far between points; what
        // looks gain is counted in `led`.
        let is_left_out = matches!(
            technique,
            Technique::Slices | Technique::Hindsight | Technique::Bends
        );
        assert!(
            is_of_use || is_left_out,
            "{} gains nothing",
            technique.name()
        );
    }
}

#[test]
fn by_all_means_the_pixels_are_the_same() {
    for (name, scene) in scenes::all() {
        let (reference, counts) = image(&scene, EvalSettings::default());
        for means in Means::ALL {
            let settings = EvalSettings {
                means: Some(means),
                ..EvalSettings::default()
            };
            let (pixels, more) = image(&scene, settings);
            let equal = pixels
                .iter()
                .zip(&reference)
                .all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(equal, "{name} differs by {}", means.name());
            assert_eq!(results(more), results(counts), "{name}");
        }
    }
}

#[test]
fn a_cancelled_block_says_so() {
    let scene = scenes::hypertexture();
    let renderer = renderer(&scene, EvalSettings::default());
    let mut pixels = Vec::new();
    let rect = scene.film.resolution.rect();
    assert_eq!(
        renderer.render_block(rect, &AtomicBool::new(true), &mut pixels),
        Err(Cancelled)
    );
}

#[test]
fn what_cannot_be_rendered_is_refused_in_words() {
    let refuse = |change: fn(&mut scene::Description), image: u32| {
        let mut scene = scenes::plane();
        change(&mut scene);
        let settings = EvalSettings::default();
        match ImageRenderer::new(&scene, &Assets::new(), ImageNumber(image), settings) {
            Ok(_) => panic!("this was to be refused"),
            Err(error) => error,
        }
    };
    let late = refuse(|_| {}, 3);
    assert!(late.to_string().contains("3 images"), "{late}");
    let none = refuse(|scene| scene.sampling.rays = 0, 0);
    assert!(matches!(none, RenderError::Rays { rays: 0 }));
    let centre = refuse(|scene| scene.sampling.filter_order = 0, 0);
    assert!(matches!(centre, RenderError::CentreAlone { rays: 2 }));
    let missing = refuse(
        |scene| {
            scene.assets.push(scene::description::AssetRef {
                name: "sand.png".to_owned(),
                digest: model::Digest([5; 32]),
                bytes: 10,
            });
            scene
                .surface
                .material
                .layers
                .push(scene::description::Layer {
                    albedo: [1.0; 3],
                    above: None,
                    below: None,
                    steeper: None,
                    gentler: None,
                    cover: None,
                    height_offset: None,
                    ramp: Some(scene::description::Ramp {
                        asset: 0,
                        low: 0.0,
                        high: 1.0,
                    }),
                });
        },
        0,
    );
    assert!(missing.to_string().contains("sand.png"), "{missing}");
}
