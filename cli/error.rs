//! What a command failed at, as one sentence, and the exit code that says it to a script.

use std::error::Error as StdError;
use std::fmt::{self, Write as _};
use std::io;
use std::process::ExitCode;

/// Why the program ended: the table of exit codes, which `--help` prints.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Ending {
    /// Everything asked for was done.
    Done,
    /// The work itself failed: a file could not be read or written, a frame could not be rendered.
    Failed,
    /// What was asked for makes no sense: a wrong option, a wrong configuration, a scene with mistakes.
    Usage,
    /// No coordinator answered, or it refused.
    Unreachable,
    /// `image compare` found a difference.
    Different,
    /// The job ended, but failed or was cancelled.
    JobLost,
    /// Ctrl-C or SIGTERM ended the command before its work.
    Interrupted,
}

impl Ending {
    /// Every ending, by rising code.
    const ALL: [Self; 7] = [
        Self::Done,
        Self::Failed,
        Self::Usage,
        Self::Unreachable,
        Self::Different,
        Self::JobLost,
        Self::Interrupted,
    ];

    /// The number that a shell sees.
    pub(crate) const fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Failed => 1,
            Self::Usage => 2,
            Self::Unreachable => 3,
            Self::Different => 4,
            Self::JobLost => 5,
            Self::Interrupted => 130,
        }
    }

    const fn meaning(self) -> &'static str {
        match self {
            Self::Done => "everything asked for was done",
            Self::Failed => {
                "the work failed: a file, a frame or a disk; `farm doctor`: something is wrong"
            }
            Self::Usage => "a wrong option or configuration, or a scene with mistakes",
            Self::Unreachable => "no coordinator answered, or it refused",
            Self::Different => {
                "`image compare`: the frames differ; `bench techniques`: a pixel does"
            }
            Self::JobLost => "the job failed or was cancelled",
            Self::Interrupted => "ended by Ctrl-C or SIGTERM before the work was done",
        }
    }

    /// The table of exit codes as `--help` shows it.
    pub(crate) fn table() -> String {
        let mut table = String::from("Exit codes:\n");
        for ending in Self::ALL {
            let _ = writeln!(table, "  {:>3}  {}", ending.code(), ending.meaning());
        }
        table
    }
}

impl From<Ending> for ExitCode {
    fn from(ending: Ending) -> Self {
        Self::from(ending.code())
    }
}

/// A cause of any type.
pub(crate) type Cause = Box<dyn StdError + Send + Sync>;

/// Why a command ended without its work done: what was attempted on what, why it
/// failed, and what to do next.
#[derive(Debug)]
pub(crate) struct Error {
    ending: Ending,
    attempt: String,
    cause: Option<Cause>,
    next: Option<String>,
}

impl Error {
    /// The work itself failed; `attempt` says what was tried, on what.
    pub(crate) fn failed(attempt: impl Into<String>) -> Self {
        Self::new(Ending::Failed, attempt)
    }

    /// What was asked for makes no sense.
    pub(crate) fn usage(attempt: impl Into<String>) -> Self {
        Self::new(Ending::Usage, attempt)
    }

    /// No coordinator answered, or it refused.
    pub(crate) fn unreachable(attempt: impl Into<String>) -> Self {
        Self::new(Ending::Unreachable, attempt)
    }

    /// The command was told to stop.
    pub(crate) fn interrupted(attempt: impl Into<String>) -> Self {
        Self::new(Ending::Interrupted, attempt)
    }

    /// An ending of any kind.
    pub(crate) fn new(ending: Ending, attempt: impl Into<String>) -> Self {
        Self {
            ending,
            attempt: attempt.into(),
            cause: None,
            next: None,
        }
    }

    /// The same failure, with what it is part of said first.
    pub(crate) fn within(mut self, whole: impl fmt::Display) -> Self {
        self.attempt = format!("{whole}: {}", self.attempt);
        self
    }

    /// Why; where the cause is known well enough, what to do about it too.
    pub(crate) fn because(mut self, cause: impl Into<Cause>) -> Self {
        let cause = cause.into();
        if self.next.is_none() {
            self.next = advice(&*cause).map(str::to_owned);
        }
        self.cause = Some(cause);
        self
    }

    /// What to do next.
    pub(crate) fn next(mut self, next: impl Into<String>) -> Self {
        self.next = Some(next.into());
        self
    }

    /// How the program ends because of it.
    pub(crate) fn ending(&self) -> Ending {
        self.ending
    }

    /// Whether the cause is that nobody reads the output any more, of which nothing need be said.
    pub(crate) fn is_broken_pipe(&self) -> bool {
        let mut cause: Option<&(dyn StdError + 'static)> =
            self.cause.as_deref().map(|cause| cause as _);
        while let Some(error) = cause {
            if let Some(error) = error.downcast_ref::<io::Error>()
                && error.kind() == io::ErrorKind::BrokenPipe
            {
                return true;
            }
            cause = error.source();
        }
        false
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.attempt)?;
        let mut said = self.attempt.clone();
        let mut cause: Option<&(dyn StdError + 'static)> =
            self.cause.as_deref().map(|cause| cause as _);
        while let Some(error) = cause {
            // Many libraries repeat their cause in their own words.
            let words = error.to_string();
            if !said.contains(&words) {
                write!(f, ": {words}")?;
                said.push_str(&words);
            }
            cause = error.source();
        }
        if let Some(next) = &self.next {
            write!(f, "\n  help: {next}")?;
        }
        Ok(())
    }
}

/// What can be done about a cause that the system names.
fn advice(cause: &(dyn StdError + 'static)) -> Option<&'static str> {
    let mut cause = Some(cause);
    while let Some(error) = cause {
        if let Some(error) = error.downcast_ref::<io::Error>() {
            return match error.kind() {
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Some(
                    "free some space there, then run the same command again: it goes on where it was",
                ),
                io::ErrorKind::PermissionDenied => Some(
                    "this user may not do that there: choose another folder, or change its permissions",
                ),
                io::ErrorKind::ReadOnlyFilesystem => {
                    Some("that disk is mounted read-only: choose another folder")
                }
                io::ErrorKind::AddrInUse => Some(
                    "another program listens there, perhaps a coordinator that still runs: \
                     stop it, or choose another port with `--listen`",
                ),
                _ => None,
            };
        }
        cause = error.source();
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_one_sentence_with_advice() {
        let error = Error::failed("cannot write the frame `a.exr`")
            .because(io::Error::from(io::ErrorKind::StorageFull));
        let said = error.to_string();
        assert!(
            said.starts_with("cannot write the frame `a.exr`: "),
            "{said}"
        );
        assert!(said.contains("help: free some space"), "{said}");
        assert_eq!(error.ending().code(), 1);
    }

    #[test]
    fn a_cause_is_said_once() {
        let error = Error::usage("cannot read it: no such file").because("no such file");
        assert_eq!(error.to_string(), "cannot read it: no such file");
    }

    #[test]
    fn codes_differ_and_stand_in_the_table() {
        let table = Ending::table();
        for (index, ending) in Ending::ALL.iter().enumerate() {
            assert!(table.contains(&format!("{:>3}  {}", ending.code(), ending.meaning())));
            assert!(
                Ending::ALL[..index]
                    .iter()
                    .all(|other| other.code() < ending.code())
            );
        }
    }

    #[test]
    fn a_reader_that_left_is_recognised() {
        let gone = io::Error::from(io::ErrorKind::BrokenPipe);
        assert!(Error::failed("cannot print").because(gone).is_broken_pipe());
        assert!(
            !Error::failed("cannot print")
                .because("full")
                .is_broken_pipe()
        );
    }
}
