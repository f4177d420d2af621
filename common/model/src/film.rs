//! What a film holds, and in which units: decided once, for every part.
//!
//! - Light is linear, premultiplied by alpha, with the primaries and white of
//!   ITU-R BT.709; inside, every value is an `f32`.
//! - Lengths are metres; the world's up axis is +z (the thesis's x₃), right-handed.
//! - Image `n` shows the instant `n / fps` with the shutter open over `[t, t + s]`.

/// How a channel is stored in a frame on disk. Inside, and in the film digest, all are `f32`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Storage {
    /// 16-bit floating point: enough for light and directions.
    Half,
    /// 32-bit floating point: half stops at 65,504, and a planet is larger.
    Float,
}

/// One plane of a film.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Channel {
    /// Its name in an EXR file; what stands before the dot is its layer.
    pub name: &'static str,
    /// How it is stored on disk.
    pub storage: Storage,
}

/// Number of channels of a film.
pub const CHANNEL_COUNT: usize = 8;

/// The channels of a film, in the order in which blocks and digests hold them.
///
/// `R`, `G`, `B`: radiance, premultiplied. `A`: the share of the pixel that the
/// surface covers, 0 to 1. `Z`: distance from the eye along the ray in metres, the mean over the
/// samples that hit, 0 where none did. `N`: the surface's unit normal in world
/// axes, averaged over the pixel, premultiplied.
pub const CHANNELS: [Channel; CHANNEL_COUNT] = [
    Channel {
        name: "R",
        storage: Storage::Half,
    },
    Channel {
        name: "G",
        storage: Storage::Half,
    },
    Channel {
        name: "B",
        storage: Storage::Half,
    },
    Channel {
        name: "A",
        storage: Storage::Half,
    },
    Channel {
        name: "Z",
        storage: Storage::Float,
    },
    Channel {
        name: "N.X",
        storage: Storage::Half,
    },
    Channel {
        name: "N.Y",
        storage: Storage::Half,
    },
    Channel {
        name: "N.Z",
        storage: Storage::Half,
    },
];

/// Bytes of one pixel in a block: every channel as a 32-bit float.
pub const PIXEL_BYTES: usize = CHANNEL_COUNT * 4;

/// Bytes of the largest block, a whole grid square.
pub const BLOCK_BYTES_MAX: usize =
    PIXEL_BYTES * (crate::rect::GRID_SQUARE * crate::rect::GRID_SQUARE) as usize;
