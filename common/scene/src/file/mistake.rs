//! What is wrong with a scene file, where, and what to do about it.

use std::fmt;
use std::ops::Range;

/// A text that mistakes point into: the scene file, or an override from the command line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Source {
    /// The file's path, or the flag's name.
    pub name: String,
    /// The whole text.
    pub text: String,
}

/// Where something was written.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Place {
    /// Which of the sources; 0 is the file.
    pub source: usize,
    /// Bytes of its text.
    pub span: Range<usize>,
}

/// One mistake.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Mistake {
    /// What is wrong, a sentence without its full stop.
    pub message: String,
    /// A few words to stand beside the caret.
    pub label: String,
    /// What to do about it.
    pub help: Option<String>,
    /// Where.
    pub place: Place,
}

/// Every mistake of a scene, in the order of their places.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SceneError {
    /// The texts that the mistakes point into.
    pub sources: Vec<Source>,
    /// At least one.
    pub mistakes: Vec<Mistake>,
}

impl Source {
    /// Line and column of a byte, both from 1; columns count characters.
    pub fn line_and_column(&self, byte: usize) -> (usize, usize) {
        let mut end = byte.min(self.text.len());
        while !self.text.is_char_boundary(end) {
            end -= 1;
        }
        let before = &self.text[..end];
        let line = before.matches('\n').count() + 1;
        let start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (line, before[start..].chars().count() + 1)
    }
}

impl SceneError {
    pub(super) fn new(sources: Vec<Source>, mut mistakes: Vec<Mistake>) -> Self {
        mistakes.sort_by_key(|mistake| (mistake.place.source, mistake.place.span.start));
        mistakes.dedup();
        Self { sources, mistakes }
    }

    /// A mistake about a file that has no text to point into.
    pub(super) fn unplaced(name: String, message: String) -> Self {
        let place = Place {
            source: 0,
            span: 0..0,
        };
        Self {
            sources: vec![Source {
                name,
                text: String::new(),
            }],
            mistakes: vec![Mistake {
                message,
                label: String::new(),
                help: None,
                place,
            }],
        }
    }
}

impl fmt::Display for SceneError {
    /// One line per mistake: `file:line:column: message (help)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, mistake) in self.mistakes.iter().enumerate() {
            if index > 0 {
                writeln!(f)?;
            }
            let source = &self.sources[mistake.place.source];
            write!(f, "{}:", source.name)?;
            if !source.text.is_empty() {
                let (line, column) = source.line_and_column(mistake.place.span.start);
                write!(f, "{line}:{column}:")?;
            }
            write!(f, " {}", mistake.message)?;
            if let Some(help) = &mistake.help {
                write!(f, " ({help})")?;
            }
        }
        Ok(())
    }
}

impl std::error::Error for SceneError {}
