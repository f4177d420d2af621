//! A scene file, read with what the user changes in it; its mistakes shown where they are.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use miette::Severity;
use model::{Digest, FrameRange, ImageNumber};
use render::Assets;
use scene::{Description, Loaded, Mistake, Overrides, SceneError, Source};

use crate::caret::Caret;
use crate::error::Error;
use crate::options::SceneOptions;
use crate::output;

/// A scene, valid and named.
pub(crate) struct Scene {
    /// As it was loaded.
    pub(crate) loaded: Loaded,
    /// Its canonical bytes.
    pub(crate) bytes: Vec<u8>,
    /// Their digest, which names the scene with all its settings.
    pub(crate) digest: Digest,
}

impl SceneOptions {
    /// What is changed in the scene.
    pub(crate) fn overrides(&self) -> Overrides {
        Overrides {
            resolution: self.resolution,
            rays: self.rays,
            crop: self.crop,
            set: self.set.clone(),
        }
    }

    /// Reads the scene; every mistake in it is part of the error.
    pub(crate) fn load(&self) -> Result<Scene, Error> {
        readable(&self.scene)?;
        match scene::load(&self.scene, &self.overrides()) {
            Ok(loaded) => Scene::new(loaded),
            Err(error) => Err(mistakes(&error)),
        }
    }

    /// What the user said about the scene, as frames keep it.
    pub(crate) fn settings_json(&self) -> String {
        let resolution = self
            .resolution
            .map(|size| format!("{}x{}", size.width, size.height));
        let crop = self
            .crop
            .map(|crop| format!("{},{},{},{}", crop.x0, crop.y0, crop.x1, crop.y1));
        let file = self.scene.file_name().unwrap_or_default();
        serde_json::json!({
            "scene": file.to_string_lossy(),
            "resolution": resolution,
            "rays": self.rays,
            "crop": crop,
            "set": self.set,
            "guarantee": render::GUARANTEE,
        })
        .to_string()
    }
}

/// Says what the system says where a file cannot be read at all.
pub(crate) fn readable(path: &Path) -> Result<(), Error> {
    let look = || {
        // Opening a pipe could wait for ever; what is no file is refused by who reads the scene.
        if path.metadata()?.is_file() {
            io::copy(&mut File::open(path)?.take(1), &mut io::sink())?;
        }
        Ok(())
    };
    look().map_err(|error: io::Error| {
        Error::failed(format!("cannot read the scene `{}`", path.display())).because(error)
    })
}

impl Scene {
    /// Names a scene that was loaded, and shows its warnings.
    pub(crate) fn new(loaded: Loaded) -> Result<Self, Error> {
        for warning in &loaded.warnings {
            output::say(show(&loaded.sources, warning, Severity::Warning).trim_end());
        }
        let bytes = loaded
            .description
            .to_bytes()
            .map_err(|error| Error::usage("this scene cannot be rendered").because(error))?;
        Ok(Self {
            digest: scene::digest_of(&bytes),
            bytes,
            loaded,
        })
    }

    /// What the renderer takes.
    pub(crate) fn description(&self) -> &Description {
        &self.loaded.description
    }

    /// The files that it names.
    pub(crate) fn assets(&self) -> Assets {
        let assets = self.loaded.assets.iter();
        assets
            .map(|(asset, bytes)| (asset.digest, bytes.clone()))
            .collect()
    }

    /// The frames asked for, or all; they must exist.
    pub(crate) fn frames(&self, asked: Option<FrameRange>) -> Result<FrameRange, Error> {
        let images = self.description().film.images;
        let frames = match asked {
            Some(frames) => frames,
            None => FrameRange::new(0, images, 1)
                .map_err(|error| Error::usage("this scene has no frames").because(error))?,
        };
        match frames.iter().find(|frame| frame.0 >= images) {
            None => Ok(frames),
            Some(ImageNumber(frame)) => Err(Error::usage(format!(
                "there is no frame {frame}: the scene has {images} frames, counted from 0"
            ))
            .next(format!("choose frames inside `--frames 0..{images}`"))),
        }
    }
}

/// Every mistake of a scene, each with its place, as one error.
pub(crate) fn mistakes(error: &SceneError) -> Error {
    let scene = error.sources.first().map_or("", |file| &file.name);
    let mut text = match error.mistakes.len() {
        1 => format!("the scene `{scene}` has a mistake\n"),
        count => format!("the scene `{scene}` has {count} mistakes\n"),
    };
    for mistake in &error.mistakes {
        text.push_str(&show(&error.sources, mistake, Severity::Error));
    }
    Error::usage(text.trim_end())
}

/// A mistake or a warning of a scene.
fn show(sources: &[Source], mistake: &Mistake, severity: Severity) -> String {
    let source = &sources[mistake.place.source];
    let caret = Caret {
        file: &source.name,
        text: &source.text,
        span: mistake.place.span.clone(),
        message: &mistake.message,
        label: &mistake.label,
        help: mistake.help.as_deref(),
    };
    caret.show(severity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Ending;
    use scene::Place;

    #[test]
    fn a_mistake_is_shown_with_file_line_column_caret_and_help() {
        let text = "[film]\nresolutoin = '1x1'\n".to_owned();
        let start = text.find("resolutoin").unwrap();
        let mistake = Mistake {
            message: "there is no key `resolutoin`".into(),
            label: "not known here".into(),
            help: Some("did you mean `resolution`?".into()),
            place: Place {
                source: 0,
                span: start..start + 10,
            },
        };
        let error = mistakes(&SceneError {
            sources: vec![Source {
                name: "a.toml".into(),
                text,
            }],
            mistakes: vec![mistake.clone(), mistake],
        });
        assert_eq!(error.ending(), Ending::Usage);
        let said = error.to_string();
        for part in [
            "2 mistakes",
            "a.toml:2:1",
            "resolutoin = '1x1'",
            "not known here",
            "did you mean `resolution`?",
        ] {
            assert!(said.contains(part), "{part}: {said}");
        }
        assert!(
            !said.contains('\u{1b}'),
            "no colours where nobody sees them"
        );
    }

    #[test]
    fn a_file_that_is_not_there_is_a_failure_and_no_mistake() {
        let options = SceneOptions {
            scene: "nowhere/at-all.toml".into(),
            resolution: None,
            rays: None,
            crop: None,
            set: Vec::new(),
        };
        let error = options.load().err().unwrap();
        assert_eq!(error.ending(), Ending::Failed);
        assert!(error.to_string().contains("nowhere/at-all.toml"), "{error}");
    }
}
