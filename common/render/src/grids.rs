//! The grids of a scene: files decoded once, attached to the graph that needs them.

use std::borrow::Cow;

use field::grid::kept::Kept;
use field::grid::{SAMPLES_MAX, Samples};
use model::Digest;
use scene::{Description, grid_file};

use crate::assets::Assets;
use crate::error::RenderError;

/// Decoded files kept for the next image.
static FILES: Kept<Digest, Samples> = Kept::new(4);

/// The description with the samples of every file that its fields need.
pub(crate) fn attached<'a>(
    description: &'a Description,
    assets: &Assets,
) -> Result<Cow<'a, Description>, RenderError> {
    let needed = description.surface.graph.files_needed();
    if needed.is_empty() {
        return Ok(Cow::Borrowed(description));
    }
    let mut owned = description.clone();
    let mut total = 0usize;
    for file in needed {
        let list = &description.assets;
        let Some(asset) = list.get(file as usize) else {
            return Err(RenderError::NoSuchAsset {
                asset: file,
                assets: list.len(),
            });
        };
        let Some(bytes) = assets.bytes(asset.digest) else {
            return Err(RenderError::MissingAsset {
                name: asset.name.clone(),
                digest: asset.digest,
            });
        };
        let refuse = |reason| RenderError::BadGrid {
            name: asset.name.clone(),
            reason,
        };
        let samples = FILES
            .get(asset.digest, || grid_file::decode(bytes))
            .map_err(refuse)?;
        total = total.saturating_add(samples.values().len());
        if total > SAMPLES_MAX {
            return Err(refuse(format!(
                "with those before it, it has more than {SAMPLES_MAX} samples"
            )));
        }
        owned.surface.graph.attach(file, samples);
    }
    Ok(Cow::Owned(owned))
}
