//! A coordinator, its workers and its jobs.

use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::time::Duration;

use serde_json::Value;

use super::{Job, Outcome, Place, Process, frames, wait};

/// When a coordinator is killed that has just been started.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Moment {
    /// Before it has done anything.
    AtOnce,
    /// It has counted its start, and opens its store and files.
    Counted,
    /// It says where it listens.
    Listening,
}

/// A farm of real processes on loopback. Dropping it kills them all.
pub(crate) struct Farm {
    /// Its workers, in the order in which they were started.
    pub(crate) workers: Vec<Process>,
    /// Its coordinator.
    pub(crate) coordinator: Process,
    /// Where the coordinator listens on this machine.
    pub(crate) address: SocketAddr,
    /// Where it is told to listen when it is started again.
    listen: SocketAddr,
    /// Where everything lies.
    pub(crate) place: Place,
    /// What its coordinator is started by, and with which further options, each time.
    wrapper: Vec<String>,
    options: Vec<String>,
}

impl Farm {
    /// A coordinator with these further options, that answers already, and no worker yet.
    pub(crate) fn new(options: &[&str]) -> Self {
        Self::wrapped(Place::new(), &[], options)
    }

    /// [`Farm::new`] in a place that a test has prepared, its coordinator started by another
    /// program that is given `wrapper`'s further words.
    pub(crate) fn wrapped(place: Place, wrapper: &[&str], options: &[&str]) -> Self {
        Self::listening(Ipv4Addr::LOCALHOST.into(), place, wrapper, options)
    }

    /// A coordinator that listens on an address that other machines can reach, and on loopback.
    pub(crate) fn reachable(address: IpAddr, options: &[&str]) -> Self {
        Self::listening(address, Place::new(), &[], options)
    }

    /// [`Farm::wrapped`], listening there.
    pub(crate) fn listening(on: IpAddr, place: Place, wrapper: &[&str], options: &[&str]) -> Self {
        let kept = |words: &[&str]| {
            words
                .iter()
                .map(|&word| word.to_owned())
                .collect::<Vec<_>>()
        };
        let (wrapper, options) = (kept(wrapper), kept(options));
        let anywhere = SocketAddr::new(on, 0).to_string();
        let mut coordinator = start_coordinator(&place, &anywhere, &wrapper, &options);
        let address = says_where(&place, &mut coordinator);
        Self {
            listen: SocketAddr::new(on, address.port()),
            workers: Vec::new(),
            coordinator,
            address,
            place,
            wrapper,
            options,
        }
    }

    /// Starts the coordinator again that was killed or has ended, as it was started first, where it
    /// was, over the same state.
    pub(crate) fn start_again(&mut self) {
        // One that was killed could not take it back.
        let _ = std::fs::remove_file(self.place.state().join("coordinator.json"));
        let listen = self.listen.to_string();
        self.coordinator = start_coordinator(&self.place, &listen, &self.wrapper, &self.options);
        assert_eq!(says_where(&self.place, &mut self.coordinator), self.address);
    }

    /// Starts the coordinator again and kills it at a moment of its start.
    #[track_caller]
    pub(crate) fn start_and_kill(&mut self, moment: Moment) {
        let state = self.place.state();
        let epoch = || std::fs::read(state.join("epoch")).ok();
        let before = epoch();
        // One that was killed could not take it back.
        let _ = std::fs::remove_file(state.join("coordinator.json"));
        let listen = self.listen.to_string();
        self.coordinator = start_coordinator(&self.place, &listen, &self.wrapper, &self.options);
        match moment {
            Moment::AtOnce => {}
            Moment::Counted => wait::until("the coordinator counts its start", || {
                (epoch() != before).then_some(())
            }),
            Moment::Listening => {
                says_where(&self.place, &mut self.coordinator);
            }
        }
        self.coordinator.kill();
    }

    /// Waits until the workers have taken so much processor time, all together, or none of them has anything to do.
    #[track_caller]
    pub(crate) fn wait_rendered(&self, time: Duration) {
        let taken = || self.workers.iter().map(Process::cpu_time).sum::<Duration>();
        let before = taken();
        wait::until(
            "the workers have rendered for a while, or all they had",
            || {
                let is_idle = !self.workers.iter().any(Process::is_running);
                (is_idle || taken() >= before + time).then_some(())
            },
        );
    }

    /// A farm of `count` workers of one thread each.
    pub(crate) fn of_workers(count: usize) -> Self {
        let mut farm = Self::new(&[]);
        for _ in 0..count {
            farm.worker(&["--threads", "1"]);
        }
        farm
    }

    /// Where other machines can reach the coordinator.
    pub(crate) fn outside(&self) -> SocketAddr {
        self.listen
    }

    /// Makes a token with these further options; answers its file, which lies in the coordinator's place.
    #[track_caller]
    pub(crate) fn token(&self, name: &str, options: &[&str]) -> String {
        let file = self.place.path(name).to_str().unwrap().to_owned();
        let command = ["token", "create", "--out", &file];
        self.flyby(command.into_iter().chain(options.iter().copied()))
            .ok();
        file
    }

    /// Starts a worker with these further options; answers its place in [`Farm::workers`].
    pub(crate) fn worker(&mut self, options: &[&str]) -> usize {
        self.worker_through(self.address, options)
    }

    /// Starts a worker that dials another address than the coordinator's own.
    pub(crate) fn worker_through(&mut self, address: SocketAddr, options: &[&str]) -> usize {
        let address = address.to_string();
        let command = ["worker", "--while-input-open", "--coordinator", &address];
        let name = format!("worker{}", self.workers.len());
        let worker = self.place.start(&name, command.iter().chain(options));
        self.workers.push(worker);
        self.workers.len() - 1
    }

    /// Puts another worker, in a process of its own, in the place of one that has ended.
    pub(crate) fn replace_worker(&mut self, place: usize, address: SocketAddr, options: &[&str]) {
        self.worker_through(address, options);
        self.workers.swap_remove(place);
    }

    /// Runs a command that speaks with this coordinator.
    #[track_caller]
    pub(crate) fn flyby<'a>(&self, arguments: impl IntoIterator<Item = &'a str>) -> Outcome {
        self.place.flyby(arguments)
    }

    /// Submits a job; answers its number.
    #[track_caller]
    pub(crate) fn submit(&self, arguments: &[&str]) -> u64 {
        let command = ["submit", "--format", "exr", "--output", "json"];
        let answer = self
            .flyby(command.into_iter().chain(arguments.iter().copied()))
            .json();
        answer["job"]
            .as_u64()
            .unwrap_or_else(|| panic!("no job in {answer}"))
    }

    /// A job as it is now.
    #[track_caller]
    pub(crate) fn job(&self, job: u64) -> Job {
        Job(self
            .flyby(["job", "show", &job.to_string(), "--output", "json"])
            .json())
    }

    /// Waits until a job is as `condition` wants it; answers it as it then is.
    #[track_caller]
    pub(crate) fn wait_until(&self, job: u64, what: &str, condition: impl Fn(&Job) -> bool) -> Job {
        wait::until(what, || Some(self.job(job)).filter(&condition))
    }

    /// Waits until at least `blocks` blocks of a job are acknowledged.
    #[track_caller]
    pub(crate) fn wait_acknowledged(&self, job: u64, blocks: u64) -> Job {
        let what = format!("{blocks} blocks are acknowledged");
        self.wait_until(job, &what, |job| job.number("blocks_done") >= blocks)
    }

    /// Waits for a job's end, which must be that all its images are done.
    #[track_caller]
    pub(crate) fn wait_done(&self, job: u64) -> Job {
        self.wait_done_within(wait::LIMIT, job)
    }

    /// [`Farm::wait_done`] with another limit.
    #[track_caller]
    pub(crate) fn wait_done_within(&self, limit: Duration, job: u64) -> Job {
        // It waits without taking the processors from the workers, as asking again and again would.
        let watch = self.place.command(["job", "watch", &job.to_string()]);
        let watched = self.place.run(watch, limit);
        let job = self.job(job);
        assert_eq!(job.state(), "done", "{job:?}\n{watched}");
        job
    }

    /// The files of a job that is done, as [`frames`] compares them.
    #[track_caller]
    pub(crate) fn frames(&self, job: u64) -> Vec<Vec<u8>> {
        let out = format!("frames-{job}");
        self.flyby(["job", "fetch", &job.to_string(), "--out", &out])
            .ok();
        frames::frames(&self.place.path(&out))
    }

    /// How many workers the coordinator counts as connected.
    #[track_caller]
    pub(crate) fn connected(&self) -> usize {
        let list = self.flyby(["worker", "list", "--output", "json"]).json();
        let workers = list["workers"].as_array().unwrap();
        let connected = workers
            .iter()
            .filter(|worker| worker["state"] == "connected");
        connected.count()
    }

    /// Waits until the coordinator counts `count` workers as connected.
    #[track_caller]
    pub(crate) fn wait_connected(&self, count: usize) {
        wait::until(&format!("{count} workers are connected"), || {
            (self.connected() == count).then_some(())
        });
    }
}

fn start_coordinator(
    place: &Place,
    listen: &str,
    wrapper: &[String],
    options: &[String],
) -> Process {
    let command = ["coordinator", "--while-input-open", "--listen", listen];
    let wrapper: Vec<_> = wrapper.iter().map(String::as_str).collect();
    let options = options.iter().map(String::as_str);
    place.start_command(
        "coordinator",
        place.wrapped(&wrapper, command.into_iter().chain(options)),
    )
}

/// Where a coordinator that was just started says that it listens.
fn says_where(place: &Place, coordinator: &mut Process) -> SocketAddr {
    let file = place.state().join("coordinator.json");
    wait::until("the coordinator says where it listens", || {
        let ended = coordinator.ended();
        assert!(
            ended.is_none(),
            "the coordinator ended with {ended:?}: {}",
            coordinator.stderr()
        );
        let said: Value = serde_json::from_slice(&std::fs::read(&file).ok()?).unwrap();
        Some(said["address"].as_str().unwrap().parse().unwrap())
    })
}

/// An address of loopback on which nobody listens.
pub(crate) fn free_address() -> SocketAddr {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    listener.local_addr().unwrap()
}
