//! Reading the tables of a scene file by their keys; mistakes are collected, never thrown.
//!
//! Every reader gives a value even where there is a mistake, so that the rest
//! is read too. What then comes out is only used for finding more mistakes.

use std::cell::RefCell;
use std::collections::BTreeMap;

use model::{Rect, Resolution};

use super::keys::{Key, Presence, Shape};
use super::mistake::{Mistake, Place, Source};
use super::quantity::{Dimension, Refusal, nearest, quantity};
use super::tree::{self, Entry, Item, Value};
use crate::curve::Curve;

/// What the reading of one scene gathers.
pub(super) struct Reader<'a> {
    pub(super) sources: &'a [Source],
    mistakes: RefCell<Vec<Mistake>>,
    warnings: RefCell<Vec<Mistake>>,
    /// Where each key's value stands, by its dotted path.
    places: RefCell<BTreeMap<String, Place>>,
}

/// A table of the file, under the keys that it may have.
pub(super) struct Section<'a> {
    pub(super) reader: &'a Reader<'a>,
    path: String,
    keys: &'static [Key],
    entries: Option<&'a BTreeMap<String, Entry>>,
    place: Place,
}

/// A text of the file and where it stands.
#[derive(Clone, Debug)]
pub(super) struct Text<'a> {
    pub(super) text: &'a str,
    pub(super) place: Place,
}

impl<'a> Reader<'a> {
    pub(super) fn new(sources: &'a [Source]) -> Self {
        Self {
            sources,
            mistakes: RefCell::default(),
            warnings: RefCell::default(),
            places: RefCell::default(),
        }
    }

    pub(super) fn add(&self, mistake: Mistake) {
        self.mistakes.borrow_mut().push(mistake);
    }

    pub(super) fn warn(&self, mistake: Mistake) {
        self.warnings.borrow_mut().push(mistake);
    }

    pub(super) fn warnings(&self) -> Vec<Mistake> {
        self.warnings.borrow().clone()
    }

    pub(super) fn has_mistakes(&self) -> bool {
        !self.mistakes.borrow().is_empty()
    }

    pub(super) fn take_mistakes(&self) -> Vec<Mistake> {
        self.mistakes.take()
    }

    /// Where the value of a dotted path stands, or the nearest table around it that is there.
    pub(super) fn place_of(&self, path: &str) -> Place {
        let places = self.places.borrow();
        let mut path = path;
        loop {
            if let Some(place) = places.get(path) {
                return place.clone();
            }
            match path.rfind(['.', '[']) {
                Some(end) => path = &path[..end],
                None => {
                    return Place {
                        source: 0,
                        span: 0..0,
                    };
                }
            }
        }
    }

    /// Whether a mistake stands at a place already.
    pub(super) fn is_marked(&self, place: &Place) -> bool {
        self.mistakes
            .borrow()
            .iter()
            .any(|mistake| mistake.place == *place)
    }

    /// The whole file as a section.
    pub(super) fn root(&'a self, root: &'a Item, keys: &'static [Key]) -> Section<'a> {
        let Value::Table(entries) = &root.value else {
            unreachable!("a document is a table")
        };
        Section::open(self, String::new(), keys, Some(entries), root.place.clone())
    }
}

impl<'a> Section<'a> {
    fn open(
        reader: &'a Reader<'a>,
        path: String,
        keys: &'static [Key],
        entries: Option<&'a BTreeMap<String, Entry>>,
        place: Place,
    ) -> Self {
        let section = Self {
            reader,
            path,
            keys,
            entries,
            place,
        };
        for (name, entry) in entries.into_iter().flatten() {
            if keys.iter().any(|key| key.name == name) {
                let place = entry.item.place.clone();
                reader
                    .places
                    .borrow_mut()
                    .insert(section.path_of(name), place);
            } else {
                section.unknown(name, entry);
            }
        }
        for key in keys {
            if key.presence == Presence::Required && section.entry(key.name).is_none() {
                reader.add(Mistake {
                    message: format!("`{}` is missing", section.path_of(key.name)),
                    label: format!("needs `{}`", key.name),
                    help: Some(key.about.to_owned()),
                    place: section.place.clone(),
                });
            }
        }
        section
    }

    fn unknown(&self, name: &str, entry: &Entry) {
        let known = || self.keys.iter().map(|key| key.name);
        let help = match nearest(name, known()) {
            Some(near) => format!("did you mean `{near}`?"),
            None if self.keys.is_empty() => "it has no keys".to_owned(),
            None => format!(
                "the keys here are {}",
                known().collect::<Vec<_>>().join(", ")
            ),
        };
        self.reader.add(Mistake {
            message: format!("there is no key `{}`", self.path_of(name)),
            label: "unknown key".into(),
            help: Some(help),
            place: entry.key.clone(),
        });
    }

    pub(super) fn path_of(&self, name: &str) -> String {
        if self.path.is_empty() {
            name.to_owned()
        } else {
            format!("{}.{name}", self.path)
        }
    }

    pub(super) fn place(&self) -> Place {
        self.place.clone()
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.entry(name).is_some()
    }

    pub(super) fn entry(&self, name: &str) -> Option<&'a Entry> {
        self.entries.and_then(|entries| entries.get(name))
    }

    fn key(&self, name: &str) -> &'static Key {
        self.keys
            .iter()
            .find(|key| key.name == name)
            .expect("the program reads keys of its own table")
    }

    fn dimension(&self, name: &str) -> Dimension {
        match self.key(name).shape {
            Shape::Number(dimension) | Shape::Curve(dimension) | Shape::Range(dimension) => {
                dimension
            }
            _ => unreachable!("`{name}` has no dimension"),
        }
    }

    /// Reads a key's value or its default; `None` if it is absent, or was refused with a mistake.
    fn read<T>(&self, name: &str, read: impl Fn(&Item) -> Result<T, Refused>) -> Option<T> {
        let item = match self.entry(name) {
            Some(entry) => &entry.item,
            None => {
                let Presence::Default(text) = self.key(name).presence else {
                    return None;
                };
                &tree::parse_value(text, 0).expect("defaults are TOML")
            }
        };
        read(item)
            .map_err(|refused| self.reader.add(refused.into_mistake(item)))
            .ok()
    }

    pub(super) fn number(&self, name: &str) -> Option<f64> {
        let dimension = self.dimension(name);
        self.read(name, |item| number(item, dimension))
    }

    pub(super) fn curve(&self, name: &str) -> Option<Curve> {
        let dimension = self.dimension(name);
        self.read(name, |item| curve(item, dimension))
    }

    pub(super) fn range(&self, name: &str) -> Option<[f64; 2]> {
        let dimension = self.dimension(name);
        self.read(name, |item| {
            let example = dimension.example();
            numbers(item, dimension, &format!("[{example}, {example}]"))
        })
    }

    pub(super) fn place3(&self, name: &str) -> Option<[f64; 3]> {
        self.read(name, |item| {
            numbers(item, Dimension::Length, "[0, 4, \"2 m\"]")
        })
    }

    pub(super) fn colour(&self, name: &str) -> Option<[f64; 3]> {
        self.read(name, colour)
    }

    pub(super) fn count(&self, name: &str) -> Option<u32> {
        self.read(name, count)
    }

    pub(super) fn flag(&self, name: &str) -> Option<bool> {
        self.read(name, |item| match item.value {
            Value::Flag(flag) => Ok(flag),
            _ => Err(Refused::kind("true or false", item)),
        })
    }

    pub(super) fn text(&self, name: &str) -> Option<Text<'a>> {
        let entry = self.entry(name)?;
        match &entry.item.value {
            Value::Text(text) => Some(Text {
                text,
                place: entry.item.place.clone(),
            }),
            _ => {
                let refused = Refused::kind("text in quotes", &entry.item);
                self.reader.add(refused.into_mistake(&entry.item));
                None
            }
        }
    }

    pub(super) fn resolution(&self, name: &str) -> Option<Resolution> {
        self.read(name, resolution)
    }

    pub(super) fn crop(&self, name: &str) -> Option<Rect> {
        self.read(name, |item| {
            let [x0, y0, x1, y1] = counts(item, "[x0, y0, x1, y1], such as [0, 0, 400, 300]")?;
            Ok(Rect { x0, y0, x1, y1 })
        })
    }

    /// A table below this one; without entries if it is absent.
    pub(super) fn table(&self, name: &str) -> Section<'a> {
        let Shape::Table(keys) = self.key(name).shape else {
            unreachable!("`{name}` is no table")
        };
        let path = self.path_of(name);
        let Some(entry) = self.entry(name) else {
            // Its required keys are missing too, but that is said once, of the table.
            return Self {
                reader: self.reader,
                path,
                keys,
                entries: None,
                place: self.place(),
            };
        };
        let entries = match &entry.item.value {
            Value::Table(entries) => Some(entries),
            _ => {
                let refused = Refused::kind("a table", &entry.item);
                self.reader.add(refused.into_mistake(&entry.item));
                return Self {
                    reader: self.reader,
                    path,
                    keys,
                    entries: None,
                    place: self.place(),
                };
            }
        };
        Self::open(self.reader, path, keys, entries, entry.key.clone())
    }

    /// The tables of a list.
    pub(super) fn tables(&self, name: &str) -> Vec<Section<'a>> {
        let Shape::List(keys) = self.key(name).shape else {
            unreachable!("`{name}` is no list")
        };
        let Some(entry) = self.entry(name) else {
            return Vec::new();
        };
        let Value::List(items) = &entry.item.value else {
            let refused = Refused::kind("a list of tables", &entry.item);
            self.reader.add(refused.into_mistake(&entry.item));
            return Vec::new();
        };
        let path = self.path_of(name);
        let mut sections = Vec::new();
        for (index, item) in items.iter().enumerate() {
            if let Value::Table(entries) = &item.value {
                let path = format!("{path}[{index}]");
                let mut places = self.reader.places.borrow_mut();
                places.insert(path.clone(), item.place.clone());
                drop(places);
                let place = item.place.clone();
                sections.push(Self::open(self.reader, path, keys, Some(entries), place));
            } else {
                self.reader
                    .add(Refused::kind("a table", item).into_mistake(item));
            }
        }
        sections
    }

    /// Curves by name, each with where its name stands.
    pub(super) fn curves(&self, name: &str) -> BTreeMap<String, (Curve, Place)> {
        let mut curves = BTreeMap::new();
        let Some(entry) = self.entry(name) else {
            return curves;
        };
        let Value::Table(entries) = &entry.item.value else {
            self.reader
                .add(Refused::kind("a table", &entry.item).into_mistake(&entry.item));
            return curves;
        };
        for (curve_name, entry) in entries {
            let path = format!("{}.{curve_name}", self.path_of(name));
            self.reader
                .places
                .borrow_mut()
                .insert(path, entry.item.place.clone());
            match curve(&entry.item, Dimension::Any) {
                Ok(curve) => {
                    curves.insert(curve_name.clone(), (curve, entry.key.clone()));
                }
                Err(refused) => self.reader.add(refused.into_mistake(&entry.item)),
            }
        }
        curves
    }

    /// Which one of some tables is there; a mistake if it is not just one.
    pub(super) fn one_of(&self, names: &[&'static str]) -> Option<&'static str> {
        let here: Vec<_> = names
            .iter()
            .copied()
            .filter(|name| self.has(name))
            .collect();
        let full = |names: &[&str]| {
            let names: Vec<_> = names
                .iter()
                .map(|name| format!("[{}]", self.path_of(name)))
                .collect();
            names.join(", ")
        };
        match here[..] {
            [only] => Some(only),
            [] => {
                self.reader.add(Mistake {
                    message: format!("[{}] needs one of {}", self.path, full(names)),
                    label: "none of them is here".into(),
                    help: None,
                    place: self.place(),
                });
                None
            }
            [first, second, ..] => {
                let entry = self.entry(second).expect("it is here");
                self.reader.add(Mistake {
                    message: format!(
                        "{} and {} exclude each other",
                        full(&[first]),
                        full(&[second])
                    ),
                    label: "a second one".into(),
                    help: Some(format!("keep one of {}", full(names))),
                    place: entry.key.clone(),
                });
                None
            }
        }
    }
}

/// Why a value was refused, and which part of it.
struct Refused {
    message: String,
    help: Option<String>,
    /// The part, if it is not the whole value.
    place: Option<Place>,
}

impl Refused {
    fn kind(wanted: &str, item: &Item) -> Self {
        Self {
            message: format!("{wanted} is wanted here, not {}", item.value.kind()),
            help: None,
            place: Some(item.place.clone()),
        }
    }

    fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    fn at(refusal: Refusal, item: &Item) -> Self {
        Self {
            message: refusal.message,
            help: refusal.help,
            place: Some(item.place.clone()),
        }
    }

    fn into_mistake(self, item: &Item) -> Mistake {
        Mistake {
            message: self.message,
            label: "here".into(),
            help: self.help,
            place: self.place.unwrap_or_else(|| item.place.clone()),
        }
    }
}

fn number(item: &Item, dimension: Dimension) -> Result<f64, Refused> {
    quantity(&item.value, dimension).map_err(|refusal| Refused::at(refusal, item))
}

fn numbers<const N: usize>(
    item: &Item,
    dimension: Dimension,
    example: &str,
) -> Result<[f64; N], Refused> {
    let items = list::<N>(item, example)?;
    let mut numbers = [0.0; N];
    for (place, item) in numbers.iter_mut().zip(items) {
        *place = number(item, dimension)?;
    }
    Ok(numbers)
}

fn list<'a, const N: usize>(item: &'a Item, example: &str) -> Result<&'a [Item; N], Refused> {
    let help = format!("write it like {example}");
    let Value::List(items) = &item.value else {
        return Err(Refused::kind(&format!("a list of {N}"), item).with_help(help));
    };
    items.as_slice().try_into().map_err(|_| Refused {
        message: format!("a list of {N} is wanted here, not of {}", items.len()),
        help: Some(help),
        place: None,
    })
}

fn count(item: &Item) -> Result<u32, Refused> {
    let whole = match item.value {
        Value::Integer(integer) => u32::try_from(integer).ok(),
        _ => None,
    };
    whole.ok_or_else(|| match item.value {
        Value::Integer(_) | Value::Number(_) => Refused {
            message: format!("a whole number from 0 to {} is wanted here", u32::MAX),
            help: None,
            place: Some(item.place.clone()),
        },
        _ => Refused::kind("a whole number", item),
    })
}

fn counts<const N: usize>(item: &Item, example: &str) -> Result<[u32; N], Refused> {
    let items = list::<N>(item, example)?;
    let mut counts = [0; N];
    for (place, item) in counts.iter_mut().zip(items) {
        *place = count(item)?;
    }
    Ok(counts)
}

fn resolution(item: &Item) -> Result<Resolution, Refused> {
    const EXAMPLE: &str = "\"800x600\"";
    if let Value::Text(text) = &item.value {
        let sides = text.split_once('x').and_then(|(width, height)| {
            Some((width.trim().parse().ok()?, height.trim().parse().ok()?))
        });
        return match sides {
            Some((width, height)) => Ok(Resolution { width, height }),
            None => Err(Refused {
                message: format!("{text:?} is no resolution"),
                help: Some(format!("write it like {EXAMPLE}")),
                place: None,
            }),
        };
    }
    let [width, height] = counts(item, EXAMPLE)?;
    Ok(Resolution { width, height })
}

fn colour(item: &Item) -> Result<[f64; 3], Refused> {
    const EXAMPLE: &str = "[0.4, 0.3, 0.2] (linear) or \"#a89078\" (sRGB)";
    let Value::Text(text) = &item.value else {
        return numbers(item, Dimension::None, EXAMPLE);
    };
    let digits = text.strip_prefix('#').filter(|digits| {
        digits.len() == 6 && digits.bytes().all(|digit| digit.is_ascii_hexdigit())
    });
    let packed = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
    let Some(packed) = packed else {
        return Err(Refused {
            message: format!("{text:?} is no colour"),
            help: Some(format!("write it like {EXAMPLE}")),
            place: None,
        });
    };
    let [_, red, green, blue] = packed.to_be_bytes();
    Ok([red, green, blue].map(|byte| linear(f64::from(byte) / 255.0)))
}

/// The linear value of an sRGB component, IEC 61966-2-1.
fn linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        libm::pow((encoded + 0.055) / 1.055, 2.4)
    }
}

fn curve(item: &Item, dimension: Dimension) -> Result<Curve, Refused> {
    let Value::Table(entries) = &item.value else {
        return number(item, dimension).map(Curve::Constant);
    };
    let example = format!(
        "{{ linear = [[\"0 s\", {0}], [\"2 s\", {0}]] }}",
        dimension.example()
    );
    let mut kinds = entries.iter();
    let (Some((kind, entry)), None) = (kinds.next(), kinds.next()) else {
        return Err(Refused {
            message: "a curve is either `linear` or `smooth`".into(),
            help: Some(format!("write it like {example}")),
            place: None,
        });
    };
    let make = match kind.as_str() {
        "linear" => Curve::Linear,
        "smooth" => Curve::Smooth,
        _ => {
            let near = nearest(kind, ["linear", "smooth"].into_iter());
            return Err(Refused {
                message: format!("there is no curve `{kind}`"),
                help: Some(match near {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("write it like {example}"),
                }),
                place: Some(entry.key.clone()),
            });
        }
    };
    let Value::List(keys) = &entry.item.value else {
        return Err(Refused::kind("a list of keys", &entry.item).with_help(example));
    };
    if keys.is_empty() {
        return Err(Refused {
            message: "the curve has no keys".into(),
            help: Some(format!("write it like {example}")),
            place: Some(entry.item.place.clone()),
        });
    }
    let keys: Vec<(f64, f64)> = keys
        .iter()
        .map(|key| {
            let [time, value] = list(key, &format!("[\"0 s\", {}]", dimension.example()))?;
            Ok((number(time, Dimension::Time)?, number(value, dimension)?))
        })
        .collect::<Result<_, Refused>>()?;
    Ok(make(keys))
}
