//! Results on standard output: as a table, as JSON, or as little as a script needs.

use std::io::{self, Write};

use serde::Serialize;

use crate::error::Error;

/// How results are printed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, clap::ValueEnum)]
pub(crate) enum Format {
    /// For people.
    #[default]
    Table,
    /// One JSON value; its fields keep their names and meanings from version to version.
    Json,
    /// Only what names the result: a number, a digest, a path; one in a line.
    Quiet,
}

/// A result that a command prints. Its JSON form is its fields, in `snake_case`.
pub(crate) trait Report: Serialize {
    /// Writes it for people.
    fn table(&self, out: &mut dyn Write) -> io::Result<()>;

    /// Writes only what names it.
    fn quiet(&self, out: &mut dyn Write) -> io::Result<()>;
}

/// Prints a result on standard output.
pub(crate) fn print(format: Format, report: &impl Report) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    write(format, report, &mut out)
        .and_then(|()| out.flush())
        .map_err(|error| Error::failed("cannot print the result").because(error))
}

fn write(format: Format, report: &impl Report, out: &mut dyn Write) -> io::Result<()> {
    match format {
        Format::Table => report.table(out),
        Format::Quiet => report.quiet(out),
        Format::Json => {
            serde_json::to_writer_pretty(&mut *out, report)?;
            writeln!(out)
        }
    }
}

/// An empty table in the house style: no lines, columns apart.
pub(crate) fn columns<const N: usize>(header: [&str; N]) -> comfy_table::Table {
    let mut table = comfy_table::Table::new();
    table
        .load_style(comfy_table::presets::NOTHING)
        .set_header(header);
    table
}

/// Prints a sentence about what is going on to standard error; a closed one is not worth ending for.
pub(crate) fn say(sentence: impl std::fmt::Display) {
    let _ = writeln!(io::stderr().lock(), "{sentence}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Answer {
        the_number: u32,
    }

    impl Report for Answer {
        fn table(&self, out: &mut dyn Write) -> io::Result<()> {
            writeln!(out, "The number is {}.", self.the_number)
        }

        fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
            writeln!(out, "{}", self.the_number)
        }
    }

    #[test]
    fn one_result_three_ways() {
        let written = |format| {
            let mut out = Vec::new();
            write(format, &Answer { the_number: 42 }, &mut out).unwrap();
            String::from_utf8(out).unwrap()
        };
        assert_eq!(written(Format::Table), "The number is 42.\n");
        assert_eq!(written(Format::Quiet), "42\n");
        assert_eq!(written(Format::Json), "{\n  \"the_number\": 42\n}\n");
    }
}
