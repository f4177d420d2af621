//! The head of a scratch file: what image it is for.

use model::{Digest, ImageNumber, Rect, Resolution};

const MAGIC: &[u8; 8] = b"FLYBYSCR";
const VERSION: u32 = 1;

/// Bytes of the header in use; the rest up to the first slot is a hole.
pub(super) const USED_BYTES: usize = 72;

/// What decides every pixel of an image: two scratch files of one identity hold the same film.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ScratchIdentity {
    /// Digest of the scene description.
    pub scene: Digest,
    /// Revision of the renderer.
    pub revision: u32,
    /// Which image of the animation.
    pub image: ImageNumber,
    /// Size of the whole image.
    pub resolution: Resolution,
}

impl ScratchIdentity {
    fn digest(&self) -> blake3::Hash {
        blake3::Hasher::new_derive_key("flyby scratch v1")
            .update(&self.scene.0)
            .update(&self.revision.to_le_bytes())
            .update(&self.image.0.to_le_bytes())
            .finalize()
    }

    /// The header of the scratch file of this image's window.
    pub(super) fn header(&self, window: Rect) -> [u8; USED_BYTES] {
        let mut header = [0; USED_BYTES];
        header[..8].copy_from_slice(MAGIC);
        header[8..12].copy_from_slice(&VERSION.to_le_bytes());
        header[12..44].copy_from_slice(self.digest().as_bytes());
        let Resolution { width, height } = self.resolution;
        let Rect { x0, y0, x1, y1 } = window;
        for (bytes, value) in header[44..]
            .chunks_exact_mut(4)
            .zip([width, height, x0, y0, x1, y1])
        {
            bytes.copy_from_slice(&value.to_le_bytes());
        }
        header
    }
}

/// Whether these first bytes of a file are some scratch file's, or nothing yet (a crash may leave
/// zeros), so that the file may be written over.
pub(super) fn is_ours(first: &[u8]) -> bool {
    first.starts_with(MAGIC) || first.iter().all(|byte| *byte == 0)
}

/// Name of a scratch file's header in its journal.
pub(super) fn binding(header: &[u8; USED_BYTES]) -> Digest {
    Digest(*blake3::hash(header).as_bytes())
}
