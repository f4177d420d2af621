//! A temporary folder, and commands of `flyby` run in it.

use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use tempfile::TempDir;

use super::{Outcome, Process, wait};

/// A test's own folder: commands run in it, the state folder lies in it, and nothing of the
/// user's home is seen. Removed when dropped.
pub(crate) struct Place {
    folder: TempDir,
    commands: std::cell::Cell<usize>,
}

impl Place {
    /// An empty one.
    pub(crate) fn new() -> Self {
        Self {
            folder: tempfile::Builder::new()
                .prefix("flyby-test-")
                .tempdir()
                .unwrap(),
            commands: std::cell::Cell::new(0),
        }
    }

    /// The folder itself.
    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// A path inside the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder().join(name)
    }

    /// The state folder of its coordinator and commands.
    pub(crate) fn state(&self) -> PathBuf {
        self.path("state")
    }

    /// Writes a file into the folder.
    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let file = self.path(name);
        std::fs::write(&file, content).unwrap();
        file
    }

    /// The names of all files below a folder of it that is there, sorted.
    pub(crate) fn files(&self, folder: &str) -> Vec<String> {
        let root = self.path(folder);
        let mut files = Vec::new();
        let mut folders = vec![root.clone()];
        while let Some(folder) = folders.pop() {
            let entries = match std::fs::read_dir(&folder) {
                // Whoever uses it may remove what is in it meanwhile.
                Err(error) if error.kind() == ErrorKind::NotFound && folder != root => continue,
                entries => entries.unwrap(),
            };
            for entry in entries {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else {
                    let name = path.strip_prefix(&root).unwrap();
                    files.push(name.to_str().unwrap().to_owned());
                }
            }
        }
        files.sort();
        files
    }

    /// A command of `flyby` that sees this place alone.
    pub(crate) fn command<A: AsRef<OsStr>>(
        &self,
        arguments: impl IntoIterator<Item = A>,
    ) -> Command {
        self.wrapped(&[], arguments)
    }

    /// [`Place::command`], started by another program that is given `wrapper`'s further words.
    pub(crate) fn wrapped<A: AsRef<OsStr>>(
        &self,
        wrapper: &[&str],
        arguments: impl IntoIterator<Item = A>,
    ) -> Command {
        const FLYBY: &str = env!("CARGO_BIN_EXE_flyby");
        let mut command = match wrapper.split_first() {
            Some((program, words)) => {
                let mut command = Command::new(program);
                command.args(words).arg(FLYBY);
                command
            }
            None => Command::new(FLYBY),
        };
        for (name, _) in std::env::vars_os() {
            if name.to_string_lossy().starts_with("FLYBY_") {
                command.env_remove(name);
            }
        }
        command
            .args(arguments)
            .current_dir(self.folder())
            .env("HOME", self.path("home"))
            .env_remove("XDG_CONFIG_HOME")
            .env_remove("XDG_STATE_HOME")
            .env("FLYBY_STATE", self.state());
        command
    }

    /// Starts a command of `flyby`, to be waited for or signalled.
    pub(crate) fn start<A: AsRef<OsStr>>(
        &self,
        name: &str,
        arguments: impl IntoIterator<Item = A>,
    ) -> Process {
        self.start_command(name, self.command(arguments))
    }

    /// Starts a command that was built before.
    pub(crate) fn start_command(&self, name: &str, command: Command) -> Process {
        let number = self.commands.get();
        self.commands.set(number + 1);
        let logs = self.path("logs");
        std::fs::create_dir_all(&logs).unwrap();
        Process::start(&format!("{number:02}-{name}"), command, &logs)
    }

    /// Runs a command of `flyby` to its end.
    #[track_caller]
    pub(crate) fn flyby<A: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = A>) -> Outcome {
        self.run(self.command(arguments), wait::LIMIT)
    }

    /// Runs a command that was built before to its end.
    #[track_caller]
    pub(crate) fn run(&self, command: Command, limit: Duration) -> Outcome {
        let said = format!("{command:?}");
        let mut process = self.start_command("command", command);
        let status = process.wait_within(limit);
        Outcome {
            command: said,
            status,
            stdout: process.stdout(),
            stderr: process.stderr(),
        }
    }
}
