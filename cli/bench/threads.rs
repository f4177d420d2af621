//! Threads of one process against as many processes of one thread at the same time.
//!
//! Each side is this program's own `render`, and its time is what that command says it took: preparation, blocks and
//! encoding, but not the start of the process. What threads share should cost nothing: the wanted ratio of
//! images per second is close to 1. Where other work keeps the machine busy, times say little; the processors' time that a picture
//! takes on either side says then whether threads hinder each other, but not whether one of them waits.

use std::env;
use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde::Serialize;
use serde_json::Value;

use crate::bench::peers::rows::{BLOB, FLIGHT, Ours, PLANET, SPHERE, TERRAIN_SHADOWS};
use crate::error::Error;
use crate::output::{Report, columns};

/// The least share of what processes do that threads should do.
pub(crate) const BUDGET: f64 = 0.98;

/// Renders shorter than this, by one thread beside others, are measured and not judged, in seconds.
pub(crate) const LEAST_SECONDS: f64 = 1.0;

/// Clock ticks of the system in a second, in which it counts the time of processes.
const TICKS: f64 = 100.0;

/// The scenes of `bench peers`.
pub(crate) const SCENES: [(&str, Ours); 5] = [
    ("sphere-3", SPHERE),
    ("terrain-shadows", TERRAIN_SHADOWS),
    ("blob", BLOB),
    ("planet", PLANET),
    ("flight", FLIGHT),
];

/// Most N of the N × N rays by which a scene is made longer.
const RAYS_MAX: f64 = 16.0;

/// The N of the N × N rays with which so many threads take well over a second, if one takes so long with one ray.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a whole number of at most 16"
)]
pub(crate) fn rays(seconds: f64, threads: u32) -> u32 {
    let wanted = (1.5 * LEAST_SECONDS * f64::from(threads) / seconds)
        .sqrt()
        .ceil();
    wanted.clamp(1.0, RAYS_MAX) as u32
}

/// `bench threads`.
#[derive(Serialize, Debug)]
pub(crate) struct Threads {
    /// Threads, and processes beside them.
    pub(crate) threads: u32,
    /// Pairs of each scene.
    pub(crate) runs: u32,
    /// The ratio wanted.
    pub(crate) budget: f64,
    /// What was measured.
    pub(crate) scenes: Vec<Measured>,
}

/// One scene.
#[derive(Serialize, Debug)]
pub(crate) struct Measured {
    /// Its name.
    pub(crate) scene: String,
    /// Seconds of one process with all threads, median.
    pub(crate) together: f64,
    /// Seconds of one of the processes of one thread beside the others, median.
    pub(crate) apart: f64,
    /// Images per second together over those apart: median, least and most of the pairs.
    pub(crate) ratio: [f64; 3],
    /// The processors' time of a picture apart over that together, median; where the system tells it.
    pub(crate) cpu_ratio: Option<f64>,
    /// Whether the budget is kept; a scene that takes less than a second is not judged.
    pub(crate) reached: Option<bool>,
}

/// One side of a pair: images per second, and the processors' seconds of an image.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Pace {
    /// Images per second of all processes together.
    pub(crate) images_per_second: f64,
    /// Seconds of one of them, on average.
    pub(crate) seconds: f64,
    /// User and system time of each image.
    pub(crate) cpu: Option<f64>,
}

/// Renders image 0 of a scene file with these options in `processes` processes of `threads` threads at the same time.
pub(crate) fn render(
    scene: &Path,
    settings: &[String],
    folder: &Path,
    (processes, threads): (u32, u32),
) -> Result<Pace, Error> {
    let program = env::current_exe()
        .map_err(|error| Error::failed("cannot find this program's file").because(error))?;
    let before = children_cpu();
    let mut running: Vec<Child> = Vec::new();
    for number in 0..processes {
        let mut command = Command::new(&program);
        command
            .args(["render", "--frames", "0", "--existing", "replace"])
            .args(["--output", "json", "--threads", &threads.to_string(), "-o"])
            .arg(folder.join(format!("frames-{number}")));
        let child = command
            .args(settings)
            .arg(scene)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        running.push(child.map_err(|error| Error::failed("cannot start a render").because(error))?);
    }
    let mut seconds = Vec::new();
    // All are waited for, also after one has failed.
    let ended: Vec<_> = running.into_iter().map(Child::wait_with_output).collect();
    for output in ended {
        let output =
            output.map_err(|error| Error::failed("cannot follow a render").because(error))?;
        let taken = output
            .status
            .success()
            .then(|| taken(&output.stdout))
            .flatten();
        seconds.push(taken.ok_or_else(|| {
            let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            Error::failed(format!("a render of `{}` failed", scene.display())).because(said)
        })?);
    }
    let cpu = before.zip(children_cpu());
    Ok(Pace {
        images_per_second: seconds.iter().map(|seconds| 1.0 / seconds).sum(),
        seconds: seconds.iter().sum::<f64>() / f64::from(processes),
        cpu: cpu.map(|(before, after)| (after - before) / f64::from(processes)),
    })
}

/// The seconds in a render's report.
fn taken(report: &[u8]) -> Option<f64> {
    let report: Value = serde_json::from_slice(report).ok()?;
    report["seconds"].as_f64().filter(|seconds| *seconds > 0.0)
}

/// Processor seconds of this process's children that have ended, as Linux counts them.
fn children_cpu() -> Option<f64> {
    ended_children(&fs::read_to_string("/proc/self/stat").ok()?)
}

/// The same, from the text of `/proc/…/stat`: its fields 16 and 17.
fn ended_children(stat: &str) -> Option<f64> {
    // The second field is a name in brackets, and may hold anything.
    let (_, fields) = stat.rsplit_once(')')?;
    let mut fields = fields.split_whitespace().skip(13);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / TICKS)
}

impl Measured {
    /// Pairs of threads together and processes apart; `None` of no pair.
    pub(crate) fn of(scene: String, pairs: &[(Pace, Pace)]) -> Option<Self> {
        let middle = |value: &dyn Fn(&(Pace, Pace)) -> f64| {
            let mut values: Vec<f64> = pairs.iter().map(value).collect();
            values.sort_by(f64::total_cmp);
            let median = *values.get(values.len().checked_sub(1)? / 2)?;
            Some([median, *values.first()?, *values.last()?])
        };
        let ratio =
            middle(&|(together, apart)| together.images_per_second / apart.images_per_second)?;
        let cpu = |(together, apart): &(Pace, Pace)| {
            let (together, apart) = together.cpu.zip(apart.cpu)?;
            (together > 0.0).then(|| apart / together)
        };
        let has_cpu = pairs.iter().all(|pair| cpu(pair).is_some());
        let [apart, ..] = middle(&|(_, apart)| apart.seconds)?;
        let [together, ..] = middle(&|(together, _)| together.seconds)?;
        let cpu_ratio = middle(&|pair| cpu(pair).unwrap_or_default())?[0];
        Some(Self {
            scene,
            together,
            apart,
            ratio,
            cpu_ratio: has_cpu.then_some(cpu_ratio),
            reached: (apart >= LEAST_SECONDS).then_some(ratio[0] >= BUDGET),
        })
    }
}

impl Report for Threads {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut table = columns([
            "scene",
            "together",
            "apart",
            "ratio",
            "budget",
            "CPU ratio",
            "",
        ]);
        for scene in &self.scenes {
            let [median, least, most] = scene.ratio;
            table.add_row([
                scene.scene.clone(),
                format!("{:.2} s", scene.together),
                format!("{:.2} s", scene.apart),
                format!("{median:.3} ({least:.3} to {most:.3})"),
                format!("≥ {:.2}", self.budget),
                scene
                    .cpu_ratio
                    .map(|ratio| format!("{ratio:.3}"))
                    .unwrap_or_default(),
                match scene.reached {
                    Some(true) => "met",
                    Some(false) => "missed",
                    None => "under a second",
                }
                .to_owned(),
            ]);
        }
        writeln!(out, "{table}")?;
        writeln!(
            out,
            "Images per second of {0} threads over those of {0} processes of one thread at the same time, median (least to \
             most) of {1} pairs.",
            self.threads, self.runs
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut scenes = self.scenes.iter();
        scenes.try_for_each(|scene| writeln!(out, "{} {:.3}", scene.scene, scene.ratio[0]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pace(images_per_second: f64, seconds: f64, cpu: f64) -> Pace {
        Pace {
            images_per_second,
            seconds,
            cpu: Some(cpu),
        }
    }

    #[test]
    fn short_scenes_get_more_rays() {
        let alone = [6.0, 1.5, 0.4, 0.06, 1e-9].map(|seconds| rays(seconds, 1));
        assert_eq!(alone, [1, 1, 2, 5, 16]);
        assert_eq!(rays(1.5, 4), 2);
    }

    #[test]
    fn ratios_are_medians_of_pairs_and_short_scenes_are_not_judged() {
        let pairs = [
            (pace(0.97, 1.03, 2.0), pace(1.0, 2.0, 2.0)),
            (pace(0.99, 1.01, 2.0), pace(1.0, 2.0, 1.9)),
            (pace(1.0, 1.0, 2.0), pace(1.0, 2.0, 1.9)),
        ];
        let measured = Measured::of("a".to_owned(), &pairs).unwrap();
        assert_eq!(measured.ratio, [0.99, 0.97, 1.0]);
        assert_eq!(
            (measured.cpu_ratio, measured.reached),
            (Some(0.95), Some(true))
        );
        let missed = Measured::of("a".to_owned(), &pairs[..1]).unwrap();
        assert_eq!(missed.reached, Some(false));
        let short = [(pace(4.0, 0.25, 0.5), pace(4.0, 0.5, 0.5))];
        assert_eq!(Measured::of("a".to_owned(), &short).unwrap().reached, None);
        assert!(Measured::of("a".to_owned(), &[]).is_none());
    }

    #[test]
    fn times_are_read_from_reports_and_from_the_system() {
        assert_eq!(taken(br#"{"seconds": 1.5, "threads": 2}"#), Some(1.5));
        assert_eq!(taken(b"{}"), None);
        assert_eq!(taken(b"no report"), None);
        let stat = "42 (a (strange) name) S 1 42 42 0 -1 4194560 100 200 0 0 7 8 150 50 20 0 1 0";
        assert_eq!(ended_children(stat), Some(2.0));
        assert_eq!(ended_children("42 (flyby) S 1"), None);
    }
}
