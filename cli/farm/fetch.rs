//! Fetches the files of finished frames into a folder of the user's.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use model::JobId;
use tempfile::TempPath;
use tokio::sync::mpsc::UnboundedReceiver;
use wire::Failure;
use wire::failure::Retry;
use wire::proto::{ErrorKind, FetchFrameRequest, FrameFile, ImageStatus};

use super::link::refused;
use crate::error::Error;
use crate::existing;
use crate::options::{Context, Existing, FarmOptions};

/// How often a file is asked for before its failure is the command's.
const TRIES: u32 = 6;

/// Where frames go.
pub(crate) struct Fetcher<'a> {
    /// How the coordinator is found.
    pub(crate) context: &'a Context,
    /// Where it is.
    pub(crate) farm: &'a FarmOptions,
    /// The job.
    pub(crate) job: JobId,
    /// The user's folder; it exists.
    pub(crate) folder: &'a Path,
    /// What to do about files that are there.
    pub(crate) existing: Existing,
}

/// What became of a file.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Fetched {
    /// It was fetched.
    New(PathBuf),
    /// It was there already, of the same pixels.
    Kept(PathBuf),
}

impl Fetcher<'_> {
    /// Fetches the files of images as they are finished, until no more will be.
    pub(crate) async fn all(
        &self,
        mut finished: UnboundedReceiver<ImageStatus>,
    ) -> Result<Vec<Fetched>, Error> {
        let mut fetched = Vec::new();
        while let Some(image) = finished.recv().await {
            fetched.extend(self.image(&image).await?);
        }
        Ok(fetched)
    }

    /// Fetches every file of an image.
    pub(crate) async fn image(&self, image: &ImageStatus) -> Result<Vec<Fetched>, Error> {
        let mut fetched = Vec::new();
        for file in &image.files {
            fetched.push(self.file(image, file).await?);
        }
        Ok(fetched)
    }

    async fn file(&self, image: &ImageStatus, file: &FrameFile) -> Result<Fetched, Error> {
        let name = plain(&file.name).ok_or_else(|| {
            Error::failed(format!(
                "the coordinator names a file `{}`, which is no plain file name",
                wire::convert::sentence(&file.name, 200)
            ))
        })?;
        let path = self.folder.join(name);
        // Removed wherever this ends, also where it is interrupted.
        let part = self.folder.join(format!(".{name}.part"));
        let part = TempPath::try_from_path(&part).map_err(|error| cannot_write(&part, error))?;
        if path.exists() {
            match self.existing {
                Existing::Replace => {}
                Existing::Fail => {
                    return Err(Error::failed(format!("`{}` is there already", path.display()))
                        .next("choose another folder with `-o`, or say `--existing skip` or `replace`"));
                }
                Existing::Skip => return self.keep(image, file, path, &part).await,
            }
        }
        self.download(image, file, &part).await?;
        part.persist(&path)
            .map_err(|error| cannot_write(&path, error.error))?;
        Ok(Fetched::New(path))
    }

    /// Leaves a file that is there alone, if its pixels are those of the job.
    async fn keep(
        &self,
        image: &ImageStatus,
        file: &FrameFile,
        path: PathBuf,
        part: &Path,
    ) -> Result<Fetched, Error> {
        let same = match existing::film_digest(&path) {
            Some(digest) => digest.0.as_slice() == image.film_digest,
            // A PPM names no film: it is compared whole.
            None => {
                self.download(image, file, part).await?;
                fs::read(part).ok() == fs::read(&path).ok()
            }
        };
        if same {
            Ok(Fetched::Kept(path))
        } else {
            Err(Error::failed(format!(
                "`{}` is there already, and it shows something else",
                path.display()
            ))
            .next("choose another folder with `-o`, or say `--existing replace`"))
        }
    }

    /// Downloads a file to `part`.
    async fn download(
        &self,
        image: &ImageStatus,
        file: &FrameFile,
        part: &Path,
    ) -> Result<(), Error> {
        let attempt = || {
            let name = wire::convert::sentence(&file.name, 200);
            format!("cannot fetch `{name}` of job {}", self.job)
        };
        let mut tries = 0;
        loop {
            tries += 1;
            let failure = match self.try_download(image, file, part).await {
                Ok(()) => return Ok(()),
                Err(Broken::Here(error)) => return Err(cannot_write(part, error)),
                Err(Broken::There(error)) => error,
                Err(Broken::Asked(failure)) if failure.retry == Retry::Never => {
                    refused(attempt(), failure)
                }
                Err(Broken::Asked(failure)) => {
                    if tries < TRIES {
                        tokio::time::sleep(Duration::from_millis(200) * tries * tries).await;
                        continue;
                    }
                    refused(attempt(), failure)
                }
            };
            return Err(failure);
        }
    }

    async fn try_download(
        &self,
        image: &ImageStatus,
        file: &FrameFile,
        part: &Path,
    ) -> Result<(), Broken> {
        let mut farm = self
            .context
            .connect(self.farm)
            .await
            .map_err(Broken::There)?;
        let request = FetchFrameRequest {
            job: self.job.0,
            image: image.image,
            format: file.format,
        };
        let answer = farm.fetch_frame(request).await;
        let mut chunks = answer.map_err(Broken::asked)?.into_inner();
        let mut to = File::create(part).map_err(Broken::Here)?;
        let mut bytes = 0;
        while let Some(chunk) = chunks.message().await.map_err(Broken::asked)? {
            bytes += chunk.data.len() as u64;
            to.write_all(&chunk.data).map_err(Broken::Here)?;
        }
        if bytes != file.bytes {
            return Err(Broken::Asked(Failure::later(
                ErrorKind::DigestMismatch,
                format!("{bytes} bytes came where {} were announced", file.bytes),
            )));
        }
        to.sync_all().map_err(Broken::Here)
    }
}

/// Why a download broke.
enum Broken {
    /// This machine's disk refused.
    Here(std::io::Error),
    /// The coordinator cannot be reached.
    There(Error),
    /// The coordinator refused, or the link died.
    Asked(Failure),
}

impl Broken {
    fn asked(status: tonic::Status) -> Self {
        Self::Asked(status.into())
    }
}

/// A name that stays in its folder and is not hidden.
fn plain(name: &str) -> Option<&str> {
    let is_plain = |letter: char| !letter.is_control() && letter != '/' && letter != '\\';
    let fits = (1..=255).contains(&name.len()) && !name.starts_with('.');
    (fits && name.chars().all(is_plain)).then_some(name)
}

fn cannot_write(path: &Path, error: std::io::Error) -> Error {
    Error::failed(format!("cannot write `{}`", path.display())).because(error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coordinator_cannot_choose_the_folder() {
        assert_eq!(plain("flyby_0007.exr"), Some("flyby_0007.exr"));
        for bad in [
            "",
            ".",
            "..",
            "../x",
            "/etc/passwd",
            "a/b",
            ".hidden",
            "a\nb",
            "a\\b",
        ] {
            assert_eq!(plain(bad), None, "{bad}");
        }
    }
}
