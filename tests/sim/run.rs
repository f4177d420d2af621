//! Many farms, on all processors; and of one that fails the smallest that still does.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::farm::Farm;
use crate::plan::Plan;

/// What many farms lived through.
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct Report {
    /// Farms.
    pub(crate) keys: u64,
    /// Events that schedulers and sessions were told.
    pub(crate) events: u64,
    /// Blocks of which two renderings differed.
    pub(crate) incidents: u64,
    /// Starts of coordinators after a crash.
    pub(crate) restarts: u64,
    /// Tiles that workers went on with after one.
    pub(crate) adopted: u64,
    /// Blocks that were fetched from polled sites.
    pub(crate) fetched: u64,
    /// Times that a polled site was out of reach for longer than its patience.
    pub(crate) lost: u64,
    /// Images that are rendered again since a worker made wrong pixels.
    pub(crate) convicted: u64,
}

/// Runs one farm; what broke where something did.
pub(crate) fn one(plan: Plan) -> Result<Report, String> {
    let run = || {
        let mut farm = Farm::new(plan);
        farm.run();
        farm.check_frames(&plan);
        Report {
            keys: 1,
            events: farm.events(),
            incidents: farm.coordinator.witness.incidents,
            restarts: farm.coordinator.restarts(),
            adopted: farm.coordinator.witness.adopted,
            fetched: farm.coordinator.witness.fetched,
            lost: farm.coordinator.witness.lost,
            convicted: farm.coordinator.witness.convicted,
        }
    };
    catch_unwind(AssertUnwindSafe(run)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|&text| text.to_owned()));
        text.unwrap_or_else(|| "it broke".to_owned())
    })
}

/// The smallest farm that breaks as this one does, and how.
pub(crate) fn smallest(mut plan: Plan, mut broken: String) -> (Plan, String) {
    while let Some(simpler) = plan
        .simpler()
        .into_iter()
        .find_map(|simpler| Some((simpler, one(simpler).err()?)))
    {
        (plan, broken) = simpler;
    }
    (plan, broken)
}

/// Runs a farm for each key. Panics with the smallest farm that breaks, if one does.
pub(crate) fn all(keys: Range<u64>, plan: impl Fn(u64) -> Plan + Sync) -> Report {
    let next = AtomicU64::new(keys.start);
    let total = Mutex::new(Report::default());
    let broken = Mutex::new(None);
    let work = || {
        loop {
            let key = next.fetch_add(1, Ordering::Relaxed);
            if key >= keys.end || broken.lock().expect("nobody panics with it").is_some() {
                return;
            }
            match one(plan(key)) {
                Ok(report) => total.lock().expect("nobody panics with it").add(report),
                Err(how) => {
                    *broken.lock().expect("nobody panics with it") = Some((plan(key), how));
                }
            }
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(work);
        }
    });
    if let Some((plan, how)) = broken.into_inner().expect("nobody panicked") {
        let key = plan.key;
        let (plan, smallest) = smallest(plan, how.clone());
        panic!("key {key}: {how}\nits smallest farm: {smallest}\nreplay it: one({plan:?})");
    }
    let report = total.into_inner().expect("nobody panicked");
    println!("{report:?}");
    report
}

/// A number that an environment variable holds.
pub(crate) fn number_from(variable: &str) -> Option<u64> {
    std::env::var(variable).ok()?.parse().ok()
}

impl Report {
    fn add(&mut self, other: Self) {
        self.keys += other.keys;
        self.events += other.events;
        self.incidents += other.incidents;
        self.restarts += other.restarts;
        self.adopted += other.adopted;
        self.fetched += other.fetched;
        self.lost += other.lost;
        self.convicted += other.convicted;
    }
}
