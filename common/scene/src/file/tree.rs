//! A TOML document as a tree whose every part knows where it was written.

use std::collections::BTreeMap;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::mistake::{Mistake, Place};

/// A value and where it was written.
#[derive(Clone, Debug)]
pub(crate) struct Item {
    pub(crate) value: Value,
    pub(crate) place: Place,
}

#[derive(Clone, Debug)]
pub(crate) enum Value {
    Text(String),
    Integer(i64),
    Number(f64),
    Flag(bool),
    /// A date or a time of day, which no scene holds.
    Date,
    List(Vec<Item>),
    Table(BTreeMap<String, Entry>),
}

#[derive(Clone, Debug)]
pub(crate) struct Entry {
    /// Where the key was written.
    pub(crate) key: Place,
    pub(crate) item: Item,
}

impl Value {
    /// What the value is, for messages.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Text(_) => "text",
            Self::Integer(_) | Self::Number(_) => "a number",
            Self::Flag(_) => "true or false",
            Self::Date => "a date",
            Self::List(_) => "a list",
            Self::Table(_) => "a table",
        }
    }
}

/// The tree of a document; what is no TOML is added to the mistakes.
pub(crate) fn parse(text: &str, source: usize, mistakes: &mut Vec<Mistake>) -> Item {
    let (document, errors) = DeTable::parse_recoverable(text);
    mistakes.extend(errors.into_iter().map(|error| Mistake {
        message: format!("this is not TOML: {}", error.message().replace('\n', ", ")),
        label: "here".into(),
        help: None,
        place: Place {
            source,
            span: within(error.span().unwrap_or(0..0), text),
        },
    }));
    let place = Place { source, span: 0..0 };
    Item {
        value: table(document.into_inner(), source, mistakes),
        place,
    }
}

/// The tree of a single value; `None` if the text is none.
pub(crate) fn parse_value(text: &str, source: usize) -> Option<Item> {
    let value = DeValue::parse(text).ok()?;
    let mut mistakes = Vec::new();
    let item = item(value, source, &mut mistakes);
    mistakes.is_empty().then_some(item)
}

fn within(span: Range<usize>, text: &str) -> Range<usize> {
    let start = span.start.min(text.len());
    start..span.end.clamp(start, text.len())
}

fn table(entries: DeTable<'_>, source: usize, mistakes: &mut Vec<Mistake>) -> Value {
    Value::Table(
        entries
            .into_iter()
            .map(|(key, value)| {
                let place = Place {
                    source,
                    span: key.span(),
                };
                let item = item(value, source, mistakes);
                (key.into_inner().into_owned(), Entry { key: place, item })
            })
            .collect(),
    )
}

fn item(value: Spanned<DeValue<'_>>, source: usize, mistakes: &mut Vec<Mistake>) -> Item {
    let place = Place {
        source,
        span: value.span(),
    };
    let value = match value.into_inner() {
        DeValue::String(text) => Value::Text(text.into_owned()),
        DeValue::Integer(digits) => match i64::from_str_radix(digits.as_str(), digits.radix()) {
            Ok(integer) => Value::Integer(integer),
            Err(_) => {
                mistakes.push(Mistake {
                    message: format!("{digits} is too large a number"),
                    label: "does not fit 64 bits".into(),
                    help: None,
                    place: place.clone(),
                });
                Value::Integer(0)
            }
        },
        DeValue::Float(digits) => Value::Number(digits.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(flag) => Value::Flag(flag),
        DeValue::Datetime(_) => Value::Date,
        DeValue::Array(items) => Value::List(
            items
                .into_iter()
                .map(|each| item(each, source, mistakes))
                .collect(),
        ),
        DeValue::Table(entries) => table(entries, source, mistakes),
    };
    Item { value, place }
}
