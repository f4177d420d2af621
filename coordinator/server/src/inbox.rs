//! Submissions as they arrive: checked against limits and digests, on disk.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use model::{Digest, JobId};
use scene::Description;
use tokio::fs::File;
use tokio::io::AsyncWriteExt as _;
use tonic::Streaming;
use wire::Failure;
use wire::convert;
use wire::link::ASSET_BYTES_MAX;
use wire::proto::{self, ErrorKind, submit_part::Part};

use crate::scene_files::SceneFiles;
use crate::state::{make_folder, remove_all};

/// Most bytes of the settings that a user gives.
const SETTINGS_BYTES_MAX: usize = 64 << 10;

/// Where submissions arrive.
#[derive(Debug)]
pub(crate) struct Inbox {
    root: PathBuf,
    next: AtomicU64,
    asset_bytes_max: u64,
}

/// The folder of one submission as it arrives. Dropping it removes it.
#[derive(Debug)]
pub(crate) struct Upload {
    files: SceneFiles,
}

/// A submission that has arrived whole.
#[derive(Debug)]
pub(crate) struct NewJob {
    pub(crate) submission: sched::Submission,
    pub(crate) description: Arc<Description>,
    pub(crate) upload: Upload,
    pub(crate) formats: image::Formats,
    pub(crate) settings: String,
}

impl Upload {
    /// The files, where they are to stay.
    pub(crate) fn files_at(&self, root: PathBuf) -> SceneFiles {
        SceneFiles {
            root,
            ..self.files.clone()
        }
    }

    /// Moves everything to where it is to stay, and makes that durable; the files are since they arrived. May
    /// be tried again.
    pub(crate) fn move_to(&self, root: &Path) -> std::io::Result<()> {
        let from = &self.files.root;
        if from.is_dir() {
            std::fs::File::open(from)?.sync_all()?;
            std::fs::rename(from, root)?;
        }
        let parent = root.parent().unwrap_or(root);
        std::fs::File::open(parent)?.sync_all()
    }
}

impl Drop for Upload {
    fn drop(&mut self) {
        if let Err(error) = remove_all(&self.files.root) {
            tracing::warn!("{}", crate::storage::chain(&error));
        }
    }
}

impl Inbox {
    pub(crate) fn new(root: PathBuf, asset_bytes_max: u64) -> Self {
        Self {
            root,
            next: AtomicU64::new(0),
            asset_bytes_max,
        }
    }

    /// Reads one submission to its end. Whatever is wrong with it costs it alone.
    pub(crate) async fn receive(
        &self,
        revision: model::Revision,
        parts: &mut Streaming<proto::SubmitPart>,
    ) -> Result<NewJob, Failure> {
        let head = match next(parts).await? {
            Some(Part::Head(head)) => head,
            _ => return Err(bad("a submission begins with its head")),
        };
        let digest = convert::digest(&head.description_digest, "head.description_digest")?;
        let frames = convert::require(head.frames, "head.frames")?.try_into()?;
        let submission = convert::submission(&head.submission)?;
        let name = convert::text(head.name, "head.name", 0..=200)?;
        let formats = formats(&head.formats)?;
        if head.settings_json.len() > SETTINGS_BYTES_MAX {
            return Err(limit(format!(
                "the settings have {} bytes; at most {SETTINGS_BYTES_MAX} are taken",
                head.settings_json.len()
            )));
        }
        let mut upload = self.open(digest)?;
        let (bytes, mut ahead) = receive_description(head.description_bytes, parts).await?;
        write(&upload.files.scene_path(), &bytes).await?;
        let description = read_description(bytes, digest).await?;
        self.receive_assets(&description, &mut upload, &mut ahead, parts)
            .await?;
        let film = &description.film;
        let last = frames_last(frames);
        if last >= film.images {
            return Err(bad(format!(
                "frame {last} is asked for, but the scene's frames are 0..{}",
                film.images
            )));
        }
        let tiles = match head.tile {
            None if head.min_tile_pixels > 0 => sched::TileShape::Rule {
                min_tile_pixels: Some(head.min_tile_pixels),
            },
            None => sched::TileShape::Time { aim: None },
            Some(proto::TileShape { width, height }) => sched::TileShape::Size { width, height },
        };
        Ok(NewJob {
            submission: sched::Submission {
                submission,
                name,
                scene: digest,
                revision,
                frames,
                window: film.window,
                tiles,
                priority: head.priority,
                share: head.share.max(1),
                needs: needs(head.needs)?,
                after: head.after.into_iter().map(JobId).collect(),
            },
            description: Arc::new(description),
            upload,
            formats,
            settings: head.settings_json,
        })
    }

    fn open(&self, description: Digest) -> Result<Upload, Failure> {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        let root = self.root.join(number.to_string());
        make_folder(&root).map_err(storage)?;
        Ok(Upload {
            files: SceneFiles {
                root,
                description,
                assets: Vec::new(),
            },
        })
    }

    /// Reads each asset's bytes, in the description's order, into a file under its digest.
    async fn receive_assets(
        &self,
        description: &Description,
        upload: &mut Upload,
        ahead: &mut Option<Part>,
        parts: &mut Streaming<proto::SubmitPart>,
    ) -> Result<(), Failure> {
        let total = description
            .assets
            .iter()
            .fold(0_u64, |total, asset| total.saturating_add(asset.bytes));
        if total > self.asset_bytes_max {
            return Err(limit(format!(
                "the scene's assets have {total} bytes; at most {} are taken",
                self.asset_bytes_max
            )));
        }
        for asset in &description.assets {
            if asset.bytes > ASSET_BYTES_MAX {
                return Err(limit(format!(
                    "the asset `{}` has {} bytes; at most {ASSET_BYTES_MAX} are taken",
                    asset.name, asset.bytes
                )));
            }
            if upload.files.assets.contains(&asset.digest) {
                continue;
            }
            let path = upload.files.asset_path(asset.digest);
            receive_asset(asset, &path, ahead, parts).await?;
            upload.files.assets.push(asset.digest);
        }
        match ahead.take() {
            Some(part) => Some(part),
            None => next(parts).await?,
        }
        .map_or(Ok(()), |_| {
            Err(bad("the submission goes on after its last asset"))
        })
    }
}

/// The description's bytes, and the part that came after them, if one did.
async fn receive_description(
    stated: u64,
    parts: &mut Streaming<proto::SubmitPart>,
) -> Result<(Vec<u8>, Option<Part>), Failure> {
    if stated > scene::BYTES_MAX as u64 {
        return Err(limit(format!(
            "the scene description has {stated} bytes; at most {} are taken",
            scene::BYTES_MAX
        )));
    }
    let mut bytes = Vec::new();
    loop {
        match next(parts).await? {
            Some(Part::Description(more)) => bytes.extend(more),
            other => {
                if bytes.len() as u64 == stated {
                    return Ok((bytes, other));
                }
                return Err(bad(format!(
                    "the scene description is cut off: {} bytes of {stated}",
                    bytes.len()
                )));
            }
        }
        if bytes.len() as u64 > stated {
            return Err(bad(format!(
                "the scene description has more than the {stated} bytes that its head states"
            )));
        }
    }
}

/// Reads and validates a description; on a thread of its own, since it may be large.
async fn read_description(bytes: Vec<u8>, expected: Digest) -> Result<Description, Failure> {
    let read = tokio::task::spawn_blocking(move || {
        let digest = scene::digest_of(&bytes);
        if digest != expected {
            return Err(Failure::new(
                ErrorKind::DigestMismatch,
                format!("the scene description's digest is {digest}, not {expected} as stated"),
            ));
        }
        Description::from_bytes(&bytes)
            .map_err(|error| Failure::new(ErrorKind::BadScene, crate::storage::chain(&error)))
    });
    read.await.unwrap_or_else(|_| {
        Err(Failure::new(
            ErrorKind::BadScene,
            "the scene description could not be read",
        ))
    })
}

async fn receive_asset(
    asset: &scene::description::AssetRef,
    path: &Path,
    ahead: &mut Option<Part>,
    parts: &mut Streaming<proto::SubmitPart>,
) -> Result<(), Failure> {
    let mut file = File::create(path).await.map_err(storage)?;
    let mut hasher = blake3::Hasher::new();
    let mut have = 0_u64;
    while have < asset.bytes {
        let part = match ahead.take() {
            Some(part) => Some(part),
            None => next(parts).await?,
        };
        let Some(Part::Asset(part)) = part else {
            return Err(bad(format!(
                "the asset `{}` is cut off: {have} bytes of {}",
                asset.name, asset.bytes
            )));
        };
        if convert::digest(&part.digest, "asset.digest")? != asset.digest {
            return Err(bad(format!(
                "bytes of another asset arrived where those of `{}` should",
                asset.name
            )));
        }
        have = have.saturating_add(part.data.len() as u64);
        if have > asset.bytes || part.data.is_empty() {
            return Err(bad(format!(
                "the asset `{}` does not have the {} bytes that its scene states",
                asset.name, asset.bytes
            )));
        }
        hasher.update(&part.data);
        file.write_all(&part.data).await.map_err(storage)?;
    }
    file.sync_all().await.map_err(storage)?;
    if *hasher.finalize().as_bytes() == asset.digest.0 {
        Ok(())
    } else {
        Err(Failure::new(
            ErrorKind::DigestMismatch,
            format!(
                "the bytes of the asset `{}` are not those its digest names",
                asset.name
            ),
        ))
    }
}

async fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let mut file = File::create(path).await.map_err(storage)?;
    file.write_all(bytes).await.map_err(storage)?;
    file.sync_all().await.map_err(storage)
}

async fn next(parts: &mut Streaming<proto::SubmitPart>) -> Result<Option<Part>, Failure> {
    match parts.message().await? {
        None => Ok(None),
        Some(proto::SubmitPart { part: Some(part) }) => Ok(Some(part)),
        Some(proto::SubmitPart { part: None }) => {
            Err(bad("a part of the submission is of no known kind"))
        }
    }
}

fn formats(list: &[i32]) -> Result<image::Formats, Failure> {
    let mut formats = Vec::new();
    for number in list.iter().take(16) {
        let format = proto::FrameFormat::try_from(*number)
            .map_err(|_| bad(format!("frame format {number} is not known here")))?;
        formats.push(crate::grpc::format(format));
    }
    if formats.is_empty() {
        formats.push(image::Format::Exr);
    }
    if formats.contains(&image::Format::Png8) && formats.contains(&image::Format::Png16) {
        return Err(bad(image::BadFormats::TwoPngs.to_string()));
    }
    Ok(image::Formats::new(formats))
}

/// What a job asks of workers.
fn needs(needs: Option<proto::Needs>) -> Result<sched::Needs, Failure> {
    let needs = needs.unwrap_or_default();
    Ok(sched::Needs {
        labels: crate::grpc::labels(needs.labels, "head.needs.labels")?,
        threads: needs.threads,
        memory_bytes: needs.memory_bytes,
    })
}

/// The last image that a range names.
fn frames_last(frames: model::FrameRange) -> u32 {
    frames.start() + (frames.count() - 1) * frames.step()
}

fn bad(sentence: impl Into<String>) -> Failure {
    Failure::new(ErrorKind::BadRequest, sentence)
}

fn limit(sentence: String) -> Failure {
    Failure::new(ErrorKind::Limit, sentence)
}

fn storage(error: impl std::error::Error) -> Failure {
    Failure::later(
        ErrorKind::Storage,
        format!(
            "the coordinator could not store the submission: {}",
            crate::storage::chain(&error)
        ),
    )
}
