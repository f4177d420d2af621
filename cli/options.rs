//! Options that several commands share.

use std::path::PathBuf;

use clap::Args;
use image::Formats;
use model::{FrameRange, Rect, Resolution};

use crate::values;

/// What every command is told.
#[derive(Clone, Debug)]
pub(crate) struct Context {
    /// How results are printed.
    pub(crate) output: crate::output::Format,
    /// The state folder: named, or the usual one; `None` where the user has no home.
    pub(crate) state: Option<PathBuf>,
    /// The file of a token, by which the coordinator of another machine is reached.
    pub(crate) token_file: Option<PathBuf>,
}

/// A scene and what to change in it.
#[derive(Args, Clone, Debug)]
pub(crate) struct SceneOptions {
    /// The scene file (TOML).
    pub(crate) scene: PathBuf,

    /// Size of the whole image in pixels, instead of the scene's.
    #[arg(long, value_name = "WxH", value_parser = values::resolution, help_heading = "What to render")]
    pub(crate) resolution: Option<Resolution>,

    /// N of the N×N rays of a pixel, instead of the scene's.
    #[arg(long, value_name = "N", help_heading = "What to render")]
    pub(crate) rays: Option<u32>,

    /// The part of each image to render: x0,y0,x1,y1 (ends not included) or WxH+X+Y.
    #[arg(long, value_name = "RECT", value_parser = values::crop, help_heading = "What to render")]
    pub(crate) crop: Option<Rect>,

    /// Sets a value of the scene file, such as `sun.elevation="20 deg"`; may be repeated.
    #[arg(long, value_name = "KEY=VALUE", help_heading = "What to render")]
    pub(crate) set: Vec<String>,
}

/// Which frames.
#[derive(Args, Clone, Debug)]
pub(crate) struct FrameOptions {
    /// Frames to render: 7, 0..25 (the end is not included) or 0..500:10; else all of the scene's.
    #[arg(long, value_name = "A..B", help_heading = "What to render")]
    pub(crate) frames: Option<FrameRange>,
}

/// Which files to leave, and where.
#[derive(Args, Clone, Debug)]
pub(crate) struct FileOptions {
    /// Formats of the frames, separated by commas: exr, png, png16, ppm.
    #[arg(
        long,
        value_name = "LIST",
        default_value = "exr,png",
        help_heading = "Results"
    )]
    pub(crate) format: Formats,

    /// What to do about frames that are there already.
    #[arg(long, value_enum, default_value_t, help_heading = "Results")]
    pub(crate) existing: Existing,

    /// Also make a movie of the frames, by ffmpeg; implies PNG frames.
    #[arg(long, help_heading = "Results")]
    pub(crate) movie: bool,
}

impl FileOptions {
    /// The formats, with PNG where a movie needs it.
    pub(crate) fn formats(&self) -> Formats {
        use image::Format::{Png8, Png16};
        if self.movie && !self.format.contains(Png16) {
            Formats::new(self.format.iter().chain([Png8]))
        } else {
            self.format
        }
    }
}

/// What to do about frames that are there already.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, clap::ValueEnum)]
pub(crate) enum Existing {
    /// Keep those of the same scene, settings and renderer; stop before touching others.
    #[default]
    Skip,
    /// Render every frame again and replace what is there.
    Replace,
    /// Stop if any frame is there.
    Fail,
}

/// The job's place among others.
#[derive(Args, Clone, Debug)]
pub(crate) struct PlaceOptions {
    /// Serve it before jobs of lower priority; it may be negative.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true,
        help_heading = "Farm"
    )]
    pub(crate) priority: i32,

    /// Its part of the farm against the other jobs of its priority, 1 to 1000.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000), help_heading = "Farm")]
    pub(crate) share: u32,

    /// Begin when this job is finished; may be repeated.
    #[arg(long, value_name = "JOB", help_heading = "Farm")]
    pub(crate) after: Vec<u64>,

    /// Only workers with this label may render it; may be repeated.
    #[arg(long, value_name = "LABEL", value_parser = values::label, help_heading = "Farm")]
    pub(crate) need_label: Vec<String>,

    /// Only workers of at least so many render threads.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096), help_heading = "Farm")]
    pub(crate) need_threads: Option<u32>,

    /// Only workers whose machine has so much memory, such as 16 GiB.
    #[arg(long, value_name = "SIZE", value_parser = values::memory, help_heading = "Farm")]
    pub(crate) need_memory: Option<u64>,
}

impl Default for PlaceOptions {
    fn default() -> Self {
        Self {
            priority: 0,
            share: 1,
            after: Vec::new(),
            need_label: Vec::new(),
            need_threads: None,
            need_memory: None,
        }
    }
}

/// Which coordinator to talk to.
#[derive(Args, Clone, Debug)]
pub(crate) struct FarmOptions {
    /// Where the coordinator is, such as farm.example.org or 192.0.2.7:7359; else where the token's file says, or the one that
    /// runs over the state folder.
    #[arg(long, value_name = "ADDR", value_parser = values::host, help_heading = "Farm")]
    pub(crate) coordinator: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_movie_needs_png() {
        let formats = |format: &str, movie| {
            let options = FileOptions {
                format: format.parse().unwrap(),
                existing: Existing::Skip,
                movie,
            };
            options.formats().to_string()
        };
        assert_eq!(formats("exr", false), "exr");
        assert_eq!(formats("exr", true), "exr,png");
        assert_eq!(formats("png16", true), "png16");
    }
}
