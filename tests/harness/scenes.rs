//! What the tests render.

use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

use super::{Place, frames, wait};

/// The thesis's animation.
pub(crate) const FLYBY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/flyby.toml");

/// Settings for a frame of which only its being there matters.
pub(crate) const TINY: [&str; 4] = ["--resolution", "80x60", "--rays", "1"];

/// All images of [`FLYBY`], at settings with which they take many minutes.
pub(crate) const ENDLESS: [&str; 5] = [FLYBY, "--resolution", "200x150", "--rays", "4"];

/// How long one thread shall take over [`slow`]'s images: long enough that something can happen meanwhile.
const SLOW: Duration = Duration::from_secs(3);

/// N of the N×N rays with which it is tried how long images take: enough that what is done once weighs little.
const TRIED: u32 = 4;

/// Images 0 and 1 of [`FLYBY`] at some settings, as one process rendered them.
pub(crate) struct Reference {
    settings: Vec<String>,
    /// The images' film digests.
    pub(crate) digests: Vec<String>,
    /// Their files, as [`frames`] compares them.
    pub(crate) frames: Vec<Vec<u8>>,
}

impl Reference {
    /// With N×N rays a pixel.
    pub(crate) fn new(rays: u32) -> Self {
        let rays = rays.to_string();
        let settings = [
            "--resolution",
            "200x150",
            "--rays",
            &rays,
            "--frames",
            "0..2",
        ];
        let place = Place::new();
        Self {
            digests: rendered(&place, "reference", &settings),
            frames: frames::frames(&place.path("reference")),
            settings: settings.map(str::to_owned).to_vec(),
        }
    }

    /// The options that give these images, and `more`.
    pub(crate) fn with<'a>(&'a self, more: &[&'a str]) -> Vec<&'a str> {
        let settings = self.settings.iter().map(String::as_str);
        settings.chain(more.iter().copied()).collect()
    }
}

/// Two images of 200×150 pixels with 2×2 rays.
pub(crate) fn small() -> &'static Reference {
    static SMALL: OnceLock<Reference> = OnceLock::new();
    SMALL.get_or_init(|| Reference::new(2))
}

/// Two images of 200×150 pixels with as many rays as keep one thread of this machine busy for seconds.
pub(crate) fn slow() -> &'static Reference {
    static SLOWLY: OnceLock<Reference> = OnceLock::new();
    SLOWLY.get_or_init(|| lasting(SLOW))
}

/// The same, with as many rays as keep one thread busy for so long.
pub(crate) fn lasting(time: Duration) -> Reference {
    Reference::new(rays_for(time))
}

/// N of the N×N rays with which images 0 and 1 of [`FLYBY`], 200×150 pixels each, keep one thread busy for so long by
/// processor time, whatever else the machine does meanwhile.
pub(crate) fn rays_for(time: Duration) -> u32 {
    let place = Place::new();
    let tried = format!(
        "--format exr --out tried --resolution 200x150 --rays {TRIED} --frames 0..2 --threads 1"
    );
    let tried = ["render", FLYBY].into_iter().chain(tried.split(' '));
    let mut tried = place.start("tried", tried);
    let mut took = Duration::from_millis(10);
    wait::until_within(wait::LONG_LIMIT, "images that are tried are there", || {
        took = took.max(tried.cpu_time());
        tried.ended()
    });
    let mut rays = 1;
    while took * (rays * rays) < time * (TRIED * TRIED) {
        rays += 1;
    }
    rays
}

/// Renders in one process; answers the frames' film digests, as their files tell them.
#[track_caller]
pub(crate) fn rendered(place: &Place, out: &str, arguments: &[&str]) -> Vec<String> {
    let command = ["render", FLYBY, "--format", "exr", "--out", out].into_iter();
    let command = place.command(command.chain(arguments.iter().copied()));
    place.run(command, wait::LONG_LIMIT).ok();
    film_digests(place, out)
}

/// The film digests in the headers of a folder's EXR files, in the order of their names.
#[track_caller]
pub(crate) fn film_digests(place: &Place, folder: &str) -> Vec<String> {
    let files = place.files(folder);
    let frames = files.iter().filter(|file| file.ends_with(".exr"));
    frames
        .map(|frame| film_digest(place, &place.path(folder).join(frame)))
        .collect()
}

/// The film digest in a frame's header.
#[track_caller]
pub(crate) fn film_digest(place: &Place, frame: &Path) -> String {
    let info = image_info(place, frame);
    let digest = info["film_digest"].as_str();
    let digest = digest.unwrap_or_else(|| panic!("no film digest: {info}"));
    digest.to_owned()
}

/// What `flyby image info` says of a frame.
#[track_caller]
pub(crate) fn image_info(place: &Place, frame: &Path) -> serde_json::Value {
    let frame = frame.to_str().unwrap();
    place
        .flyby(["image", "info", frame, "--output", "json"])
        .json()
}
