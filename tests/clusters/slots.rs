//! A site where four tasks of one user run at a time, as on the thesis's Snowdon (table C.1), looked at every second, with
//! tasks of a few seconds: whether its slots stay busy from image to image, by the queue's own accounts (§C.3.5).

use std::fs;
use std::net::Ipv4Addr;
use std::time::Duration;

use serde_json::Value;

use crate::engine::{Engine, Kind};
use crate::harness::scenes::{FLYBY, rays_for};
use crate::harness::{Farm, Place, wait};

/// Slots that one user may have.
const SLOTS: usize = 4;

/// Images of each job, and tiles of each: 200×150 pixels in tiles of 2500, the thesis's rule.
const IMAGES: usize = 5;
const TILES: usize = 12;

/// How long one thread would take over two images: a task takes more than a look, and an image several.
const TWO_IMAGES: Duration = Duration::from_secs(20);

/// A task by the queue's accounts, in seconds since 1970.
#[derive(Clone, Copy, Debug)]
struct Account {
    submitted: u64,
    started: u64,
    ended: u64,
}

/// The tasks of a site, as Grid Engine's accounting(5) has them.
fn accounts(engine: &Engine, site: &str) -> Vec<Account> {
    let file = "gridengine/root/default/common/accounting";
    let text = fs::read_to_string(engine.folder.join(file)).unwrap_or_default();
    let records = text.lines().filter(|line| !line.starts_with('#'));
    let records = records.map(|line| line.split(':').collect::<Vec<_>>());
    let of_site = records.filter(|record| record[4].contains(&format!("-{site}.")));
    let time = |word: &str| word.parse().unwrap();
    let account = |record: Vec<&str>| Account {
        submitted: time(record[8]),
        started: time(record[9]),
        ended: time(record[10]),
    };
    of_site.map(account).collect()
}

/// The share of the time in which a slot was free while nothing waited: from when all were busy first to when the last
/// image was submitted.
fn free_share(accounts: &[Account]) -> f64 {
    let at = |time: u64| {
        let running = accounts
            .iter()
            .filter(|task| task.started <= time && time < task.ended);
        let waiting = accounts
            .iter()
            .filter(|task| task.submitted <= time && time < task.started);
        (running.count(), waiting.count())
    };
    let last = accounts.iter().map(|task| task.submitted).max().unwrap();
    let first = accounts.iter().map(|task| task.started).min().unwrap();
    let full = (first..last).find(|&time| at(time).0 == SLOTS);
    let times = full.expect("all slots were busy once")..last;
    let all = f64::from(u32::try_from(times.end - times.start).unwrap());
    let free = times.filter(|&time| {
        let (running, waiting) = at(time);
        assert!(running <= SLOTS, "{running} run");
        running < SLOTS && waiting == 0
    });
    f64::from(u32::try_from(free.count()).unwrap()) / all
}

#[test]
#[ignore = "long: tests/run --all"]
fn stay_busy_from_image_to_image_with_one_image_ahead() {
    let Some(engine) = Engine::gridengine(3, &[("GE_MAXUJOBS", "4")]) else {
        return;
    };
    let place = Place::new();
    let site = |ahead: u32| {
        format!(
            "[site.ahead{ahead}]\n{}folder = '{}'\nprogram = '{}'\nmode = 'poll'\npoll = '1 s'\nahead = {ahead}\n\
             min_tile_pixels = 2500\n",
            engine.site(Kind::GridEngine),
            place.path("there").display(),
            env!("CARGO_BIN_EXE_flyby"),
        )
    };
    place.write("sites.toml", [0, 1].map(site).concat());
    let options = ["--sites", "sites.toml"];
    let farm = Farm::listening(Ipv4Addr::LOCALHOST.into(), place, &[], &options);
    let rays = rays_for(TWO_IMAGES).to_string();
    let frames = format!("0..{IMAGES}");
    let settings = [
        "--resolution",
        "200x150",
        "--rays",
        &rays,
        "--frames",
        &frames,
    ];
    let shares = ["ahead0", "ahead1"].map(|site| {
        let label = format!("site.{site}");
        let here = [FLYBY, "--need-label", &label];
        let job = farm.submit(&[&here[..], &settings[..]].concat());
        farm.wait_done(job);
        let accounts = wait::until("the queue accounts for every task", || {
            let accounts = accounts(&engine, site);
            (accounts.len() >= IMAGES * TILES).then_some(accounts)
        });
        assert_eq!(accounts.len(), IMAGES * TILES);
        free_share(&accounts)
    });
    let command = ["site", "plot", "ahead0", "ahead1", "-o", "busy.svg"];
    let told = farm.flyby(command.into_iter().chain(["--output", "json"]));
    let told = told.json();
    let told = [0, 1].map(|site| {
        let site: &Value = &told["sites"][site];
        assert_eq!(site["slots"], 4, "{site}");
        site["free_share"].as_f64().unwrap()
    });
    for [none, one] in [shares, told] {
        assert!(
            one < 0.02,
            "with one image ahead: by the queue {shares:?}, by the looks {told:?}"
        );
        assert!(
            none > one + 0.02,
            "without and with one: by the queue {shares:?}, by the looks {told:?}"
        );
    }
    let plot = fs::read_to_string(farm.place.path("busy.svg")).unwrap();
    assert!(plot.contains("ahead1, ahead 1: a slot free"), "{plot}");
    let mut farm = farm;
    farm.coordinator.kill();
    for site in ["ahead0", "ahead1"] {
        farm.flyby(["site", "clean", site, "--sites", "sites.toml"])
            .ok();
    }
}
