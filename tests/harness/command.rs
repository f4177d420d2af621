//! How a command of `flyby` ended, and what it said.

use std::process::ExitStatus;

use serde_json::Value;

/// The end of a command.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// The command, for messages.
    pub(crate) command: String,
    /// How it ended.
    pub(crate) status: ExitStatus,
    /// Its standard output.
    pub(crate) stdout: String,
    /// Its standard error.
    pub(crate) stderr: String,
}

impl Outcome {
    /// It must have done what was asked for; answers its standard output.
    #[track_caller]
    pub(crate) fn ok(self) -> String {
        assert!(self.status.success(), "{self}");
        self.stdout
    }

    /// It must have done what was asked for; answers its standard output as JSON.
    #[track_caller]
    pub(crate) fn json(self) -> Value {
        assert!(self.status.success(), "{self}");
        serde_json::from_str(&self.stdout).unwrap_or_else(|why| panic!("no JSON: {why}\n{self}"))
    }

    /// It must have ended with exit code `code` and a sentence on standard error that holds
    /// every one of `phrases`; and never by a panic.
    #[track_caller]
    pub(crate) fn refused(self, code: i32, phrases: &[&str]) {
        assert_eq!(self.status.code(), Some(code), "{self}");
        assert!(!self.stderr.contains("panicked at"), "{self}");
        // Long sentences may be broken into lines where they are shown.
        let said = self.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        for phrase in phrases {
            assert!(said.contains(phrase), "`{phrase}` is not said\n{self}");
        }
    }
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            command,
            status,
            stdout,
            stderr,
        } = self;
        write!(f, "{command}\nended with {status}\n{stdout}\n{stderr}")
    }
}
