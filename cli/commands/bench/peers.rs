//! `flyby bench peers`: this renderer beside other programs on the same surfaces.

use std::fs;
use std::path::Path;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use render::SimdLevel;

use crate::bench::peers::report::{Compared, Peers, Skipped, Times};
use crate::bench::peers::rows::{Peer, ROWS, Row};
use crate::bench::peers::{ours, povray};
use crate::error::{Ending, Error};
use crate::load::Scene;
use crate::options::{Context, SceneOptions};
use crate::output;
use crate::progress::Progress;
use crate::stop::Stop;

#[derive(Args, Debug)]
pub(crate) struct Options {
    /// Rows to measure [default: all].
    #[arg(value_name = "ROW", value_parser = rows())]
    rows: Vec<String>,

    /// Turns of both sides; the median counts.
    #[arg(long, value_name = "N", default_value_t = 3,
          value_parser = clap::value_parser!(u32).range(1..=1_000))]
    runs: u32,
}

/// Renders the peer's side once and tells the seconds.
type Turn<'a> = Box<dyn Fn() -> Result<f64, Error> + 'a>;

fn rows() -> PossibleValuesParser {
    ROWS.iter()
        .map(|row| PossibleValue::new(row.name))
        .collect::<Vec<_>>()
        .into()
}

/// Runs the command.
pub(crate) fn run(context: &Context, options: &Options) -> Result<Ending, Error> {
    let folder = tempfile::tempdir()
        .map_err(|error| Error::failed("cannot make a folder for the scenes").because(error))?;
    let stop = Stop::on_signals()?;
    let chosen: Vec<&Row> = ROWS
        .iter()
        .filter(|row| options.rows.is_empty() || options.rows.iter().any(|name| name == row.name))
        .collect();
    let total = chosen.len() as u64 * u64::from(options.runs);
    let mut progress = Progress::new(context.output, total, 0);
    let mut peers = Peers {
        runs: options.runs,
        simd: SimdLevel::best().to_string(),
        rows: Vec::new(),
        skipped: Vec::new(),
    };
    let has_povray = povray::is_there();
    for (number, row) in chosen.into_iter().enumerate() {
        let mut skip = |why: String| {
            peers.skipped.push(Skipped { row: row.name, why });
        };
        let scene = match scene(row, folder.path()) {
            Ok(scene) => scene,
            Err(error) => {
                skip(error.to_string());
                continue;
            }
        };
        let peer: (&str, Turn<'_>) = match row.peer {
            Peer::Absent(program) => {
                skip(format!("needs {program}, which is not here"));
                continue;
            }
            Peer::PovRay(_) if !has_povray => {
                skip("povray is not installed (apt-get install povray povray-includes)".into());
                continue;
            }
            Peer::PovRay(declarations) => {
                let file = folder.path().join("peer.pov");
                write(&file, row.scene.povray)?;
                let folder = folder.path();
                (
                    "POV-Ray",
                    Box::new(move || povray::trace(&file, folder, declarations)),
                )
            }
            Peer::OneRay { .. } => {
                let single = load(row, folder.path(), 1)?;
                ("one ray per pixel", Box::new(move || ours::render(&single)))
            }
        };
        let (mut mine, mut theirs) = (Vec::new(), Vec::new());
        for turn in 0..options.runs {
            if stop.is_set() {
                return Err(Error::interrupted("the measurement was stopped"));
            }
            progress.update(
                number as u64 * u64::from(options.runs) + u64::from(turn),
                row.name,
            );
            mine.push(ours::render(&scene)?);
            theirs.push(peer.1()?);
        }
        peers.rows.extend(compared(row, peer.0, mine, theirs));
    }
    progress.finish();
    output::print(context.output, &peers)?;
    Ok(Ending::Done)
}

fn compared(row: &'static Row, peer: &str, mine: Vec<f64>, theirs: Vec<f64>) -> Option<Compared> {
    let (ours, theirs) = (Times::of(mine)?, Times::of(theirs)?);
    let theirs = match row.peer {
        Peer::OneRay { rays } => theirs.times(f64::from(rays * rays)),
        Peer::PovRay(_) | Peer::Absent(_) => theirs,
    };
    let ratio = theirs.median / ours.median;
    Some(Compared {
        row: row.name,
        ours,
        peer: peer.to_owned(),
        theirs,
        ratio,
        budget: row.budget,
        reached: ratio >= row.budget,
    })
}

/// Our side's scene.
fn scene(row: &Row, folder: &Path) -> Result<Scene, Error> {
    load(
        row,
        folder,
        match row.peer {
            Peer::OneRay { rays } => rays,
            Peer::PovRay(_) | Peer::Absent(_) => 1,
        },
    )
}

fn load(row: &Row, folder: &Path, rays: u32) -> Result<Scene, Error> {
    let file = folder.join("ours.toml");
    write(&file, row.scene.ours)?;
    SceneOptions {
        scene: file,
        resolution: None,
        rays: Some(rays),
        crop: None,
        set: row.set.iter().map(|&set| set.to_owned()).collect(),
    }
    .load()
}

fn write(path: &Path, text: &str) -> Result<(), Error> {
    fs::write(path, text)
        .map_err(|error| Error::failed(format!("cannot write `{}`", path.display())).because(error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_that_can_run_has_a_scene_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        for row in ROWS {
            // Blobs may be missing from a build; nothing else may.
            if !row.name.starts_with("blob") {
                let scene = scene(row, folder.path()).unwrap();
                assert_eq!(scene.description().film.images, 1);
            }
        }
    }

    #[test]
    fn many_rays_are_compared_with_as_many_single_ones() {
        let row = ROWS.iter().find(|row| row.name == "many-rays").unwrap();
        let compared = compared(row, "one ray", vec![2.0], vec![0.1]).unwrap();
        assert_eq!((compared.ratio, compared.reached), (5.0, true));
    }
}
