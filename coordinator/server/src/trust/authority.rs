//! The farm's certificate authority.
//!
//! It is made when a coordinator first starts over its state folder, and kept in one file with its key, so that
//! there is never one without the other. What it signs is short-lived: the coordinator's own certificate, which is
//! made anew at a handshake once two thirds of its life are over (so that nothing must run for it, and a machine
//! that slept wakes up with a good one), and those of workers, who ask for a fresh one in time.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, UNIX_EPOCH};

use model::{Digest, Span};
use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose, PKCS_ECDSA_P256_SHA256, PublicKeyData, SignatureAlgorithm,
};
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::{ClientHello, ResolvesServerCert};
use rustls::sign::CertifiedKey;
use wire::Failure;
use wire::proto::ErrorKind;
use wire::tls::certificate::{Claims, fingerprint, now};
use wire::tls::{COORDINATOR, provider};

use crate::state::{StateError, io_error, replace, secret};

/// How long an authority counts: as long as a farm can be thought to live. Nothing renews it, since every token and
/// every worker knows it by its fingerprint.
const AUTHORITY_YEARS: u64 = 30;

/// How far certificates reach back: clocks of clusters are minutes behind at times.
const BACKDATED: u64 = 10 * 60;

const YEAR: u64 = 366 * 24 * 3600;

/// Bytes of a worker's public key: an uncompressed point of P-256.
const KEY_BYTES: usize = 65;

/// What stands before the token's number in the name of a worker's certificate.
const WORKER: &str = "flyby worker of token ";

/// The authority, and the coordinator's own certificate.
pub(crate) struct Authority {
    key: KeyPair,
    certificate: CertificateDer<'static>,
    /// How long what it signs counts, seconds.
    life: u64,
    own: Mutex<Own>,
}

/// The coordinator's certificate.
struct Own {
    key: Arc<CertifiedKey>,
    claims: Claims,
}

impl std::fmt::Debug for Authority {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Authority({})", self.fingerprint())
    }
}

impl Authority {
    /// Reads it, or makes one where there is none.
    pub(crate) fn open(path: &Path, life: Span) -> Result<Self, StateError> {
        let text = match secret(path)? {
            Some(text) => text,
            None => {
                let text = found().map_err(|error| failed("make", path, error))?;
                replace(path, text.as_bytes(), 0o600)?;
                text
            }
        };
        let nonsense = || StateError::Nonsense {
            path: path.to_owned(),
            expected: "a certificate authority with its key (removing it makes every token and every worker's certificate worthless)",
        };
        let certificate =
            CertificateDer::from_pem_slice(text.as_bytes()).map_err(|_| nonsense())?;
        let key = PrivateKeyDer::from_pem_slice(text.as_bytes()).map_err(|_| nonsense())?;
        let key = KeyPair::try_from(&key).map_err(|_| nonsense())?;
        let life = (life.0 / 1_000_000).max(1);
        let own = own(&key, &certificate, life).map_err(|error| failed("use", path, error))?;
        Ok(Self {
            key,
            certificate,
            life,
            own: Mutex::new(own),
        })
    }

    /// Its certificate's.
    pub(crate) fn fingerprint(&self) -> Digest {
        fingerprint(&self.certificate)
    }

    /// Its certificate, by which those that it signed are verified.
    pub(crate) fn certificate(&self) -> &CertificateDer<'static> {
        &self.certificate
    }

    /// Until when the coordinator's own certificate counts, seconds since 1970.
    pub(crate) fn own_until(&self) -> u64 {
        let own = self.own.lock().unwrap_or_else(PoisonError::into_inner);
        own.claims.not_after
    }

    /// When what it signs now would expire, seconds since 1970.
    pub(crate) fn until(&self) -> u64 {
        now() + self.life
    }

    /// Signs a worker's certificate.
    pub(crate) fn sign_worker(&self, public_key: &[u8], token: u64) -> Result<Vec<u8>, Failure> {
        let key = WorkerKey::new(public_key)?;
        let mut params = short_lived(self.life);
        params.distinguished_name = name(&format!("{WORKER}{token}"));
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
        let signed = params.signed_by(&key, &issuer(&self.key));
        let signed = signed.map_err(|error| {
            tracing::error!(%error, "a worker's certificate cannot be signed");
            Failure::new(ErrorKind::Internal, "the certificate cannot be signed")
        })?;
        Ok(signed.der().to_vec())
    }

    /// The token that a worker's certificate was got by; `None` where it is not a worker's.
    pub(crate) fn token_of(claims: &Claims) -> Option<u64> {
        claims.name.strip_prefix(WORKER)?.parse().ok()
    }
}

impl ResolvesServerCert for Authority {
    fn resolve(&self, _: ClientHello<'_>) -> Option<Arc<CertifiedKey>> {
        let mut current = self.own.lock().unwrap_or_else(PoisonError::into_inner);
        let now = now();
        let left = current.claims.not_after.saturating_sub(now);
        // The second condition holds after a clock was set back.
        if left * 3 < self.life || left > self.life {
            match own(&self.key, &self.certificate, self.life) {
                Ok(fresh) => {
                    tracing::debug!("the coordinator has a fresh certificate");
                    *current = fresh;
                }
                Err(error) => {
                    tracing::error!(%error, "the coordinator's certificate cannot be renewed");
                }
            }
        }
        Some(current.key.clone())
    }
}

/// A new authority with its key, as its file holds it.
fn found() -> Result<String, String> {
    let key = KeyPair::generate_for(&PKCS_ECDSA_P256_SHA256).map_err(|error| error.to_string())?;
    let mut params = authority_params();
    let (from, until) = (now() - BACKDATED, now() + AUTHORITY_YEARS * YEAR);
    params.not_before = (UNIX_EPOCH + Duration::from_secs(from)).into();
    params.not_after = (UNIX_EPOCH + Duration::from_secs(until)).into();
    let certificate = params
        .self_signed(&key)
        .map_err(|error| error.to_string())?;
    Ok(format!("{}{}", certificate.pem(), key.serialize_pem()))
}

fn authority_params() -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name = name("flyby authority");
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![
        KeyUsagePurpose::KeyCertSign,
        KeyUsagePurpose::DigitalSignature,
    ];
    params
}

fn issuer(key: &KeyPair) -> Issuer<'static, &KeyPair> {
    Issuer::new(authority_params(), key)
}

fn name(common: &str) -> DistinguishedName {
    let mut name = DistinguishedName::new();
    name.push(DnType::CommonName, common);
    name
}

fn short_lived(life: u64) -> CertificateParams {
    let mut params = CertificateParams::default();
    let now = now();
    params.not_before = (UNIX_EPOCH + Duration::from_secs(now.saturating_sub(BACKDATED))).into();
    params.not_after = (UNIX_EPOCH + Duration::from_secs(now + life)).into();
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.use_authority_key_identifier_extension = true;
    params
}

/// A fresh certificate for the coordinator itself, with a fresh key.
fn own(
    authority: &KeyPair,
    certificate: &CertificateDer<'static>,
    life: u64,
) -> Result<Own, String> {
    let said = |error: rcgen::Error| error.to_string();
    let key = KeyPair::generate_for(&PKCS_ECDSA_P256_SHA256).map_err(said)?;
    let mut params = short_lived(life);
    params.subject_alt_names = vec![rcgen::SanType::DnsName(
        COORDINATOR.try_into().map_err(said)?,
    )];
    params.distinguished_name = name(COORDINATOR);
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
    let own = params.signed_by(&key, &issuer(authority)).map_err(said)?;
    let claims = Claims::read(own.der()).ok_or("it cannot be read back")?;
    // The authority goes along: clients know its fingerprint alone.
    let chain = vec![own.der().clone(), certificate.clone()];
    let key = PrivateKeyDer::try_from(key.serialize_der())?;
    let key = CertifiedKey::from_der(chain, key, &provider()).map_err(|error| error.to_string())?;
    Ok(Own {
        key: Arc::new(key),
        claims,
    })
}

fn failed(attempted: &'static str, path: &Path, why: String) -> StateError {
    io_error(attempted, path)(std::io::Error::other(why))
}

/// A worker's public key.
struct WorkerKey([u8; KEY_BYTES]);

impl WorkerKey {
    fn new(bytes: &[u8]) -> Result<Self, Failure> {
        match <[u8; KEY_BYTES]>::try_from(bytes) {
            Ok(bytes) if bytes[0] == 4 => Ok(Self(bytes)),
            _ => Err(Failure::new(
                ErrorKind::BadRequest,
                "the public key is no uncompressed point of P-256",
            )),
        }
    }
}

impl PublicKeyData for WorkerKey {
    fn der_bytes(&self) -> &[u8] {
        &self.0
    }

    fn algorithm(&self) -> &'static SignatureAlgorithm {
        &PKCS_ECDSA_P256_SHA256
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    #[test]
    fn it_is_made_once_and_only_its_owner_may_read_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("authority.pem");
        let life = Span::from_secs(60);
        let first = Authority::open(&path, life).unwrap().fingerprint();
        assert_eq!(Authority::open(&path, life).unwrap().fingerprint(), first);
        let mode = std::fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o640)).unwrap();
        let said = Authority::open(&path, life).unwrap_err().to_string();
        assert!(said.contains("mode 640"), "{said}");
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
        std::fs::write(&path, "hello").unwrap();
        let said = Authority::open(&path, life).unwrap_err().to_string();
        assert!(
            said.contains("does not hold a certificate authority"),
            "{said}"
        );
    }

    #[test]
    fn a_workers_certificate_names_its_token() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("authority.pem");
        let authority = Authority::open(&path, Span::from_secs(60)).unwrap();
        let key = KeyPair::generate().unwrap();
        let signed = authority.sign_worker(key.public_key_raw(), 7).unwrap();
        let claims = Claims::read(&signed).unwrap();
        assert_eq!(Authority::token_of(&claims), Some(7));
        assert!(claims.not_after <= authority.until() && claims.not_after + 5 > authority.until());
        let own = Claims::read(authority.own.lock().unwrap().key.cert[0].as_ref()).unwrap();
        assert_eq!(
            (own.name.as_str(), Authority::token_of(&own)),
            (COORDINATOR, None)
        );
        for bad in [&[][..], &[4; 64], &[0; 65]] {
            assert!(authority.sign_worker(bad, 7).is_err());
        }
    }
}
