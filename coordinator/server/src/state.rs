//! The state folder: who may use it, and what outlives a coordinator.
//!
//! ```text
//! lock               held while a coordinator runs
//! token              64 hexadecimal digits, mode 0600
//! epoch              how often a coordinator was started here
//! coordinator.json   where the running one listens on this machine
//! authority.pem      the farm's certificate authority with its key, mode 0600
//! tokens.json        tokens for other machines, without their secrets, mode 0600
//! coordinator.json   where the running one listens
//! farm               what this farm is called at its sites; there once it has some
//! ssh/               connections to them that are open
//! farm.sqlite        jobs, finished images, blocks of the others: what the `store` keeps
//! jobs/arriving/     submissions, on the disk that they are to stay on; of this start only
//! jobs/<job>/scene/    the scene and its assets
//! jobs/<job>/frames/   finished frames; they stay when the job is forgotten
//! jobs/<job>/scratch/  images being rendered
//! ```

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};

use model::{Epoch, ImageNumber, ImageRef, JobId};
use wire::auth::Token;
use wire::place::{self, COORDINATOR_FILE, Coordinator, TOKEN_FILE};

use crate::input::Frames;

/// The folder among those of jobs where submissions arrive.
const ARRIVING: &str = "arriving";

/// Why a state folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// Another coordinator holds it.
    #[error(
        "another coordinator runs over the state folder {}: stop it, or give this one a folder of its own",
        .0.display()
    )]
    Locked(PathBuf),
    /// Others may read a secret.
    #[error(
        "{} has mode {mode:03o}, so that others can read it: `chmod 600` it, or remove it to get a new one",
        path.display()
    )]
    Mode {
        /// The file that holds it.
        path: PathBuf,
        /// Its mode.
        mode: u32,
    },
    /// A file of it holds something else.
    #[error("{} does not hold {expected}: remove it to start anew", path.display())]
    Nonsense {
        /// The file.
        path: PathBuf,
        /// What should be there.
        expected: &'static str,
    },
    /// The system refused.
    #[error("cannot {attempted} {}", path.display())]
    Io {
        /// What was attempted, as it stands after "cannot".
        attempted: &'static str,
        /// On which path.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// A state folder that this process holds.
#[derive(Debug)]
pub(crate) struct State {
    root: PathBuf,
    epoch: Epoch,
    token: Token,
    _lock: File,
}

/// The folders of one job.
#[derive(Clone, Debug)]
pub(crate) struct JobFolders {
    /// What is left at the end.
    pub(crate) frames: PathBuf,
    /// Images being rendered.
    pub(crate) scratch: PathBuf,
    /// What workers fetch.
    pub(crate) scene: PathBuf,
    root: PathBuf,
}

impl State {
    /// Takes the folder: locks it, counts the start, makes the token if there
    /// is none, removes submissions that had not arrived whole.
    pub(crate) fn take(root: &Path) -> Result<Self, StateError> {
        make_folder(root)?;
        let lock = lock(root)?;
        let state = Self {
            epoch: next_epoch(root)?,
            token: token(root)?,
            root: root.to_owned(),
            _lock: lock,
        };
        remove_all(&state.root.join(COORDINATOR_FILE))?;
        remove_all(&state.inbox())?;
        make_folder(&state.inbox())?;
        Ok(state)
    }

    pub(crate) fn epoch(&self) -> Epoch {
        self.epoch
    }

    pub(crate) fn token(&self) -> &Token {
        &self.token
    }

    /// Where submissions arrive.
    pub(crate) fn inbox(&self) -> PathBuf {
        self.root.join("jobs").join(ARRIVING)
    }

    /// The file of the certificate authority.
    pub(crate) fn authority(&self) -> PathBuf {
        self.root.join(place::AUTHORITY_FILE)
    }

    /// The file of tokens for other machines.
    pub(crate) fn tokens(&self) -> PathBuf {
        self.root.join(place::TOKENS_FILE)
    }

    /// The store's file.
    pub(crate) fn store(&self) -> PathBuf {
        self.root.join("farm.sqlite")
    }

    /// A job's folders; nothing is made yet.
    pub(crate) fn job(&self, job: JobId) -> JobFolders {
        JobFolders::at(self.root.join("jobs").join(job.to_string()))
    }

    /// Removes what no job that is there needs: folders of submissions that were cut off before they
    /// were taken, frames that were being written, scratch files of images that nobody renders. Finished frames stay.
    pub(crate) fn clean(
        &self,
        jobs: &BTreeSet<JobId>,
        in_flight: &BTreeSet<ImageRef>,
    ) -> Result<(), StateError> {
        let root = self.root.join("jobs");
        let listed = fs::read_dir(&root).map_err(io_error("list", &root))?;
        for entry in listed {
            let entry = entry.map_err(io_error("list", &root))?;
            let name = entry.file_name();
            if name == ARRIVING {
                continue;
            }
            let job = name.to_str().and_then(|name| name.parse().ok()).map(JobId);
            let job = job.filter(|job| jobs.contains(job));
            remove_unfinished(&entry.path().join("frames"));
            let Some(job) = job else {
                JobFolders::at(entry.path()).forget(Frames::Stay)?;
                continue;
            };
            let Ok(scratch) = fs::read_dir(entry.path().join("scratch")) else {
                continue;
            };
            for file in scratch.flatten() {
                let name = file.file_name();
                let image = name.to_str().and_then(|name| name.parse().ok());
                let image = image.map(|image| ImageRef {
                    job,
                    image: ImageNumber(image),
                });
                if image.is_none_or(|image| !in_flight.contains(&image)) {
                    remove_all(&file.path())?;
                }
            }
        }
        Ok(())
    }

    /// The largest number of a job that has a folder.
    pub(crate) fn last_job_folder(&self) -> JobId {
        self.job_folders().pop().unwrap_or(JobId(0))
    }

    /// The folder itself.
    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// The numbers of all jobs that have a folder, in order.
    pub(crate) fn job_folders(&self) -> Vec<JobId> {
        let listed = fs::read_dir(self.root.join("jobs"));
        let names = listed.into_iter().flatten().flatten();
        let numbers = names.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        let mut jobs: Vec<_> = numbers.map(JobId).collect();
        jobs.sort_unstable();
        jobs
    }

    /// Says where this coordinator listens.
    pub(crate) fn announce(&self, address: std::net::SocketAddr) -> Result<(), StateError> {
        let path = self.root.join(COORDINATOR_FILE);
        let coordinator = Coordinator {
            address,
            pid: std::process::id(),
            epoch: self.epoch.0,
        };
        let text = serde_json::to_string(&coordinator).expect("an address is text");
        replace(&path, text.as_bytes(), 0o644)
    }

    /// Takes that back; a file that is gone already is no error worth telling.
    pub(crate) fn withdraw(&self) {
        let _ = fs::remove_file(self.root.join(COORDINATOR_FILE));
        let _ = fs::remove_dir_all(self.inbox());
    }
}

impl JobFolders {
    pub(crate) fn at(root: PathBuf) -> Self {
        Self {
            frames: root.join("frames"),
            scratch: root.join("scratch"),
            scene: root.join("scene"),
            root,
        }
    }

    /// Makes those of frames and scratch files.
    pub(crate) fn make(&self) -> Result<(), StateError> {
        make_folder(&self.frames)?;
        make_folder(&self.scratch)
    }

    /// Removes all; finished frames only where they are to go.
    pub(crate) fn forget(&self, frames: Frames) -> Result<(), StateError> {
        remove_all(&self.scratch)?;
        remove_all(&self.scene)?;
        if frames == Frames::Go {
            remove_all(&self.frames)?;
        }
        // Both succeed only where nothing is left inside.
        let _ = fs::remove_dir(&self.frames);
        let _ = fs::remove_dir(&self.root);
        Ok(())
    }
}

/// Frames that a killed coordinator was writing: hidden names, which no finished frame has.
fn remove_unfinished(frames: &Path) {
    let Ok(files) = fs::read_dir(frames) else {
        return;
    };
    for file in files.flatten() {
        if file.file_name().as_encoded_bytes().starts_with(b".") {
            let _ = fs::remove_file(file.path());
        }
    }
}

fn lock(root: &Path) -> Result<File, StateError> {
    let path = root.join("lock");
    let file = OpenOptions::new()
        .create(true)
        .truncate(false)
        .write(true)
        .mode(0o600)
        .open(&path)
        .map_err(io_error("open", &path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(StateError::Locked(root.to_owned())),
        Err(TryLockError::Error(error)) => Err(io_error("lock", &path)(error)),
    }
}

/// Counts this start, durably before anyone sees the number.
fn next_epoch(root: &Path) -> Result<Epoch, StateError> {
    let path = root.join("epoch");
    let nonsense = || StateError::Nonsense {
        path: path.clone(),
        expected: "a number",
    };
    let last = match fs::read_to_string(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => 0,
        text => text
            .map_err(io_error("read", &path))?
            .trim()
            .parse::<u64>()
            .map_err(|_| nonsense())?,
    };
    let next = last.checked_add(1).ok_or_else(nonsense)?;
    replace(&path, format!("{next}\n").as_bytes(), 0o600)?;
    Ok(Epoch(next))
}

/// Reads the token, or makes one.
fn token(root: &Path) -> Result<Token, StateError> {
    let path = root.join(TOKEN_FILE);
    let metadata = match fs::metadata(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let mut bits = [0; 32];
            getrandom::fill(&mut bits)
                .map_err(|error| io_error("draw", &path)(io::Error::other(error.to_string())))?;
            let token = Token::from_random(bits);
            replace(&path, format!("{}\n", token.reveal()).as_bytes(), 0o600)?;
            return Ok(token);
        }
        metadata => metadata.map_err(io_error("look at", &path))?,
    };
    refuse_readers(&path, &metadata)?;
    let text = fs::read_to_string(&path).map_err(io_error("read", &path))?;
    text.parse().map_err(|_| StateError::Nonsense {
        path,
        expected: "a token of 64 hexadecimal digits",
    })
}

/// A file with a secret, if it is there; refused where others can read it.
pub(crate) fn secret(path: &Path) -> Result<Option<String>, StateError> {
    match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        metadata => refuse_readers(path, &metadata.map_err(io_error("look at", path))?)?,
    }
    fs::read_to_string(path)
        .map(Some)
        .map_err(io_error("read", path))
}

fn refuse_readers(path: &Path, metadata: &fs::Metadata) -> Result<(), StateError> {
    let mode = metadata.permissions().mode() & 0o777;
    if mode & 0o177 == 0 {
        return Ok(());
    }
    Err(StateError::Mode {
        path: path.to_owned(),
        mode,
    })
}

/// [`place::replace`], with this crate's error.
pub(crate) fn replace(path: &Path, bytes: &[u8], mode: u32) -> Result<(), StateError> {
    place::replace(path, bytes, mode).map_err(io_error("write", path))
}

/// Makes a folder that only its owner may enter, and those above it.
pub(crate) fn make_folder(path: &Path) -> Result<(), StateError> {
    fs::DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(path)
        .map_err(io_error("make the folder", path))
}

/// Removes a file or a folder with what it holds, if it is there.
pub(crate) fn remove_all(path: &Path) -> Result<(), StateError> {
    let removed = if path.is_dir() {
        fs::remove_dir_all(path)
    } else {
        fs::remove_file(path)
    };
    remove_if_there(removed).map_err(io_error("remove", path))
}

fn remove_if_there(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        result => result,
    }
}

pub(crate) fn io_error(
    attempted: &'static str,
    path: &Path,
) -> impl FnOnce(io::Error) -> StateError {
    let path = path.to_owned();
    move |source| StateError::Io {
        attempted,
        path,
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_start_counts_and_keeps_the_token() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("deep/state");
        let first = State::take(&root).unwrap();
        let token = first.token().reveal().to_owned();
        assert_eq!(first.epoch(), Epoch(1));
        assert!(matches!(State::take(&root), Err(StateError::Locked(_))));
        drop(first);
        let second = State::take(&root).unwrap();
        assert_eq!(second.epoch(), Epoch(2));
        assert_eq!(second.token().reveal(), token);
        let mode = fs::metadata(root.join("token"))
            .unwrap()
            .permissions()
            .mode();
        assert_eq!(mode & 0o777, 0o600);
    }

    #[test]
    fn a_token_that_others_can_read_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        drop(State::take(folder.path()).unwrap());
        let token = folder.path().join("token");
        fs::set_permissions(&token, fs::Permissions::from_mode(0o640)).unwrap();
        let refused = State::take(folder.path()).unwrap_err();
        assert!(refused.to_string().contains("mode 640"), "{refused}");
    }

    #[test]
    fn what_no_job_needs_goes_and_frames_stay() {
        let folder = tempfile::tempdir().unwrap();
        let state = State::take(folder.path()).unwrap();
        let image = ImageRef {
            job: JobId(1),
            image: ImageNumber(0),
        };
        let (there, gone) = (state.job(JobId(1)), state.job(JobId(2)));
        for job in [&there, &gone] {
            job.make().unwrap();
            make_folder(&job.scene).unwrap();
            for image in ["0", "1"] {
                fs::write(job.scratch.join(image), "x").unwrap();
            }
        }
        fs::write(there.frames.join(".a_0001.exr.part"), "x").unwrap();
        fs::write(gone.frames.join("a_0000.exr"), "x").unwrap();
        state.clean(&[JobId(1)].into(), &[image].into()).unwrap();
        assert!(there.scene.exists() && there.scratch.join("0").exists());
        assert!(!there.scratch.join("1").exists());
        assert!(!there.frames.join(".a_0001.exr.part").exists());
        assert!(gone.frames.join("a_0000.exr").exists());
        assert!(!gone.scratch.exists() && !gone.scene.exists());
        fs::remove_file(gone.frames.join("a_0000.exr")).unwrap();
        state.clean(&BTreeSet::new(), &BTreeSet::new()).unwrap();
        assert!(!gone.root.exists() && !there.root.exists());
    }

    #[test]
    fn an_epoch_that_is_no_number_is_named() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("epoch"), "many").unwrap();
        let refused = State::take(folder.path()).unwrap_err().to_string();
        assert!(refused.contains("does not hold a number"), "{refused}");
    }
}
