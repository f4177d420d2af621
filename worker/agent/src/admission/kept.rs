//! Where a worker's certificate is kept, so that one that is started again needs no second token.
//!
//! ```text
//! joined/<authority>-<token>/<n>/   a place of its own for each worker that runs at the same time
//!     lock               held while a worker uses it
//!     key.pem            mode 0600
//!     certificate.der
//! ```

use std::fs::{self, DirBuilder, File, TryLockError};
use std::io;
use std::os::unix::fs::DirBuilderExt as _;
use std::path::{Path, PathBuf};

use rcgen::{KeyPair, PKCS_ECDSA_P256_SHA256};
use wire::place;
use wire::tls::token_file::TokenFile;

use crate::RunError;

/// Most workers of one token that share a state folder.
const PLACES_MAX: usize = 4_096;

/// Most bytes of a certificate.
const CERTIFICATE_BYTES_MAX: u64 = 16 << 10;

/// Digits of the authority's fingerprint in a folder's name.
const DIGITS: usize = 16;

/// A place that this worker alone uses; without a folder, nothing is kept.
#[derive(Debug)]
pub(super) struct Place {
    folder: Option<(PathBuf, File)>,
    /// The worker's key. It stays the same: certificates are made for it, one after another.
    pub(super) key: KeyPair,
}

impl Place {
    /// Takes the first place of a token that no other worker uses, and the key in it, or makes one.
    pub(super) fn take(keep: Option<&Path>, file: &TokenFile) -> Result<Self, RunError> {
        let Some(keep) = keep else {
            return Ok(Self {
                folder: None,
                key: fresh_key()?,
            });
        };
        let authority = file.authority.to_string();
        let all = keep.join(format!("{}-{}", &authority[..DIGITS], file.id));
        for number in 0..PLACES_MAX {
            let folder = all.join(number.to_string());
            let make = DirBuilder::new()
                .recursive(true)
                .mode(0o700)
                .create(&folder);
            make.map_err(refused("make the folder", &folder))?;
            let path = folder.join("lock");
            let lock = File::create(&path).map_err(refused("open", &path))?;
            match lock.try_lock() {
                Ok(()) => {
                    let key = key(&folder.join("key.pem"))?;
                    return Ok(Self {
                        folder: Some((folder, lock)),
                        key,
                    });
                }
                Err(TryLockError::WouldBlock) => {}
                Err(TryLockError::Error(error)) => return Err(refused("lock", &path)(error)),
            }
        }
        let full = io::Error::other(format!("{PLACES_MAX} workers use it already"));
        Err(refused("take a place in", &all)(full))
    }

    /// The certificate that was kept, if one was.
    pub(super) fn certificate(&self) -> Option<Vec<u8>> {
        use io::Read as _;
        let (folder, _) = self.folder.as_ref()?;
        let file = File::open(folder.join("certificate.der")).ok()?;
        let mut certificate = Vec::new();
        let read = file
            .take(CERTIFICATE_BYTES_MAX)
            .read_to_end(&mut certificate);
        read.ok().map(|_| certificate)
    }

    /// Keeps a certificate. Where that fails it is used all the same, until the worker ends.
    pub(super) fn keep(&self, certificate: &[u8]) {
        let Some((folder, _)) = &self.folder else {
            return;
        };
        let path = folder.join("certificate.der");
        if let Err(error) = place::replace(&path, certificate, 0o600) {
            let path = path.display();
            tracing::warn!(%path, %error, "the worker's certificate cannot be kept: a restart needs another token");
        }
    }
}

/// The key in a file, or a fresh one that is put there: before it is used, so that a worker that asks for a
/// certificate again is known as the one that asked before.
fn key(path: &Path) -> Result<KeyPair, RunError> {
    match fs::read_to_string(path) {
        Ok(text) => {
            if let Ok(key) = KeyPair::from_pem(&text)
                && key.is_compatible(&PKCS_ECDSA_P256_SHA256)
            {
                return Ok(key);
            }
            tracing::warn!(path = %path.display(), "the worker's key cannot be read: it gets a new one");
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(refused("read", path)(error)),
    }
    let key = fresh_key()?;
    let pem = key.serialize_pem();
    place::replace(path, pem.as_bytes(), 0o600).map_err(refused("write", path))?;
    Ok(key)
}

fn fresh_key() -> Result<KeyPair, RunError> {
    KeyPair::generate_for(&PKCS_ECDSA_P256_SHA256)
        .map_err(|error| RunError::Random(error.to_string()))
}

fn refused(attempted: &'static str, path: &Path) -> impl FnOnce(io::Error) -> RunError {
    let path = path.to_owned();
    move |source| RunError::State {
        attempted,
        path,
        source,
    }
}

#[cfg(test)]
mod tests {
    use model::Digest;
    use wire::auth::Token;

    use super::*;

    #[test]
    fn each_worker_has_a_place_of_its_own_and_finds_it_again() {
        let folder = tempfile::tempdir().unwrap();
        let file = TokenFile {
            id: 3,
            role: "worker".into(),
            secret: Token::from_random([1; 32]),
            authority: Digest([7; 32]),
            addresses: vec!["192.0.2.1:7".into()],
        };
        let take = || Place::take(Some(folder.path()), &file).unwrap();
        let (first, second) = (take(), take());
        let key = first.key.public_key_raw().to_vec();
        assert_ne!(second.key.public_key_raw(), key);
        assert_eq!(first.certificate(), None);
        first.keep(b"certificate");
        drop(first);
        let again = take();
        assert_eq!(again.key.public_key_raw(), key);
        assert_eq!(again.certificate().unwrap(), b"certificate");
        let path = folder.path().join("0707070707070707-3/0/key.pem");
        let mode =
            std::os::unix::fs::PermissionsExt::mode(&fs::metadata(&path).unwrap().permissions());
        assert_eq!(mode & 0o777, 0o600);
        drop(again);
        fs::write(&path, "what?").unwrap();
        assert_ne!(take().key.public_key_raw(), key);
    }
}
