//! Fetching bytes by their digest.

use model::Digest;
use wire::Failure;
use wire::link::Workers;
use wire::proto::{ErrorKind, FetchRequest};

/// What is fetched.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum What {
    Scene,
    Asset,
}

/// The bytes that the coordinator has under a digest; at most `bytes_max`. Whether they are those
/// is for the caller to find out.
pub(super) async fn fetch(
    what: What,
    digest: Digest,
    bytes_max: u64,
    link: &mut Workers,
) -> Result<Vec<u8>, Failure> {
    let request = FetchRequest {
        digest: digest.0.to_vec(),
    };
    let mut chunks = match what {
        What::Scene => link.fetch_scene(request).await,
        What::Asset => link.fetch_asset(request).await,
    }?
    .into_inner();
    let mut bytes = Vec::new();
    while let Some(chunk) = chunks.message().await? {
        let have = bytes.len() as u64 + chunk.data.len() as u64;
        if chunk.bytes > bytes_max || have > bytes_max {
            return Err(Failure::new(
                ErrorKind::Limit,
                format!("the coordinator sends more than {bytes_max} bytes for {digest}"),
            ));
        }
        bytes.extend_from_slice(&chunk.data);
    }
    Ok(bytes)
}
