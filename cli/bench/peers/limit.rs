//! How far the hot loop is from the machine's limit: what an evaluation takes, and how much of it is noise.
//!
//! The share of noise is reckoned: evaluations of lattice cells, as the render counts them, by the time that one takes alone
//! in long batches. Its ends are the times of a value and of a value with its gradient: derivatives along rays lie between.

use std::env;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use field::SimdLevel;
use serde::Serialize;

use super::rows::Ours;
use super::{clock, noise, ours};
use crate::error::Error;

/// What one scene's evaluations take.
#[derive(Serialize, Clone, Debug)]
pub(crate) struct Limit {
    /// The scene.
    pub(crate) scene: &'static str,
    /// CPU seconds of one render.
    pub(crate) seconds: f64,
    /// Evaluations of the field per ray, camera and shadow.
    pub(crate) evaluations_per_ray: f64,
    /// CPU time of the whole render by its evaluations, nanoseconds.
    pub(crate) nanoseconds_per_evaluation: f64,
    /// Lattice cells per evaluation.
    pub(crate) noises_per_evaluation: f64,
    /// The share of the time that noise kernels take, if each takes what a value or a value with gradient does.
    pub(crate) share_of_noise: [f64; 2],
    /// Instructions of the whole render by its evaluations, where the machine counts them.
    pub(crate) instructions_per_evaluation: Option<f64>,
    /// Why they are not known.
    pub(crate) not_counted: Option<String>,
}

impl Limit {
    /// Measures a scene.
    pub(crate) fn of(name: &'static str, scene: Ours, folder: &Path) -> Result<Self, Error> {
        let loaded = scene.load(folder, &[])?;
        let counts = ours::render(&loaded)?;
        let seconds = clock::seconds(|| ours::render(&loaded).map(|_| ()))?;
        let level = SimdLevel::best();
        let program = noise::program(1).map_err(Error::failed)?;
        let each = |what: &dyn Fn()| {
            let all = clock::seconds(|| {
                what();
                Ok(())
            });
            all.map(|all| all / noise::POINTS as f64)
        };
        let value = each(&|| noise::value(&program, level))?;
        let gradient = each(&|| noise::gradient(&program, level))?;
        let evaluations = counts.evaluations as f64;
        let noises = counts.noise_evaluations as f64;
        let (instructions, not_counted) = match instructions(folder) {
            Ok(count) => (Some(count / evaluations), None),
            Err(why) => (None, Some(why)),
        };
        Ok(Self {
            scene: name,
            seconds,
            evaluations_per_ray: evaluations / (counts.rays + counts.shadow_rays) as f64,
            nanoseconds_per_evaluation: 1e9 * seconds / evaluations,
            noises_per_evaluation: noises / evaluations,
            share_of_noise: [value, gradient].map(|each| noises * each / seconds),
            instructions_per_evaluation: instructions,
            not_counted,
        })
    }

    /// A line for people.
    pub(crate) fn show(&self) -> String {
        let [least, most] = self.share_of_noise.map(|share| 100.0 * share);
        let instructions = match (self.instructions_per_evaluation, &self.not_counted) {
            (Some(count), _) => format!("{count:.0} instructions"),
            (None, Some(why)) => format!("instructions not counted: {why}"),
            (None, None) => String::new(),
        };
        format!(
            "{}: {:.1} evaluations per ray of {:.1} ns and {:.1} noises each; noise kernels {least:.0} to {most:.0} % of the \
             time; {instructions}",
            self.scene,
            self.evaluations_per_ray,
            self.nanoseconds_per_evaluation,
            self.noises_per_evaluation,
        )
    }
}

/// Instructions of rendering the scene that lies in the folder, less those of a picture of 8 × 8 pixels.
fn instructions(folder: &Path) -> Result<f64, String> {
    let whole = counted(folder, &[])?;
    let start = counted(folder, &["--resolution", "8x8"])?;
    Ok(whole - start)
}

fn counted(folder: &Path, more: &[&str]) -> Result<f64, String> {
    let program = env::current_exe().map_err(|error| error.to_string())?;
    let log = folder.join("perf.csv");
    let status = Command::new("perf")
        .args(["stat", "-x,", "-e", "instructions:u", "-o"])
        .arg(&log)
        .arg("--")
        .arg(program)
        .args([
            "render",
            "--threads",
            "1",
            "--existing",
            "replace",
            "--output",
            "quiet",
            "-o",
        ])
        .arg(folder.join("frames"))
        .args(more)
        .arg(folder.join("ours.toml"))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .map_err(|_| "perf is not installed (apt-get install linux-perf)".to_owned())?;
    let text = fs::read_to_string(&log).unwrap_or_default();
    if !status.success() {
        return Err("perf could not run the render".to_owned());
    }
    count(&text).ok_or_else(|| "this machine shows no performance counters".to_owned())
}

/// The count in perf's comma-separated lines.
fn count(log: &str) -> Option<f64> {
    let line = log.lines().find(|line| line.contains("instructions"))?;
    line.split(',').next()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_read_where_there_are_any() {
        let log = "# started on Fri\n\n7423105,,instructions:u,5139571,100.00,,\n";
        assert_eq!(count(log), Some(7_423_105.0));
        assert_eq!(count("<not supported>,,instructions:u,0,100.00,,\n"), None);
        assert_eq!(count(""), None);
    }
}
