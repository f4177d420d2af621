//! Settings from the command line, laid over a scene file before it is read.

use model::{Rect, Resolution};

use super::mistake::{Mistake, Place, Source};
use super::tree::{self, Entry, Item, Value};

/// Settings that replace those of a scene file. They are part of the scene and of its digest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overrides {
    /// `--resolution`: pixels of the whole image.
    pub resolution: Option<Resolution>,
    /// `--rays`: N of the N × N rays of a pixel.
    pub rays: Option<u32>,
    /// `--crop`: the part of the image that is rendered.
    pub crop: Option<Rect>,
    /// `--set`: each a `key=value` with a dotted key, the value as in the file; text needs no quotes.
    pub set: Vec<String>,
}

impl Overrides {
    /// Puts every override into the tree; the named flags win over `--set`.
    pub(super) fn lay_over(
        &self,
        root: &mut Item,
        sources: &mut Vec<Source>,
        mistakes: &mut Vec<Mistake>,
    ) {
        for text in &self.set {
            let source = sources.len();
            sources.push(Source {
                name: "--set".into(),
                text: text.clone(),
            });
            match split(text, source) {
                Ok((path, item)) => insert(root, &path, item, mistakes),
                Err(mistake) => mistakes.push(mistake),
            }
        }
        let named = [
            self.resolution.map(|size| {
                let sides = vec![size.width, size.height];
                ("--resolution", "film", "resolution", Shape::List(sides))
            }),
            self.crop.map(|crop| {
                let ends = vec![crop.x0, crop.y0, crop.x1, crop.y1];
                ("--crop", "film", "crop", Shape::List(ends))
            }),
            self.rays
                .map(|rays| ("--rays", "sampling", "rays", Shape::Count(rays))),
        ];
        for (flag, section, key, shape) in named.into_iter().flatten() {
            let text = match &shape {
                Shape::Count(count) => count.to_string(),
                Shape::List(counts) => {
                    let counts: Vec<_> = counts.iter().map(u32::to_string).collect();
                    counts.join(if key == "resolution" { "x" } else { "," })
                }
            };
            let place = Place {
                source: sources.len(),
                span: 0..text.len(),
            };
            sources.push(Source {
                name: flag.into(),
                text,
            });
            let item = |value| Item {
                value,
                place: place.clone(),
            };
            let item = match shape {
                Shape::Count(count) => item(Value::Integer(count.into())),
                Shape::List(counts) => item(Value::List(
                    counts
                        .into_iter()
                        .map(|count| item(Value::Integer(count.into())))
                        .collect(),
                )),
            };
            let path = [section, key].map(|part| (part.to_owned(), place.clone()));
            insert(root, &path, item, mistakes);
        }
    }
}

enum Shape {
    Count(u32),
    List(Vec<u32>),
}

type Path = Vec<(String, Place)>;

/// A key's parts, each with its place, and the value.
fn split(text: &str, source: usize) -> Result<(Path, Item), Mistake> {
    let whole = Place {
        source,
        span: 0..text.len(),
    };
    let Some((key, value)) = text.split_once('=') else {
        return Err(Mistake {
            message: format!("`{text}` sets nothing"),
            label: "no `=`".into(),
            help: Some("write key=value, for example film.fps=30".into()),
            place: whole,
        });
    };
    let mut path = Vec::new();
    let mut start = 0;
    for part in key.split('.') {
        let span = start..start + part.len();
        start = span.end + 1;
        let place = Place { source, span };
        if part.trim().is_empty() {
            return Err(Mistake {
                message: format!("`{key}` is not a key"),
                label: "a part of it is empty".into(),
                help: Some("keys are written as in camera.great_circle.altitude".into()),
                place,
            });
        }
        path.push((part.trim().to_owned(), place));
    }
    let offset = key.len() + 1;
    let item = match tree::parse_value(value, source) {
        Some(mut item) => {
            shift(&mut item, offset);
            item
        }
        // What is no TOML value is text whose quotes the shell took.
        None => Item {
            value: Value::Text(value.to_owned()),
            place: Place {
                source,
                span: offset..text.len(),
            },
        },
    };
    Ok((path, item))
}

/// Moves every place of an item, which was parsed by itself, to where it stands in the override.
fn shift(item: &mut Item, offset: usize) {
    let moved = |place: &mut Place| {
        place.span = place.span.start + offset..place.span.end + offset;
    };
    moved(&mut item.place);
    match &mut item.value {
        Value::List(items) => items.iter_mut().for_each(|item| shift(item, offset)),
        Value::Table(entries) => {
            for entry in entries.values_mut() {
                moved(&mut entry.key);
                shift(&mut entry.item, offset);
            }
        }
        _ => {}
    }
}

/// Puts an item where its path leads; tables that are missing on the way are made.
fn insert(into: &mut Item, path: &[(String, Place)], item: Item, mistakes: &mut Vec<Mistake>) {
    let Some(((name, place), rest)) = path.split_first() else {
        *into = item;
        return;
    };
    match &mut into.value {
        Value::Table(entries) => {
            let entry = entries.entry(name.clone()).or_insert_with(|| Entry {
                key: place.clone(),
                item: Item {
                    value: Value::Table([].into()),
                    place: place.clone(),
                },
            });
            insert(&mut entry.item, rest, item, mistakes);
        }
        Value::List(items) => {
            let count = items.len();
            match name
                .parse::<usize>()
                .ok()
                .and_then(|index| items.get_mut(index))
            {
                Some(element) => insert(element, rest, item, mistakes),
                None => mistakes.push(Mistake {
                    message: format!("`{name}` is no element of a list of {count}"),
                    label: "no such element".into(),
                    help: Some("elements are numbered from 0: material.layer.0.albedo".into()),
                    place: place.clone(),
                }),
            }
        }
        other => mistakes.push(Mistake {
            message: format!(
                "`{name}` cannot be set: what it belongs to is {}",
                other.kind()
            ),
            label: "has no such part".into(),
            help: None,
            place: place.clone(),
        }),
    }
}
