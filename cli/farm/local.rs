//! A farm of processes on this machine that dies with this one.
//!
//! Every child's standard input is a pipe from here, and it stops when that ends: on any
//! way out of this process, a `kill -9` included, nobody is left behind.

use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader};
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::error::Error;
use crate::options::{Context, FarmOptions};
use crate::stop::Stop;

/// How long the coordinator may take until it listens.
const START_TIMEOUT: Duration = Duration::from_secs(30);

/// How long children may take to end by themselves.
const END_TIMEOUT: Duration = Duration::from_secs(5);

/// How often children are looked at.
const LOOK_INTERVAL: Duration = Duration::from_millis(100);

/// Where a coordinator listens on this machine, on any free port.
pub(crate) const ANY_PORT: SocketAddr = SocketAddr::V4(SocketAddrV4::new(Ipv4Addr::LOCALHOST, 0));

/// Bytes of a child's log that are part of a message.
const LOG_TAIL_BYTES: usize = 2_000;

/// What went wrong with a child while nobody was looking.
#[derive(Clone, Default)]
pub(crate) struct Troubles(Arc<Mutex<Option<String>>>);

impl Troubles {
    /// The first trouble, as this command's error.
    pub(crate) fn first(&self) -> Option<Error> {
        let what = lock(&self.0).clone()?;
        Some(Error::failed("a process of the farm ended by itself").because(what))
    }
}

/// A running farm; dropping it ends it.
pub(crate) struct LocalFarm {
    address: SocketAddr,
    children: Arc<Mutex<Vec<Process>>>,
    ending: Arc<AtomicBool>,
    watcher: Option<JoinHandle<()>>,
    state: TempDir,
}

/// A child; dropping it kills it.
pub(crate) struct Process {
    name: String,
    child: Child,
    log: PathBuf,
}

impl LocalFarm {
    /// Starts a coordinator on a free port and workers of so many threads each, with a state
    /// folder of their own. Where one of them ends by itself, `stop` is set and `troubles` says why.
    pub(crate) fn start(
        workers: usize,
        threads: usize,
        stop: &Stop,
        troubles: &Troubles,
    ) -> Result<Self, Error> {
        let state = tempfile::Builder::new()
            .prefix("flyby-")
            .tempdir()
            .map_err(|error| {
                Error::failed("cannot make a temporary folder for the farm").because(error)
            })?;
        let (coordinator, address) = coordinator(state.path(), ANY_PORT, &[], stop)?;
        let mut farm = Self {
            address,
            children: Arc::new(Mutex::new(vec![coordinator])),
            ending: Arc::default(),
            watcher: None,
            state,
        };
        for number in 1..=workers {
            let worker = worker(farm.state.path(), address, number, threads)?;
            lock(&farm.children).push(worker);
        }
        farm.watcher = Some(farm.watch(stop.clone(), troubles.clone()));
        Ok(farm)
    }

    /// How commands reach it.
    pub(crate) fn context(&self, context: &Context) -> (Context, FarmOptions) {
        let context = Context {
            state: Some(self.state.path().to_owned()),
            token_file: None,
            ..context.clone()
        };
        let options = FarmOptions {
            coordinator: Some(self.address.to_string()),
        };
        (context, options)
    }

    /// Looks at the children until the farm ends.
    fn watch(&self, stop: Stop, troubles: Troubles) -> JoinHandle<()> {
        let (children, ending) = (self.children.clone(), self.ending.clone());
        thread::spawn(move || {
            while !ending.load(Ordering::Acquire) {
                // A signal that stops this process stops the children too: no trouble.
                if !stop.is_set()
                    && let Some(trouble) = lock(&children).iter_mut().find_map(Process::ended)
                {
                    lock(&troubles.0).get_or_insert(trouble);
                    stop.now();
                }
                thread::park_timeout(LOOK_INTERVAL);
            }
        })
    }
}

impl Drop for LocalFarm {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Release);
        if let Some(watcher) = self.watcher.take() {
            watcher.thread().unpark();
            let _ = watcher.join();
        }
        let mut children = lock(&self.children);
        // Workers first, so that they can say goodbye.
        for process in children.iter_mut().rev() {
            drop(process.child.stdin.take());
        }
        let deadline = Instant::now() + END_TIMEOUT;
        for process in children.iter_mut().rev() {
            process.end(deadline);
        }
    }
}

impl Process {
    fn start(name: String, state: &Path, arguments: &[&str]) -> Result<Self, Error> {
        let attempt = || format!("cannot start the {name}");
        let failed = |error: io::Error| Error::failed(attempt()).because(error);
        let program = std::env::current_exe().map_err(failed)?;
        let log = state.join(format!("{}.log", name.replace(' ', "-")));
        let stderr = File::create(&log).map_err(failed)?;
        let child = Command::new(program)
            .args(arguments)
            .args(["--while-input-open", "--log", "warn", "--output", "quiet"])
            .arg("--state")
            .arg(state)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(stderr)
            .spawn()
            .map_err(failed)?;
        Ok(Self { name, child, log })
    }

    /// Its number.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Why it has ended, if it has.
    pub(crate) fn ended(&mut self) -> Option<String> {
        let status = self.child.try_wait().ok()??;
        Some(format!(
            "the {} ended with {status}; it said:\n{}",
            self.name,
            tail(&self.log)
        ))
    }

    /// Waits for its end, and kills it where it takes too long.
    fn end(&mut self, deadline: Instant) {
        while Instant::now() < deadline {
            match self.child.try_wait() {
                Ok(None) => thread::sleep(Duration::from_millis(10)),
                _ => return,
            }
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A child that is forgotten on the way of an error must not stay.
impl Drop for Process {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// Starts a coordinator over a state folder, with these options beside the usual ones; answers once it listens, and where.
pub(crate) fn coordinator(
    state: &Path,
    listen: SocketAddr,
    options: &[&str],
    stop: &Stop,
) -> Result<(Process, SocketAddr), Error> {
    let listen = listen.to_string();
    let mut arguments = vec!["coordinator", "--listen", &listen, "--liveness", "4 s"];
    arguments.extend(options);
    let mut process = Process::start("coordinator".to_owned(), state, &arguments)?;
    let stdout = process.child.stdout.take().expect("it is piped");
    let (tell, heard) = mpsc::channel();
    thread::spawn(move || {
        let mut line = String::new();
        let _ = BufReader::new(stdout).read_line(&mut line);
        let _ = tell.send(line);
    });
    let deadline = Instant::now() + START_TIMEOUT;
    loop {
        let said = match heard.recv_timeout(LOOK_INTERVAL) {
            Ok(line) => line.trim().parse().ok(),
            Err(RecvTimeoutError::Disconnected) => None,
            Err(RecvTimeoutError::Timeout) if stop.is_set() => {
                return Err(Error::interrupted("interrupted while the farm started"));
            }
            Err(RecvTimeoutError::Timeout) if Instant::now() < deadline => continue,
            Err(RecvTimeoutError::Timeout) => None,
        };
        return match said {
            Some(address) => Ok((process, address)),
            None => Err(Error::failed("the coordinator did not start")
                .because(format!("it said:\n{}", tail(&process.log)))),
        };
    }
}

fn worker(
    state: &Path,
    coordinator: SocketAddr,
    number: usize,
    threads: usize,
) -> Result<Process, Error> {
    let (coordinator, threads) = (coordinator.to_string(), threads.to_string());
    let name = format!("local-{number}");
    let arguments = [
        "worker",
        "--coordinator",
        &coordinator,
        "--threads",
        &threads,
        "--name",
        &name,
    ];
    Process::start(format!("worker {number}"), state, &arguments)
}

/// The last lines of a log.
fn tail(log: &Path) -> String {
    let bytes = fs::read(log).unwrap_or_default();
    let from = bytes.len().saturating_sub(LOG_TAIL_BYTES);
    String::from_utf8_lossy(&bytes[from..]).trim().to_owned()
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
