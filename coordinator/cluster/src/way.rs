//! Scripts run at a site: here, or over the system's ssh, so that its configuration, agents and jump hosts work.
//!
//! A script travels on standard input, as one group in braces: a link that is cut in the middle leaves a group that
//! does not end, of which a shell runs nothing. What is printed counts from a mark on, so that a login that greets
//! everybody disturbs nothing. Time and output are limited.

use std::fs::DirBuilder;
use std::io::{self, Read, Write as _};
use std::os::unix::fs::DirBuilderExt as _;
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use model::Span;
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

use crate::error::{ClusterError, Refusal};
use crate::sites::Site;
use crate::words::quote_path;

/// How long most scripts may take.
pub const LIMIT: Span = Span::from_secs(60);

/// Most bytes that a script may print; a queue of 100,000 tasks of ours is 8 MiB.
const STDOUT_MAX: usize = 32 << 20;

/// Most bytes of what it says is wrong.
const STDERR_MAX: usize = 64 << 10;

/// Most bytes of what somebody said that are part of a message.
const SAID_MAX: usize = 2_000;

/// How long the output of a script that has ended may still come: somebody whom it left behind may hold it open.
const LATE: Duration = Duration::from_secs(1);

/// A Unix socket's path may have about a hundred bytes, and ssh adds seventeen while it makes one.
const SOCKET_PATH_MAX: usize = 80;

/// What is printed first.
const MARK: &str = "--flyby--";

/// The way to a site.
#[derive(Clone, Debug)]
pub struct Way {
    address: Option<String>,
    /// All options of ssh.
    ssh: Vec<String>,
    setup: Option<String>,
}

/// What a script said.
#[derive(Debug)]
pub struct Said {
    /// How it ended; `None` where a signal killed it.
    pub code: Option<i32>,
    /// What it printed.
    pub stdout: String,
    /// What it says is wrong.
    pub stderr: String,
}

impl Way {
    /// The way to a site; connections are shared by sockets in a folder, which is made.
    pub fn to(site: &Site, sockets: &Path) -> Self {
        let mut ssh = site.ssh_options.clone();
        for option in [
            "BatchMode=yes",
            "ConnectTimeout=10",
            "ServerAliveInterval=5",
            "ServerAliveCountMax=3",
        ] {
            ssh.extend(["-o".to_owned(), option.to_owned()]);
        }
        if let Some(address) = &site.address {
            let whom = blake3::hash(format!("{address}\0{}", ssh.join("\0")).as_bytes());
            let socket = sockets.join(&whom.to_hex()[..12]);
            let made = DirBuilder::new()
                .recursive(true)
                .mode(0o700)
                .create(sockets);
            let socket = socket.to_str().filter(|path| path.len() <= SOCKET_PATH_MAX);
            // Without a place for them every script logs in anew: slower, and no less right.
            if let (Some(socket), Ok(())) = (socket, made) {
                // ssh takes % for one of its own words.
                let path = format!("ControlPath={}", socket.replace('%', "%%"));
                for option in ["ControlMaster=auto", "ControlPersist=60", &path] {
                    ssh.extend(["-o".to_owned(), option.to_owned()]);
                }
            }
        }
        Self {
            address: site.address.clone(),
            ssh,
            setup: site.setup.clone(),
        }
    }

    /// [`Way::run`], of which what is printed counts as bytes, and also where the link was cut half-way: with the
    /// error comes what had arrived.
    pub fn fetch(
        &self,
        attempt: &str,
        script: &str,
        limit: Span,
    ) -> (Vec<u8>, Result<(), ClusterError>) {
        let (raw, ended) = self.perform(attempt, self.shell(), &self.group(script)[..], limit);
        let mark = format!("{MARK}\n").into_bytes();
        let begins = raw
            .stdout
            .windows(mark.len())
            .position(|window| window == mark);
        let stdout = match begins {
            Some(place) => raw.stdout[place + mark.len()..].to_vec(),
            None => Vec::new(),
        };
        let ended = ended.and_then(|()| match (raw.code, begins) {
            (Some(0), Some(_)) => Ok(()),
            (_, None) => Err(not_begun(attempt, &raw.said())),
            (_, Some(_)) => {
                let said = Said {
                    stdout: String::new(),
                    ..raw.said()
                };
                Err(said.refused(attempt, "flyby"))
            }
        });
        (stdout, ended)
    }

    /// Runs a script of POSIX shell there. An error is that it did not run; how it ended is for the caller.
    pub fn run(&self, attempt: &str, script: &str, limit: Span) -> Result<Said, ClusterError> {
        let (raw, ended) = self.perform(attempt, self.shell(), &self.group(script)[..], limit);
        ended?;
        let said = raw.said();
        match said.stdout.split_once(&format!("{MARK}\n")) {
            Some((_, after)) => Ok(Said {
                stdout: after.to_owned(),
                ..said
            }),
            None => Err(not_begun(attempt, &said)),
        }
    }

    /// A script as it travels.
    fn group(&self, script: &str) -> Vec<u8> {
        let setup = self.setup.as_deref().unwrap_or(":");
        format!("{{\n{setup}\necho {MARK}\n{script}\n}} </dev/null\n").into_bytes()
    }

    fn shell(&self) -> Command {
        self.command("exec /bin/sh -s", &["-s"])
    }

    /// [`Way::run`], where the script must end well; `program` is what it needs there.
    pub(crate) fn ask(
        &self,
        attempt: &str,
        program: &str,
        script: &str,
    ) -> Result<String, ClusterError> {
        let said = self.run(attempt, script, LIMIT)?;
        match said.code {
            Some(0) => Ok(said.stdout),
            _ => Err(said.refused(attempt, program)),
        }
    }

    /// Puts a file of `bytes` bytes there, whole or not at all.
    pub fn put(
        &self,
        mut from: impl Read + Send,
        bytes: u64,
        path: &str,
        mode: u32,
        limit: Span,
    ) -> Result<(), ClusterError> {
        let attempt = format!("copying {path}");
        let path = quote_path(path);
        // A link that is cut looks there like the end of the file: hence the count.
        let script = format!(
            "umask 077; d=$(dirname {path}) && mkdir -p \"$d\" && t={path}.part.$$ && \
             if cat >\"$t\" && [ $(wc -c <\"$t\") -eq {bytes} ] && chmod {mode:o} \"$t\" && mv -f \"$t\" {path}; \
             then exit 0; else rm -f \"$t\"; exit 1; fi"
        );
        let there = format!("exec /bin/sh -c {}", quote_always(&script));
        let command = self.command(&there, &["-c", &script]);
        let (raw, ended) = self.perform(&attempt, command, &mut from, limit);
        ended?;
        let said = raw.said();
        match said.code {
            Some(0) => Ok(()),
            _ => Err(said.refused(&attempt, "cat")),
        }
    }

    fn command(&self, there: &str, here: &[&str]) -> Command {
        match &self.address {
            Some(address) => {
                let mut command = Command::new("ssh");
                command.args(&self.ssh).args(["-T", "--", address, there]);
                command
            }
            None => {
                let mut command = Command::new("/bin/sh");
                command.args(here);
                command
            }
        }
    }

    /// Runs a command; beside what it said, whether it ended by itself and was there at all.
    fn perform(
        &self,
        attempt: &str,
        mut command: Command,
        input: impl Read + Send,
        limit: Span,
    ) -> (Raw, Result<(), ClusterError>) {
        let deadline = Instant::now() + Duration::from_micros(limit.0);
        let program = command.get_program().to_string_lossy().into_owned();
        let child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .process_group(0)
            .spawn()
            .map_err(|source| ClusterError::Start { program, source });
        let mut child = match child {
            Ok(child) => Group(child),
            Err(error) => return (Raw::default(), Err(error)),
        };
        let (comes, came) = mpsc::channel();
        let stdout = Gathered::from(child.0.stdout.take(), STDOUT_MAX, Some(comes.clone()));
        let stderr = Gathered::from(child.0.stderr.take(), STDERR_MAX, None);
        let stdin = child.0.stdin.take();
        let ended = thread::scope(|scope| {
            scope.spawn(move || {
                let mut input = input;
                if let Some(mut stdin) = stdin {
                    // Whoever ends before it has read all says why by how it ended.
                    let _ = io::copy(&mut input, &mut stdin).and_then(|_| stdin.flush());
                }
            });
            let leader = Pid::from_child(&child.0);
            scope.spawn(move || {
                // It is not taken away: its number stays its own until whoever may kill it has done that.
                let ended = WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
                let _ = waitid(WaitId::Pid(leader), ended);
                let _ = comes.send(Came::Ended);
            });
            child.wait(deadline, &came)
        });
        let raw = Raw {
            code: ended.and_then(|status| status.code()),
            stdout: stdout.bytes(),
            stderr: stderr.bytes(),
        };
        if ended.is_none() {
            let late = ClusterError::TimedOut {
                attempt: attempt.to_owned(),
                limit,
            };
            return (raw, Err(late));
        }
        if stdout.is_full() {
            let error = ClusterError::Nonsense {
                attempt: attempt.to_owned(),
                what: format!("it is longer than {STDOUT_MAX} bytes"),
                said: brief(&raw.said().stdout),
            };
            return (raw, Err(error));
        }
        match (&self.address, raw.code) {
            // Of its own troubles ssh tells by this code alone.
            (Some(address), Some(255)) => {
                let error = not_there(address, &raw.said().stderr);
                (raw, Err(error))
            }
            _ => (raw, Ok(())),
        }
    }
}

/// What a command said, as it came.
#[derive(Default)]
struct Raw {
    code: Option<i32>,
    stdout: Vec<u8>,
    stderr: Vec<u8>,
}

impl Raw {
    fn said(&self) -> Said {
        Said {
            code: self.code,
            stdout: String::from_utf8_lossy(&self.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&self.stderr).into_owned(),
        }
    }
}

/// The setup ended the shell, or nobody runs scripts there.
fn not_begun(attempt: &str, said: &Said) -> ClusterError {
    let words = format!("{}\n{}", said.stdout, said.stderr);
    ClusterError::Nonsense {
        attempt: attempt.to_owned(),
        what: "the shell there ended before it began; look at the site's `setup`".to_owned(),
        said: brief(&words),
    }
}

impl Said {
    /// That it did not end well, as the error of whoever asked for it.
    pub(crate) fn refused(&self, attempt: &str, program: &str) -> ClusterError {
        let said = match self.stderr.trim().is_empty() {
            true => brief(&self.stdout),
            false => brief(&self.stderr),
        };
        if self.code == Some(127) {
            return ClusterError::Missing {
                program: program.to_owned(),
                said,
            };
        }
        ClusterError::Refused {
            attempt: attempt.to_owned(),
            refusal: Refusal::of(&said),
            said: match said.is_empty() {
                true => format!("it ended with {:?} and said nothing", self.code),
                false => said,
            },
        }
    }
}

/// What ssh says when it does not get there.
fn not_there(address: &str, stderr: &str) -> ClusterError {
    let (address, said) = (address.to_owned(), brief(stderr));
    if said.contains("Host key verification failed") || said.contains("IDENTIFICATION HAS CHANGED")
    {
        ClusterError::HostKey { address, said }
    } else if said.contains("Permission denied") || said.contains("Too many authentication") {
        ClusterError::Login { address, said }
    } else {
        ClusterError::Unreachable { address, said }
    }
}

/// The words that matter of what was said, in one line: the last ones, since what went wrong is said last.
pub(crate) fn brief(text: &str) -> String {
    let lines = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with("@@@"));
    let line = lines.collect::<Vec<_>>().join("; ");
    let line: String = line.chars().filter(|letter| !letter.is_control()).collect();
    let mut from = line.len().saturating_sub(SAID_MAX);
    while !line.is_char_boundary(from) {
        from += 1;
    }
    line[from..].to_owned()
}

/// A word in quotes, whatever it holds.
fn quote_always(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// A process that is killed, with all in its group, where it is dropped before it was waited for.
struct Group(Child);

/// What a process that runs is waited for.
enum Came {
    /// It has ended.
    Ended,
    /// It has printed all that it may.
    Full,
}

impl Group {
    /// How it ended, killed where it prints too much; `None` where it has to be killed because it is too late.
    fn wait(&mut self, deadline: Instant, came: &Receiver<Came>) -> Option<ExitStatus> {
        let came = came.recv_timeout(deadline.saturating_duration_since(Instant::now()));
        if !matches!(came, Ok(Came::Ended)) {
            self.kill();
        }
        let status = self.0.wait().ok();
        status.filter(|_| came.is_ok())
    }

    fn kill(&self) {
        let leader = i32::try_from(self.0.id()).ok();
        if let Some(group) = leader.and_then(Pid::from_raw) {
            let _ = kill_process_group(group, Signal::KILL);
        }
    }
}

/// What comes out of a pipe, up to a limit, gathered by a thread.
struct Gathered {
    bytes: Arc<Mutex<Vec<u8>>>,
    ended: Receiver<()>,
    most: usize,
}

impl Gathered {
    /// `full` hears of it when there is as much as there may be.
    fn from(
        pipe: Option<impl Read + Send + 'static>,
        most: usize,
        full: Option<Sender<Came>>,
    ) -> Self {
        let bytes = Arc::<Mutex<Vec<u8>>>::default();
        let (end, ended) = mpsc::channel();
        let into = bytes.clone();
        thread::spawn(move || {
            let mut chunk = [0; 8_192];
            let Some(mut pipe) = pipe else { return };
            while let Ok(count @ 1..) = pipe.read(&mut chunk) {
                let mut into = into.lock().unwrap_or_else(PoisonError::into_inner);
                // What is over the limit is read and dropped, so that nobody waits for a reader.
                if into.len() < most {
                    into.extend_from_slice(&chunk[..count]);
                    if let Some(full) = full.as_ref().filter(|_| into.len() >= most) {
                        let _ = full.send(Came::Full);
                    }
                }
            }
            let _ = end.send(());
        });
        Self { bytes, ended, most }
    }

    fn is_full(&self) -> bool {
        let bytes = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        bytes.len() >= self.most
    }

    fn bytes(&self) -> Vec<u8> {
        let _ = self.ended.recv_timeout(LATE);
        let bytes = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        bytes.clone()
    }
}

#[cfg(test)]
mod tests;
