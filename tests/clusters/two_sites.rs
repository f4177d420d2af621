//! One job across two sites: Slurm in pilot mode, Grid Engine in poll mode behind a firewall, and a worker of this machine
//! that joins half-way; the coordinator is on an address that is not loopback, so that Slurm's workers join over TLS.

use std::collections::BTreeSet;
use std::time::Duration;

use crate::engine::{Engine, Kind};
use crate::harness::scenes::{FLYBY, lasting};
use crate::harness::{Farm, Place, frames, wait};

/// How long one thread would take.
const WORK: Duration = Duration::from_secs(40);

/// Of whose workers blocks have come so far, by their labels and names.
fn givers(farm: &Farm) -> BTreeSet<&'static str> {
    let list = farm.flyby(["worker", "list", "--output", "json"]).json();
    let workers = list["workers"].as_array().unwrap().iter();
    let busy = workers.filter(|worker| worker["blocks"].as_u64() > Some(0));
    busy.map(|worker| {
        let text = worker.to_string();
        ["site.slurm", "site.grid"]
            .into_iter()
            .find(|label| text.contains(label))
            .unwrap_or("here")
    })
    .collect()
}

#[test]
#[ignore = "long: tests/run --all"]
fn and_a_worker_here_give_the_frames_of_one_process() {
    let (Some(slurm), Some(grid)) = (Engine::slurm(2), Engine::gridengine(2, &[])) else {
        return;
    };
    for host in ["ge1", "ge2"] {
        // The queue itself, which may connect anew at any time, is not kept from its hosts.
        grid.tool("firewall", &[host, "drop", "head"]);
    }
    let place = Place::new();
    let (there, program) = (place.path("there"), env!("CARGO_BIN_EXE_flyby"));
    let usual = format!(
        "folder = '{}'\nprogram = '{program}'\npoll = '1 s'\n",
        there.display()
    );
    let text = format!(
        "[site.slurm]\n{}{usual}mode = 'pilot'\nidle = '3 s'\nmax_running = 1\n\
         [site.grid]\n{}{usual}mode = 'poll'\nmin_tile_pixels = 1000\nahead = 0\nmax_running = 1\n",
        slurm.site(Kind::Slurm),
        grid.site(Kind::GridEngine)
    );
    place.write("sites.toml", text);
    let sites = ["--sites", "sites.toml"];
    let mut farm = Farm::listening(grid.head().into(), place, &[], &sites);
    let work = lasting(WORK);
    let job = farm.submit(&work.with(&[FLYBY]));
    wait::until("both sites bring blocks", || {
        let givers = givers(&farm);
        (givers.contains("site.slurm") && givers.contains("site.grid")).then_some(())
    });
    farm.worker(&["--threads", "1"]);
    let done = farm.wait_done(job);
    frames::are_same(&farm.frames(job), &work.frames);
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
    farm.coordinator.kill();
    for site in ["slurm", "grid"] {
        farm.flyby(["site", "clean", site, "--sites", "sites.toml"])
            .ok();
    }
    assert!(!grid.tool("qstat", &["-u", "*"]).contains("flyby-"));
    assert_eq!(slurm.slurm_tool("squeue", &["-h"]), "");
}
