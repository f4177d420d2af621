//! What a frame says about how it came to be.

use model::Digest;

use crate::error::ImageError;

/// Most bytes of one text of the metadata.
pub const METADATA_TEXT_MAX: usize = 1 << 20;

/// What a frame says about itself beside its pixels; never part of a digest.
#[derive(Clone, PartialEq, Debug)]
pub struct FrameMetadata {
    /// Digest of the scene description.
    pub scene_digest: Digest,
    /// Revision of the renderer.
    pub revision: u32,
    /// The settings that decide the pixels, as JSON.
    pub settings: String,
    /// Counts of the render (no times), as JSON.
    pub statistics: String,
    /// Name and version of the program.
    pub software: String,
    /// Images per second of the animation.
    pub frames_per_second: f64,
    /// Remarks for people; may be empty.
    pub comments: String,
}

impl FrameMetadata {
    /// The texts under the names that EXR and PNG give them, the film's digest among them.
    pub(crate) fn texts(&self, film: Digest) -> [(&'static str, String); 6] {
        [
            ("flyby:sceneDigest", self.scene_digest.to_string()),
            ("flyby:filmDigest", film.to_string()),
            ("flyby:revision", self.revision.to_string()),
            ("flyby:settings", self.settings.clone()),
            ("flyby:statistics", self.statistics.clone()),
            ("flyby:software", self.software.clone()),
        ]
    }

    /// Fails if a text is too long to store or holds a NUL.
    pub(crate) fn check(&self) -> Result<(), ImageError> {
        for (name, text) in [
            ("flyby:settings", &self.settings),
            ("flyby:statistics", &self.statistics),
            ("flyby:software", &self.software),
            ("comments", &self.comments),
        ] {
            let reason = if text.len() > METADATA_TEXT_MAX {
                "it is longer than 1 MiB"
            } else if text.contains('\0') {
                "it holds a NUL"
            } else {
                continue;
            };
            return Err(ImageError::BadMetadata {
                name: name.to_owned(),
                reason,
            });
        }
        match self.rate() {
            Some(_) => Ok(()),
            None => Err(ImageError::BadMetadata {
                name: "framesPerSecond".to_owned(),
                reason: "it is not a number above 0 and at most 1,000,000",
            }),
        }
    }

    /// Images per second as a fraction: whole, NTSC's (n·1000/1001), else in thousandths.
    pub(crate) fn rate(&self) -> Option<(i32, u32)> {
        let rate = self.frames_per_second;
        if !(0.001..=1e6).contains(&rate) {
            return None;
        }
        [(1.0, 1), (1.001, 1001), (1000.0, 1000)]
            .into_iter()
            .find_map(|(factor, divisor)| {
                let whole = libm::round(rate * factor);
                let near = (whole / factor - rate).abs() <= 1e-9 * rate || divisor == 1000;
                #[expect(clippy::cast_possible_truncation, reason = "at most 10^9")]
                let dividend = whole as i32 * if divisor == 1001 { 1000 } else { 1 };
                (near && dividend > 0).then_some((dividend, divisor))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn metadata() -> FrameMetadata {
        FrameMetadata {
            scene_digest: Digest([7; 32]),
            revision: 3,
            settings: "{}".into(),
            statistics: "{}".into(),
            software: "flyby 0.1.0".into(),
            frames_per_second: 25.0,
            comments: String::new(),
        }
    }

    #[test]
    fn rates_as_film_people_write_them() {
        let rate = |frames_per_second| {
            FrameMetadata {
                frames_per_second,
                ..metadata()
            }
            .rate()
        };
        assert_eq!(rate(25.0), Some((25, 1)));
        assert_eq!(rate(24_000.0 / 1001.0), Some((24_000, 1001)));
        assert_eq!(rate(12.5), Some((12_500, 1000)));
        assert_eq!(rate(1e6), Some((1_000_000, 1)));
        for bad in [0.0, -25.0, f64::NAN, f64::INFINITY, 1e7] {
            assert_eq!(rate(bad), None);
        }
    }

    #[test]
    fn texts_that_no_file_holds_are_refused() {
        assert!(metadata().check().is_ok());
        let long = FrameMetadata {
            settings: "x".repeat(METADATA_TEXT_MAX + 1),
            ..metadata()
        };
        assert!(long.check().is_err());
        let nul = FrameMetadata {
            comments: "a\0b".into(),
            ..metadata()
        };
        assert!(nul.check().is_err());
    }
}
