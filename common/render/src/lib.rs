//! Images from fields: rays, their first roots, anti-aliasing, shading, sky.
//!
//! A pixel depends on the scene, the image number and its own place, and on
//! nothing else: not on blocks, batches, threads or SIMD levels. This crate opens no file, reads no clock
//! and starts no thread; [`ImageRenderer`] is the way in.
//!
//! - `sample`: where and when the image is sampled (thesis §6.2, §6.3).
//! - `view`: how a sample becomes a ray.
//! - `trace`: where the ray meets the surface, guaranteed (thesis §5.2).
//! - `shade`, `sky`: what light leaves there and arrives here.
//! - `film`: samples become pixels.

mod assets;
mod counts;
mod crew;
mod error;
mod film;
mod grids;
mod places;
mod renderer;
mod sample;
mod shade;
mod sky;
mod times;
mod trace;
mod view;

#[cfg(test)]
mod tests;

pub use assets::Assets;
pub use counts::Counts;
pub use crew::{Alone, Crew};
pub use error::{Cancelled, RenderError};
pub use field::SimdLevel;
pub use renderer::{EvalSettings, ImageRenderer};
pub use sample::spline::FILTER_ORDER_MAX;
pub use sample::strata::RAYS_MAX;
pub use times::{Clock, Part, Times};
pub use trace::{Arithmetic, Means, Technique, methods};

/// The renderer's revision: raised whenever a pixel of any scene changes.
///
/// The test `pixels_change_only_with_the_revision` holds digests of small images
/// beside it. Jobs are pinned to one revision, and only workers of it get their tiles.
pub const REVISION: u32 = 3;

/// What every hit of every image is, whichever means found it: frames say so beside their settings.
pub const GUARANTEE: &str = "proven: no ray passes a point of its grid where the field is not positive, and neighbours \
                             on the grid are at most half a pixel's width apart";
