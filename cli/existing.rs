//! What frames are in a folder already, and what that means for a run into it.

use std::path::{Path, PathBuf};

use image::{Format, Formats, FrameInfo, frame_name};
use model::{Digest, ImageNumber};

use crate::error::Error;
use crate::options::Existing;

/// Under which name a frame says the digest of its scene.
pub(crate) const SCENE_DIGEST: &str = "flyby:sceneDigest";
/// Under which name a frame says the digest of its film.
pub(crate) const FILM_DIGEST: &str = "flyby:filmDigest";
/// Under which name a frame says the revision of its renderer.
pub(crate) const REVISION: &str = "flyby:revision";

/// The frames that a run is about.
pub(crate) struct Wanted<'a> {
    /// Where they go.
    pub(crate) folder: &'a Path,
    /// What their names begin with.
    pub(crate) stem: &'a str,
    /// Their numbers.
    pub(crate) images: &'a [ImageNumber],
    /// The files of each.
    pub(crate) formats: Formats,
    /// The digest of their scene.
    pub(crate) scene: Digest,
    /// The revision of their renderer.
    pub(crate) revision: u32,
}

/// What is left to do.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Survey {
    /// Frames that are there, every file whole and of the same scene and renderer, with the
    /// digests of their films as they say them.
    pub(crate) kept: Vec<(ImageNumber, Option<Digest>)>,
    /// Frames to make.
    pub(crate) missing: Vec<ImageNumber>,
}

/// Looks at the folder and decides, as the user wants it, what is kept and what is made.
///
/// Fails where the user's choice leaves nothing to decide: a frame is there that is to
/// be neither kept nor replaced.
pub(crate) fn survey(wanted: &Wanted<'_>, existing: Existing) -> Result<Survey, Error> {
    let mut survey = Survey::default();
    for &image in wanted.images {
        let files: Vec<(Format, PathBuf)> = wanted
            .formats
            .iter()
            .map(|format| (format, wanted.path(image, format)))
            .collect();
        let there = files.iter().find(|(_, path)| path.exists());
        match (existing, there) {
            (Existing::Replace, _) | (_, None) => survey.missing.push(image),
            (Existing::Fail, Some((_, path))) => {
                return Err(
                    Error::failed(format!("`{}` is there already", path.display())).next(
                        "choose another folder with `-o`, or say `--existing skip` or `replace`",
                    ),
                );
            }
            (Existing::Skip, Some(_)) => match wanted.look(&files)? {
                Found::Whole(film) => survey.kept.push((image, film)),
                Found::InPart => survey.missing.push(image),
            },
        }
    }
    Ok(survey)
}

enum Found {
    /// Every file is there; one of them says the digest of the film.
    Whole(Option<Digest>),
    /// Some files are missing; those there are the same frame's.
    InPart,
}

impl Wanted<'_> {
    /// Where a frame's file is.
    pub(crate) fn path(&self, image: ImageNumber, format: Format) -> PathBuf {
        self.folder.join(frame_name(self.stem, image, format))
    }

    /// Whether the files of a frame are the ones wanted.
    fn look(&self, files: &[(Format, PathBuf)]) -> Result<Found, Error> {
        let mut vouched = None;
        for (format, path) in files.iter().filter(|(_, path)| path.exists()) {
            match self.own(path)? {
                Ok(film) => vouched = vouched.or(Some(film)),
                // A PPM says nothing about itself; the files beside it speak for it.
                Err(_) if *format == Format::Ppm && vouched.is_some() => {}
                Err(why) => {
                    return Err(Error::failed(format!(
                        "`{}` is there already, and {why}",
                        path.display()
                    ))
                    .next("choose another folder with `-o`, or say `--existing replace`"));
                }
            }
        }
        let whole = files.iter().all(|(_, path)| path.exists());
        Ok(if whole {
            Found::Whole(vouched.flatten())
        } else {
            Found::InPart
        })
    }

    /// The film digest of a file that is the one wanted, or why it is not.
    fn own(&self, path: &Path) -> Result<Result<Option<Digest>, String>, Error> {
        let info = match image::info(path) {
            Ok(info) => info,
            Err(error @ image::ImageError::Io { .. }) => {
                return Err(Error::failed("cannot look at a frame that is there").because(error));
            }
            Err(error) => return Ok(Err(format!("it is no frame that can be read: {error}"))),
        };
        let (Some(scene), Some(revision)) = (said(&info, SCENE_DIGEST), said(&info, REVISION))
        else {
            return Ok(Err("it does not say which scene it shows".to_owned()));
        };
        if scene != self.scene.to_string() {
            return Ok(Err("it shows another scene, or other settings".to_owned()));
        }
        if revision != self.revision.to_string() {
            return Ok(Err(format!(
                "another revision of the renderer made it ({revision}, this one is {})",
                self.revision
            )));
        }
        Ok(Ok(
            said(&info, FILM_DIGEST).and_then(|digest| digest.parse().ok())
        ))
    }
}

/// What a frame says about itself under a name.
pub(crate) fn said<'a>(info: &'a FrameInfo, name: &str) -> Option<&'a str> {
    let found = info.metadata.iter().find(|(key, _)| key == name);
    found.map(|(_, value)| value.as_str())
}

/// The film digest that a frame says it has.
pub(crate) fn film_digest(path: &Path) -> Option<Digest> {
    let info = image::info(path).ok()?;
    said(&info, FILM_DIGEST)?.parse().ok()
}

/// What the names of a scene's files begin with: the letters, digits, `-` and `_` of its
/// name, as on the farm.
pub(crate) fn stem(name: &str) -> String {
    let kept: String = name
        .chars()
        .filter(|letter| letter.is_ascii_alphanumeric() || matches!(letter, '-' | '_'))
        .take(100)
        .collect();
    if kept.is_empty() {
        "frame".to_owned()
    } else {
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{FrameMetadata, FrameRequest, Scratch, ScratchIdentity, ViewTransform};
    use model::Resolution;

    /// Leaves frame `image` of a black 8×8 film in `folder`.
    fn frame(folder: &Path, image: u32, scene: Digest, formats: &str) {
        let resolution = Resolution {
            width: 8,
            height: 8,
        };
        let number = ImageNumber(image);
        let identity = ScratchIdentity {
            scene,
            revision: 1,
            image: number,
            resolution,
        };
        let scratch =
            Scratch::create(folder.join(".scratch"), identity, resolution.rect()).unwrap();
        let black = vec![0; 8 * 8 * model::film::PIXEL_BYTES];
        scratch.write_block(resolution.rect(), &black).unwrap();
        let request = FrameRequest {
            folder: folder.to_owned(),
            stem: "s".into(),
            number,
            formats: formats.parse().unwrap(),
            metadata: FrameMetadata {
                scene_digest: scene,
                revision: 1,
                settings: "{}".into(),
                statistics: "{}".into(),
                software: "test".into(),
                frames_per_second: 25.0,
                comments: String::new(),
            },
            view: ViewTransform::default(),
            threads: 1,
        };
        image::finish(&scratch, &request).unwrap();
        scratch.discard().unwrap();
    }

    fn look(
        folder: &Path,
        scene: Digest,
        revision: u32,
        existing: Existing,
    ) -> Result<Survey, Error> {
        let images: Vec<ImageNumber> = (0..3).map(ImageNumber).collect();
        let wanted = Wanted {
            folder,
            stem: "s",
            images: &images,
            formats: "exr,png,ppm".parse().unwrap(),
            scene,
            revision,
        };
        survey(&wanted, existing)
    }

    #[test]
    fn frames_of_the_same_scene_are_kept_and_others_stand_in_the_way() {
        let (ours, theirs) = (Digest([1; 32]), Digest([2; 32]));
        let folder = tempfile::tempdir().unwrap();
        let numbers = |images: &[ImageNumber]| images.iter().map(|n| n.0).collect::<Vec<_>>();

        frame(folder.path(), 0, ours, "exr,png,ppm");
        frame(folder.path(), 1, ours, "exr");
        let kept = look(folder.path(), ours, 1, Existing::Skip).unwrap();
        let film = film_digest(&folder.path().join("s_0000.exr"));
        assert!(film.is_some());
        assert_eq!(kept.kept, [(ImageNumber(0), film)]);
        assert_eq!(numbers(&kept.missing), [1, 2]);
        let all = look(folder.path(), ours, 1, Existing::Replace).unwrap();
        assert_eq!(numbers(&all.missing), [0, 1, 2]);
        assert!(look(folder.path(), ours, 1, Existing::Fail).is_err());

        let other = look(folder.path(), theirs, 1, Existing::Skip).unwrap_err();
        assert!(other.to_string().contains("another scene"), "{other}");
        let newer = look(folder.path(), ours, 2, Existing::Skip).unwrap_err();
        assert!(newer.to_string().contains("another revision"), "{newer}");
        std::fs::write(folder.path().join("s_0002.exr"), "no image").unwrap();
        let broken = look(folder.path(), ours, 1, Existing::Skip).unwrap_err();
        assert!(
            broken.to_string().contains("no frame that can be read"),
            "{broken}"
        );
    }

    #[test]
    fn stems_are_plain_file_names() {
        assert_eq!(stem("flyby"), "flyby");
        assert_eq!(stem("Höhen flug/2"), "Hhenflug2");
        assert_eq!(stem("../x"), "x");
        assert_eq!(stem("..."), "frame");
    }
}
