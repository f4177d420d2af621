//! Sending a file in chunks.

use std::path::PathBuf;

use tokio::fs::File;
use tokio::io::AsyncReadExt as _;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Status;
use wire::Failure;
use wire::link::CHUNK_BYTES;
use wire::proto::ErrorKind;

/// Chunks that are read ahead of the one that is being sent.
const AHEAD: usize = 2;

/// What a stream of chunks is made of.
pub(super) type Chunks<T> = ReceiverStream<Result<T, Status>>;

/// Sends the first of these files that is there; `chunk` makes a message of the file's length, the place of the
/// chunk in it, and the chunk's bytes. An empty file is one empty chunk.
pub(super) async fn send_file<T: Send + 'static>(
    paths: Vec<PathBuf>,
    chunk: impl Fn(u64, u64, Vec<u8>) -> T + Send + 'static,
) -> Result<Chunks<T>, Failure> {
    let mut file = Err(std::io::ErrorKind::NotFound.into());
    for path in paths {
        file = File::open(&path).await;
        let is_gone = |error: &std::io::Error| error.kind() == std::io::ErrorKind::NotFound;
        if !file.as_ref().is_err_and(is_gone) {
            break;
        }
    }
    let mut file = file.map_err(gone)?;
    let length = file.metadata().await.map_err(gone)?.len();
    let (sender, receiver) = mpsc::channel(AHEAD);
    tokio::spawn(async move {
        let mut place = 0;
        loop {
            let mut bytes = Vec::with_capacity(CHUNK_BYTES);
            let read = (&mut file)
                .take(CHUNK_BYTES as u64)
                .read_to_end(&mut bytes)
                .await;
            let message = match read {
                Ok(0) if place > 0 => return,
                Ok(read) => {
                    let message = chunk(length, place, bytes);
                    place += read as u64;
                    Ok(message)
                }
                Err(error) => Err(Status::from(gone(error))),
            };
            let failed = message.is_err();
            if sender.send(message).await.is_err() || failed || place >= length {
                return;
            }
        }
    });
    Ok(ReceiverStream::new(receiver))
}

/// What was there a moment ago is not, or the disk refused.
fn gone(error: std::io::Error) -> Failure {
    match error.kind() {
        std::io::ErrorKind::NotFound => Failure::new(
            ErrorKind::NotFound,
            "the file is gone: its job is over, or someone removed it",
        ),
        _ => Failure::later(
            ErrorKind::Storage,
            format!("the coordinator could not read the file: {error}"),
        ),
    }
}
