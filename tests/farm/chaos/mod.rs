//! Whatever befalls coordinator, workers, links and disk while jobs run, in whatever order: the farm goes on by
//! itself, every frame is right, and nothing that was acknowledged is rendered again.
//!
//! A farm of three workers, two of them behind proxies, the state folder on a small disk. Rounds are drawn from a
//! key; each lets some blocks pass, makes trouble, ends it, and waits until all workers are there and more blocks are
//! acknowledged. `FLYBY_CHAOS_KEY` and `FLYBY_CHAOS_ROUNDS` choose other rounds and more of them. Which blocks are
//! under way at that instant is the machine's affair: the same key makes the same troubles, not the same run.
//!
//! What is held against the farm:
//!
//! - Nobody touches anything: that a process which was killed is started again is the only help.
//! - Every job ends with all its images done, each with the film digest of an undisturbed render, as the coordinator tells
//!   it and as the fetched files do. Every block is counted once, and none differs from another rendering of it.
//! - What `job show` told as acknowledged before a coordinator was killed or frozen is there after.
//! - *No lease ever asks for a block that was acknowledged*, by whichever coordinator: exactly, without exception
//!   ([`witness`]). So no failure makes anyone begin an acknowledged block again.
//!
//! What may honestly come twice is a block that two attempts were leased *before* either delivered it: a worker
//! whose link is closed keeps its attempt until its limit, while its tile is leased to somebody else; and near the
//! end of a job tiles are leased twice on purpose. The witness counts those too, and the farm must not tell of more
//! (`blocks_again` and `blocks_twice`, summed over coordinators, since each counts for itself). Where no worker was parted
//! from the coordinator since a job began, which is where only coordinators were killed or frozen and disks
//! were full, `blocks_again` must be 0.

mod trouble;
mod witness;

use std::collections::BTreeMap;
use std::time::Instant;

use self::trouble::{Links, Meanwhile, Round, Rounds, Trouble, Until};
use self::witness::{LOG, Witness};
use super::failures::{SHORT_LIMITS, blocks, submit};
use crate::harness::scenes::{film_digests, slow};
use crate::harness::{Farm, Job, Place, Proxy, Signal, SmallDisk, wait};

const WORKERS: usize = 3;

/// Workers that are behind a proxy; they come first.
const LINKS: usize = 2;

/// Room for a few jobs, and for what SQLite keeps beside its file.
const DISK: &str = "32m";

/// One in how many leases may be given back.
const GIVEN_BACK_PART: u64 = 20;

const ONE_THREAD: [&str; 2] = ["--threads", "1"];

#[test]
fn three_rounds() {
    // A frozen worker, a full disk, a killed worker, and two coordinators that are killed meanwhile.
    Chaos::new(number_from("FLYBY_CHAOS_KEY").unwrap_or(45)).rounds(3);
}

#[test]
#[ignore = "long: tests/run --all"]
fn twenty_rounds() {
    // Every kind of trouble.
    let key = number_from("FLYBY_CHAOS_KEY").unwrap_or(34);
    Chaos::new(key).rounds(number_from("FLYBY_CHAOS_ROUNDS").unwrap_or(20));
}

fn number_from(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;
    let number = text.parse();
    Some(number.unwrap_or_else(|why| panic!("{variable}={text}: {why}")))
}

/// A farm in trouble.
struct Chaos {
    farm: Farm,
    links: [Proxy; LINKS],
    disk: Option<SmallDisk>,
    rounds: Rounds,
    witness: Witness,
    job: u64,
    /// Whether a worker was parted from the coordinator since the job began.
    parted: bool,
    /// The present job's blocks that came again, as coordinators told that are gone.
    again: u64,
    tally: Tally,
}

/// What a run comes to.
#[derive(Default, Debug)]
struct Tally {
    rounds: BTreeMap<&'static str, u64>,
    jobs: u64,
    blocks: u64,
    restarts: u64,
    blocks_again: u64,
    blocks_twice: u64,
}

impl Chaos {
    fn new(key: u64) -> Self {
        eprintln!("FLYBY_CHAOS_KEY={key}");
        let place = Place::new();
        let disk = SmallDisk::mount(&place, &place.state(), DISK);
        let wrapper = disk.as_ref().map(SmallDisk::wrapper).unwrap_or_default();
        let options = [SHORT_LIMITS, LOG].concat();
        let mut farm = Farm::wrapped(place, &wrapper, &options);
        let links = [(); LINKS].map(|()| Proxy::to(farm.address));
        for worker in 0..WORKERS {
            let address = links.get(worker).map_or(farm.address, Proxy::address);
            farm.worker_through(address, &ONE_THREAD);
        }
        let job = submit(&farm);
        Self {
            farm,
            links,
            rounds: Rounds::new(key, disk.is_some()),
            disk,
            witness: Witness::default(),
            job,
            parted: false,
            again: 0,
            tally: Tally::default(),
        }
    }

    fn rounds(mut self, count: u64) {
        for number in 1..=count {
            if self.job_now().is_over() {
                self.job_is_right();
                self.job = submit(&self.farm);
            }
            let round = self.rounds.draw();
            eprintln!("round {number}, job {}: {round:?}", self.job);
            let start = Instant::now();
            let before = (self.witness.leases, self.witness.rendered_twice);
            self.round(round);
            eprintln!(
                "  {:.1} s, {} tiles leased, {} blocks came of two",
                start.elapsed().as_secs_f64(),
                self.witness.leases - before.0,
                self.witness.rendered_twice - before.1
            );
        }
        self.farm.wait_done(self.job);
        self.job_is_right();
        // But for acknowledgements that a killed coordinator had decided and not come to, the witness saw them all.
        let acknowledged = self.witness.acknowledged_count() as u64;
        assert!(acknowledged * 10 >= self.tally.blocks * 9 && self.witness.leases > 0);
        // A worker that holds too much may be leased something, but not the same again and again.
        let given_back = self.witness.given_back;
        assert!(
            given_back * GIVEN_BACK_PART <= self.witness.leases,
            "{given_back} of {} leases were given back",
            self.witness.leases
        );
        eprintln!(
            "{:#?}\n{} tiles leased, {given_back} of them given back, {} blocks acknowledged, none leased after that; {} leased to two before",
            self.tally, self.witness.leases, acknowledged, self.witness.rendered_twice
        );
    }

    fn round(&mut self, round: Round) {
        let before = self.blocks_done();
        self.wait_for("some blocks pass", |job| {
            job.number("blocks_done") >= before + round.after_blocks
        });
        *self.tally.rounds.entry(round.trouble.name()).or_default() += 1;
        self.parted |= round.trouble.parts_a_worker();
        self.make(round.trouble);
        let left = self.blocks_done();
        self.wait_for("the farm goes on", |job| job.number("blocks_done") > left);
        self.farm.wait_connected(WORKERS);
        self.witness.read(&self.farm.coordinator);
    }

    fn make(&mut self, trouble: Trouble) {
        match trouble {
            Trouble::KillCoordinator => self.kill_coordinator(|_| ()),
            Trouble::KillCoordinatorAsItStarts(moment) => {
                self.kill_coordinator(|chaos| {
                    chaos.farm.start_and_kill(moment);
                    chaos.witness.read(&chaos.farm.coordinator);
                    chaos.witness.another();
                });
            }
            Trouble::FreezeCoordinator(a_while) => {
                let before = self.blocks_done();
                self.farm.coordinator.signal(Signal::Stop);
                self.farm.wait_rendered(a_while);
                self.farm.coordinator.signal(Signal::Continue);
                let after = self.blocks_done();
                assert!(after >= before, "{after} blocks of {before} are there");
            }
            Trouble::KillWorker(worker) => {
                self.farm.workers[worker].kill();
                let address = self.links.get(worker);
                let address = address.map_or(self.farm.address, Proxy::address);
                self.farm.replace_worker(worker, address, &ONE_THREAD);
            }
            Trouble::FreezeWorker(worker, until, meanwhile) => {
                self.farm.workers[worker].signal(Signal::Stop);
                self.while_frozen(1, until, meanwhile);
                self.farm.workers[worker].signal(Signal::Continue);
            }
            Trouble::CutLinks(links) => self.links_of(links).for_each(Proxy::cut),
            Trouble::FreezeLinks(links, until, meanwhile) => {
                self.links_of(links).for_each(Proxy::freeze);
                self.while_frozen(self.links_of(links).count(), until, meanwhile);
                self.links_of(links).for_each(Proxy::thaw);
            }
            Trouble::FillDisk(meanwhile) => self.fill_disk(meanwhile),
        }
    }

    /// Kills the coordinator and starts another, with something in between; what was acknowledged is there again.
    fn kill_coordinator(&mut self, in_between: impl FnOnce(&mut Self)) {
        let before = self.job_now();
        self.again += before.number("blocks_again");
        self.tally.blocks_twice += before.number("blocks_twice");
        let before = before.number("blocks_done");
        self.farm.coordinator.kill();
        self.witness.read(&self.farm.coordinator);
        self.witness.another();
        in_between(self);
        self.farm.start_again();
        self.tally.restarts += 1;
        let after = self.blocks_done();
        assert!(after >= before, "{after} blocks of {before} are there");
    }

    fn while_frozen(&mut self, away: usize, until: Until, meanwhile: Meanwhile) {
        if meanwhile == Meanwhile::KillCoordinator {
            self.kill_coordinator(|_| ());
        }
        match until {
            Until::Missed => wait::until("whoever is frozen is missed", || {
                (self.farm.connected() <= WORKERS - away).then_some(())
            }),
            Until::OthersDeliver(blocks) => {
                let before = self.blocks_done();
                self.wait_for("the others deliver", |job| {
                    job.number("blocks_done") >= before + blocks
                });
            }
        }
    }

    fn links_of(&self, links: Links) -> impl Iterator<Item = &Proxy> {
        let chosen = self.links.iter().zip(links);
        chosen.filter_map(|(link, is_chosen)| is_chosen.then_some(link))
    }

    /// Until the coordinator says that it waits, or needs no more room for this job.
    fn fill_disk(&mut self, meanwhile: Meanwhile) {
        let job = self.job.to_string();
        wait::until("the coordinator says that it waits for its disk", || {
            // What it frees meanwhile is taken too.
            self.disk().fill();
            let why = self.farm.flyby(["job", "why", &job]).ok();
            let waits = why.contains("the coordinator waits for its disk");
            (waits || self.job_now().is_over()).then_some(())
        });
        match meanwhile {
            Meanwhile::Nothing => self.disk().empty(),
            Meanwhile::KillCoordinator => self.kill_coordinator(|chaos| chaos.disk().empty()),
        }
    }

    fn disk(&self) -> &SmallDisk {
        let disk = self.disk.as_ref();
        disk.expect("where there is none, it is not drawn")
    }

    fn job_now(&self) -> Job {
        self.farm.job(self.job)
    }

    fn blocks_done(&self) -> u64 {
        self.job_now().number("blocks_done")
    }

    /// Waits until the job is as `condition` wants it, or over, which must be that it is done.
    #[track_caller]
    fn wait_for(&self, what: &str, condition: impl Fn(&Job) -> bool) {
        let job = self
            .farm
            .wait_until(self.job, what, |job| job.is_over() || condition(job));
        assert!(matches!(job.state(), "running" | "done"), "{job:?}");
    }

    /// The job that is over is as if nothing had happened; then it goes, so that there is room for others.
    fn job_is_right(&mut self) {
        let done = self.job_now();
        assert_eq!(done.state(), "done", "{done:?}");
        assert_eq!(done.film_digests(), slow().digests);
        assert_eq!(done.number("pixels_done"), done.number("pixels"));
        assert_eq!(done.number("blocks_done"), blocks(), "{done:?}");
        assert_eq!(done.number("incidents"), 0, "{done:?}");
        let job = self.job.to_string();
        let fetched = format!("fetched{job}");
        self.farm
            .flyby(["job", "fetch", &job, "--out", &fetched])
            .ok();
        assert_eq!(film_digests(&self.farm.place, &fetched), slow().digests);

        let again = self.again + done.number("blocks_again");
        assert!(
            self.parted || again == 0,
            "{again} blocks came again: {done:?}"
        );
        self.tally.blocks_again += again;
        self.tally.blocks_twice += done.number("blocks_twice");
        self.witness.read(&self.farm.coordinator);
        let (told, seen) = (
            self.tally.blocks_again + self.tally.blocks_twice,
            self.witness.rendered_twice,
        );
        assert!(
            told <= seen,
            "{told} blocks came twice, of which {seen} were leased to two"
        );
        self.tally.jobs += 1;
        self.tally.blocks += done.number("blocks_done");
        self.farm.flyby(["job", "remove", "--frames", &job]).ok();
        std::fs::remove_dir_all(self.farm.place.path(&fetched)).unwrap();
        (self.parted, self.again) = (false, 0);
    }
}
