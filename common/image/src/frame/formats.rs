//! The formats of frames, and the names of their files.

use std::fmt;
use std::str::FromStr;

use model::ImageNumber;

/// One format of frame files.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Format {
    /// OpenEXR: every channel of the film, scene-linear, with metadata.
    Exr,
    /// PNG of 8 bits per channel, through the view transform.
    Png8,
    /// PNG of 16 bits per channel, through the view transform.
    Png16,
    /// Binary PPM (P6) of 8 bits per channel, through the view transform.
    Ppm,
}

impl Format {
    /// All of them, in the order in which they are written.
    pub const ALL: [Self; 4] = [Self::Exr, Self::Png8, Self::Png16, Self::Ppm];

    /// How users write it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::Png8 => "png",
            Self::Png16 => "png16",
            Self::Ppm => "ppm",
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A set of formats, written `exr,png`. PNG is in it once at most, since both depths have the
/// same file name.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Formats([bool; Format::ALL.len()]);

impl Formats {
    /// The set of these formats; of the two PNGs, the deeper.
    pub fn new(formats: impl IntoIterator<Item = Format>) -> Self {
        let mut set = Self::default();
        for format in formats {
            set.0[format as usize] = true;
        }
        if set.contains(Format::Png16) {
            set.0[Format::Png8 as usize] = false;
        }
        set
    }

    /// Whether `format` is in the set.
    pub const fn contains(self, format: Format) -> bool {
        self.0[format as usize]
    }

    /// The formats, in the order of [`Format::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Format> {
        Format::ALL
            .into_iter()
            .filter(move |format| self.contains(*format))
    }

    /// Whether no format is in it.
    pub fn is_empty(self) -> bool {
        self.iter().next().is_none()
    }
}

impl fmt::Display for Formats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, format) in self.iter().enumerate() {
            let comma = if index == 0 { "" } else { "," };
            write!(f, "{comma}{format}")?;
        }
        Ok(())
    }
}

/// Why a text is no list of formats.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum BadFormats {
    /// The list, or a place in it, is empty.
    #[error("a format is missing: write a list such as exr,png")]
    Empty,
    /// One of them is not known.
    #[error("`{0}` is no format of frames: choose from exr, png, png16, ppm")]
    Unknown(String),
    /// Both depths of PNG.
    #[error("png and png16 would write the same file: choose one of them")]
    TwoPngs,
}

impl FromStr for Formats {
    type Err = BadFormats;

    fn from_str(text: &str) -> Result<Self, BadFormats> {
        let formats = text
            .split(',')
            .map(|word| {
                let word = word.trim();
                let named = |format: &Format| format.name().eq_ignore_ascii_case(word);
                match Format::ALL.into_iter().find(named) {
                    Some(format) => Ok(format),
                    None if word.is_empty() => Err(BadFormats::Empty),
                    None => Err(BadFormats::Unknown(word.to_owned())),
                }
            })
            .collect::<Result<Vec<_>, _>>()?;
        if formats.contains(&Format::Png8) && formats.contains(&Format::Png16) {
            return Err(BadFormats::TwoPngs);
        }
        Ok(Self::new(formats))
    }
}

/// The name of a frame's file: `flyby_0007.exr`; a PPM's number is not padded, as in thesis §C.3.6.
pub fn frame_name(stem: &str, number: ImageNumber, format: Format) -> String {
    let number = number.0;
    match format {
        Format::Exr => format!("{stem}_{number:04}.exr"),
        Format::Png8 | Format::Png16 => format!("{stem}_{number:04}.png"),
        Format::Ppm => format!("{stem}_{number}.ppm"),
    }
}

/// Whether `stem` can begin the name of a file that is not hidden, in the folder it is put in.
pub(crate) fn is_stem(stem: &str) -> bool {
    let plain = |letter: char| !letter.is_control() && letter != '/' && letter != '\\';
    !stem.is_empty() && stem.len() <= 128 && !stem.starts_with('.') && stem.chars().all(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_as_users_write_them() {
        let list = |text: &str| text.parse::<Formats>().map(|formats| formats.to_string());
        assert_eq!(list("png,exr"), Ok("exr,png".into()));
        assert_eq!(list(" EXR , png16,ppm,exr"), Ok("exr,png16,ppm".into()));
        assert_eq!(list(""), Err(BadFormats::Empty));
        assert_eq!(list("exr,"), Err(BadFormats::Empty));
        assert_eq!(list("exr,jpg"), Err(BadFormats::Unknown("jpg".into())));
        assert_eq!(list("png,png16"), Err(BadFormats::TwoPngs));
        assert!(
            list("tiff")
                .unwrap_err()
                .to_string()
                .contains("exr, png, png16, ppm")
        );
    }

    #[test]
    fn names_sort_like_their_numbers_but_for_the_thesis_s() {
        let name = |number, format| frame_name("flyby", ImageNumber(number), format);
        assert_eq!(name(7, Format::Exr), "flyby_0007.exr");
        assert_eq!(name(12_345, Format::Png16), "flyby_12345.png");
        assert_eq!(name(7, Format::Ppm), "flyby_7.ppm");
    }

    #[test]
    fn a_stem_stays_in_its_folder() {
        assert!(is_stem("flyby") && is_stem("Höhenflug 2"));
        for bad in ["", "..", ".x", "a/b", "a\0", "a\n"] {
            assert!(!is_stem(bad), "{bad:?}");
        }
    }
}
