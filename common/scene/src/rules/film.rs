//! Rules of `[film]` and `[sampling]`.

use model::frames::FRAMES_MAX;
use model::rect::SIDE_MAX;

use super::{PIXELS_MAX, Problems, Wanted, brief};
use crate::description::{Film, Sampling};

/// Most rays along one side of a pixel.
pub const RAYS_MAX: u32 = 64;

/// Highest order of the B-spline filter: beyond it the filter is a Gaussian to the eye.
pub const FILTER_ORDER_MAX: u32 = 16;

pub(super) fn check(film: &Film, found: &mut Problems) {
    let size = film.resolution;
    let sides = 1..=SIDE_MAX;
    if !sides.contains(&size.width) || !sides.contains(&size.height) {
        found.add_with_help(
            "film.resolution",
            format!(
                "an image of {} × {} pixels cannot be made",
                size.width, size.height
            ),
            format!("each side has 1 to {SIDE_MAX} pixels"),
        );
    } else if size.rect().area() > PIXELS_MAX {
        found.add(
            "film.resolution",
            format!(
                "an image of {} × {} pixels is too large; {PIXELS_MAX} pixels are the most",
                size.width, size.height
            ),
        );
    } else if film.window.is_empty() || !size.rect().contains(film.window) {
        let crop = film.window;
        found.add_with_help(
            "film.crop",
            format!(
                "the crop [{}, {}, {}, {}] holds no pixel or leaves the image",
                crop.x0, crop.y0, crop.x1, crop.y1
            ),
            format!(
                "it is [x0, y0, x1, y1] with 0 <= x0 < x1 <= {} and 0 <= y0 < y1 <= {}",
                size.width, size.height
            ),
        );
    }
    if !(1..=FRAMES_MAX).contains(&film.images) {
        found.add(
            "film.images",
            format!("a scene has 1 to {FRAMES_MAX} images, not {}", film.images),
        );
    }
    let fps = Wanted::number(1e-3, 1e4, "the number of images per second");
    if found.range("film.fps", film.fps, fps) {
        let interval = 1.0 / film.fps;
        if !(film.shutter >= 0.0) {
            found.add(
                "film.shutter",
                "the shutter cannot stay open for a negative time",
            );
        } else if film.shutter >= interval {
            found.add_with_help(
                "film.shutter",
                format!(
                    "the shutter stays open for {} s, but images follow each other after {} s",
                    brief(film.shutter),
                    brief(interval)
                ),
                format!("half of that is usual: \"{} ms\"", brief(500.0 * interval)),
            );
        }
    }
    found.range(
        "film.exposure",
        film.exposure,
        Wanted::number(-32.0, 32.0, "the exposure in stops"),
    );
}

pub(super) fn check_sampling(sampling: &Sampling, found: &mut Problems) {
    if !(1..=RAYS_MAX).contains(&sampling.rays) {
        found.add_with_help(
            "sampling.rays",
            format!("a pixel cannot have {0} × {0} rays", sampling.rays),
            format!("rays = N means N × N rays per pixel, N from 1 to {RAYS_MAX}"),
        );
    }
    if sampling.filter_order > FILTER_ORDER_MAX {
        found.add_with_help(
            "sampling.filter_order",
            format!(
                "order {} is above the highest, {FILTER_ORDER_MAX}",
                sampling.filter_order
            ),
            "4 is the cubic B-spline; 0 samples pixel centres alone",
        );
    }
}
