//! `flyby image`: what frames hold, and whether two are equal.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use image::{Comparison, FrameInfo, ImageError, Window};
use serde::Serialize;

use crate::error::{Ending, Error};
use crate::existing;
use crate::options::Context;
use crate::output::{self, Report, columns};

#[derive(Subcommand, Debug)]
pub(crate) enum ImageCommand {
    /// Prints the digest of what each frame stores, then its path.
    Digest(Frames),
    /// Says what a frame holds: size, channels, metadata.
    Info(Frame),
    /// Says whether two frames store the same values, and where they differ (exit code 4).
    Compare(Compare),
}

#[derive(Args, Debug)]
pub(crate) struct Frames {
    /// Frames: EXR, PNG or PPM.
    #[arg(required = true)]
    frames: Vec<PathBuf>,
}

#[derive(Args, Debug)]
pub(crate) struct Frame {
    /// A frame: EXR, PNG or PPM.
    frame: PathBuf,
}

#[derive(Args, Debug)]
pub(crate) struct Compare {
    /// One frame.
    a: PathBuf,
    /// The other.
    b: PathBuf,
}

/// Runs the command.
pub(crate) fn run(context: &Context, command: ImageCommand) -> Result<Ending, Error> {
    match command {
        ImageCommand::Digest(Frames { frames }) => digest(context, frames),
        ImageCommand::Info(Frame { frame }) => info(context, &frame),
        ImageCommand::Compare(both) => compare(context, both),
    }
}

fn cannot_read(error: ImageError) -> Error {
    Error::failed("cannot read the frame").because(error)
}

fn digest(context: &Context, frames: Vec<PathBuf>) -> Result<Ending, Error> {
    let digests = frames
        .into_iter()
        .map(|path| {
            let digest = image::file_digest(&path).map_err(cannot_read)?;
            Ok(DigestLine {
                digest: digest.to_string(),
                path,
            })
        })
        .collect::<Result<_, Error>>()?;
    output::print(context.output, &Digests(digests))?;
    Ok(Ending::Done)
}

/// `image digest`: one entry per frame, in the order of the command line.
#[derive(Serialize)]
#[serde(transparent)]
struct Digests(Vec<DigestLine>);

/// One frame's digest.
#[derive(Serialize)]
struct DigestLine {
    /// 64 hexadecimal digits over the values that the file stores.
    digest: String,
    /// The file.
    path: PathBuf,
}

impl Report for Digests {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        for line in &self.0 {
            writeln!(out, "{}  {}", line.digest, line.path.display())?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        for line in &self.0 {
            writeln!(out, "{}", line.digest)?;
        }
        Ok(())
    }
}

fn info(context: &Context, frame: &Path) -> Result<Ending, Error> {
    let info = image::info(frame).map_err(cannot_read)?;
    output::print(context.output, &Info::from(info))?;
    Ok(Ending::Done)
}

/// `image info`: what a frame holds.
#[derive(Serialize)]
struct Info {
    /// The file.
    path: PathBuf,
    /// `exr`, `png` or `ppm`.
    format: String,
    /// How the file is packed, in words.
    packing: String,
    /// Digest of the scene that it shows, where it says so.
    scene_digest: Option<String>,
    /// Digest of the film that it was made from, where it says so.
    film_digest: Option<String>,
    /// Revision of the renderer that made it, where it says so.
    revision: Option<u32>,
    /// Its parts; one, but for multi-part EXR.
    parts: Vec<Part>,
    /// Everything that it says about itself, by name.
    metadata: serde_json::Map<String, serde_json::Value>,
}

/// One part of a frame.
#[derive(Serialize)]
struct Part {
    /// Its name, if it has one.
    name: Option<String>,
    /// Columns of the whole image.
    width: u32,
    /// Rows of the whole image.
    height: u32,
    /// The pixels that it stores.
    data_window: Area,
    /// The image that they are a part of.
    display_window: Area,
    /// Its layers, by name.
    layers: Vec<String>,
    /// Its channels, by name.
    channels: Vec<Channel>,
}

/// A rectangle of pixels.
#[derive(Serialize)]
struct Area {
    /// First column.
    x: i32,
    /// First row.
    y: i32,
    /// Columns.
    width: u32,
    /// Rows.
    height: u32,
}

/// One channel of a part.
#[derive(Serialize)]
struct Channel {
    /// Its name.
    name: String,
    /// How samples are stored, such as `half` or `float`.
    storage: String,
    /// Least finite value.
    min: f64,
    /// Greatest finite value.
    max: f64,
    /// Mean of the finite values.
    mean: f64,
    /// Samples that are NaN or infinite.
    not_finite: u64,
}

impl From<Window> for Area {
    fn from(window: Window) -> Self {
        Self {
            x: window.x,
            y: window.y,
            width: window.width,
            height: window.height,
        }
    }
}

impl From<FrameInfo> for Info {
    fn from(info: FrameInfo) -> Self {
        let part = |part: image::PartInfo| Part {
            name: part.name,
            width: part.display_window.width,
            height: part.display_window.height,
            data_window: part.data_window.into(),
            display_window: part.display_window.into(),
            layers: part.layers,
            channels: part
                .channels
                .into_iter()
                .map(|channel| Channel {
                    name: channel.name,
                    storage: channel.kind.name().to_owned(),
                    min: channel.min,
                    max: channel.max,
                    mean: channel.mean,
                    not_finite: channel.not_finite,
                })
                .collect(),
        };
        let said = |name: &str| existing::said(&info, name).map(str::to_owned);
        Self {
            scene_digest: said(existing::SCENE_DIGEST),
            film_digest: said(existing::FILM_DIGEST),
            revision: said(existing::REVISION).and_then(|revision| revision.parse().ok()),
            path: info.path,
            format: info.kind.name().to_owned(),
            packing: info.packing,
            parts: info.parts.into_iter().map(part).collect(),
            metadata: info
                .metadata
                .into_iter()
                .map(|(name, value)| (name, value.into()))
                .collect(),
        }
    }
}

impl Report for Info {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let path = self.path.display();
        writeln!(out, "{path}: {}, {}", self.format, self.packing)?;
        for part in &self.parts {
            part.table(out)?;
        }
        for (name, value) in &self.metadata {
            writeln!(out, "  {name}: {}", value.as_str().unwrap_or_default())?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let digest = self.film_digest.as_deref().unwrap_or("-");
        writeln!(out, "{digest}")
    }
}

impl Part {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let (image, data) = (&self.display_window, &self.data_window);
        if let Some(name) = &self.name {
            writeln!(out, "  part {name}")?;
        }
        writeln!(out, "  image  {}x{}", image.width, image.height)?;
        writeln!(
            out,
            "  stored {}x{}+{}+{}",
            data.width, data.height, data.x, data.y
        )?;
        let mut table = columns([
            "channel",
            "storage",
            "least",
            "greatest",
            "mean",
            "not finite",
        ]);
        for channel in &self.channels {
            table.add_row([
                channel.name.clone(),
                channel.storage.clone(),
                format!("{:.6}", channel.min),
                format!("{:.6}", channel.max),
                format!("{:.6}", channel.mean),
                channel.not_finite.to_string(),
            ]);
        }
        for line in table.lines() {
            writeln!(out, "  {}", line.trim_end())?;
        }
        Ok(())
    }
}

fn compare(context: &Context, Compare { a, b }: Compare) -> Result<Ending, Error> {
    let compared = match image::compare(&a, &b) {
        Ok(comparison) => Compared::new(a, b, &comparison),
        // Frames of different sizes or channels are as different as can be.
        Err(ImageError::NotComparable { a, b, what }) => Compared {
            incomparable: Some(what),
            ..Compared::different(a, b)
        },
        Err(error) => return Err(cannot_read(error)),
    };
    output::print(context.output, &compared)?;
    Ok(if compared.equal {
        Ending::Done
    } else {
        Ending::Different
    })
}

/// `image compare`.
#[derive(Serialize)]
struct Compared {
    /// One frame.
    a: PathBuf,
    /// The other.
    b: PathBuf,
    /// Whether both store the same values, to the bit.
    equal: bool,
    /// Why their pixels cannot be compared at all, if so.
    incomparable: Option<String>,
    /// Pixels compared.
    pixels: u64,
    /// Pixels that differ in any channel.
    differing_pixels: u64,
    /// The largest absolute difference; null where it is not finite.
    largest: f64,
    /// The first difference, row by row.
    first: Option<Difference>,
    /// The smallest rectangle around all differences.
    bounds: Option<Area>,
}

/// One sample that differs.
#[derive(Serialize)]
struct Difference {
    /// Column.
    x: i32,
    /// Row.
    y: i32,
    /// Channel.
    channel: String,
    /// Its value in `a`.
    a: f64,
    /// Its value in `b`.
    b: f64,
}

impl Compared {
    fn different(a: PathBuf, b: PathBuf) -> Self {
        Self {
            a,
            b,
            equal: false,
            incomparable: None,
            pixels: 0,
            differing_pixels: 0,
            largest: 0.0,
            first: None,
            bounds: None,
        }
    }

    fn new(a: PathBuf, b: PathBuf, comparison: &Comparison) -> Self {
        Self {
            equal: comparison.is_equal(),
            pixels: comparison.pixels,
            differing_pixels: comparison.differing_pixels,
            largest: comparison.largest,
            first: comparison.first.clone().map(|first| Difference {
                x: first.x,
                y: first.y,
                channel: first.channel,
                a: first.a,
                b: first.b,
            }),
            bounds: comparison.bounds.map(Area::from),
            ..Self::different(a, b)
        }
    }
}

impl Report for Compared {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        if self.equal {
            return writeln!(out, "equal: {} pixels, to the bit", self.pixels);
        }
        if let Some(why) = &self.incomparable {
            return writeln!(out, "different: {why}");
        }
        writeln!(
            out,
            "different: {} of {} pixels, by {} at most",
            self.differing_pixels, self.pixels, self.largest
        )?;
        if let Some(first) = &self.first {
            writeln!(
                out,
                "first at column {}, row {}, channel {}: {} and {}",
                first.x, first.y, first.channel, first.a, first.b
            )?;
        }
        if let Some(Area {
            x,
            y,
            width,
            height,
        }) = self.bounds
        {
            writeln!(out, "all inside {width}x{height}+{x}+{y}")?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", if self.equal { "equal" } else { "different" })
    }
}
