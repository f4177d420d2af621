//! What the tests render.

use std::path::Path;

use super::{Place, wait};

/// The thesis's animation.
pub(crate) const FLYBY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/flyby.toml");

/// Settings at which [`FLYBY`]'s frames take about a second.
pub(crate) const SMALL: [&str; 4] = ["--resolution", "200x150", "--rays", "2"];

/// Settings at which a frame takes long enough for something to happen meanwhile.
pub(crate) const SLOW: [&str; 4] = ["--resolution", "200x150", "--rays", "6"];

/// Renders in one process; answers the frames' film digests, as their files tell them.
#[track_caller]
pub(crate) fn rendered(place: &Place, out: &str, arguments: &[&str]) -> Vec<String> {
    let command = ["render", FLYBY, "--out", out].into_iter();
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
    let arguments = [
        "image".as_ref(),
        "info".as_ref(),
        frame.as_os_str(),
        "--output".as_ref(),
        "json".as_ref(),
    ];
    let info = place.flyby(arguments).json();
    let digest = info["film_digest"].as_str();
    digest
        .unwrap_or_else(|| panic!("no film digest: {info}"))
        .to_owned()
}
