//! How large the gallery's pictures are.

use model::Resolution;
use scene::Description;

use super::index::Figure;

/// Longest side of a picture, in pixels, and most of the N of its N × N rays a pixel, unless scenes are shown at
/// their own size: the whole gallery then takes minutes instead of an hour.
const SIDE_MAX: u32 = 360;
const RAYS_MAX: u32 = 2;

/// Size and rays of a figure's picture on the page; its proportions are those of the scene.
pub(crate) fn on_the_page(scene: &Description, figure: &Figure) -> (Resolution, u32) {
    let Resolution { width, height } = scene.film.resolution;
    let longest = width.max(height);
    let most = figure.side.unwrap_or(SIDE_MAX).max(1);
    let scaled = |side: u32| {
        if longest <= most {
            return side;
        }
        let exact = u64::from(side) * u64::from(most);
        let rounded = (exact + u64::from(longest) / 2) / u64::from(longest);
        u32::try_from(rounded).unwrap_or(most).max(1)
    };
    let resolution = Resolution {
        width: scaled(width),
        height: scaled(height),
    };
    (resolution, scene.sampling.rays.min(RAYS_MAX))
}
