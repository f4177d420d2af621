//! What `--stats` reports: counts, averages over rays, and where the time went.
//!
//! Counts alone also stand in frames: times are never the same twice.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::ops::AddAssign;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use render::{Counts, Means, Times};
use serde::Serialize;
use serde_json::{Map, Value};

use crate::output::columns;

/// Where a render's time went, summed over its threads.
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct Spent {
    /// In the parts of blocks.
    pub(crate) blocks: Times,
    /// In compiling images and opening their scratch files.
    pub(crate) preparation: Duration,
    /// In putting blocks into scratch files.
    pub(crate) storing: Duration,
    /// In making frames of finished images.
    pub(crate) encoding: Duration,
}

impl Spent {
    /// Seconds of every part, in the order of the work.
    fn seconds(&self) -> Vec<(&'static str, f64)> {
        let blocks = self.blocks.parts();
        let blocks = blocks.map(|(part, nanoseconds)| (part.name(), nanoseconds as f64 * 1e-9));
        let mut seconds = vec![("preparation", self.preparation.as_secs_f64())];
        seconds.extend(blocks);
        seconds.push(("storing", self.storing.as_secs_f64()));
        seconds.push(("encoding", self.encoding.as_secs_f64()));
        seconds
    }
}

impl AddAssign for Spent {
    fn add_assign(&mut self, other: Self) {
        self.blocks += other.blocks;
        self.preparation += other.preparation;
        self.storing += other.storing;
        self.encoding += other.encoding;
    }
}

/// Nanoseconds on the wall's clock since this was first called.
pub(crate) fn clock() -> u64 {
    static START: OnceLock<Instant> = OnceLock::new();
    let since = START.get_or_init(Instant::now).elapsed();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

/// `--stats`.
#[derive(Serialize, Debug)]
pub(crate) struct Statistics {
    /// Everything that was counted, by name.
    #[serde(flatten)]
    counts: Map<String, Value>,
    /// How many images were traced by each method.
    methods: BTreeMap<&'static str, usize>,
    /// Averages over all rays, those towards the sun included.
    per_ray: PerRay,
    /// Seconds of each part of the work, summed over the threads.
    seconds: Map<String, Value>,
    /// The same, in the order of the work.
    #[serde(skip)]
    parts: Vec<(&'static str, f64)>,
}

/// What a ray took on average, whether from the camera or towards the sun.
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
struct PerRay {
    /// Evaluations of the field, those shared with other rays and those of normals included.
    evaluations: f64,
    /// Evaluations of a noise's lattice cell within them and in shading.
    noise_evaluations: f64,
    /// Steps of its own search.
    steps: f64,
    /// Steps taken back.
    backtracks: f64,
    /// Bundles cut into smaller ones.
    subdivisions: f64,
}

impl Statistics {
    /// The report of what was counted and measured.
    pub(crate) fn new(
        counts: &Counts,
        spent: &Spent,
        methods: &BTreeMap<&'static str, usize>,
    ) -> Self {
        let parts = spent.seconds();
        Self {
            counts: by_name(counts),
            methods: methods.clone(),
            per_ray: PerRay::of(counts),
            seconds: parts
                .iter()
                .map(|&(name, seconds)| (name.to_owned(), seconds.into()))
                .collect(),
            parts,
        }
    }

    /// Writes it for people.
    pub(crate) fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        for (name, count) in &self.counts {
            writeln!(out, "  {name:<20} {count:>16}")?;
        }
        let methods = self.methods.iter();
        let methods: Vec<_> = methods
            .map(|(name, images)| format!("{name} {images}"))
            .collect();
        writeln!(out, "  images by method     {:>16}", methods.join(", "))?;
        let PerRay {
            evaluations,
            noise_evaluations,
            steps,
            backtracks,
            subdivisions,
        } = self.per_ray;
        writeln!(
            out,
            "per ray: {evaluations:.2} evaluations ({noise_evaluations:.1} of noises), {steps:.2} steps, \
             {backtracks:.3} of them back, {subdivisions:.3} subdivisions"
        )?;
        let total: f64 = self.parts.iter().map(|(_, seconds)| seconds).sum();
        let mut table = columns(["part", "seconds", "share"]);
        for &(name, seconds) in &self.parts {
            let share = if total > 0.0 { seconds / total } else { 0.0 };
            table.add_row([
                name.to_owned(),
                format!("{seconds:.3}"),
                format!("{:.1} %", 100.0 * share),
            ]);
        }
        writeln!(out, "{table}")
    }
}

impl PerRay {
    fn of(counts: &Counts) -> Self {
        let rays = counts.rays + counts.shadow_rays;
        let average = |count: u64| {
            if rays > 0 {
                count as f64 / rays as f64
            } else {
                0.0
            }
        };
        Self {
            evaluations: average(counts.evaluations),
            noise_evaluations: average(counts.noise_evaluations),
            steps: average(counts.steps),
            backtracks: average(counts.backtracks),
            subdivisions: average(counts.subdivisions),
        }
    }
}

/// What a frame says of how it was made: counts by name, and the method.
pub(crate) fn told(counts: &Counts, means: Means) -> String {
    let mut statistics = by_name(counts);
    statistics.insert("method".to_owned(), means.name().into());
    Value::Object(statistics).to_string()
}

/// Counts by name.
fn by_name(counts: &Counts) -> Map<String, Value> {
    let named = counts.named().into_iter();
    named
        .map(|(name, count)| (name.to_owned(), count.into()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn averages_are_over_camera_and_shadow_rays() {
        let counts = Counts {
            rays: 6,
            shadow_rays: 2,
            evaluations: 40,
            steps: 32,
            backtracks: 2,
            subdivisions: 1,
            ..Counts::default()
        };
        let statistics = Statistics::new(&counts, &Spent::default(), &BTreeMap::new());
        let per_ray = statistics.per_ray;
        assert_eq!(
            (per_ray.evaluations, per_ray.steps, per_ray.backtracks),
            (5.0, 4.0, 0.25)
        );
        assert_eq!(per_ray.subdivisions, 0.125);
        let nothing = PerRay::of(&Counts::default());
        assert_eq!(nothing.steps, 0.0, "no ray, no average that is not finite");
    }

    #[test]
    fn counts_keep_their_names_and_times_stand_apart() {
        let spent = Spent {
            encoding: Duration::from_millis(250),
            ..Spent::default()
        };
        let statistics = Statistics::new(&Counts::default(), &spent, &[("values", 3)].into());
        let json = serde_json::to_value(&statistics).unwrap();
        assert_eq!(json["evaluations"], 0);
        assert_eq!(json["methods"]["values"], 3);
        assert_eq!(json["seconds"]["encoding"], 0.25);
        assert_eq!(json["seconds"]["shadows"], 0.0);
        let mut table = Vec::new();
        statistics.table(&mut table).unwrap();
        let table = String::from_utf8(table).unwrap();
        assert!(table.contains("100.0 %"), "{table}");
    }
}
