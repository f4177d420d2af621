//! Real engines on this machine, by the scripts beside this file: started for one test, and stopped with it.

use std::net::Ipv4Addr;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

use crate::harness::need;

const SCRIPTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clusters/scripts");

/// The exit status of a script for what this machine cannot run.
const CANNOT: i32 = 77;

/// Engines that share one folder. Dropping it stops them, whatever became of the test.
pub(crate) struct Engine {
    /// Where their files lie.
    pub(crate) folder: PathBuf,
    /// What was started, to be stopped in the other order.
    started: Vec<&'static str>,
    // The last to go.
    _root: TempDir,
}

impl Engine {
    fn new() -> Self {
        // Short, since sockets lie in it.
        let root = tempfile::Builder::new()
            .prefix("fc-")
            .tempdir_in("/tmp")
            .unwrap();
        Self {
            folder: root.path().join("c"),
            started: Vec::new(),
            _root: root,
        }
    }

    /// Slurm with nodes `n1`, `n2`, … of two processors each; `None` where it cannot run here.
    pub(crate) fn slurm(nodes: u32) -> Option<Self> {
        Self::slurm_with(nodes, &[])
    }

    /// The same, with these settings of its script.
    pub(crate) fn slurm_with(nodes: u32, settings: &[(&str, &str)]) -> Option<Self> {
        let mut engine = Self::new();
        engine
            .up("slurm", &[&nodes.to_string()], settings)
            .then_some(engine)
    }

    /// Grid Engine with hosts `ge1`, `ge2`, … of two slots each, on hosts of their own; with these settings of its script.
    pub(crate) fn gridengine(nodes: u32, settings: &[(&str, &str)]) -> Option<Self> {
        let mut engine = Self::new();
        engine
            .up("gridengine", &[&nodes.to_string()], settings)
            .then_some(engine)
    }

    /// Hosts `node1`, `node2`, … without a queue, on networks of their own, with ssh.
    pub(crate) fn hosts(nodes: u32) -> Option<Self> {
        let mut engine = Self::new();
        let is_up = engine.up("netns", &[&nodes.to_string()], &[]) && engine.add_ssh();
        is_up.then_some(engine)
    }

    /// ssh on loopback alone, as `node1`.
    pub(crate) fn ssh() -> Option<Self> {
        let mut engine = Self::new();
        engine.up("ssh", &["1"], &[]).then_some(engine)
    }

    /// ssh besides, on every host that there is, or on loopback as `node1`.
    #[must_use]
    pub(crate) fn add_ssh(&mut self) -> bool {
        self.add_ssh_with(&[])
    }

    /// The same, with these settings of its script.
    #[must_use]
    pub(crate) fn add_ssh_with(&mut self, settings: &[(&str, &str)]) -> bool {
        let has_hosts = self.folder.join("net").is_dir();
        self.up("ssh", if has_hosts { &[] } else { &["1"] }, settings)
    }

    /// Starts one kind; false where it cannot run here.
    fn up(&mut self, kind: &'static str, words: &[&str], settings: &[(&str, &str)]) -> bool {
        // Stopped even where the start ends half-way.
        self.started.push(kind);
        let output = self.script(&format!("{kind}-up.sh"), words, settings);
        if output.status.code() == Some(CANNOT) {
            need::leave_out(
                kind,
                &String::from_utf8_lossy(&output.stderr)
                    .trim()
                    .replace('\n', "; "),
            );
            return false;
        }
        assert!(
            output.status.success(),
            "{kind}-up.sh ended with {}:\n{}",
            output.status,
            String::from_utf8_lossy(&output.stderr)
        );
        true
    }

    fn script(&self, name: &str, words: &[&str], settings: &[(&str, &str)]) -> Output {
        Command::new(Path::new(SCRIPTS).join(name))
            .args(words)
            .envs(settings.iter().copied())
            .env("CLUSTER_DIR", &self.folder)
            // A group of its own: a Ctrl-C for the tests must not end what stops the engines.
            .process_group(0)
            .output()
            .unwrap_or_else(|why| panic!("cannot run {name}: {why}"))
    }

    /// The address at which its hosts, which have networks of their own, find this machine.
    pub(crate) fn head(&self) -> Ipv4Addr {
        let subnet = std::fs::read_to_string(self.folder.join("net/subnet")).unwrap();
        format!("{}.1", subnet.trim()).parse().unwrap()
    }

    /// Runs one of the tools in its `bin`; it must do what was asked.
    #[track_caller]
    pub(crate) fn tool(&self, name: &str, words: &[&str]) -> String {
        let path = self.folder.join("bin").join(name);
        succeeds(Command::new(path).args(words))
    }

    /// Runs a command of Slurm.
    #[track_caller]
    pub(crate) fn slurm_tool(&self, name: &str, words: &[&str]) -> String {
        let config = self.folder.join("slurm/slurm.conf");
        succeeds(Command::new(name).args(words).env("SLURM_CONF", config))
    }

    /// What stands in `sites.toml` for a site that uses it: its way and its kind.
    pub(crate) fn site(&self, kind: Kind) -> String {
        let folder = self.folder.display();
        let ssh = |host: &str| {
            format!("address = '{host}'\nssh_options = ['-F', '{folder}/ssh/config']\n")
        };
        match kind {
            Kind::Slurm => format!("kind = 'slurm'\nsetup = '. {folder}/slurm/env.sh'\n"),
            Kind::SlurmOverSsh => format!(
                "kind = 'slurm'\nsetup = '. {folder}/slurm/env.sh'\n{}",
                ssh("node1")
            ),
            Kind::GridEngine => {
                format!("kind = 'gridengine'\nsetup = 'PATH={folder}/bin:$PATH'\n")
            }
            Kind::GridEngineOverSsh => format!("kind = 'gridengine'\n{}", ssh("qmaster")),
            Kind::Ssh => format!("kind = 'ssh'\n{}", ssh("node1")),
            Kind::Local => "kind = 'local'\n".to_owned(),
        }
    }
}

/// A site of a test.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Kind {
    Slurm,
    SlurmOverSsh,
    GridEngine,
    GridEngineOverSsh,
    Ssh,
    Local,
}

#[track_caller]
fn succeeds(command: &mut Command) -> String {
    let output = command
        .output()
        .unwrap_or_else(|why| panic!("{command:?}: {why}"));
    assert!(output.status.success(), "{command:?}: {output:?}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

impl Drop for Engine {
    fn drop(&mut self) {
        for kind in self.started.iter().rev() {
            let output = self.script(&format!("{kind}-down.sh"), &[], &[]);
            // Where the test has failed already, that is what must be read.
            if !output.status.success() && !std::thread::panicking() {
                panic!("{kind}-down.sh: {output:?}");
            }
        }
    }
}
