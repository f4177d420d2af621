//! What a certificate of a farm says: whose it is, and from when until when.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use model::Digest;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject as _;
use time::OffsetDateTime;
use yasna::tags::TAG_UTCTIME;
use yasna::{ASN1Error, ASN1ErrorKind, ASN1Result, BERReader, BERReaderSeq, Tag};

/// What a certificate says. Times are whole seconds since 1970 (UTC).
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Claims {
    /// Whose it is: its subject's common name.
    pub name: String,
    /// It counts from then on.
    pub not_before: u64,
    /// It counts until then.
    pub not_after: u64,
}

/// How a certificate's time stands to a clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Age {
    /// It does not count yet.
    TooYoung,
    /// It counts.
    Alive,
    /// It counts no more.
    Expired,
}

impl Claims {
    /// Reads a certificate (DER). It is not verified here: TLS did that, or its reader wrote it.
    /// `None`: it is no certificate that a farm makes.
    pub fn read(certificate: &[u8]) -> Option<Self> {
        yasna::parse_der(certificate, |reader| {
            reader.read_sequence(|outer| {
                let claims = outer.next().read_sequence(to_be_signed)?;
                // The signature's algorithm and the signature.
                outer.next().read_der()?;
                outer.next().read_der()?;
                Ok(claims)
            })
        })
        .ok()
    }

    /// How it stands to a clock that says `now`, in seconds since 1970.
    pub fn age(&self, now: u64) -> Age {
        if now < self.not_before {
            Age::TooYoung
        } else if now > self.not_after {
            Age::Expired
        } else {
            Age::Alive
        }
    }
}

fn to_be_signed(fields: &mut BERReaderSeq<'_, '_>) -> ASN1Result<Claims> {
    fields
        .next()
        .read_tagged(Tag::context(0), |version| version.read_i64())?;
    // Serial number, algorithm, issuer.
    for _ in 0..3 {
        fields.next().read_der()?;
    }
    let (not_before, not_after) = fields.next().read_sequence(|validity| {
        let not_before = moment_of(validity.next())?;
        Ok((not_before, moment_of(validity.next())?))
    })?;
    let mut names = fields.next().read_sequence(|subject| {
        subject.next().collect_set_of(|name| {
            name.read_sequence(|pair| {
                pair.next().read_oid()?;
                pair.next().read_utf8string()
            })
        })
    })?;
    let name = names.pop().filter(|_| names.is_empty());
    let name = name.ok_or(ASN1Error::new(ASN1ErrorKind::Invalid))?;
    // The key, and what the key may be used for.
    while fields.next().read_der().is_ok() {}
    Ok(Claims {
        name,
        not_before,
        not_after,
    })
}

fn moment_of(reader: BERReader<'_, '_>) -> ASN1Result<u64> {
    // Years from 2050 on are written in four digits.
    let at = match reader.lookahead_tag()? {
        TAG_UTCTIME => reader.read_utctime()?.datetime().unix_timestamp(),
        _ => reader.read_generalized_time()?.datetime().unix_timestamp(),
    };
    u64::try_from(at).map_err(|_| ASN1Error::new(ASN1ErrorKind::Invalid))
}

/// The first certificate of a PEM file (DER), if there is one.
pub fn of_pem(text: &str) -> Option<Vec<u8>> {
    let certificate = CertificateDer::from_pem_slice(text.as_bytes()).ok()?;
    Some(certificate.to_vec())
}

/// The fingerprint by which an authority is known: the BLAKE3 digest of its certificate (DER).
pub fn fingerprint(certificate: &[u8]) -> Digest {
    Digest(blake3::hash(certificate).into())
}

/// This machine's clock, in seconds since 1970.
pub fn now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.unwrap_or(Duration::ZERO).as_secs()
}

/// A time as people read it, such as `2026-11-27 22:39:26 UTC`.
pub fn moment(unix: u64) -> String {
    let at = i64::try_from(unix)
        .ok()
        .and_then(|unix| OffsetDateTime::from_unix_timestamp(unix).ok());
    match at {
        Some(at) => format!(
            "{} {:02}:{:02}:{:02} UTC",
            at.date(),
            at.hour(),
            at.minute(),
            at.second()
        ),
        None => format!("{unix} s after 1970"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn certificate(until: u64) -> Vec<u8> {
        let key = rcgen::KeyPair::generate().unwrap();
        let mut params = rcgen::CertificateParams::new(vec!["a.b".into()]).unwrap();
        params.not_before = (UNIX_EPOCH + Duration::from_secs(1_000)).into();
        params.not_after = (UNIX_EPOCH + Duration::from_secs(until)).into();
        params.distinguished_name = rcgen::DistinguishedName::new();
        params
            .distinguished_name
            .push(rcgen::DnType::CommonName, "worker of token 7");
        params.self_signed(&key).unwrap().der().to_vec()
    }

    #[test]
    fn a_certificate_says_whose_it_is_and_until_when() {
        // The second lies beyond 2050, which is written in another way.
        for until in [2_000, 4_000_000_000] {
            let claims = Claims::read(&certificate(until)).unwrap();
            assert_eq!(claims.name, "worker of token 7");
            assert_eq!((claims.not_before, claims.not_after), (1_000, until));
            assert_eq!(claims.age(999), Age::TooYoung);
            assert_eq!(claims.age(until), Age::Alive);
            assert_eq!(claims.age(until + 1), Age::Expired);
        }
    }

    #[test]
    fn what_is_no_certificate_is_none() {
        let good = certificate(2_000);
        assert_eq!(Claims::read(b""), None);
        for end in 0..good.len() {
            assert_eq!(Claims::read(&good[..end]), None, "{end}");
        }
        // Whatever a byte is changed to, reading ends with an answer.
        for place in 0..good.len() {
            let mut bad = good.clone();
            bad[place] ^= 0xff;
            let _ = Claims::read(&bad);
        }
    }

    #[test]
    fn moments_are_legible() {
        assert_eq!(moment(0), "1970-01-01 00:00:00 UTC");
        assert_eq!(moment(1_795_819_166), "2026-11-27 22:39:26 UTC");
    }
}
