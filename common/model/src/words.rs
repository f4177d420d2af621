//! How people write amounts and labels, in flags and in files: `4 s`, `512 MiB`, `big-mem.2`.
//!
//! Each function answers a sentence for its writer where the text is nothing of the kind.

use alloc::borrow::ToOwned as _;
use alloc::format;
use alloc::string::String;

use crate::Span;

/// A length of time: `1500 ms`, `4 s`, `2 min`, `12 h`, `30 d`.
pub fn span(text: &str) -> Result<Span, String> {
    let form =
        || format!("`{text}` is no length of time: write it as 1500 ms, 4 s, 2 min, 12 h or 30 d");
    let text = text.trim();
    let digits = text.trim_end_matches(|letter: char| letter.is_ascii_alphabetic());
    let milliseconds = match &text[digits.len()..] {
        "ms" => 1,
        "s" => 1_000,
        "min" => 60_000,
        "h" => 3_600_000,
        "d" => 86_400_000,
        _ => return Err(form()),
    };
    let number: u64 = digits.trim().parse().map_err(|_| form())?;
    match number.checked_mul(milliseconds) {
        // A year is more than anything here may take, and far from any overflow.
        Some(total @ 1..=31_536_000_000) => Ok(Span::from_millis(total)),
        _ => Err(format!(
            "`{text}` is out of range: 1 ms to a year is possible"
        )),
    }
}

/// A size of memory: `512 MiB`, `4 GiB`; in bytes.
pub fn memory(text: &str) -> Result<u64, String> {
    let form = || format!("`{text}` is no size of memory: write it as 512 MiB or 4 GiB");
    let text = text.trim();
    let digits = text.trim_end_matches(|letter: char| letter.is_ascii_alphabetic());
    let unit: u64 = match &text[digits.len()..] {
        "MiB" => 1 << 20,
        "GiB" => 1 << 30,
        "TiB" => 1 << 40,
        _ => return Err(form()),
    };
    let number: u64 = digits.trim().parse().map_err(|_| form())?;
    number
        .checked_mul(unit)
        .filter(|&bytes| bytes > 0)
        .ok_or_else(form)
}

/// A label of workers: 1 to 64 bytes of letters, digits, `-`, `_`, `.`.
pub fn label(text: &str) -> Result<String, String> {
    let may_be = |letter: char| letter.is_ascii_alphanumeric() || "-_.".contains(letter);
    if (1..=64).contains(&text.len()) && text.chars().all(may_be) {
        Ok(text.to_owned())
    } else {
        Err(format!(
            "`{text}` is no label: it has 1 to 64 letters, digits, `-`, `_` or `.`"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_of_time() {
        assert_eq!(span("1500 ms"), Ok(Span::from_millis(1_500)));
        assert_eq!(span("4s"), Ok(Span::from_secs(4)));
        assert_eq!(span("2 min"), Ok(Span::from_secs(120)));
        assert_eq!(span("12 h"), Ok(Span::from_secs(43_200)));
        assert_eq!(span("1d"), Ok(Span::from_secs(86_400)));
        for wrong in [
            "",
            "4",
            "s",
            "-4 s",
            "4 weeks",
            "0 s",
            "99999999999999 min",
            "4.5 s",
        ] {
            assert!(span(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn memory_and_labels() {
        assert_eq!(memory("512 MiB"), Ok(512 << 20));
        assert_eq!(memory("4GiB"), Ok(4 << 30));
        for wrong in ["4", "0 GiB", "4 GB", "99999999999999 TiB", ""] {
            assert!(memory(wrong).is_err(), "{wrong}");
        }
        assert_eq!(label("big-mem.2"), Ok("big-mem.2".to_owned()));
        for wrong in ["", "a b", "é", &"x".repeat(65)] {
            assert!(label(wrong).is_err(), "{wrong}");
        }
    }
}
