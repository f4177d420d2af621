//! A mistake in a file, shown with its line and a caret.

use std::fmt::Write as _;
use std::io::{self, IsTerminal as _};
use std::ops::Range;

use miette::{
    GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteDiagnostic, NamedSource, Report,
    Severity,
};

/// Columns of a report of mistakes.
const REPORT_WIDTH: usize = 100;

/// Something to say of a place in a file.
pub(crate) struct Caret<'a> {
    /// The file's name.
    pub(crate) file: &'a str,
    /// Its text; empty where there is none to point into.
    pub(crate) text: &'a str,
    /// Bytes of the text.
    pub(crate) span: Range<usize>,
    /// What is wrong.
    pub(crate) message: &'a str,
    /// A few words beside the caret.
    pub(crate) label: &'a str,
    /// What to do about it.
    pub(crate) help: Option<&'a str>,
}

impl Caret<'_> {
    /// The line with a caret below, and what to do.
    pub(crate) fn show(&self, severity: Severity) -> String {
        let mut diagnostic = MietteDiagnostic::new(self.message).with_severity(severity);
        if let Some(help) = self.help {
            diagnostic = diagnostic.with_help(help);
        }
        if !self.text.is_empty() {
            diagnostic = diagnostic.with_label(LabeledSpan::at(self.span.clone(), self.label));
        }
        let report = Report::new(diagnostic)
            .with_source_code(NamedSource::new(self.file, self.text.to_owned()));
        let theme = if io::stderr().is_terminal() {
            GraphicalTheme::unicode()
        } else {
            GraphicalTheme::unicode_nocolor()
        };
        let mut text = String::new();
        let shown = GraphicalReportHandler::new_themed(theme)
            .with_width(REPORT_WIDTH)
            .render_report(&mut text, report.as_ref());
        if shown.is_err() {
            // A span that the handler cannot show is no reason to hide the mistake.
            text.clear();
            let _ = writeln!(text, "{}: {}", self.file, self.message);
        }
        text
    }
}
