//! What an allocation of pilot mode runs: one worker, which dials the coordinator.

use model::Span;

use crate::camp::Camp;
use crate::words::{quote_all, quote_path};

/// How a worker gets to its coordinator.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Dials<'a> {
    /// It is on this loopback address, and the token is its owner's.
    Address(&'a str),
    /// The token's file says where it is.
    TokenFile,
}

/// The script of an allocation. The worker finds its token in the camp's folder, never on a command line; it knows how
/// long it may run, and leaves before; it gives its place back when it is idle.
pub fn script(camp: &Camp, dials: Dials<'_>, time_limit: Option<Span>) -> String {
    let site = &camp.site;
    let milliseconds = |span: Span| format!("{} ms", span.0.div_ceil(1_000));
    let (place, mut options) = match dials {
        Dials::Address(address) => (
            String::new(),
            vec!["--coordinator".to_owned(), address.to_owned()],
        ),
        Dials::TokenFile => (
            format!(" --token-file {}", quote_path(&token_file(camp))),
            Vec::new(),
        ),
    };
    options.extend([
        "--threads".to_owned(),
        site.threads.to_string(),
        "--idle".to_owned(),
        milliseconds(site.idle),
        "--log".to_owned(),
        "warn".to_owned(),
    ]);
    if let Some(limit) = time_limit {
        options.extend(["--time-limit".to_owned(), milliseconds(limit)]);
    }
    for label in site.labels.iter().chain([&site.label()]) {
        options.extend(["--label".to_owned(), label.clone()]);
    }
    format!(
        "exec {} worker --state {}{place} {}",
        quote_path(&site.program),
        quote_path(&camp.folder()),
        quote_all(options)
    )
}

/// The file there that holds the token, inside the camp's folder.
pub fn token_file(camp: &Camp) -> String {
    format!("{}/token", camp.folder())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::sites;

    #[test]
    fn a_worker_is_told_all_but_the_token() {
        let text = "[site.a]\nkind = 'local'\nthreads = 2\nlabels = ['big']\nidle = '90 s'\n";
        let site = sites::parse("s", text, None).unwrap().0.remove(0);
        let camp = Camp::new(site, "00c0ffee".into(), Path::new("/x"));
        let limit = Some(Span::from_secs(60));
        assert_eq!(
            script(&camp, Dials::Address("127.0.0.1:7359"), limit),
            "exec \"$HOME\"/.flyby/bin/flyby worker --state \"$HOME\"/.flyby/farm-00c0ffee/a --coordinator 127.0.0.1:7359 \
             --threads 2 --idle '90000 ms' --log warn --time-limit '60000 ms' --label big --label site.a"
        );
        assert_eq!(
            script(&camp, Dials::TokenFile, None),
            "exec \"$HOME\"/.flyby/bin/flyby worker --state \"$HOME\"/.flyby/farm-00c0ffee/a --token-file \"$HOME\"/.flyby/farm-00c0ffee/a/token \
             --threads 2 --idle '90000 ms' --log warn --label big --label site.a"
        );
        assert_eq!(token_file(&camp), "~/.flyby/farm-00c0ffee/a/token");
    }
}
