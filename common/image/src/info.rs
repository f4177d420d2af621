//! What a frame holds, for people and for tables.

use std::path::{Path, PathBuf};

use crate::error::ImageError;
use crate::read::{self, Channel, FileKind, SampleKind, Window};

/// What a frame holds.
#[derive(Clone, PartialEq, Debug)]
pub struct FrameInfo {
    /// The file.
    pub path: PathBuf,
    /// Its format.
    pub kind: FileKind,
    /// How it is packed, in words.
    pub packing: String,
    /// Its parts; one, but for multi-part EXR.
    pub parts: Vec<PartInfo>,
    /// What it says about itself: names and values, sorted by name.
    pub metadata: Vec<(String, String)>,
}

/// One part of a frame.
#[derive(Clone, PartialEq, Debug)]
pub struct PartInfo {
    /// Its name, if it has one.
    pub name: Option<String>,
    /// The pixels that it stores.
    pub data_window: Window,
    /// The image that they are a part of.
    pub display_window: Window,
    /// Its channels, sorted by name.
    pub channels: Vec<ChannelInfo>,
    /// The layers of its channels, sorted; channels without a dot in their name are in none.
    pub layers: Vec<String>,
}

/// One channel of a part.
#[derive(Clone, PartialEq, Debug)]
pub struct ChannelInfo {
    /// Its name.
    pub name: String,
    /// How its samples are stored.
    pub kind: SampleKind,
    /// Least finite value; 0 if there is none.
    pub min: f64,
    /// Greatest finite value; 0 if there is none.
    pub max: f64,
    /// Mean of the finite values; 0 if there is none.
    pub mean: f64,
    /// Samples that are NaN or infinite.
    pub not_finite: u64,
}

/// Says what a frame holds.
///
/// Fails if the file cannot be read or is no whole image. See
/// [`DECODED_BYTES_MAX`](crate::DECODED_BYTES_MAX) for the memory it may take.
pub fn info(path: impl AsRef<Path>) -> Result<FrameInfo, ImageError> {
    let picture = read::picture(path.as_ref())?;
    Ok(FrameInfo {
        path: path.as_ref().to_owned(),
        kind: picture.kind,
        packing: picture.packing,
        parts: picture.parts.into_iter().map(part).collect(),
        metadata: picture.metadata,
    })
}

fn part(part: read::Part) -> PartInfo {
    let mut layers: Vec<_> = part
        .channels
        .iter()
        .filter_map(|channel| channel.name.rsplit_once('.'))
        .map(|(layer, _)| layer.to_owned())
        .collect();
    layers.sort();
    layers.dedup();
    PartInfo {
        name: part.name,
        data_window: part.data_window,
        display_window: part.display_window,
        channels: part.channels.iter().map(channel).collect(),
        layers,
    }
}

fn channel(channel: &Channel) -> ChannelInfo {
    let (mut least, mut greatest, mut sum, mut finite) =
        (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0_u32);
    let samples = &channel.samples;
    let values = (0..samples.len()).map(|index| samples.value(index));
    for value in values.filter(|value| value.is_finite()) {
        least = least.min(value);
        greatest = greatest.max(value);
        sum += value;
        finite += 1;
    }
    let any = |value: f64| if finite == 0 { 0.0 } else { value };
    ChannelInfo {
        name: channel.name.clone(),
        kind: samples.kind(),
        min: any(least),
        max: any(greatest),
        mean: any(sum / f64::from(finite)),
        not_finite: samples.len() as u64 - u64::from(finite),
    }
}
