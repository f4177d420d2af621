//! Frames in the making: rows that are done are encoded while others are still to come.
//!
//! A file begins with what is said about the whole film, so that nothing can be written until that is done. What has been
//! encoded is kept in memory up to a limit, and the rest is encoded at the end.

use std::sync::Mutex;
use std::sync::TryLockError;

use super::formats::{Format, Formats, frame_name};
use super::publish::{Pending, sync_folder_of};
use super::{FinishedFile, FinishedFrame, FrameRequest, Source, check, exr, png, ppm};
use crate::error::ImageError;
use crate::read::FileKind;
use crate::scratch::{FilmHasher, Scratch, Strip, StripMemory};
use crate::share::in_order;
use crate::view::ViewTransform;

/// Where so many bytes of one image are encoded, the rest of it waits for its end: one strip more than that is kept at most.
const KEPT_MAX: usize = 64 << 20;

/// The frames of one image, as far as they are encoded; shared by the threads that deliver its blocks.
pub struct Encoding {
    formats: Formats,
    view: ViewTransform,
    begun: Mutex<Begun>,
}

/// What has been encoded.
struct Begun {
    /// The first row of pixels that has not been.
    row: u32,
    film: FilmHasher,
    parts: Vec<Part>,
    memory: StripMemory,
}

/// One frame in the making.
enum Part {
    Exr(Box<exr::Begun>),
    Png(Box<png::Begun>),
    Ppm(Box<png::Begun>),
}

impl Encoding {
    /// Begins the frames of an image, with nothing encoded.
    pub fn new(scratch: &Scratch, formats: Formats, view: ViewTransform) -> Self {
        let begun = Mutex::new(Begun::new(scratch, formats, view));
        Self {
            formats,
            view,
            begun,
        }
    }

    /// Encodes the next rows, if they are done and no other thread is at it.
    ///
    /// Fails if the scratch file cannot be read.
    pub fn go_on(&self, scratch: &Scratch) -> Result<(), ImageError> {
        match self.begun.try_lock() {
            Ok(mut begun) => begun.go_on(scratch, KEPT_MAX).inspect_err(|_| {
                // Some of the frames may have the strip, and others not.
                *begun = Begun::new(scratch, self.formats, self.view);
            }),
            Err(TryLockError::WouldBlock | TryLockError::Poisoned(_)) => Ok(()),
        }
    }

    /// What [`finish`](super::finish) does, in less time.
    pub fn finish(
        self,
        scratch: &Scratch,
        request: &FrameRequest,
    ) -> Result<FinishedFrame, ImageError> {
        check(request)?;
        let is_asked = (self.formats, self.view) == (request.formats, request.view);
        let begun = self.begun.into_inner().ok().filter(|_| is_asked);
        let begun = begun.unwrap_or_else(|| Begun::new(scratch, request.formats, request.view));
        let Begun {
            row, film, parts, ..
        } = begun;
        let source = Source {
            scratch,
            request,
            film_digest: scratch.film_digest_from(row, film, request.threads)?,
            row,
        };
        let parts: Vec<(Format, Part)> = request.formats.iter().zip(parts).collect();
        let write = |(format, part)| write(&source, format, part);
        let written = in_order(parts, request.threads, write);
        let written: Vec<Written> = written.into_iter().collect::<Result<_, _>>()?;
        let mut files = Vec::new();
        for Written { pending, file } in written {
            pending.publish()?;
            files.push(file);
        }
        if let Some(file) = files.first() {
            sync_folder_of(&file.path)?;
        }
        Ok(FinishedFrame {
            film_digest: source.film_digest,
            files,
        })
    }
}

impl Begun {
    fn new(scratch: &Scratch, formats: Formats, view: ViewTransform) -> Self {
        let window = scratch.window();
        Self {
            row: window.y0,
            film: FilmHasher::new(window),
            parts: formats
                .iter()
                .map(|format| Part::new(format, scratch, view))
                .collect(),
            memory: StripMemory::default(),
        }
    }

    /// Encodes the next strip if it is done and less than `most` bytes are kept.
    fn go_on(&mut self, scratch: &Scratch, most: usize) -> Result<(), ImageError> {
        let kept: usize = self.parts.iter().map(Part::kept).sum();
        let Some(rect) = scratch.done_from(self.row).filter(|_| kept < most) else {
            return Ok(());
        };
        let strip = scratch.read(rect, &mut self.memory)?;
        self.film.take(strip);
        for part in &mut self.parts {
            part.take(scratch, strip)?;
        }
        self.row = rect.y1;
        Ok(())
    }
}

impl Part {
    fn new(format: Format, scratch: &Scratch, view: ViewTransform) -> Self {
        let window = scratch.window();
        let png = |kind, depth| Box::new(png::Begun::new(kind, depth, window, view));
        match format {
            Format::Exr => Self::Exr(Box::new(exr::Begun::new(scratch))),
            Format::Png8 => Self::Png(png(FileKind::Png, png::Depth::Eight)),
            Format::Png16 => Self::Png(png(FileKind::Png, png::Depth::Sixteen)),
            Format::Ppm => Self::Ppm(png(FileKind::Ppm, png::Depth::Eight)),
        }
    }

    fn take(&mut self, scratch: &Scratch, strip: &Strip) -> Result<(), ImageError> {
        match self {
            Self::Exr(begun) => begun.take(scratch, strip)?,
            Self::Png(begun) | Self::Ppm(begun) => begun.take(strip),
        }
        Ok(())
    }

    fn kept(&self) -> usize {
        match self {
            Self::Exr(begun) => begun.kept(),
            Self::Png(begun) | Self::Ppm(begun) => begun.kept(),
        }
    }
}

/// A frame that is whole and durable, and has no name yet.
struct Written {
    pending: Pending,
    file: FinishedFile,
}

fn write(source: &Source<'_>, format: Format, part: Part) -> Result<Written, ImageError> {
    let request = source.request;
    let name = frame_name(&request.stem, request.number, format);
    let pending = Pending::create(&request.folder, &name)?;
    let digest = match part {
        Part::Exr(begun) => begun.write(source, &pending),
        Part::Png(begun) => begun.write(source, &pending),
        Part::Ppm(begun) => ppm::write(*begun, source, &pending),
    }?;
    let bytes = pending.sync()?;
    let file = FinishedFile {
        path: pending.target().to_owned(),
        format,
        digest,
        bytes,
    };
    Ok(Written { pending, file })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scratch::ScratchIdentity;
    use model::film::CHANNEL_COUNT;
    use model::{ImageNumber, Resolution};

    #[test]
    fn no_more_is_kept_than_may_be() {
        let folder = tempfile::tempdir().unwrap();
        let resolution = Resolution {
            width: 40,
            height: 200,
        };
        let identity = ScratchIdentity {
            scene: model::Digest([7; 32]),
            revision: 1,
            image: ImageNumber(0),
            resolution,
        };
        let window = resolution.rect();
        let scratch = Scratch::create(folder.path().join("film"), identity, window).unwrap();
        for block in window.blocks() {
            let samples = CHANNEL_COUNT * usize::try_from(block.area()).unwrap();
            scratch.write_block(block, &vec![0; 4 * samples]).unwrap();
        }
        let formats = Formats::new([Format::Ppm]);
        let of_strip = 32 * 40 * 3;
        for (most, rows) in [(0, 0), (1, 32), (2 * of_strip, 64), (100 * of_strip, 200)] {
            let mut begun = Begun::new(&scratch, formats, ViewTransform::default());
            for _ in 0..10 {
                begun.go_on(&scratch, most).unwrap();
            }
            assert_eq!(begun.row, rows);
            let kept: usize = begun.parts.iter().map(Part::kept).sum();
            assert_eq!(kept, rows as usize * 40 * 3);
        }
    }
}
