//! The list of figures: which scene, changed how, is which figure of the thesis.

use std::path::Path;

use serde::Deserialize;

use crate::error::Error;

/// Most figures of a gallery.
const FIGURES_MAX: usize = 1_000;

/// `figures/gallery.toml`.
#[derive(Deserialize, Debug)]
#[serde(deny_unknown_fields)]
pub(crate) struct Index {
    /// In the order of the page.
    #[serde(rename = "figure")]
    pub(crate) figures: Vec<Figure>,
}

/// One figure.
#[derive(Deserialize, Debug)]
#[serde(deny_unknown_fields)]
pub(crate) struct Figure {
    /// What its picture is called; letters, digits and `-`, unlike any other's.
    pub(crate) name: String,
    /// Its number in the thesis, with its part: `3.14a`.
    pub(crate) number: String,
    /// Its scene file, from the folder of the scenes.
    pub(crate) scene: String,
    /// What is changed in the scene, as `--set` takes it.
    #[serde(default)]
    pub(crate) set: Vec<String>,
    /// Which of the scene's frames is shown.
    #[serde(default)]
    pub(crate) frame: u32,
    /// Longest side of its picture on the page, in pixels, where the usual one would take too long.
    #[serde(default)]
    pub(crate) side: Option<u32>,
    /// What the page says about it.
    pub(crate) caption: String,
}

impl Index {
    /// Reads and checks the list.
    pub(crate) fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|error| {
            Error::failed(format!(
                "cannot read the gallery's list `{}`",
                path.display()
            ))
            .because(error)
            .next("name the folder of the scenes: `flyby gallery path/to/scenes`")
        })?;
        Self::parse(&text).map_err(|error| {
            Error::usage(format!(
                "the gallery's list `{}` has a mistake",
                path.display()
            ))
            .because(error)
        })
    }

    fn parse(text: &str) -> Result<Self, String> {
        let index: Self = toml::from_str(text).map_err(|error| error.to_string())?;
        if index.figures.len() > FIGURES_MAX {
            return Err(format!("it lists more than {FIGURES_MAX} figures"));
        }
        for (place, figure) in index.figures.iter().enumerate() {
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
            if figure.name.is_empty() || figure.name.len() > 60 || !figure.name.chars().all(plain) {
                return Err(format!(
                    "`{}` is no name: use 1 to 60 letters, digits and `-`",
                    figure.name
                ));
            }
            if index.figures[..place]
                .iter()
                .any(|other| other.name == figure.name)
            {
                return Err(format!("two figures are called `{}`", figure.name));
            }
        }
        Ok(index)
    }

    /// The names of all figures, for people.
    pub(crate) fn names(&self) -> String {
        let names: Vec<_> = self
            .figures
            .iter()
            .map(|figure| format!("{} ({})", figure.name, figure.number))
            .collect();
        names.join(", ")
    }
}

impl Figure {
    /// Whether a user who says `name` means it.
    pub(crate) fn is_called(&self, name: &str) -> bool {
        self.name == name || self.number == name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENTRY: &str =
        "[[figure]]\nname = 'a'\nnumber = '3.14a'\nscene = 'a.toml'\ncaption = 'A.'\n";

    #[test]
    fn figures_are_found_by_name_and_by_number() {
        let index = Index::parse(ENTRY).unwrap();
        let figure = &index.figures[0];
        assert!(figure.is_called("a") && figure.is_called("3.14a") && !figure.is_called("3.14"));
        assert_eq!((figure.frame, figure.set.len()), (0, 0));
        assert_eq!(index.names(), "a (3.14a)");
    }

    #[test]
    fn mistakes_are_told() {
        for (text, said) in [
            (ENTRY.repeat(2), "two figures are called `a`"),
            (ENTRY.replace("'a'", "'../a'"), "is no name"),
            (ENTRY.replace("caption", "capton"), "capton"),
        ] {
            let error = Index::parse(&text).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn every_figure_of_the_repository_has_its_scene() {
        let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
        let index = Index::read(&scenes.join("figures/gallery.toml")).unwrap();
        assert!(index.figures.len() > 10);
        for figure in &index.figures {
            assert!(scenes.join(&figure.scene).is_file(), "{}", figure.scene);
        }
    }
}
