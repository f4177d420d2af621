//! One running process.

use std::fs::{self, File};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use super::wait;

/// A process in a process group of its own, with what it writes in two files.
///
/// Dropping it kills the group; in a test that fails, it also prints what the process wrote.
pub(crate) struct Process {
    name: String,
    child: Child,
    ended: Option<ExitStatus>,
    stdout: PathBuf,
    stderr: PathBuf,
}

/// The fields of `/proc/…/stat` from the third on: the second is a name in brackets, and may hold anything.
fn fields(stat: &str) -> impl Iterator<Item = &str> {
    let fields = stat.rsplit_once(')').map_or("", |(_, fields)| fields);
    fields.split_whitespace()
}

/// What can be sent to a process.
#[derive(Clone, Copy)]
pub(crate) enum Signal {
    /// Ctrl-C.
    Interrupt,
    /// Ends it between any two instructions.
    Kill,
    /// Freezes it.
    Stop,
    /// Thaws it.
    Continue,
}

impl Process {
    /// Starts `command`; what it writes goes to `<folder>/<name>.out` and `<name>.err`.
    ///
    /// Its standard input stays open for as long as this lives: what is started with
    /// `--while-input-open` ends even where the tests themselves are killed.
    pub(crate) fn start(name: &str, mut command: Command, folder: &Path) -> Self {
        let stdout = folder.join(format!("{name}.out"));
        let stderr = folder.join(format!("{name}.err"));
        let child = command
            .stdin(Stdio::piped())
            .stdout(File::create(&stdout).unwrap())
            .stderr(File::create(&stderr).unwrap())
            .process_group(0)
            .spawn()
            .unwrap_or_else(|why| panic!("cannot start {name} ({command:?}): {why}"));
        Self {
            name: name.to_owned(),
            child,
            ended: None,
            stdout,
            stderr,
        }
    }

    /// Its number.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// What it wrote to its standard output so far.
    pub(crate) fn stdout(&self) -> String {
        read(&self.stdout)
    }

    /// What it wrote to its standard error so far.
    pub(crate) fn stderr(&self) -> String {
        read(&self.stderr)
    }

    /// Processor time that it took so far; none where it is gone.
    pub(crate) fn cpu_time(&self) -> Duration {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.child.id()));
        let stat = stat.unwrap_or_default();
        // User's and system's, in hundredths of a second.
        let ticks = fields(&stat).skip(11).take(2);
        let ticks: u64 = ticks.filter_map(|field| field.parse::<u64>().ok()).sum();
        Duration::from_millis(10 * ticks)
    }

    /// Whether one of its threads has something to do at this moment.
    pub(crate) fn is_running(&self) -> bool {
        let tasks = fs::read_dir(format!("/proc/{}/task", self.child.id()));
        let tasks = tasks.into_iter().flatten().flatten();
        let mut stats = tasks.filter_map(|task| fs::read_to_string(task.path().join("stat")).ok());
        stats.any(|stat| fields(&stat).next() == Some("R"))
    }

    /// Sends a signal to the process alone.
    pub(crate) fn signal(&self, signal: Signal) {
        assert!(self.ended.is_none(), "{} has ended", self.name);
        assert!(send(signal, &self.child.id().to_string()));
    }

    /// Sends a signal to the process and all it started, as a terminal's Ctrl-C does.
    pub(crate) fn signal_group(&self, signal: Signal) {
        assert!(self.ended.is_none(), "{} has ended", self.name);
        assert!(send(signal, &format!("-{}", self.child.id())));
    }

    /// Whether any process of its group is left.
    pub(crate) fn group_lives(&self) -> bool {
        exists(&format!("-{}", self.child.id()))
    }

    /// How it ended, if it has.
    pub(crate) fn ended(&mut self) -> Option<ExitStatus> {
        if self.ended.is_none() {
            self.ended = self.child.try_wait().unwrap();
        }
        self.ended
    }

    /// Waits for its end.
    #[track_caller]
    pub(crate) fn wait(&mut self) -> ExitStatus {
        self.wait_within(wait::LIMIT)
    }

    /// [`Process::wait`] with another limit.
    #[track_caller]
    pub(crate) fn wait_within(&mut self, limit: Duration) -> ExitStatus {
        let what = format!("{} ends", self.name);
        wait::until_within(limit, &what, || self.ended())
    }

    /// `kill -9`, and waits until it is gone.
    pub(crate) fn kill(&mut self) {
        self.signal(Signal::Kill);
        self.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        send(Signal::Kill, &format!("-{}", self.child.id()));
        if self.ended.is_none() {
            let _ = self.child.wait();
        }
        if std::thread::panicking() {
            eprintln!(
                "---- {} wrote:\n{}{}",
                self.name,
                self.stdout(),
                self.stderr()
            );
        }
    }
}

fn read(file: &Path) -> String {
    String::from_utf8_lossy(&fs::read(file).unwrap_or_default()).into_owned()
}

/// Sends a signal through the shell, whose `kill` is always there; answers whether anybody got it.
fn send(signal: Signal, to: &str) -> bool {
    let signal = match signal {
        Signal::Interrupt => "INT",
        Signal::Kill => "KILL",
        Signal::Stop => "STOP",
        Signal::Continue => "CONT",
    };
    kill(signal, to)
}

fn exists(whom: &str) -> bool {
    kill("0", whom)
}

fn kill(signal: &str, whom: &str) -> bool {
    Command::new("sh")
        .args([
            "-c",
            "kill -s \"$1\" -- \"$2\" 2>/dev/null",
            "sh",
            signal,
            whom,
        ])
        .status()
        .is_ok_and(|status| status.success())
}
