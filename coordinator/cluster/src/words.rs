//! Words of a shell's command line.

/// A word that any POSIX shell reads as exactly this text.
pub(crate) fn quote(text: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-_./:=,@%+".contains(letter);
    match !text.is_empty() && text.chars().all(is_plain) {
        true => text.to_owned(),
        false => format!("'{}'", text.replace('\'', r"'\''")),
    }
}

/// A path of a site: one that begins with `~/` lies in the home of whoever logs in there.
pub(crate) fn quote_path(path: &str) -> String {
    match path.strip_prefix("~/") {
        Some(rest) => format!("\"$HOME\"/{}", quote(rest)),
        None => quote(path),
    }
}

/// All of them, apart.
pub(crate) fn quote_all<T: AsRef<str>>(words: impl IntoIterator<Item = T>) -> String {
    let words: Vec<_> = words.into_iter().map(|word| quote(word.as_ref())).collect();
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn a_shell_reads_what_was_quoted(words in prop::collection::vec("[^\u{0}]{0,12}", 0..4)) {
            let script = format!("printf '%s\\0' {}", quote_all(&words));
            let said = Command::new("sh").arg("-c").arg(script).output().unwrap();
            let expected: String = match words.is_empty() {
                true => "\0".to_owned(),
                false => words.iter().map(|word| format!("{word}\0")).collect(),
            };
            prop_assert_eq!(String::from_utf8_lossy(&said.stdout), expected);
        }
    }

    #[test]
    fn a_path_in_a_home_stays_there() {
        assert_eq!(quote_path("~/a b"), "\"$HOME\"/'a b'");
        assert_eq!(quote_path("/x/~/y"), "'/x/~/y'");
    }
}
