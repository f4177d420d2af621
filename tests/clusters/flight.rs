//! A farm with one site, and what must hold of it.

use std::fs;
use std::net::Ipv4Addr;

use serde_json::Value;

use crate::engine::{Engine, Kind};
use crate::harness::scenes::{FLYBY, small};
use crate::harness::{Farm, Place, frames, wait};

/// A farm whose coordinator has one site, called `test`.
pub(crate) struct Flight {
    pub(crate) farm: Farm,
}

impl Flight {
    /// With these further lines in `sites.toml`.
    pub(crate) fn new(engine: &Engine, kind: Kind, more: &str) -> Self {
        Self::with_program(engine, kind, env!("CARGO_BIN_EXE_flyby"), more)
    }

    /// The same, with another program at the site.
    pub(crate) fn with_program(engine: &Engine, kind: Kind, program: &str, more: &str) -> Self {
        Self::at(&engine.site(kind), program, more)
    }

    /// The same, at a site of these lines.
    pub(crate) fn at(site: &str, program: &str, more: &str) -> Self {
        Self::on(Ipv4Addr::LOCALHOST, site, program, more)
    }

    /// The same, in this place.
    pub(crate) fn in_place(place: Place, site: &str, program: &str, more: &str) -> Self {
        Self::start(place, Ipv4Addr::LOCALHOST, (site, program, more))
    }

    /// A coordinator on an address that the hosts of an engine dial, so that they join over TLS.
    pub(crate) fn over_tls(engine: &Engine, kind: Kind, more: &str) -> Self {
        let program = env!("CARGO_BIN_EXE_flyby");
        Self::on(engine.head(), &engine.site(kind), program, more)
    }

    fn on(listens: Ipv4Addr, site: &str, program: &str, more: &str) -> Self {
        Self::start(Place::new(), listens, (site, program, more))
    }

    fn start(place: Place, listens: Ipv4Addr, (site, program, more): (&str, &str, &str)) -> Self {
        let there = place.path("there");
        let text = format!(
            "[site.test]\n{site}folder = '{}'\nprogram = '{program}'\npoll = '1 s'\n{more}\n",
            there.display(),
        );
        place.write("sites.toml", text);
        Self {
            farm: Farm::listening(listens.into(), place, &[], &["--sites", "sites.toml"]),
        }
    }

    /// The site, as the coordinator sees it.
    pub(crate) fn site(&self) -> Value {
        let list = self.farm.flyby(["site", "list", "--output", "json"]).json();
        list["sites"][0]["seen"].clone()
    }

    pub(crate) fn count(&self, name: &str) -> u64 {
        self.site()[name].as_u64().unwrap()
    }

    #[track_caller]
    pub(crate) fn wait_trouble(&self, phrases: &[&str]) {
        let what = format!("the site's trouble holds {phrases:?}");
        wait::until(&what, || self.has_trouble(phrases).then_some(()));
    }

    /// Whether the site's trouble holds these words now.
    pub(crate) fn has_trouble(&self, phrases: &[&str]) -> bool {
        let site = self.site();
        let trouble = site["trouble"].as_str();
        trouble.is_some_and(|trouble| phrases.iter().all(|phrase| trouble.contains(phrase)))
    }

    pub(crate) fn clean(&self) {
        let clean = ["site", "clean", "test", "--sites", "sites.toml"];
        self.farm.flyby(clean).ok();
    }

    /// Nothing of the farm is left at the site: neither folder nor process.
    #[track_caller]
    pub(crate) fn has_left_nothing(&self) {
        let there = self.farm.place.path("there");
        let left: Vec<_> = fs::read_dir(&there)
            .into_iter()
            .flatten()
            .flatten()
            .collect();
        assert!(left.is_empty(), "{left:?}");
        self.runs_nothing();
    }

    /// No process of the site runs, on whichever of its hosts.
    #[track_caller]
    pub(crate) fn runs_nothing(&self) {
        let there = self.farm.place.path("there").display().to_string();
        wait::until("no process of the site is left", || {
            processes_with(&there).is_empty().then_some(())
        });
    }
}

/// Whatever becomes of a test, no process of a host without a queue stays behind.
impl Drop for Flight {
    fn drop(&mut self) {
        // It would submit again.
        if self.farm.coordinator.ended().is_none() {
            self.farm.coordinator.kill();
        }
        let _ = self
            .farm
            .place
            .flyby(["site", "clean", "test", "--sites", "sites.toml"]);
    }
}

/// The command lines that hold a text, of everybody but who looks.
pub(crate) fn processes_with(text: &str) -> Vec<String> {
    let entries = fs::read_dir("/proc").unwrap().flatten();
    let lines = entries.filter_map(|entry| fs::read(entry.path().join("cmdline")).ok());
    let lines = lines.map(|line| String::from_utf8_lossy(&line).replace('\0', " "));
    lines.filter(|line| line.contains(text)).collect()
}

/// The same frames as one process renders, and nothing left behind.
pub(crate) fn renders_the_same(flight: &Flight) {
    let job = flight.farm.submit(&small().with(&[FLYBY]));
    let done = flight.farm.wait_done(job);
    frames::are_same(&flight.farm.frames(job), &small().frames);
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
    flight.clean();
    flight.has_left_nothing();
}
