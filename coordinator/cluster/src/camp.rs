//! What one farm has at one site: a folder of its own, and arrays whose names say whose they are.
//!
//! The names are the record: whatever the queue shows under them is this farm's, whoever submitted it and however
//! that coordinator ended.

use std::fs::{self, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use model::Span;

use crate::error::{ClusterError, Refusal};
use crate::queue::{self, Queue, Task, TaskId, TaskState};
use crate::sites::Site;
use crate::way::{LIMIT, Way};
use crate::words::quote_path;

/// The file of a state folder that names its farm.
const FARM_FILE: &str = "farm";

/// How long deleted allocations may take to end.
const END_LIMIT: Duration = Duration::from_secs(120);

/// How often they are looked at meanwhile.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// Bytes for which there must be room: with less, tasks would begin for a few blocks each.
const ROOM_BYTES: u32 = 1 << 20;

/// Logs that are kept at a site.
const LOGS_MAX: u32 = 200;

/// The name of a farm: eight hexadecimal digits, drawn once for a state folder and kept there.
pub fn farm_of(state: &Path) -> Result<String, ClusterError> {
    let path = state.join(FARM_FILE);
    let failed = |attempted| {
        let path = path.display().to_string();
        move |source: io::Error| ClusterError::File {
            attempted,
            path,
            source,
        }
    };
    match fs::read_to_string(&path) {
        Ok(text) => {
            let name = text.trim();
            let is_name = name.len() == 8 && name.chars().all(|digit| digit.is_ascii_hexdigit());
            return match is_name {
                true => Ok(name.to_owned()),
                false => Err(failed("understand")(io::Error::other(
                    "it is not eight hexadecimal digits",
                ))),
            };
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(failed("read")(error)),
    }
    let mut bits = [0; 4];
    let drawn = fs::File::open("/dev/urandom").and_then(|mut random| random.read_exact(&mut bits));
    drawn.map_err(failed("draw"))?;
    let name = format!("{:08x}", u32::from_le_bytes(bits));
    let write = || {
        fs::create_dir_all(state)?;
        let mut options = OpenOptions::new();
        let mut file = options
            .create_new(true)
            .write(true)
            .mode(0o600)
            .open(&path)?;
        writeln!(file, "{name}")?;
        file.sync_all()?;
        fs::File::open(state)?.sync_all()
    };
    match write() {
        // Somebody else was faster.
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => farm_of(state),
        written => written.map(|()| name).map_err(failed("write")),
    }
}

/// What became of all that a farm had at a site.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Cleaned {
    /// Allocations that waited or ran, and were ended.
    pub ended: usize,
    /// Those that the queue still shows, on hosts of which it hears nothing: they go when the hosts come back, or by an
    /// operator's hand.
    pub away: Vec<TaskId>,
}

/// One farm at one site.
pub struct Camp {
    /// The site.
    pub site: Site,
    /// The way there.
    pub way: Way,
    /// Its queue.
    pub queue: Box<dyn Queue>,
    farm: String,
}

impl Camp {
    /// The camp of a farm. Nothing is made and nobody asked yet.
    pub fn new(site: Site, farm: String, sockets: &Path) -> Self {
        let way = Way::to(&site, sockets);
        let queue = queue::open(&site, way.clone(), &folder(&site, &farm));
        Self {
            site,
            way,
            queue,
            farm,
        }
    }

    /// The farm's name.
    pub(crate) fn farm(&self) -> &str {
        &self.farm
    }

    /// What the names of its arrays begin with. No other site's do, since no site's name has a dot.
    pub fn prefix(&self) -> String {
        format!("flyby-{}-{}.", self.farm, self.site.name)
    }

    /// The folder there that holds all it has there, the program aside.
    pub fn folder(&self) -> String {
        folder(&self.site, &self.farm)
    }

    /// Where an array's tasks write what they say.
    pub fn log(&self, array: &str) -> String {
        format!("{}/log/{array}-%.log", self.folder())
    }

    /// The end of what a task wrote, for people.
    pub fn said(&self, array: &str, task: u32) -> Result<String, ClusterError> {
        Ok(crate::way::brief(&self.log_of(array, task)?))
    }

    /// The end of what a task wrote, as it is.
    pub(crate) fn log_of(&self, array: &str, task: u32) -> Result<String, ClusterError> {
        let log = quote_path(&self.log(array).replace('%', &task.to_string()));
        let script = format!("tail -c 1000 {log} 2>/dev/null || :");
        self.way.ask("reading a log", "tail", &script)
    }

    /// Sees that its folder there takes more: by writing, since no count of free bytes knows of quotas. Where it was not made yet
    /// that is tried beside it. The file has no name while it is written, where that may be: nothing of it stays, whatever becomes of
    /// who writes.
    pub fn has_room(&self) -> Result<(), ClusterError> {
        let folder = quote_path(&self.folder());
        let script = format!(
            "d={folder}; [ -d \"$d\" ] || d=$(dirname \"$(dirname \"$d\")\")\n\
             while [ ! -d \"$d\" ]; do d=$(dirname \"$d\"); done; f=$d/.room.$$\n\
             {{ rm -f \"$f\"; head -c {ROOM_BYTES} /dev/zero; }} >\"$f\"; code=$?; rm -f \"$f\"; exit $code"
        );
        let found = self.way.ask("writing there", "head", &script);
        found.map(|_| ()).map_err(|error| self.full(error))
    }

    /// An error of here, which names the folder where its cause is that nothing more can be written.
    pub fn full(&self, error: ClusterError) -> ClusterError {
        match error {
            ClusterError::Refused {
                refusal: Refusal::Disk,
                said,
                ..
            } => self.is_full(said),
            error => error,
        }
    }

    /// That nothing more can be written into its folder there.
    pub fn is_full(&self, said: String) -> ClusterError {
        let here = || "this machine".to_owned();
        ClusterError::Full {
            folder: self.folder(),
            host: self.site.address.clone().unwrap_or_else(here),
            said,
        }
    }

    /// Removes all but the latest logs.
    pub fn trim_logs(&self) -> Result<(), ClusterError> {
        let folder = quote_path(&format!("{}/log", self.folder()));
        let script = format!(
            "cd {folder} 2>/dev/null || exit 0; ls -t | tail -n +{} | while read -r f; do rm -f \"./$f\"; done",
            LOGS_MAX + 1
        );
        self.way.ask("removing old logs", "ls", &script).map(|_| ())
    }

    /// Ends and removes all that this farm has there.
    pub fn clean(&self) -> Result<Cleaned, ClusterError> {
        let prefix = self.prefix();
        let deadline = Instant::now() + END_LIMIT;
        let mut cleaned = Cleaned::default();
        let mut asked = false;
        loop {
            let mut tasks = self.queue.list(&prefix)?;
            tasks.retain(|task| task.state.is_live());
            let ids = |tasks: &[Task]| tasks.iter().map(|task| task.id.clone()).collect();
            let live: Vec<TaskId> = ids(&tasks);
            cleaned.ended = cleaned.ended.max(live.len());
            tasks.retain(|task| matches!(task.state, TaskState::Away { .. }));
            cleaned.away = ids(&tasks);
            // Those whose hosts are gone end at once, or for nobody.
            if live.is_empty() || (asked && cleaned.away.len() == live.len()) {
                break;
            }
            asked = true;
            if Instant::now() > deadline {
                return Err(ClusterError::TimedOut {
                    attempt: format!("ending {} allocations", live.len()),
                    limit: Span::from_secs(END_LIMIT.as_secs()),
                });
            }
            // Whole arrays: few words, however many tasks.
            let mut arrays: Vec<TaskId> =
                live.into_iter().map(|id| TaskId::whole(id.array)).collect();
            arrays.dedup();
            self.queue.delete(&arrays)?;
            thread::sleep(LOOK_EVERY);
        }
        let script = removal(&quote_path(&self.folder()));
        let said = self.way.run("removing what is left", &script, LIMIT)?;
        match said.code {
            Some(0) => {
                cleaned.ended -= cleaned.away.len();
                Ok(cleaned)
            }
            _ => Err(said.refused("removing what is left", "rm")),
        }
    }
}

/// The script that removes a site's folder, and the farm's with its last site.
///
/// What has just ended, or a last look at the site, may write a file into a folder whose others are removed already, and it is
/// then not empty.
fn removal(folder: &str) -> String {
    format!(
        "tries=50; until rm -rf {folder} 2>/dev/null; do tries=$((tries - 1)); [ $tries -gt 0 ] || break; sleep 0.1; done\n\
         rm -rf {folder} && {{ rmdir \"$(dirname {folder})\" 2>/dev/null || :; }}"
    )
}

fn folder(site: &Site, farm: &str) -> String {
    format!("{}/farm-{farm}/{}", site.folder, site.name)
}

#[cfg(test)]
mod tests {
    use std::process;

    use super::*;
    use crate::sites;

    #[test]
    fn a_folder_is_removed_although_something_still_writes_into_it() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("farm/site");
        fs::create_dir_all(&folder).unwrap();
        // So many that removing them takes its time.
        for number in 0..2000 {
            fs::write(folder.join(format!("old{number}")), "").unwrap();
        }
        let path = folder.display();
        // Ends once the folder is gone, as what is cleaned away does; else after so many files.
        let writer = format!(
            "echo begun; i=0; while [ $i -lt 2000 ]; do i=$((i + 1)); true 2>/dev/null >'{path}/'$i || exit 0; done"
        );
        let mut writer = process::Command::new("sh")
            .args(["-c", &writer])
            .stdout(process::Stdio::piped())
            .spawn()
            .unwrap();
        let mut begun = [0];
        writer
            .stdout
            .as_mut()
            .unwrap()
            .read_exact(&mut begun)
            .unwrap();
        let removed = process::Command::new("sh")
            .args(["-c", &removal(&quote_path(&path.to_string()))])
            .output()
            .unwrap();
        assert!(writer.wait().unwrap().success());
        assert!(removed.status.success(), "{removed:?}");
        assert!(!place.path().join("farm").exists());
    }

    #[test]
    fn a_state_folder_keeps_its_farm_s_name() {
        let state = tempfile::tempdir().unwrap();
        let name = farm_of(&state.path().join("deep")).unwrap();
        assert_eq!(farm_of(&state.path().join("deep")).unwrap(), name);
        assert_ne!(farm_of(state.path()).unwrap(), name);
        fs::write(state.path().join("farm"), "../../x").unwrap();
        let error = farm_of(state.path()).unwrap_err().to_string();
        assert!(error.contains("farm"), "{error}");
    }

    #[test]
    fn a_site_s_names_are_no_other_site_s() {
        let text = "[site.a]\nkind = 'local'\n[site.a-1]\nkind = 'local'\n";
        let sites = sites::parse("s", text, None).unwrap();
        let camp =
            |index: usize| Camp::new(sites.0[index].clone(), "00c0ffee".into(), Path::new("/x"));
        assert_eq!(camp(0).prefix(), "flyby-00c0ffee-a.");
        assert!(!format!("{}7", camp(1).prefix()).starts_with(&camp(0).prefix()));
    }
}
