//! Options of functions, given as a map, and lists of numbers.

use rhai::{Array, Dynamic, Map};

use super::Shared;
use super::refusal;
use super::values::{Made, refuse};
use crate::file::nearest;

/// The options of one call.
pub(super) struct Options<'a> {
    function: &'static str,
    given: &'a Map,
}

impl<'a> Options<'a> {
    /// Those of a call of `function`; refused if one is not among the `known`.
    pub(super) fn new(
        function: &'static str,
        known: &[&'static str],
        given: &'a Map,
    ) -> Made<Self> {
        if let Some(unknown) = given.keys().find(|key| !known.contains(&key.as_str())) {
            let help = match nearest(unknown, known.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None if known.is_empty() => "it takes no options".to_owned(),
                None => format!("its options are {}", known.join(", ")),
            };
            return refuse(format!("`{function}` has no option `{unknown}`"), help);
        }
        Ok(Self { function, given })
    }

    /// Whether it was given.
    pub(super) fn has(&self, option: &str) -> bool {
        self.given.contains_key(option)
    }

    /// A constant number.
    pub(super) fn number(&self, option: &str, default: f64) -> Made<f64> {
        match self.given.get(option) {
            Some(value) => Shared::constant(&format!("{}: {option}", self.function), value),
            None => Ok(default),
        }
    }

    /// Yes or no.
    pub(super) fn flag(&self, option: &str, default: bool) -> Made<bool> {
        match self.given.get(option) {
            None => Ok(default),
            Some(value) => value.as_bool().or_else(|_| {
                refuse(
                    format!("`{}: {option}` wants true or false", self.function),
                    format!("write {option}: true"),
                )
            }),
        }
    }

    /// One of some names, by its place among them.
    pub(super) fn name(&self, option: &str, names: &[&str], default: usize) -> Made<usize> {
        let Some(value) = self.given.get(option) else {
            return Ok(default);
        };
        let given = value.clone().into_string().unwrap_or_default();
        match names.iter().position(|name| *name == given) {
            Some(place) => Ok(place),
            None => {
                let quoted: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
                let help = match nearest(&given, names.iter().copied()) {
                    Some(near) => format!("did you mean \"{near}\"?"),
                    None => format!("it is one of {}", quoted.join(", ")),
                };
                refuse(
                    format!("`{}` has no {option} `{value}`", self.function),
                    help,
                )
            }
        }
    }

    /// A list of exactly N constant numbers.
    pub(super) fn numbers<const N: usize>(
        &self,
        option: &str,
        default: [f64; N],
    ) -> Made<[f64; N]> {
        let Some(value) = self.given.get(option) else {
            return Ok(default);
        };
        let what = format!("{}: {option}", self.function);
        let list = numbers(&what, value)?;
        match <[f64; N]>::try_from(list) {
            Ok(list) => Ok(list),
            Err(list) => refuse(
                format!("`{what}` wants {N} numbers, not {}", list.len()),
                format!("write it as a list of {N} numbers"),
            ),
        }
    }
}

/// A list.
pub(super) fn list(what: &str, value: &Dynamic) -> Made<Array> {
    let kind = refusal::kind(value.type_name()).to_owned();
    match value.clone().try_cast::<Array>() {
        Some(list) => Ok(list),
        None => refuse(
            format!("`{what}` wants a list here, not {kind}"),
            "lists are written in brackets: [1, 2, 3]",
        ),
    }
}

/// A list of constant numbers.
pub(super) fn numbers(what: &str, value: &Dynamic) -> Made<Vec<f64>> {
    list(what, value)?
        .iter()
        .map(|number| Shared::constant(what, number))
        .collect()
}

/// A place: a list of three numbers.
pub(super) fn place(what: &str, value: &Dynamic) -> Made<[f64; 3]> {
    let list = numbers(what, value)?;
    <[f64; 3]>::try_from(list).or_else(|list| {
        refuse(
            format!("`{what}` wants places of three numbers, not {}", list.len()),
            "a place is written [x, y, z]",
        )
    })
}
