//! A temporary folder in which commands run, and which sees nothing of the user's home.

use std::path::PathBuf;

use assert_cmd::Command;
use tempfile::TempDir;

/// A test's own folder; removed when dropped.
pub(crate) struct Place(TempDir);

impl Place {
    /// An empty one.
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// A path inside.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file.
    pub(crate) fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    /// A command of `flyby`.
    pub(crate) fn flyby(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_flyby"));
        for (name, _) in std::env::vars_os() {
            if name.to_string_lossy().starts_with("FLYBY_") {
                command.env_remove(name);
            }
        }
        command
            .args(arguments)
            .current_dir(self.0.path())
            .env("HOME", self.path("home"))
            .env_remove("XDG_CONFIG_HOME")
            .env_remove("XDG_STATE_HOME");
        command
    }

    /// Runs a command that must end with this code; answers its standard output and error.
    #[track_caller]
    pub(crate) fn ends(&self, code: i32, arguments: &[&str]) -> (String, String) {
        ends(self.flyby(arguments), code)
    }
}

/// Runs a command that must end with this code; answers its standard output and error.
#[track_caller]
pub(crate) fn ends(mut command: Command, code: i32) -> (String, String) {
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(
        output.status.code(),
        Some(code),
        "{command:?}\n{out}\n{err}"
    );
    assert!(!err.contains("panicked at"), "{err}");
    (out, err)
}
