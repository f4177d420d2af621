//! What goes wrong at a site: what was attempted, what the queue or ssh said, and what to change.

use std::io;

use model::Span;

/// Why something could not be done at a site.
#[derive(Debug, thiserror::Error)]
pub enum ClusterError {
    /// A program could not be started here at all.
    #[error("cannot start `{program}` here")]
    Start {
        /// Which.
        program: String,
        /// What the system said.
        source: io::Error,
    },
    /// A file could not be read or written here.
    #[error("cannot {attempted} {path}")]
    File {
        /// What was attempted, as it stands after "cannot".
        attempted: &'static str,
        /// On which.
        path: String,
        /// What the system said.
        source: io::Error,
    },
    /// A template holds what nobody can fill in.
    #[error("the template {path} cannot be used: {what}")]
    Template {
        /// Which.
        path: String,
        /// What is wrong.
        what: String,
    },
    /// It took longer than it may.
    #[error("{attempt} took longer than {} s", limit.0 / 1_000_000)]
    TimedOut {
        /// What was attempted.
        attempt: String,
        /// How long it may take.
        limit: Span,
    },
    /// ssh could not reach the host.
    #[error("{address} cannot be reached by ssh: {said}")]
    Unreachable {
        /// Whom.
        address: String,
        /// What ssh said.
        said: String,
    },
    /// The host's key is not the one that is known, or none is.
    #[error("ssh does not trust the host key of {address}: {said}")]
    HostKey {
        /// Whose.
        address: String,
        /// What ssh said.
        said: String,
    },
    /// The host let nobody in.
    #[error("{address} refuses the login: {said}")]
    Login {
        /// Who.
        address: String,
        /// What ssh said.
        said: String,
    },
    /// A program is not there.
    #[error("there is no `{program}` there: {said}")]
    Missing {
        /// Which.
        program: String,
        /// What the shell said.
        said: String,
    },
    /// The program there cannot be used.
    #[error("the program {path} at site {site} cannot be used: {what}")]
    Program {
        /// Its path there.
        path: String,
        /// The site.
        site: String,
        /// What is wrong with it.
        what: String,
    },
    /// The queue refused.
    #[error("{attempt} was refused: {said}")]
    Refused {
        /// What was attempted.
        attempt: String,
        /// Of what kind the refusal is, as far as its words tell.
        refusal: Refusal,
        /// What the queue said.
        said: String,
    },
    /// Nothing more can be written there.
    #[error("the folder {folder} on {host} is full, or its owner's quota is: {said}")]
    Full {
        /// The folder.
        folder: String,
        /// Where.
        host: String,
        /// What was said.
        said: String,
    },
    /// What was printed is not what the program should print.
    #[error("{attempt} gave an answer that cannot be understood ({what}): {said}")]
    Nonsense {
        /// What was attempted.
        attempt: String,
        /// What is wrong with it.
        what: String,
        /// The beginning of it.
        said: String,
    },
}

/// Of what kind a queue's refusal is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Refusal {
    /// More tasks than an array may have.
    ArrayTooLarge,
    /// More jobs or tasks than the user may have.
    Quota,
    /// The account, project or quality of service may not be used.
    Account,
    /// The partition or queue is not there or may not be used.
    Queue,
    /// The queue has no machine of such a size.
    Resources,
    /// The time limit is longer than the queue's.
    TimeLimit,
    /// The disk is full, or a quota of it is used up.
    Disk,
    /// The system there is older than what the program was built for.
    OldSystem,
    /// The queue's daemon does not answer.
    Away,
    /// Something else.
    Other,
}

impl ClusterError {
    /// What to change, for whoever may.
    pub fn next(&self) -> &'static str {
        match self {
            Self::Start { .. } => "install it on this machine, or look at the PATH of this program",
            Self::File { .. } => "look at the folder and its permissions",
            Self::Template { .. } => {
                "mend the template: `deploy/` in the source holds the usual ones, with the names that may stand between `@`s"
            }
            Self::TimedOut { .. } => "try the same by hand; a queue that is busy may answer later",
            Self::Unreachable { .. } => {
                "try `ssh ADDRESS true` by hand; jump hosts and ports belong into ~/.ssh/config or `ssh_options`"
            }
            Self::HostKey { .. } => {
                "log in once by hand and compare the key with what the site publishes; a key that has changed is removed by `ssh-keygen -R HOST`"
            }
            Self::Login { .. } => {
                "`ssh ADDRESS true` must work without a password: copy a key there by `ssh-copy-id ADDRESS`, or load it into the agent"
            }
            Self::Missing { .. } => {
                "name what makes it known in the site's `setup`, such as \"module load slurm\""
            }
            Self::Program { .. } => "bring this one there: `flyby site install SITE`",
            Self::Refused { refusal, .. } => refusal.next(),
            Self::Full { .. } => {
                "make room there, and it goes on by itself; or name another `folder`"
            }
            Self::Nonsense { .. } => {
                "run the command there by hand; if it prints what it should, this is a mistake of this program"
            }
        }
    }

    /// Whether it may be over later without anybody's doing.
    pub fn may_pass(&self) -> bool {
        match self {
            Self::TimedOut { .. } | Self::Unreachable { .. } | Self::Full { .. } => true,
            Self::Refused { refusal, .. } => {
                matches!(refusal, Refusal::Quota | Refusal::Away | Refusal::Disk)
            }
            _ => false,
        }
    }
}

impl Refusal {
    fn next(self) -> &'static str {
        match self {
            Self::ArrayTooLarge => "lower the site's `max_array_size`",
            Self::Quota => {
                "lower the site's `max_running`, or wait until others of your jobs there are over"
            }
            Self::Account => "name one that may be used in the site's `account`",
            Self::Queue => "name one that is there in the site's `queue`",
            Self::Resources => "lower the site's `threads` or `memory`, or name another `queue`",
            Self::TimeLimit => "lower the site's `time_limit`, or name another `queue`",
            Self::Disk => "make room there, or name another `folder`",
            Self::OldSystem => {
                "build one that brings its C library along: `cargo build --release --target x86_64-unknown-linux-musl`, then `flyby site install --program FILE`"
            }
            Self::Away => "it may answer later; `flyby site check` says when it does",
            Self::Other => "ask for the same by hand with what `flyby site check` shows",
        }
    }

    /// The kind of refusal that a queue's words tell.
    pub(crate) fn of(said: &str) -> Self {
        let said = said.to_lowercase();
        let says = |words: &[&str]| words.iter().any(|word| said.contains(word));
        // The order matters: "job array specification" before what merely names a job.
        if says(&["glibc_", "exec format error", "kernel too old"]) {
            Self::OldSystem
        } else if says(&["invalid job array", "job with more than", "array task"]) {
            Self::ArrayTooLarge
        } else if says(&["no space left", "disk quota", "quota exceeded on"]) {
            Self::Disk
        } else if says(&[
            "too many jobs",
            "submit limit",
            "jobs per user",
            "maximum number of jobs",
            "max_u_jobs",
            "qosmaxsubmit",
            "assocmaxsubmit",
            "job limit",
            "allowed jobs",
        ]) {
            Self::Quota
        } else if says(&["time limit", "timelimit", "h_rt"]) {
            Self::TimeLimit
        } else if says(&["account", "project", "qos"]) {
            Self::Account
        } else if says(&["partition", "unknown queue", "no suitable queue"]) {
            Self::Queue
        } else if says(&[
            "node configuration",
            "memory specification",
            "cpu count",
            "parallel environment",
        ]) {
            Self::Resources
        } else if says(&[
            "unable to contact",
            "connection refused",
            "cannot reach",
            "commlib error",
            "can't connect",
            "socket timed out",
        ]) {
            Self::Away
        } else {
            Self::Other
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What Slurm 22.05.8 and Grid Engine 8.1.9 said, and what their sources say.
    #[test]
    fn refusals_as_queues_say_them() {
        for (said, refusal) in [
            (
                "sbatch: error: Batch job submission failed: Invalid job array specification",
                Refusal::ArrayTooLarge,
            ),
            (
                "Unable to run job: job rejected: you tried to submit a job with more than 75000 tasks",
                Refusal::ArrayTooLarge,
            ),
            (
                "sbatch: error: invalid partition specified: nope",
                Refusal::Queue,
            ),
            (
                "Unable to run job: Job was rejected because job requests unknown queue \"nope\"",
                Refusal::Queue,
            ),
            (
                "Unable to run job: job rejected: the requested project \"nope\" does not exist",
                Refusal::Account,
            ),
            (
                "sbatch: error: Memory specification can not be satisfied",
                Refusal::Resources,
            ),
            (
                "sbatch: error: Batch job submission failed: Job violates accounting/QOS policy (job submit limit, user's size and/or time limits)",
                Refusal::Quota,
            ),
            (
                "sbatch: error: Batch job submission failed: Requested time limit is invalid (missing or exceeds some limit)",
                Refusal::TimeLimit,
            ),
            (
                "slurm_load_jobs error: Unable to contact slurm controller (connect failure)",
                Refusal::Away,
            ),
            (
                "mkdir: cannot create directory: No space left on device",
                Refusal::Disk,
            ),
            (
                "flyby: /lib64/libc.so.6: version `GLIBC_2.34' not found (required by flyby)",
                Refusal::OldSystem,
            ),
            ("it is Sunday", Refusal::Other),
        ] {
            assert_eq!(Refusal::of(said), refusal, "{said}");
        }
    }
}
