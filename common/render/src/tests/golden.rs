//! Pixels change only with the revision.

use super::scenes::{self, image};
use crate::{EvalSettings, REVISION};

/// The revision whose pixels these are.
const BLESSED: u32 = 1;

/// BLAKE3 of the planes of every small scene, f32 little-endian.
const DIGESTS: [(&str, &str); 6] = [
    ("sphere", ""),
    ("plane", ""),
    ("hypertexture", ""),
    ("ridges", ""),
    ("planet", ""),
    ("cube", ""),
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
