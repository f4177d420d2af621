//! How the parts on one machine find each other: files of the state folder.
//!
//! The coordinator makes them; workers and users read them.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::auth::Token;

/// The file that names a running coordinator, inside its state folder.
pub const COORDINATOR_FILE: &str = "coordinator.json";

/// The file with the coordinator's token, inside its state folder; mode 0600.
pub const TOKEN_FILE: &str = "token";

/// The file with the coordinator's certificate authority and its key, inside its state folder; mode 0600.
pub const AUTHORITY_FILE: &str = "authority.pem";

/// The file with the tokens for other machines, inside the coordinator's state folder; mode 0600.
pub const TOKENS_FILE: &str = "tokens.json";

/// The folder of certificates by which workers joined, inside the state folder.
pub const JOINED_FOLDER: &str = "joined";

/// The port that a coordinator listens on unless told otherwise.
pub const DEFAULT_PORT: u16 = 7359;

/// Most bytes that either file may have.
const FILE_BYTES_MAX: u64 = 4096;

/// A running coordinator, as its file says it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Coordinator {
    /// Where it listens on this machine: a loopback address, for whoever finds it by this file.
    pub address: SocketAddr,
    /// Its process.
    pub pid: u32,
    /// How often a coordinator was started over this state folder.
    pub epoch: u64,
}

/// Why a coordinator is not found.
#[derive(Debug, thiserror::Error)]
pub enum NotFound {
    /// No coordinator says that it runs.
    #[error(
        "no coordinator runs over the state folder {}: start one with `flyby coordinator`, or \
         say where it is", .0.display()
    )]
    NotRunning(PathBuf),
    /// The state folder has no token.
    #[error(
        "there is no token at {}: it is made by the coordinator when it first starts; copy it \
         from the coordinator's machine", .0.display()
    )]
    NoToken(PathBuf),
    /// A file holds something else.
    #[error("the file {} is not the coordinator's: {what}", path.display())]
    Nonsense {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The system refused to read a file.
    #[error("cannot read {}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// The coordinator that runs over a state folder.
pub fn coordinator(state: &Path) -> Result<Coordinator, NotFound> {
    let path = state.join(COORDINATOR_FILE);
    let text = read(&path)?.ok_or_else(|| NotFound::NotRunning(state.to_owned()))?;
    serde_json::from_str(&text).map_err(|error| NotFound::Nonsense {
        path,
        what: error.to_string(),
    })
}

/// The token of the coordinator of a state folder.
pub fn token(state: &Path) -> Result<Token, NotFound> {
    let path = state.join(TOKEN_FILE);
    let text = read(&path)?.ok_or_else(|| NotFound::NoToken(path.clone()))?;
    text.parse().map_err(|error| NotFound::Nonsense {
        path,
        what: format!("{error}"),
    })
}

/// A small text file; `None` if it is not there.
fn read(path: &Path) -> Result<Option<String>, NotFound> {
    use std::io::Read as _;
    let unreadable = |source| NotFound::Unreadable {
        path: path.to_owned(),
        source,
    };
    let file = match File::open(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        file => file.map_err(unreadable)?,
    };
    let mut text = String::new();
    file.take(FILE_BYTES_MAX)
        .read_to_string(&mut text)
        .map_err(unreadable)?;
    Ok(Some(text))
}

/// Writes a small file so that it holds the old bytes or the new ones, whatever happens, and durably.
pub fn replace(path: &Path, bytes: &[u8], mode: u32) -> io::Result<()> {
    use std::io::Write as _;
    use std::os::unix::fs::OpenOptionsExt as _;
    let fresh = path.with_extension("new");
    match fs::remove_file(&fresh) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let mut file = OpenOptions::new()
        .create_new(true)
        .write(true)
        .mode(mode)
        .open(&fresh)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(&fresh, path)?;
    match path.parent() {
        Some(folder) => File::open(folder)?.sync_all(),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_there_has_its_sentence() {
        let state = tempfile::tempdir().unwrap();
        assert!(matches!(
            coordinator(state.path()),
            Err(NotFound::NotRunning(_))
        ));
        assert!(matches!(token(state.path()), Err(NotFound::NoToken(_))));
        fs::write(state.path().join(TOKEN_FILE), "hello").unwrap();
        fs::write(state.path().join(COORDINATOR_FILE), "{}").unwrap();
        let said = coordinator(state.path()).unwrap_err().to_string();
        assert!(said.contains("missing field"), "{said}");
        assert!(
            token(state.path())
                .unwrap_err()
                .to_string()
                .contains("64 hexadecimal digits")
        );
    }
}
