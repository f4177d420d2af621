//! Pixels change only with the revision.

use super::scenes::{self, image};
use crate::{EvalSettings, REVISION};

/// The revision whose pixels these are.
const BLESSED: u32 = 3;

/// BLAKE3 of the planes of every small scene, f32 little-endian.
const DIGESTS: [(&str, &str); 8] = [
    (
        "sphere",
        "a97d2f9ca84f7d315a10d9d384c5d87765f22c8d5c8c7c00e0ae45eee261c4fc",
    ),
    (
        "plane",
        "c6b1729b39dbbba0239250e05c221be78b3f597b4c4a5228348e6bbb67e20f8d",
    ),
    (
        "hypertexture",
        "0905ce98614cc4bb9bdd963250e7dbba69669361eef5aff2e923446988647be3",
    ),
    (
        "ridges",
        "4f997c73d4b3b3127a8b8938cfba7d71fc7fafde99c2acf708a58c78bb73c48f",
    ),
    (
        "planet",
        "ca97dbfc564a3fcfec5aa5f6d7d94965e890248ae4de06e25c8c27fe0ac87245",
    ),
    (
        "cube",
        "666de9bc344f78af424f6959034fbe5c4e358d5857fb9c9809b686c94c158dbf",
    ),
    (
        "bodies",
        "e726c90017453619a1a959bf2a1a45977acad7c4709b545789d275014f6dfe10",
    ),
    (
        "blobs",
        "1b280868af1b95173b3a047e51e21510a1ddadaa018190ae92db815a86410fa0",
    ),
];

#[test]
fn pixels_change_only_with_the_revision() {
    let mut seen = String::new();
    let mut same = true;
    for ((name, scene), (blessed_name, blessed)) in scenes::all().into_iter().zip(DIGESTS) {
        let mut hasher = blake3::Hasher::new();
        for value in image(&scene, EvalSettings::default()).0 {
            hasher.update(&value.to_le_bytes());
        }
        let digest = hasher.finalize().to_hex();
        same &= name == blessed_name && digest.as_str() == blessed;
        seen.push_str(&format!("    (\"{name}\", \"{digest}\"),\n"));
    }
    assert!(
        same && BLESSED == REVISION,
        "the pixels are not those of revision {BLESSED}, and REVISION is {REVISION}. If they are meant to change, \
         raise REVISION in common/render/src/lib.rs by one, set BLESSED here to it, and replace \
         DIGESTS by:\n{seen}"
    );
}
