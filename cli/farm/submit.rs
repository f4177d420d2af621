//! Hands a job to a coordinator: the head, the scene's bytes, its files.

use std::num::NonZeroU64;

use image::Formats;
use model::{Digest, FrameRange, Resolution, SubmissionId};
use tokio_stream::iter;
use wire::link::CHUNK_BYTES;
use wire::proto::submit_part::Part;
use wire::proto::{AssetPart, Needs, SubmitHead, SubmitPart, Submitted, TileShape};

use super::link::refused;
use super::view::wire_format;
use crate::error::Error;
use crate::load::Scene;
use crate::options::{Context, FarmOptions, PlaceOptions};

/// A job to hand in.
pub(crate) struct Submission<'a> {
    /// The scene.
    pub(crate) scene: &'a Scene,
    /// What the job is called.
    pub(crate) name: &'a str,
    /// Which frames.
    pub(crate) frames: FrameRange,
    /// Size of the tiles; `None` leaves it to the coordinator.
    pub(crate) tile: Option<Resolution>,
    /// Fewest pixels of the tiles that the coordinator chooses; `None` leaves that to it too.
    pub(crate) min_tile_pixels: Option<NonZeroU64>,
    /// Which files each frame becomes.
    pub(crate) formats: Formats,
    /// Its place among other jobs.
    pub(crate) place: PlaceOptions,
    /// What the user said about the scene, JSON.
    pub(crate) settings_json: String,
}

impl Submission<'_> {
    /// Submits it; answers the job's number, and what it may need of the coordinator's disk.
    pub(crate) async fn hand_in(
        &self,
        context: &Context,
        farm: &FarmOptions,
    ) -> Result<Submitted, Error> {
        let mut id = [0; 16];
        getrandom::fill(&mut id).map_err(|error| {
            Error::failed("cannot draw a number for the job").because(error.to_string())
        })?;
        let parts = self.parts(SubmissionId(u128::from_ne_bytes(id)));
        let mut farm = context.connect(farm).await?;
        let answer = farm
            .submit(iter(parts))
            .await
            .map_err(|status| refused("cannot submit the job", status))?;
        Ok(answer.into_inner())
    }

    /// The submission's messages, in the order that the protocol wants.
    fn parts(&self, id: SubmissionId) -> Vec<SubmitPart> {
        let head = SubmitHead {
            submission: wire::convert::submission_bytes(id),
            name: self.name.to_owned(),
            description_digest: self.scene.digest.0.to_vec(),
            description_bytes: self.scene.bytes.len() as u64,
            frames: Some(self.frames.into()),
            tile: self.tile.map(|tile| TileShape {
                width: tile.width,
                height: tile.height,
            }),
            formats: self
                .formats
                .iter()
                .map(|format| wire_format(format).into())
                .collect(),
            settings_json: self.settings_json.clone(),
            min_tile_pixels: self.min_tile_pixels.map_or(0, NonZeroU64::get),
            priority: self.place.priority,
            share: self.place.share,
            needs: Some(Needs {
                labels: self.place.need_label.clone(),
                threads: self.place.need_threads.unwrap_or(0),
                memory_bytes: self.place.need_memory.unwrap_or(0),
            }),
            after: self.place.after.clone(),
        };
        let description = self.scene.bytes.chunks(CHUNK_BYTES);
        let description = description.map(|bytes| Part::Description(bytes.to_vec()));
        let assets = self.scene.loaded.assets.iter();
        let assets = assets.flat_map(|(asset, bytes)| {
            let Digest(digest) = asset.digest;
            bytes.chunks(CHUNK_BYTES).map(move |data| {
                Part::Asset(AssetPart {
                    digest: digest.to_vec(),
                    data: data.to_vec(),
                })
            })
        });
        std::iter::once(Part::Head(head))
            .chain(description)
            .chain(assets)
            .map(|part| SubmitPart { part: Some(part) })
            .collect()
    }
}
