//! The twins of every long option: an environment variable and a key of the configuration file.
//!
//! `flyby render --threads 2` may also be said as `FLYBY_RENDER_THREADS=2`, or in
//! the file as `threads = 2` under `[render]`; options of every command, such as `--state`,
//! are `FLYBY_STATE` and `state` at the file's top. File < environment < flag.
//!
//! It is done once, over clap's tree of commands: a twin becomes its option's default
//! value, after it has passed the option's own parser.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};

use clap::builder::{ArgPredicate, OsStr as ClapStr};
use clap::{Arg, ArgAction, Command};
use toml::{Table, Value};

use crate::error::Error;

/// The configuration file as it was read.
#[derive(Default)]
pub(crate) struct ConfigFile {
    /// Its path, for messages.
    pub(crate) path: String,
    /// What it says.
    pub(crate) table: Table,
}

impl ConfigFile {
    /// Parses the file's text.
    pub(crate) fn parse(path: String, text: &str) -> Result<Self, Error> {
        match text.parse() {
            Ok(table) => Ok(Self { path, table }),
            Err(error) => {
                Err(Error::usage(format!("the configuration `{path}` is no TOML")).because(error))
            }
        }
    }
}

/// Where twins are looked up.
pub(crate) struct Sources {
    /// The configuration file.
    pub(crate) file: ConfigFile,
    /// The environment's variables, at least those that start with `FLYBY_`.
    pub(crate) environment: BTreeMap<OsString, OsString>,
}

/// Which twin a value comes from, the stronger one last.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum Origin {
    File,
    Environment,
}

/// What a twin says about one option.
struct Twin {
    origin: Origin,
    values: Vec<OsString>,
    /// The twin in words, for messages.
    place: String,
}

/// Gives every long option of `command` and its subcommands the default that its twins name.
///
/// Fails on a key that no option has and on a value that the option would refuse.
pub(crate) fn apply(command: Command, sources: &Sources) -> Result<Command, Error> {
    level(command, &[], Some(&sources.file.table), sources)
}

fn level(
    mut command: Command,
    path: &[String],
    table: Option<&Table>,
    sources: &Sources,
) -> Result<Command, Error> {
    if let Some(table) = table {
        refuse_unknown_keys(&command, path, table, sources)?;
    }
    let mut twins: Vec<(String, Twin)> = Vec::new();
    for arg in command.get_arguments().filter(|arg| has_twins(arg)) {
        if let Some(twin) = find(arg, path, table, sources)? {
            twins.push((arg.get_id().to_string(), twin));
        }
    }
    for (id, twin) in &twins {
        let rivals = rivals(&command, id);
        let stronger = twins
            .iter()
            .filter(|(other, rival)| rivals.contains(other) && rival.origin >= twin.origin)
            .max_by_key(|(_, rival)| rival.origin);
        match stronger {
            Some((_, rival)) if rival.origin == twin.origin => {
                return Err(Error::usage(format!(
                    "{} and {} exclude each other",
                    twin.place, rival.place
                ))
                .next("keep one of them"));
            }
            Some(_) => {}
            None => command = command.mut_arg(id, |arg| with_default(arg, twin, &rivals)),
        }
    }
    let children: Vec<String> = command
        .get_subcommands()
        .map(|child| child.get_name().to_owned())
        .collect();
    for name in children {
        let mut child_path = path.to_vec();
        child_path.push(name.clone());
        let child_table = table
            .and_then(|table| table.get(&name))
            .and_then(Value::as_table);
        let mut failure = None;
        command = command.mut_subcommand(&name, |child| {
            let unchanged = child.clone();
            level(child, &child_path, child_table, sources).unwrap_or_else(|error| {
                failure = Some(error);
                unchanged
            })
        });
        if let Some(error) = failure {
            return Err(error);
        }
    }
    Ok(command)
}

/// Whether an argument is a long option that says something (not `--help`).
fn has_twins(arg: &Arg) -> bool {
    arg.get_long().is_some()
        && matches!(
            arg.get_action(),
            ArgAction::Set | ArgAction::Append | ArgAction::SetTrue
        )
}

/// The options that exclude this one; clap may know it of either of the two.
fn rivals(command: &Command, id: &str) -> Vec<String> {
    let excludes = |one: &Arg, other: &str| {
        let excluded = command.get_arg_conflicts_with(one);
        excluded.iter().any(|arg| arg.get_id() == other)
    };
    let arg = command.get_arguments().find(|arg| arg.get_id() == id);
    command
        .get_arguments()
        .filter(|other| {
            let other_id = other.get_id().as_str();
            other_id != id
                && (excludes(other, id) || arg.is_some_and(|arg| excludes(arg, other_id)))
        })
        .map(|other| other.get_id().to_string())
        .collect()
}

fn with_default(arg: Arg, twin: &Twin, rivals: &[String]) -> Arg {
    let values = twin.values.iter().cloned().map(ClapStr::from);
    // A rival on the command line silences the twin.
    let arg = rivals.iter().fold(arg, |arg, rival| {
        arg.default_value_if(rival, ArgPredicate::IsPresent, None)
    });
    arg.required(false).default_values(values)
}

/// What the stronger of an option's twins says, checked by the option's own parser.
fn find(
    arg: &Arg,
    path: &[String],
    table: Option<&Table>,
    sources: &Sources,
) -> Result<Option<Twin>, Error> {
    let long = arg.get_long().expect("only long options have twins");
    let variable = variable(path, long);
    let twin = if let Some(value) = sources.environment.get(OsStr::new(&variable)) {
        Twin {
            origin: Origin::Environment,
            values: vec![value.clone()],
            place: format!("the environment variable `{variable}`"),
        }
    } else if let Some(value) = table.and_then(|table| table.get(long)) {
        let place = in_file(path, long, sources);
        let values = texts(value).ok_or_else(|| {
            Error::usage(format!("{place} must be a text, a number, true or false"))
        })?;
        Twin {
            origin: Origin::File,
            values,
            place,
        }
    } else {
        return Ok(None);
    };
    let twin = if matches!(arg.get_action(), ArgAction::SetTrue) {
        as_switch(twin)?
    } else {
        check(arg, long, twin)?
    };
    Ok(Some(twin))
}

/// The environment variable of an option.
fn variable(path: &[String], long: &str) -> String {
    let mut name = String::from("FLYBY");
    for word in path.iter().map(String::as_str).chain([long]) {
        name.push('_');
        name.push_str(&word.to_uppercase().replace('-', "_"));
    }
    name
}

fn in_file(path: &[String], key: &str, sources: &Sources) -> String {
    let table = match path {
        [] => String::new(),
        path => format!(" under `[{}]`", path.join(".")),
    };
    format!(
        "`{key}`{table} in the configuration `{}`",
        sources.file.path
    )
}

/// A value of the file as the texts that the command line would hold.
fn texts(value: &Value) -> Option<Vec<OsString>> {
    match value {
        Value::String(text) => Some(vec![text.into()]),
        Value::Integer(number) => Some(vec![number.to_string().into()]),
        Value::Float(number) => Some(vec![number.to_string().into()]),
        Value::Boolean(answer) => Some(vec![answer.to_string().into()]),
        Value::Array(values) => {
            let mut all = Vec::new();
            for value in values {
                if value.is_array() {
                    return None;
                }
                all.extend(texts(value)?);
            }
            Some(all)
        }
        Value::Table(_) | Value::Datetime(_) => None,
    }
}

/// A switch's twin as clap's own word for on or off.
fn as_switch(twin: Twin) -> Result<Twin, Error> {
    let word = match twin.values.as_slice() {
        [word] => word.to_string_lossy().to_lowercase(),
        _ => String::new(),
    };
    let on = match word.as_str() {
        "true" | "1" | "yes" | "on" => "true",
        "false" | "0" | "no" | "off" => "false",
        _ => {
            return Err(Error::usage(format!(
                "{} switches something on or off: it must be true or false",
                twin.place
            )));
        }
    };
    Ok(Twin {
        values: vec![on.into()],
        ..twin
    })
}

/// Passes a twin through its option's own parser, by a command that has this option alone.
fn check(arg: &Arg, long: &str, twin: Twin) -> Result<Twin, Error> {
    let mut alone = Arg::new("value")
        .long(long.to_owned())
        .action(arg.get_action().clone())
        .value_parser(arg.get_value_parser().clone());
    if let Some(delimiter) = arg.get_value_delimiter() {
        alone = alone.value_delimiter(delimiter);
    }
    let words = twin.values.iter().map(|value| {
        let mut word = OsString::from(format!("--{long}="));
        word.push(value);
        word
    });
    let tried = Command::new("twin")
        .no_binary_name(true)
        .arg(alone)
        .try_get_matches_from(words);
    match tried {
        Ok(_) => Ok(twin),
        Err(error) => {
            let said = error.render().to_string();
            let said = said.lines().next().unwrap_or_default();
            let said = said.strip_prefix("error: ").unwrap_or(said).to_owned();
            Err(Error::usage(format!("{} is refused", twin.place)).because(said))
        }
    }
}

fn refuse_unknown_keys(
    command: &Command,
    path: &[String],
    table: &Table,
    sources: &Sources,
) -> Result<(), Error> {
    let options: Vec<&str> = command
        .get_arguments()
        .filter(|arg| has_twins(arg))
        .filter_map(Arg::get_long)
        .collect();
    let commands: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
    for (key, value) in table {
        let known = if value.is_table() {
            &commands
        } else {
            &options
        };
        if known.contains(&key.as_str()) {
            continue;
        }
        let place = in_file(path, key, sources);
        let nearest = options
            .iter()
            .chain(&commands)
            .map(|name| (strsim::damerau_levenshtein(key, name), name))
            .min_by_key(|(distance, _)| *distance)
            .filter(|(distance, name)| *distance <= 1 + name.len() / 4);
        let error = Error::usage(format!("{place} is no option of this program"));
        return Err(match nearest {
            Some((0, name)) if value.is_table() => error.next(format!("`{name}` takes one value")),
            Some((0, name)) => error.next(format!("`{name}` is a command: write `[{name}]`")),
            Some((_, name)) => error.next(format!("did you mean `{name}`?")),
            None => error.next(format!("known here: {}", known.join(", "))),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program() -> Command {
        let number = |name: &'static str| {
            Arg::new(name)
                .long(name)
                .value_parser(clap::value_parser!(u32))
        };
        Command::new("flyby")
            .arg(Arg::new("state").long("state").global(true))
            .subcommand(
                Command::new("render")
                    .arg(number("threads"))
                    .arg(number("tile").conflicts_with("min-tile-pixels"))
                    .arg(number("min-tile-pixels"))
                    .arg(Arg::new("movie").long("movie").action(ArgAction::SetTrue))
                    .arg(Arg::new("set").long("set").action(ArgAction::Append)),
            )
            .subcommand(Command::new("job").subcommand(Command::new("list").arg(number("last"))))
    }

    fn sources(file: &str, environment: &[(&str, &str)]) -> Sources {
        Sources {
            file: ConfigFile::parse("c.toml".into(), file).unwrap(),
            environment: environment
                .iter()
                .map(|(name, value)| (name.into(), value.into()))
                .collect(),
        }
    }

    fn threads(file: &str, environment: &[(&str, &str)], words: &[&str]) -> Option<u32> {
        let words = ["flyby", "render"].iter().chain(words);
        apply(program(), &sources(file, environment))
            .unwrap()
            .get_matches_from(words)
            .subcommand_matches("render")
            .unwrap()
            .get_one("threads")
            .copied()
    }

    #[test]
    fn file_then_environment_then_flag() {
        let file = "[render]\nthreads = 1";
        let environment = [("FLYBY_RENDER_THREADS", "2")];
        assert_eq!(threads("", &[], &[]), None);
        assert_eq!(threads(file, &[], &[]), Some(1));
        assert_eq!(threads(file, &environment, &[]), Some(2));
        assert_eq!(threads(file, &environment, &["--threads", "3"]), Some(3));
    }

    #[test]
    fn nested_commands_switches_and_lists() {
        let matches = |file: &str, environment: &[(&str, &str)], words: &[&str]| {
            apply(program(), &sources(file, environment))
                .unwrap()
                .get_matches_from(words)
        };
        let nested = matches("[job.list]\nlast = 4", &[], &["flyby", "job", "list"]);
        let list = nested
            .subcommand_matches("job")
            .and_then(|job| job.subcommand_matches("list"))
            .unwrap();
        assert_eq!(list.get_one::<u32>("last"), Some(&4));

        let file = "state = '/s'\n[render]\nmovie = true\nset = ['a=1', 'b=2']";
        let all = matches(file, &[("FLYBY_STATE", "/t")], &["flyby", "render"]);
        let render = all.subcommand_matches("render").unwrap();
        assert_eq!(render.get_one::<String>("state").unwrap(), "/t");
        assert!(render.get_flag("movie"));
        let set: Vec<&String> = render.get_many("set").unwrap().collect();
        assert_eq!(set, ["a=1", "b=2"]);

        let off = matches(file, &[("FLYBY_RENDER_MOVIE", "no")], &["flyby", "render"]);
        assert!(!off.subcommand_matches("render").unwrap().get_flag("movie"));
    }

    #[test]
    fn what_excludes_each_other() {
        let tiles = |file: &str, environment: &[(&str, &str)], words: &[&str]| {
            let matches = apply(program(), &sources(file, environment))
                .unwrap()
                .get_matches_from(["flyby", "render"].iter().chain(words));
            let render = matches.subcommand_matches("render").unwrap();
            (
                render.get_one::<u32>("tile").copied(),
                render.get_one::<u32>("min-tile-pixels").copied(),
            )
        };
        let file = "[render]\ntile = 1";
        assert_eq!(tiles(file, &[], &[]), (Some(1), None));
        let flag = ["--min-tile-pixels", "2"];
        assert_eq!(tiles(file, &[], &flag), (None, Some(2)));
        let environment = [("FLYBY_RENDER_MIN_TILE_PIXELS", "3")];
        assert_eq!(tiles(file, &environment, &[]), (None, Some(3)));
        assert_eq!(tiles(file, &environment, &["--tile", "4"]), (Some(4), None));
    }

    #[test]
    fn mistakes_are_named_with_their_place() {
        let said = |file: &str, environment: &[(&str, &str)]| {
            let error = apply(program(), &sources(file, environment)).unwrap_err();
            assert_eq!(error.ending(), crate::error::Ending::Usage);
            error.to_string()
        };
        let unknown = said("[render]\nthread = 2", &[]);
        assert!(unknown.contains("`thread` under `[render]` in the configuration `c.toml`"));
        assert!(unknown.contains("did you mean `threads`?"));
        let wrong = said("[render]\nthreads = 'two'", &[]);
        assert!(
            wrong.contains("invalid value 'two' for '--threads"),
            "{wrong}"
        );
        let variable = said("", &[("FLYBY_RENDER_THREADS", "many")]);
        assert!(
            variable.contains("`FLYBY_RENDER_THREADS` is refused"),
            "{variable}"
        );
        assert!(said("[rendr]\n", &[]).contains("did you mean `render`?"));
        assert!(said("render = 3", &[]).contains("write `[render]`"));
        assert!(said("[render]\nmovie = 3", &[]).contains("true or false"));
        let both = said("[render]\ntile = 1\nmin-tile-pixels = 2", &[]);
        assert!(both.contains("exclude each other"), "{both}");
        assert!(ConfigFile::parse("c.toml".into(), "= 3").is_err());
    }
}
