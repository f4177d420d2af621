//! Reading `sites.toml`: a table for each site, every value checked where it stands.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::net::SocketAddr;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use model::{Span, words};
use serde::Deserialize;
use toml::Spanned;

use super::{Cancelled, Kind, Mistake, Mode, Site, Sites, SitesError};

/// Most bytes of the file.
pub const FILE_BYTES_MAX: u64 = 1 << 20;

/// Most sites.
const SITES_MAX: usize = 64;

/// The file as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    #[serde(default)]
    site: BTreeMap<Spanned<String>, SiteText>,
}

/// A site as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SiteText {
    kind: Spanned<Kind>,
    #[serde(default)]
    mode: Mode,
    address: Option<Spanned<String>>,
    #[serde(default)]
    ssh_options: Vec<Spanned<String>>,
    setup: Option<Spanned<String>>,
    min_tile_pixels: Option<Spanned<i64>>,
    max_array_size: Option<Spanned<i64>>,
    max_running: Option<Spanned<i64>>,
    poll: Option<Spanned<String>>,
    ahead: Option<Spanned<i64>>,
    time_limit: Option<Spanned<String>>,
    queue: Option<Spanned<String>>,
    account: Option<Spanned<String>>,
    parallel_environment: Option<Spanned<String>>,
    #[serde(default)]
    submit: Vec<Spanned<String>>,
    #[serde(default)]
    labels: Vec<Spanned<String>>,
    threads: Option<Spanned<i64>>,
    memory: Option<Spanned<String>>,
    folder: Option<Spanned<String>>,
    program: Option<Spanned<String>>,
    template: Option<Spanned<String>>,
    idle: Option<Spanned<String>>,
    patience: Option<Spanned<String>>,
    coordinator: Option<Spanned<String>>,
    #[serde(default)]
    cancelled: Cancelled,
}

/// Reads and checks the file.
pub fn read(path: &Path) -> Result<Sites, SitesError> {
    let unreadable = |what: String| SitesError {
        file: path.display().to_string(),
        text: String::new(),
        mistakes: vec![Mistake {
            message: format!("it cannot be read: {what}"),
            label: String::new(),
            help: Some("`deploy/sites.toml` in the source is one to start from".to_owned()),
            span: 0..0,
        }],
    };
    let mut text = String::new();
    let read = File::open(path).and_then(|file| {
        // One byte more than there may be, to see whether there is.
        file.take(FILE_BYTES_MAX + 1).read_to_string(&mut text)
    });
    match read {
        Err(error) => Err(unreadable(error.to_string())),
        Ok(bytes) if bytes as u64 > FILE_BYTES_MAX => Err(unreadable(format!(
            "it has more than {FILE_BYTES_MAX} bytes"
        ))),
        Ok(_) => parse(&path.display().to_string(), &text, path.parent()),
    }
}

/// Checks the text of a file; paths of templates begin at `folder`, where they are not absolute.
pub fn parse(file: &str, text: &str, folder: Option<&Path>) -> Result<Sites, SitesError> {
    let mut mistakes = Vec::new();
    let mut sites = Vec::new();
    match toml::from_str::<Text>(text) {
        Err(error) => mistakes.push(not_so(&error, text)),
        Ok(read) => {
            if read.site.len() > SITES_MAX {
                mistakes.push(Mistake {
                    message: format!("there are more than {SITES_MAX} sites"),
                    label: String::new(),
                    help: None,
                    span: 0..0,
                });
            }
            for (name, site) in read.site {
                let mut check = Check {
                    mistakes: &mut mistakes,
                };
                sites.push(check.site(name, site, folder));
            }
        }
    }
    if mistakes.is_empty() {
        return Ok(Sites(sites));
    }
    mistakes.sort_by_key(|mistake| mistake.span.start);
    Err(SitesError {
        file: file.to_owned(),
        text: text.to_owned(),
        mistakes,
    })
}

/// What the TOML reader says.
fn not_so(error: &toml::de::Error, text: &str) -> Mistake {
    let message = error.message().lines().collect::<Vec<_>>().join(", ");
    let span = error.span().unwrap_or(0..0);
    let start = span.start.min(text.len());
    let span = start..span.end.clamp(start, text.len());
    let help = message
        .strip_prefix("unknown field `")
        .and_then(|rest| rest.split_once('`'))
        .and_then(|(unknown, rest)| {
            let known = rest.split('`').skip(1).step_by(2);
            nearest(unknown, known)
        })
        .map(|near| format!("did you mean `{near}`?"));
    Mistake {
        message,
        label: "here".to_owned(),
        help,
        span,
    }
}

/// The word that was probably meant.
fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    /// Jaro-Winkler similarity below which two words share nothing.
    const ALIKE: f64 = 0.8;
    let alike = known.map(|each| (strsim::jaro_winkler(word, each), each));
    let near = alike.filter(|(alike, _)| *alike >= ALIKE);
    near.max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, each)| each)
}

/// Gathers what is wrong with one site; every reader gives a value, so that the rest is read too.
struct Check<'a> {
    mistakes: &'a mut Vec<Mistake>,
}

impl Check<'_> {
    fn site(&mut self, name: Spanned<String>, text: SiteText, folder: Option<&Path>) -> Site {
        let kind = *text.kind.get_ref();
        let kind_span = text.kind.span();
        let has_address = text.address.is_some();
        match kind {
            Kind::Ssh if !has_address => self.add(
                kind_span.clone(),
                "a site of kind ssh needs its address".to_owned(),
                "write address = \"user@host\", as for the ssh program",
            ),
            Kind::Local if has_address => self.add(
                kind_span.clone(),
                "a site of kind local is this machine and has no address".to_owned(),
                "remove the address, or write kind = \"ssh\"",
            ),
            _ => {}
        }
        let threads = self
            .whole(text.threads.as_ref(), "threads", 1..=4_096)
            .unwrap_or(1);
        let parallel_environment = self.word(text.parallel_environment.as_ref());
        if kind == Kind::GridEngine && threads > 1 && parallel_environment.is_none() {
            self.add(
                text.threads.map_or(kind_span, |threads| threads.span()),
                "Grid Engine gives several slots of one host through a parallel environment".to_owned(),
                "name it, such as parallel_environment = \"smp\"; `qconf -spl` lists those there are",
            );
        }
        let folder_there = self
            .path(text.folder.as_ref())
            .unwrap_or_else(|| "~/.flyby".to_owned());
        let program = self.path(text.program.as_ref());
        let program = program.unwrap_or_else(|| format!("{folder_there}/bin/flyby"));
        Site {
            kind,
            mode: text.mode,
            address: self.address(text.address.as_ref()),
            ssh_options: self.lines(text.ssh_options),
            setup: text.setup.map(|setup| self.line(&setup)),
            min_tile_pixels: self
                .whole(
                    text.min_tile_pixels.as_ref(),
                    "min_tile_pixels",
                    1..=1 << 30,
                )
                .map_or(2_500, u64::from),
            max_array_size: self.whole(text.max_array_size.as_ref(), "max_array_size", 1..=1 << 24),
            max_running: self.whole(text.max_running.as_ref(), "max_running", 1..=100_000),
            poll: self
                .span(text.poll.as_ref(), "1 s", "5 min")
                .unwrap_or(Span::from_secs(30)),
            ahead: self
                .whole(text.ahead.as_ref(), "ahead", 0..=64)
                .unwrap_or(1),
            time_limit: self.span(text.time_limit.as_ref(), "1 min", "365 d"),
            queue: self.word(text.queue.as_ref()),
            account: self.word(text.account.as_ref()),
            parallel_environment,
            submit: self.lines(text.submit),
            labels: self.labels(text.labels),
            threads,
            memory_bytes: text
                .memory
                .and_then(|memory| self.take(memory.span(), words::memory(memory.get_ref()))),
            folder: folder_there,
            program,
            template: text.template.map(|template| {
                let template = PathBuf::from(template.into_inner());
                folder.map_or(template.clone(), |folder| folder.join(template))
            }),
            idle: self
                .span(text.idle.as_ref(), "1 s", "1 d")
                .unwrap_or(Span::from_secs(120)),
            patience: self
                .span(text.patience.as_ref(), "1 s", "7 d")
                .unwrap_or(Span::from_secs(3_600)),
            coordinator: self.dial(text.coordinator.as_ref()),
            cancelled: text.cancelled,
            name: self.name(name),
        }
    }

    fn add(&mut self, span: Range<usize>, message: String, help: &str) {
        self.mistakes.push(Mistake {
            message,
            label: "here".to_owned(),
            help: (!help.is_empty()).then(|| help.to_owned()),
            span,
        });
    }

    /// A value, or the sentence that says why it is none.
    fn take<T>(&mut self, span: Range<usize>, value: Result<T, String>) -> Option<T> {
        value.map_err(|why| self.add(span, why, "")).ok()
    }

    fn name(&mut self, name: Spanned<String>) -> String {
        let is_first = |letter: char| letter.is_ascii_alphanumeric();
        let may_be = |letter: char| letter.is_ascii_alphanumeric() || "-_".contains(letter);
        let text = name.get_ref();
        if text.len() > 32 || !text.starts_with(is_first) || !text.chars().all(may_be) {
            self.add(
                name.span(),
                format!("`{text}` is no name of a site"),
                "it has at most 32 letters, digits, `-` or `_`, a letter or digit first",
            );
        }
        name.into_inner()
    }

    fn whole(
        &mut self,
        value: Option<&Spanned<i64>>,
        name: &str,
        range: RangeInclusive<u32>,
    ) -> Option<u32> {
        let value = value?;
        let number = u32::try_from(*value.get_ref()).ok();
        let number = number.filter(|number| range.contains(number));
        if number.is_none() {
            let (least, most) = (range.start(), range.end());
            self.add(
                value.span(),
                format!("`{name}` is a whole number from {least} to {most}"),
                "",
            );
        }
        number
    }

    /// A length of time between two others.
    fn span(&mut self, value: Option<&Spanned<String>>, least: &str, most: &str) -> Option<Span> {
        let value = value?;
        let span = self.take(value.span(), words::span(value.get_ref()))?;
        let is_within = |bound: &str, above: bool| {
            words::span(bound).is_ok_and(|bound| if above { span >= bound } else { span <= bound })
        };
        if is_within(least, true) && is_within(most, false) {
            return Some(span);
        }
        let message = format!("this must be between {least} and {most}");
        self.add(value.span(), message, "");
        None
    }

    /// A name that a queue gives: one word.
    fn word(&mut self, value: Option<&Spanned<String>>) -> Option<String> {
        let value = value?;
        let text = value.get_ref();
        let may_be = |letter: char| letter.is_ascii_alphanumeric() || "-_.@,*".contains(letter);
        if text.is_empty() || text.len() > 128 || text.starts_with('-') || !text.chars().all(may_be)
        {
            let message = format!("`{text}` is no name that a queue gives");
            self.add(value.span(), message, "");
        }
        Some(text.clone())
    }

    /// Where ssh logs in: a word that it cannot take for an option.
    fn address(&mut self, value: Option<&Spanned<String>>) -> Option<String> {
        let value = value?;
        let text = value.get_ref();
        let may_be = |letter: char| letter.is_ascii_alphanumeric() || "-_.@:%[]/".contains(letter);
        if text.is_empty() || text.len() > 256 || text.starts_with('-') || !text.chars().all(may_be)
        {
            let message = format!("`{text}` is no address for ssh");
            self.add(
                value.span(),
                message,
                "write it as user@host, or as a Host of ~/.ssh/config",
            );
        }
        Some(text.clone())
    }

    /// Where workers dial: an address and a port.
    fn dial(&mut self, value: Option<&Spanned<String>>) -> Option<String> {
        let value = value?;
        let text = value.get_ref();
        let address: Option<SocketAddr> = text.parse().ok();
        if address.is_none_or(|address| address.port() == 0) {
            let message = format!("`{text}` is no address of a coordinator");
            self.add(value.span(), message, "write it as 192.0.2.7:7359");
        }
        Some(text.clone())
    }

    /// A path there, absolute or in the home.
    fn path(&mut self, value: Option<&Spanned<String>>) -> Option<String> {
        let value = value?;
        let text = value.get_ref();
        let begins = text.starts_with('/') || text.starts_with("~/");
        if !begins
            || text.len() > 1_024
            || text
                .chars()
                .any(|letter| letter.is_control() || letter == '%')
        {
            self.add(
                value.span(),
                format!("`{text}` is no path that is the same from everywhere"),
                "begin it with / or ~/, and leave out %",
            );
        }
        Some(text.trim_end_matches('/').to_owned())
    }

    fn line(&mut self, value: &Spanned<String>) -> String {
        let text = value.get_ref();
        if text.chars().any(char::is_control) {
            let message = "this must be one line, without control characters".to_owned();
            self.add(value.span(), message, "join several commands by `;`");
        }
        text.clone()
    }

    fn lines(&mut self, values: Vec<Spanned<String>>) -> Vec<String> {
        values.iter().map(|value| self.line(value)).collect()
    }

    fn labels(&mut self, values: Vec<Spanned<String>>) -> Vec<String> {
        if let Some(value) = values.get(14) {
            let message = "a worker has at most 16 labels, one of which is its site's".to_owned();
            self.add(value.span(), message, "");
        }
        let label =
            |value: &Spanned<String>| self.take(value.span(), words::label(value.get_ref()));
        values.iter().filter_map(label).collect()
    }
}
