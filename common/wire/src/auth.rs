//! The token that guards a coordinator, as metadata `authorization: Bearer <token>`.

use tonic::metadata::{Ascii, MetadataMap, MetadataValue};
use tonic::service::Interceptor;
use tonic::{Request, Status};

use crate::Failure;
use crate::proto::ErrorKind;

/// A coordinator's token: 64 hexadecimal digits. Its `Debug` hides it.
#[derive(Clone)]
pub struct Token {
    text: String,
    header: MetadataValue<Ascii>,
}

impl std::fmt::Debug for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Token(hidden)")
    }
}

/// The text is not 64 hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a token is 64 hexadecimal digits")]
pub struct NotAToken;

impl std::str::FromStr for Token {
    type Err = NotAToken;

    fn from_str(text: &str) -> Result<Self, NotAToken> {
        let text = text.trim().to_ascii_lowercase();
        if text.len() != 64 || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return Err(NotAToken);
        }
        let mut header: MetadataValue<Ascii> =
            format!("Bearer {text}").parse().map_err(|_| NotAToken)?;
        header.set_sensitive(true);
        Ok(Self { text, header })
    }
}

impl Token {
    /// A token of 256 random bits.
    pub fn from_random(bits: [u8; 32]) -> Self {
        let text = model::Digest(bits).to_string();
        text.parse().expect("64 hexadecimal digits are a token")
    }

    /// Its text; for its file alone.
    pub fn reveal(&self) -> &str {
        &self.text
    }

    /// What a coordinator keeps of it: a digest, from which nobody gets back to the secret.
    pub fn digest(&self) -> model::Digest {
        model::Digest(blake3::derive_key("flyby 2026 token", self.text.as_bytes()))
    }

    /// The token that a call's metadata carries, if it is one.
    pub fn said(metadata: &MetadataMap) -> Option<Self> {
        let said = metadata.get("authorization")?.to_str().ok()?;
        said.strip_prefix("Bearer ")?.parse().ok()
    }

    /// Whether a call's metadata carries this token. The time it takes does not
    /// depend on how much of a wrong one is right.
    pub fn check(&self, metadata: &MetadataMap) -> Result<(), Failure> {
        let refused = |sentence: &str| Failure::new(ErrorKind::Unauthenticated, sentence);
        let Some(said) = metadata.get("authorization") else {
            return Err(refused(
                "the call carries no token: give the one in the file `token` of the \
                 coordinator's state folder",
            ));
        };
        // BLAKE3's `Hash` compares in constant time.
        if blake3::hash(said.as_encoded_bytes()) == blake3::hash(self.header.as_encoded_bytes()) {
            Ok(())
        } else {
            Err(refused(
                "the token is not this coordinator's: it stands in the file `token` of the \
                 coordinator's state folder",
            ))
        }
    }
}

/// What a client puts on each of its calls: a token, or nothing where its certificate says who it is.
#[derive(Clone, Debug, Default)]
pub struct Bearer(pub Option<Token>);

impl Interceptor for Bearer {
    fn call(&mut self, request: Request<()>) -> Result<Request<()>, Status> {
        match &mut self.0 {
            Some(token) => token.call(request),
            None => Ok(request),
        }
    }
}

/// Puts the token on every call of a client.
impl Interceptor for Token {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        request
            .metadata_mut()
            .insert("authorization", self.header.clone());
        Ok(request)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_same_token_opens() {
        let mut token = Token::from_random([7; 32]);
        let request = token.call(Request::new(())).unwrap();
        assert_eq!(token.check(request.metadata()), Ok(()));
        let other = Token::from_random([8; 32]);
        let wrong = other.check(request.metadata()).unwrap_err();
        assert_eq!(wrong.kind, ErrorKind::Unauthenticated);
        assert!(wrong.sentence.contains("not this coordinator's"));
        assert!(
            other
                .check(&MetadataMap::new())
                .unwrap_err()
                .sentence
                .contains("no token")
        );
        assert!(!format!("{token:?}").contains("0707"));
        assert!("0707".parse::<Token>().is_err());
    }
}
