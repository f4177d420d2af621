//! What a user is given to reach a farm by: one line of JSON, which is a secret.

use std::io;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};

use model::Digest;
use serde::{Deserialize, Serialize};

use crate::auth::Token;

/// Most addresses that one may name.
pub const ADDRESSES_MAX: usize = 8;

/// The version of the line; a reader takes no other.
const VERSION: u32 = 1;

/// Most bytes of such a file.
const BYTES_MAX: u64 = 4096;

/// A token with all that whoever holds it needs to know.
#[derive(Clone, Debug)]
pub struct TokenFile {
    /// The token's number, by which it is revoked.
    pub id: u64,
    /// What it allows: `view`, `submit`, `operate` or `worker`.
    pub role: String,
    /// The secret.
    pub secret: Token,
    /// The fingerprint of the coordinator's authority.
    pub authority: Digest,
    /// Where the coordinator may be reached, each a host or an address with a port; 1 to [`ADDRESSES_MAX`].
    pub addresses: Vec<String>,
}

/// The line as it is written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    flyby_token: u32,
    id: u64,
    role: String,
    secret: String,
    authority: String,
    addresses: Vec<String>,
}

/// Why a token file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum NoTokenFile {
    /// The system refused to read it.
    #[error("cannot read the token file {}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Others may read it.
    #[error(
        "the token file {} has mode {mode:03o}, so that others can read it: `chmod 600` it; where somebody may have read it already, revoke the token and make another",
        path.display()
    )]
    Mode {
        /// The file.
        path: PathBuf,
        /// Its mode.
        mode: u32,
    },
    /// It holds something else.
    #[error("{} is no token file ({what}): `flyby token create --out FILE` makes one", path.display())]
    Nonsense {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
}

impl TokenFile {
    /// Reads one that only its owner can read.
    pub fn read(path: &Path) -> Result<Self, NoTokenFile> {
        use std::io::Read as _;
        let unreadable = |source| NoTokenFile::Unreadable {
            path: path.to_owned(),
            source,
        };
        let file = std::fs::File::open(path).map_err(unreadable)?;
        let metadata = file.metadata().map_err(unreadable)?;
        let mode = metadata.permissions().mode() & 0o777;
        if metadata.is_file() && mode & 0o077 != 0 {
            return Err(NoTokenFile::Mode {
                path: path.to_owned(),
                mode,
            });
        }
        let mut text = String::new();
        file.take(BYTES_MAX)
            .read_to_string(&mut text)
            .map_err(unreadable)?;
        Self::parse(&text).map_err(|what| NoTokenFile::Nonsense {
            path: path.to_owned(),
            what,
        })
    }

    /// Parses the line; an error says what is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        // What serde says of a wrong value may quote it, and this one is a secret.
        let line: Line =
            serde_json::from_str(text.trim()).map_err(|_| "it is not one's line".to_owned())?;
        if line.flyby_token != VERSION {
            return Err(format!(
                "it is of version {}, this program knows {VERSION}",
                line.flyby_token
            ));
        }
        if line.addresses.is_empty() || line.addresses.len() > ADDRESSES_MAX {
            return Err(format!("it must name 1 to {ADDRESSES_MAX} addresses"));
        }
        Ok(Self {
            id: line.id,
            role: line.role,
            secret: line
                .secret
                .parse()
                .map_err(|_| "its secret is cut off".to_owned())?,
            authority: line
                .authority
                .parse()
                .map_err(|_| "its authority is no fingerprint".to_owned())?,
            addresses: line.addresses,
        })
    }

    /// The line, for its file or its reader's eyes alone.
    pub fn reveal(&self) -> String {
        let line = Line {
            flyby_token: VERSION,
            id: self.id,
            role: self.role.clone(),
            secret: self.secret.reveal().to_owned(),
            authority: self.authority.to_string(),
            addresses: self.addresses.clone(),
        };
        serde_json::to_string(&line).expect("numbers and text are JSON")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one() -> TokenFile {
        TokenFile {
            id: 3,
            role: "worker".into(),
            secret: Token::from_random([0x5a; 32]),
            authority: Digest([7; 32]),
            addresses: vec!["192.0.2.1:7359".into(), "[2001:db8::1]:7359".into()],
        }
    }

    #[test]
    fn a_token_file_survives_its_journey_and_hides_its_secret() {
        let line = one().reveal();
        let read = TokenFile::parse(&format!("{line}\n")).unwrap();
        assert_eq!(read.reveal(), line);
        assert!(!format!("{read:?}").contains("5a5a"));
    }

    #[test]
    fn what_is_wrong_with_one_is_said_without_its_secret() {
        let line = one().reveal();
        let changed = [
            line.replace("\"flyby_token\":1", "\"flyby_token\":9"),
            line.replace("5a5a5a", ""),
            line.replace("0707", "zz"),
            line.replace("\"id\":3", "\"id\":\"5a5a5a\""),
            line[..line.len() / 2].to_owned(),
            String::new(),
        ];
        for text in changed {
            let said = TokenFile::parse(&text).unwrap_err();
            assert!(!said.contains("5a5a"), "{said}");
        }
    }

    #[test]
    fn one_that_others_can_read_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t");
        std::fs::write(&path, one().reveal()).unwrap();
        let mode = |mode| {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
            TokenFile::read(&path)
        };
        assert!(mode(0o600).is_ok());
        let said = mode(0o644).unwrap_err().to_string();
        assert!(said.contains("chmod 600"), "{said}");
    }
}
