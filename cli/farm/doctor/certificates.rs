//! Certificates and the files of their keys.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};

use wire::place;
use wire::tls::certificate::{Age, Claims, moment, now, of_pem};
use wire::tls::token_file::TokenFile;

use super::Finding;

/// An authority that counts for less than that should be replaced in good time, seconds.
const AUTHORITY_LOW: u64 = 365 * 86_400;

/// Most certificates of workers that are looked at.
const JOINED_MAX: usize = 10_000;

/// The file of a token.
pub(super) fn token_file(path: &Path) -> Finding {
    match TokenFile::read(path) {
        Ok(file) => Finding::fine(
            "token",
            format!(
                "number {}, for the role `{}`, leads to {}",
                file.id,
                file.role,
                file.addresses.join(" and ")
            ),
        ),
        Err(error) => Finding::bad("token", error.to_string(), "`flyby token create` makes one"),
    }
}

/// The authority of a state folder; nothing where there is none.
pub(super) fn authority(state: &Path) -> Vec<Finding> {
    let path = state.join(place::AUTHORITY_FILE);
    let Ok(text) = fs::read_to_string(&path) else {
        return Vec::new();
    };
    let mut findings = modes(
        "authority",
        &[path, state.join(place::TOKENS_FILE)],
        "where somebody may have read the authority's key, move it away, start the coordinator again and make new tokens",
    );
    let claims = of_pem(&text).and_then(|certificate| Claims::read(&certificate));
    findings.push(match claims {
        None => Finding::bad(
            "authority",
            "the certificate authority of the state folder cannot be read",
            "put a copy back; without one, move `authority.pem` away: the coordinator makes another, and every worker and user of other machines needs a new token",
        ),
        Some(claims) if claims.age(now()) == Age::TooYoung => Finding::bad(
            "authority",
            format!(
                "the certificate authority counts from {} on, and this machine's clock says {}",
                moment(claims.not_before),
                moment(now())
            ),
            "this clock was set back: let it follow a time server",
        ),
        Some(claims) if claims.not_after < now() + AUTHORITY_LOW => Finding::doubtful(
            "authority",
            format!("the certificate authority counts until {}", moment(claims.not_after)),
            "before that, move `authority.pem` away and start the coordinator again; then make new tokens",
        ),
        Some(claims) => Finding::fine(
            "authority",
            format!("counts until {}; only its owner can read its key", moment(claims.not_after)),
        ),
    });
    findings
}

/// The coordinator's own certificate, by its own clock.
pub(super) fn own(until_unix_ms: u64, now_unix_ms: u64) -> Finding {
    let until = moment(until_unix_ms / 1_000);
    match until_unix_ms > now_unix_ms {
        true => Finding::fine(
            "certificate",
            format!("the coordinator's own counts until {until}; it is renewed by itself"),
        ),
        // It is made anew when somebody asks for it.
        false => Finding::fine(
            "certificate",
            format!(
                "nobody has asked for the coordinator's own since {until}; it is renewed when somebody does"
            ),
        ),
    }
}

/// Certificates by which workers of this state folder joined; nothing where there are none.
pub(super) fn joined(state: &Path) -> Vec<Finding> {
    let folders = |path: &Path| {
        let listed = fs::read_dir(path).into_iter().flatten().flatten();
        listed.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    let tokens = folders(&state.join(place::JOINED_FOLDER));
    let places: Vec<PathBuf> = tokens
        .iter()
        .flat_map(|token| folders(token))
        .take(JOINED_MAX)
        .collect();
    if places.is_empty() {
        return Vec::new();
    }
    let keys: Vec<PathBuf> = places.iter().map(|place| place.join("key.pem")).collect();
    let mut findings = modes(
        "joined",
        &keys,
        "where somebody may have read it, revoke the token that the worker joined by",
    );
    let claims: Vec<Claims> = places
        .iter()
        .filter_map(|place| Claims::read(&fs::read(place.join("certificate.der")).ok()?))
        .collect();
    let now = now();
    let early = claims
        .iter()
        .find(|claims| claims.age(now) == Age::TooYoung);
    if let Some(claims) = early {
        findings.push(Finding::bad(
            "joined",
            format!(
                "a worker's certificate counts from {} on, and this machine's clock says {}",
                moment(claims.not_before),
                moment(now)
            ),
            "one of the two clocks is wrong: let both machines follow a time server",
        ));
    }
    let expired = claims
        .iter()
        .filter(|claims| claims.age(now) == Age::Expired)
        .count();
    let alive = claims.len() - expired;
    findings.push(Finding::fine(
        "joined",
        format!("{alive} certificates of workers count, {expired} have expired; workers that start again with an expired one need a token that still opens"),
    ));
    findings
}

/// Those of the files that others can read.
fn modes(part: &'static str, files: &[PathBuf], and: &str) -> Vec<Finding> {
    let open = |path: &&PathBuf| {
        fs::metadata(path).is_ok_and(|metadata| metadata.permissions().mode() & 0o077 != 0)
    };
    let open = files.iter().filter(open);
    open.map(|path| {
        let shown = path.display();
        Finding::bad(
            part,
            format!("others can read {shown}"),
            format!("`chmod 600 {shown}`; {and}"),
        )
    })
    .collect()
}
