//! Why an image cannot be rendered, in sentences.

use model::{Digest, ImageNumber};

/// Why no renderer could be made for an image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The animation is shorter.
    #[error("the scene has {images} images, counted from 0, so there is no image {image}")]
    NoSuchImage {
        /// What was asked for.
        image: ImageNumber,
        /// How many there are.
        images: u32,
    },
    /// More samples than [`crate::RAYS_MAX`] × [`crate::RAYS_MAX`] per pixel, or none.
    #[error("{rays} × {rays} rays per pixel; 1 to {max} along each side are possible", max = crate::RAYS_MAX)]
    Rays {
        /// Rays along each side.
        rays: u32,
    },
    /// A filter wider than [`crate::FILTER_ORDER_MAX`].
    #[error("a filter of order {order}; orders up to {max} are possible", max = crate::FILTER_ORDER_MAX)]
    FilterOrder {
        /// The order.
        order: u32,
    },
    /// The samples of a pixel centre coincide.
    #[error(
        "filter order 0 samples pixel centres alone, so it goes with 1 ray per pixel, not {rays} × {rays}"
    )]
    CentreAlone {
        /// Rays along each side.
        rays: u32,
    },
    /// A file that the scene names was not handed over.
    #[error("the asset `{name}` ({digest}) is missing; fetch it before rendering")]
    MissingAsset {
        /// The scene's name for it.
        name: String,
        /// What it must contain.
        digest: Digest,
    },
    /// The description names an asset that it does not list.
    #[error("the scene refers to asset number {asset}, but lists {assets}")]
    NoSuchAsset {
        /// The number.
        asset: u32,
        /// How many are listed.
        assets: usize,
    },
    /// An asset is no image that can be read.
    #[error("the asset `{name}` is not a PNG image that can be read")]
    BadImage {
        /// The scene's name for it.
        name: String,
        /// What the decoder says.
        #[source]
        source: png::DecodingError,
    },
    /// An asset is a PNG of a kind or size that a ramp cannot be.
    #[error("the asset `{name}` cannot be a ramp: {reason}")]
    BadRamp {
        /// The scene's name for it.
        name: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// An asset is no grid of samples, or too large a one.
    #[error("the asset `{name}` is no grid: {reason}")]
    BadGrid {
        /// The scene's name for it.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A field cannot be compiled.
    #[error("the {what} cannot be compiled")]
    Field {
        /// Which field.
        what: &'static str,
        /// What the compiler says.
        #[source]
        source: field::CompileError,
    },
}

/// The caller asked to stop before the block was done; nothing of it may be used.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("rendering was cancelled")]
pub struct Cancelled;
