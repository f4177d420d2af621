//! Tokens for other machines: what was given away, and what became of it.
//!
//! Only digests of secrets are kept. The whole list stands in one file, which is replaced whenever it changes,
//! durably and before anybody is answered: a token that was used up or revoked stays so, whatever happens. Whoever
//! only asks looks at a snapshot, and never waits for the disk.

use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};

use model::Digest;
use serde::{Deserialize, Serialize};
use tokio::sync::{Mutex, watch};
use wire::Failure;
use wire::auth::Token;
use wire::proto::{self, ErrorKind};
use wire::tls::certificate::{moment, now};

use super::role::Role;
use crate::state::{StateError, replace, secret};

/// Most tokens that are remembered.
const TOKENS_MAX: usize = 1_000;

/// Most workers of one token.
const USES_MAX: u32 = 100_000;

/// Longest life of a token, seconds: a year.
const LIFE_MAX: u64 = 366 * 24 * 3600;

/// How long a token is remembered after it and all its certificates have ended, so that whoever still tries it
/// is told why it does not open, seconds.
const REMEMBERED: u64 = 7 * 24 * 3600;

/// How many of the last keys of a token are kept, to know a worker that asks again.
const KEYS_KEPT: usize = 16;

/// All tokens.
#[derive(Debug)]
pub(crate) struct Tokens {
    kept: Arc<Kept>,
    /// Held while the list is changed.
    changing: Arc<Mutex<()>>,
    /// Counts revocations.
    revocations: watch::Sender<u64>,
}

/// The list as it counts, and its file.
#[derive(Debug)]
struct Kept {
    path: PathBuf,
    list: RwLock<Arc<List>>,
}

impl Kept {
    fn list(&self) -> Arc<List> {
        self.list
            .read()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Puts another list in its place, durably before it counts.
    fn replace(&self, list: List) -> Result<(), StateError> {
        let text = serde_json::to_vec(&list).expect("numbers and text are JSON");
        replace(&self.path, &text, 0o600)?;
        *self.list.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(list);
        Ok(())
    }
}

/// Tokens by rising number, as their file holds them.
#[derive(Clone, Default, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    last: u64,
    tokens: Vec<Record>,
}

/// One token. Times are seconds since 1970.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    id: u64,
    role: Role,
    digest: String,
    made: u64,
    expires: u64,
    /// How many workers may join by it; none for users.
    uses: Option<u32>,
    used: u32,
    revoked: Option<u64>,
    /// Until when certificates of it would count.
    certificates_until: u64,
    /// Digests of the keys that joined last.
    keys: Vec<String>,
}

impl Record {
    fn message(&self) -> proto::Token {
        let milliseconds = |seconds: u64| seconds.saturating_mul(1_000);
        proto::Token {
            id: self.id,
            role: self.role.message().into(),
            made_unix_ms: milliseconds(self.made),
            expires_unix_ms: milliseconds(self.expires),
            uses: self.uses,
            used: self.used,
            revoked_unix_ms: self.revoked.map(milliseconds),
            certificates_until_unix_ms: milliseconds(self.certificates_until),
        }
    }

    /// When it is forgotten.
    fn forgotten_at(&self) -> u64 {
        let ends = self.revoked.unwrap_or(self.expires);
        ends.max(self.certificates_until).saturating_add(REMEMBERED)
    }

    /// Whether it opens at all.
    fn check(&self, now: u64) -> Result<(), Failure> {
        let Self { id, .. } = self;
        let why = if let Some(at) = self.revoked {
            format!("token {id} was revoked at {}", moment(at))
        } else if now > self.expires {
            format!(
                "token {id} expired at {}; the coordinator's clock says {}",
                moment(self.expires),
                moment(now)
            )
        } else {
            return Ok(());
        };
        Err(refused(format!("{why}: {ANOTHER}")))
    }
}

/// What to do about a token that does not open.
const ANOTHER: &str = "make another with `flyby token create` where the coordinator runs";

fn refused(sentence: String) -> Failure {
    Failure::new(ErrorKind::Unauthenticated, sentence)
}

fn unknown() -> Failure {
    refused(format!(
        "the token is not this coordinator's, or was forgotten after its end: on the coordinator's machine it stands in the file `token` of the state folder; for other machines, {ANOTHER}"
    ))
}

impl Tokens {
    /// Reads the list of a file; there need be none.
    pub(crate) fn open(path: PathBuf) -> Result<Self, StateError> {
        let list = match secret(&path)? {
            None => List::default(),
            Some(text) => serde_json::from_str(&text).map_err(|_| StateError::Nonsense {
                path: path.clone(),
                expected: "a list of tokens",
            })?,
        };
        let list = RwLock::new(Arc::new(list));
        Ok(Self {
            kept: Arc::new(Kept { path, list }),
            changing: Arc::default(),
            revocations: watch::Sender::new(0),
        })
    }

    fn list(&self) -> Arc<List> {
        self.kept.list()
    }

    /// The file that holds them.
    pub(crate) fn path(&self) -> &Path {
        &self.kept.path
    }

    /// Changes the list, durably before it counts. Whoever asked may leave meanwhile: what was begun is ended.
    async fn change<T>(
        &self,
        change: impl FnOnce(&mut List, u64) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let changing = self.changing.clone().lock_owned().await;
        let (mut list, now) = ((*self.list()).clone(), now());
        list.tokens.retain(|token| token.forgotten_at() > now);
        let answer = change(&mut list, now)?;
        let kept = self.kept.clone();
        let written = tokio::task::spawn_blocking(move || {
            let written = kept.replace(list);
            drop(changing);
            written
        });
        let written = written.await.map_err(|error| error.to_string());
        if let Err(error) = written.and_then(|written| written.map_err(|error| error.to_string())) {
            tracing::error!(error, "the list of tokens cannot be written");
            return Err(Failure::later(
                ErrorKind::Storage,
                "the coordinator's disk refused: what was asked of its tokens is not done",
            ));
        }
        Ok(answer)
    }

    /// Makes one.
    pub(crate) async fn create(
        &self,
        role: Role,
        uses: Option<u32>,
        life: u64,
    ) -> Result<(proto::Token, Token), Failure> {
        let bad = |sentence: String| Err(Failure::new(ErrorKind::BadRequest, sentence));
        if !(1..=LIFE_MAX).contains(&life) {
            return bad("a token lives for 1 second to 366 days".into());
        }
        let uses = match (role, uses) {
            (Role::Worker, uses) => Some(uses.unwrap_or(1)),
            (_, None) => None,
            (role, Some(_)) => {
                return bad(format!(
                    "a token of the role `{role}` is shown at every call and not used up: only tokens for workers have a number of uses"
                ));
            }
        };
        if uses.is_some_and(|uses| !(1..=USES_MAX).contains(&uses)) {
            return bad(format!("1 to {USES_MAX} workers may join by one token"));
        }
        let mut bits = [0; 32];
        getrandom::fill(&mut bits)
            .map_err(|error| Failure::later(ErrorKind::Internal, error.to_string()))?;
        let secret = Token::from_random(bits);
        let digest = secret.digest().to_string();
        let made = self
            .change(|list, now| {
                if list.tokens.len() >= TOKENS_MAX {
                    return Err(Failure::new(
                        ErrorKind::Limit,
                        format!("there are {TOKENS_MAX} tokens already: they are forgotten a week after they and their certificates have ended"),
                    ));
                }
                list.last += 1;
                let record = Record {
                    id: list.last,
                    role,
                    digest,
                    made: now,
                    expires: now + life,
                    uses,
                    used: 0,
                    revoked: None,
                    certificates_until: 0,
                    keys: Vec::new(),
                };
                let message = record.message();
                list.tokens.push(record);
                Ok(message)
            })
            .await?;
        Ok((made, secret))
    }

    /// All that are remembered.
    pub(crate) fn all(&self) -> Vec<proto::Token> {
        let (list, now) = (self.list(), now());
        let there = list
            .tokens
            .iter()
            .filter(|token| token.forgotten_at() > now);
        there.map(Record::message).collect()
    }

    /// Ends one, and what was got by it.
    pub(crate) async fn revoke(&self, id: u64) -> Result<proto::Token, Failure> {
        let revoked = self.change(|list, now| {
            let record = list.tokens.iter_mut().find(|record| record.id == id);
            let record = record.ok_or_else(|| {
                Failure::new(ErrorKind::NotFound, format!("there is no token {id}"))
            })?;
            record.revoked.get_or_insert(now);
            Ok(record.message())
        });
        let revoked = revoked.await?;
        self.revocations.send_modify(|count| *count += 1);
        Ok(revoked)
    }

    /// The role of whoever says this secret.
    pub(crate) fn role(&self, secret: &Token) -> Result<Role, Failure> {
        let list = self.list();
        let record = list.find(secret).ok_or_else(unknown)?;
        record.check(now())?;
        Ok(record.role)
    }

    /// Counts a worker that joins with a key, whose certificate will count until then; answers the token's number.
    pub(crate) async fn join(
        &self,
        secret: &Token,
        key: Digest,
        until: u64,
    ) -> Result<u64, Failure> {
        let key = key.to_string();
        self.change(|list, now| {
            let digest = secret.digest().to_string();
            let record = list.tokens.iter_mut().find(|record| record.digest == digest);
            let record = record.ok_or_else(unknown)?;
            record.check(now)?;
            if record.role != Role::Worker {
                return Err(Failure::new(
                    ErrorKind::Forbidden,
                    format!("token {} has the role `{}`, and workers join by one of the role `worker`: `flyby token create --role worker`", record.id, record.role),
                ));
            }
            if !record.keys.contains(&key) {
                if record.uses.is_some_and(|uses| record.used >= uses) {
                    return Err(refused(format!(
                        "token {} is used up: {} workers have joined by it; {ANOTHER}, with `--uses N` for N workers",
                        record.id, record.used
                    )));
                }
                record.used += 1;
                let kept = record.keys.len().saturating_sub(KEYS_KEPT - 1);
                record.keys.drain(..kept);
                record.keys.push(key);
            }
            record.certificates_until = record.certificates_until.max(until);
            Ok(record.id)
        })
        .await
    }

    /// Notes that a certificate of a token was renewed, and will count until then.
    pub(crate) async fn renew(&self, id: u64, until: u64) -> Result<(), Failure> {
        self.change(|list, _| {
            let record = list.tokens.iter_mut().find(|record| record.id == id);
            let record = record.ok_or_else(unknown)?;
            record.certificates_until = record.certificates_until.max(until);
            Ok(())
        })
        .await
    }

    /// Whether certificates of a token still count. One that is not remembered has none that live.
    pub(crate) fn check_certificates(&self, id: u64) -> Result<(), Failure> {
        let list = self.list();
        let record = list.tokens.iter().find(|record| record.id == id);
        match record.ok_or_else(unknown)?.revoked {
            None => Ok(()),
            Some(at) => Err(refused(format!(
                "the token {id}, by which this worker joined, was revoked at {}, and its certificates with it: {ANOTHER}",
                moment(at)
            ))),
        }
    }

    /// Where revocations are heard of.
    pub(crate) fn revocations(&self) -> watch::Receiver<u64> {
        self.revocations.subscribe()
    }
}

impl List {
    fn find(&self, secret: &Token) -> Option<&Record> {
        // Digests of secrets may be compared in any time.
        let digest = secret.digest().to_string();
        self.tokens.iter().find(|record| record.digest == digest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(byte: u8) -> Digest {
        Digest([byte; 32])
    }

    fn open(folder: &tempfile::TempDir) -> Tokens {
        Tokens::open(folder.path().join("tokens.json")).unwrap()
    }

    #[tokio::test]
    async fn a_token_is_used_up_across_restarts_and_the_same_key_is_one_use() {
        let folder = tempfile::tempdir().unwrap();
        let tokens = open(&folder);
        let (made, secret) = tokens.create(Role::Worker, Some(2), 3600).await.unwrap();
        assert_eq!(tokens.join(&secret, key(1), 9).await, Ok(made.id));
        let tokens = open(&folder);
        assert_eq!(tokens.join(&secret, key(1), 9).await, Ok(made.id));
        assert_eq!(tokens.join(&secret, key(2), 9).await, Ok(made.id));
        let said = tokens.join(&secret, key(3), 9).await.unwrap_err();
        assert!(said.sentence.contains("used up"), "{said}");
        assert_eq!(open(&folder).all()[0].used, 2);
        let text = std::fs::read_to_string(folder.path().join("tokens.json")).unwrap();
        assert!(!text.contains(secret.reveal()));
    }

    #[tokio::test]
    async fn a_revoked_token_takes_its_certificates_along() {
        let folder = tempfile::tempdir().unwrap();
        let tokens = open(&folder);
        let (made, secret) = tokens.create(Role::Worker, None, 3600).await.unwrap();
        tokens.join(&secret, key(1), now() + 60).await.unwrap();
        assert_eq!(tokens.check_certificates(made.id), Ok(()));
        tokens.revoke(made.id).await.unwrap();
        let tokens = open(&folder);
        for refused in [
            tokens.check_certificates(made.id).unwrap_err(),
            tokens.join(&secret, key(1), 9).await.unwrap_err(),
            tokens.role(&secret).unwrap_err(),
        ] {
            assert!(refused.sentence.contains("revoked"), "{refused}");
        }
        assert!(tokens.revoke(99).await.is_err());
    }

    #[tokio::test]
    async fn only_workers_join_and_only_their_tokens_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let tokens = open(&folder);
        let (_, secret) = tokens.create(Role::Submit, None, 3600).await.unwrap();
        assert_eq!(tokens.role(&secret), Ok(Role::Submit));
        let said = tokens.join(&secret, key(1), 9).await.unwrap_err();
        assert_eq!(said.kind, ErrorKind::Forbidden);
        assert!(tokens.create(Role::View, Some(3), 3600).await.is_err());
        for (uses, life) in [(0, 60), (USES_MAX + 1, 60), (1, 0), (1, LIFE_MAX + 1)] {
            let refused = tokens.create(Role::Worker, Some(uses), life).await;
            assert!(refused.is_err(), "{uses} {life}");
        }
        let other = Token::from_random([1; 32]);
        assert!(
            tokens
                .role(&other)
                .unwrap_err()
                .sentence
                .contains("not this coordinator's")
        );
    }

    #[test]
    fn what_has_ended_is_said_and_in_the_end_forgotten() {
        let record = Record {
            id: 1,
            role: Role::View,
            digest: String::new(),
            made: 0,
            expires: 100,
            uses: None,
            used: 0,
            revoked: None,
            certificates_until: 0,
            keys: Vec::new(),
        };
        assert_eq!(record.check(100), Ok(()));
        let said = record.check(101).unwrap_err().sentence;
        assert!(
            said.contains("1970-01-01 00:01:40 UTC") && said.contains("00:01:41"),
            "{said}"
        );
        assert_eq!(record.forgotten_at(), 100 + REMEMBERED);
    }
}
