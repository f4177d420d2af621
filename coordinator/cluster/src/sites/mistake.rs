//! What is wrong with `sites.toml`, where, and what to do about it.

use std::fmt;
use std::ops::Range;

/// One mistake.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Mistake {
    /// What is wrong, a sentence without its full stop.
    pub message: String,
    /// A few words to stand beside the caret.
    pub label: String,
    /// What to do about it.
    pub help: Option<String>,
    /// Bytes of the file's text.
    pub span: Range<usize>,
}

/// Every mistake that was found in the file, in the order of their places.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SitesError {
    /// The file's path.
    pub file: String,
    /// Its text; empty where it could not be read.
    pub text: String,
    /// At least one.
    pub mistakes: Vec<Mistake>,
}

impl SitesError {
    /// Line and column of a byte, both from 1; columns count characters.
    pub fn line_and_column(&self, byte: usize) -> (usize, usize) {
        let mut end = byte.min(self.text.len());
        while !self.text.is_char_boundary(end) {
            end -= 1;
        }
        let before = &self.text[..end];
        let start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = before.matches('\n').count() + 1;
        (line, before[start..].chars().count() + 1)
    }
}

impl fmt::Display for SitesError {
    /// One line per mistake: `file:line:column: message (help)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, mistake) in self.mistakes.iter().enumerate() {
            if index > 0 {
                writeln!(f)?;
            }
            write!(f, "{}:", self.file)?;
            if !self.text.is_empty() {
                let (line, column) = self.line_and_column(mistake.span.start);
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

impl std::error::Error for SitesError {}
