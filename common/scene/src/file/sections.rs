//! From the sections of a scene file to a description.

mod camera;
mod light;
mod surface;

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

use super::assets::Files;
use super::keys;
use super::mistake::{Mistake, Place};
use super::section::{Reader, Section, Text};
use super::tree::Item;
use crate::bound;
use crate::curve::Curve;
use crate::description::{AssetRef, Bound, Description, Film, Sampling, Sky};
use crate::expression::{Fields, is_name, is_taken};
use crate::ground;
use crate::rules::{self, Problem};
use field::{Graph, NodeId};
use model::{Rect, Resolution};

type Assets = Vec<(AssetRef, Arc<[u8]>)>;

/// Reads the whole file; gives a valid scene, its graph in canonical order, or every mistake.
pub(super) fn scene(
    reader: &Reader<'_>,
    root: &Item,
    stem: &str,
    folder: &Path,
) -> Result<(Description, Assets), Vec<Mistake>> {
    let root = reader.root(root, keys::SCENE);
    let seed = surface::seed(&root);
    let curves = curves(&root);
    let files = Rc::new(Files::new(folder));
    let mut making = Making {
        reader,
        fields: Fields::with_files(
            seed,
            curves
                .iter()
                .map(|(name, (curve, _))| (name.clone(), curve.clone()))
                .collect(),
            files.clone(),
        ),
        files,
    };
    let surface = surface::read(&root, seed, &mut making);
    let film = film(&root.table("film"));
    let camera = camera::read(&root, seed);
    let sky = light::sky(&root, &making);
    let assets = making.files.take();
    let description = Description {
        name: root.text("name").map_or(stem, |name| name.text).to_owned(),
        key: root.count("key").unwrap_or(1),
        sampling: sampling(&root.table("sampling")),
        sun: light::sun(&root.table("sun"), &camera),
        sky,
        camera,
        film,
        surface: surface.surface,
        assets: assets.iter().map(|(asset, _)| asset.clone()).collect(),
    };
    for name in making.fields.unused_curves() {
        reader.warn(Mistake {
            message: format!("no field uses the curve `{name}`"),
            label: "unused".into(),
            help: None,
            place: curves[&name].1.clone(),
        });
    }
    let mut description = description;
    description.surface.graph = making.fields.into_graph();
    finish(reader, description, surface.bound_given)
        .map(|description| (description, assets))
        .ok_or_else(|| reader.take_mistakes())
}

/// Holds the scene to all rules, and finds where its surface can be.
fn finish(reader: &Reader<'_>, mut scene: Description, bound_given: bool) -> Option<Description> {
    if !reader.has_mistakes() && !bound_given {
        match bound::derive(&scene) {
            Ok(bound) => scene.surface.bound = bound,
            Err(problem) => report(reader, problem),
        }
    }
    if reader.has_mistakes() {
        forget_fields(&mut scene);
    }
    for problem in rules::problems(&scene) {
        report(reader, problem);
    }
    if reader.has_mistakes() {
        return None;
    }
    let scene = scene.canonical();
    for problem in ground::problems(&scene) {
        report(reader, problem);
    }
    (!reader.has_mistakes()).then_some(scene)
}

/// Turns a broken rule into a mistake at the key it is about, unless one stands there already.
fn report(reader: &Reader<'_>, problem: Problem) {
    let place = reader.place_of(&problem.key);
    if !reader.is_marked(&place) || place.span.is_empty() {
        reader.add(Mistake {
            message: problem.message,
            label: "here".into(),
            help: problem.help,
            place,
        });
    }
}

/// What reading the fields of a scene gathers.
struct Making<'a> {
    reader: &'a Reader<'a>,
    fields: Fields,
    files: Rc<Files>,
}

impl Making<'_> {
    /// The field of a key, if it is there and right.
    fn field(&self, section: &Section<'_>, name: &str) -> Option<NodeId> {
        let entry = section.entry(name)?;
        let text = match &entry.item.value {
            super::tree::Value::Integer(integer) => integer.to_string(),
            super::tree::Value::Number(number) => format!("{number:?}"),
            _ => section.text(name)?.text.to_owned(),
        };
        let place = &entry.item.place;
        match self.fields.field(&text) {
            Ok(id) => Some(id),
            Err(refusal) => {
                self.reader.add(Mistake {
                    message: refusal.message,
                    label: "in this expression".into(),
                    help: refusal.help,
                    place: match refusal.position {
                        Some(position) => self.place_in_text(&text, place, position),
                        None => place.clone(),
                    },
                });
                None
            }
        }
    }

    fn place_in_text(&self, text: &str, place: &Place, (line, column): (usize, usize)) -> Place {
        let start: usize = text
            .split_inclusive('\n')
            .take(line - 1)
            .map(str::len)
            .sum();
        let byte = text[start..]
            .char_indices()
            .nth(column - 1)
            .map_or(text.len(), |(byte, _)| start + byte);
        let raw = &self.reader.sources[place.source].text[place.span.clone()];
        let (from, to) = raw_span(raw, text, byte);
        Place {
            source: place.source,
            span: place.span.start + from..place.span.start + to,
        }
    }

    /// The number of a file among the scene's assets.
    fn asset(&mut self, name: &Text<'_>) -> Option<u32> {
        match self.files.get(name.text) {
            Ok((number, _)) => Some(number),
            Err(message) => {
                self.reader.add(Mistake {
                    message,
                    label: "this file".into(),
                    help: Some("paths are relative to the scene file".into()),
                    place: name.place.clone(),
                });
                None
            }
        }
    }
}

/// Where byte `at` of a text stands in the TOML that wrote it: the span of its word there.
fn raw_span(raw: &str, text: &str, at: usize) -> (usize, usize) {
    let quotes = if raw.starts_with("\"\"\"") || raw.starts_with("'''") {
        3
    } else {
        1
    };
    let quoted = raw.starts_with(['"', '\'']);
    let escapes = raw.starts_with('"');
    let mut from = if quoted { quotes } else { 0 };
    if quotes == 3 {
        // A line break right after the quotes is not part of the text.
        from += raw[from..].len() - raw[from..].trim_start_matches('\r').len();
        from += usize::from(raw[from..].starts_with('\n'));
    }
    for character in text[..at].chars() {
        let rest = &raw[from..];
        from += match rest.chars().next() {
            Some('\\') if escapes => escape_length(rest),
            // TOML may turn a line break of two bytes into one.
            Some('\r') if character == '\n' => 2,
            Some(raw) => raw.len_utf8(),
            None => 0,
        };
        from = from.min(raw.len());
    }
    let word: usize = text[at..]
        .chars()
        .take_while(|c| c.is_alphanumeric() || *c == '_')
        .map(char::len_utf8)
        .sum();
    let end = (from + word.max(1)).min(raw.len());
    let end = (end..=raw.len())
        .find(|end| raw.is_char_boundary(*end))
        .unwrap_or(raw.len());
    (from, end)
}

/// Bytes of the escape at the start of a basic string's rest.
fn escape_length(rest: &str) -> usize {
    match rest.as_bytes().get(1) {
        Some(b'x') => 4,
        Some(b'u') => 6,
        Some(b'U') => 10,
        Some(b'\n' | b'\r' | b' ' | b'\t') => {
            // A line that ends in a backslash is joined to the next word, which is the character meant.
            let skipped = 1 + rest[1..].len() - rest[1..].trim_start().len();
            skipped + rest[skipped..].chars().next().map_or(0, char::len_utf8)
        }
        _ => 2,
    }
    .min(rest.len())
}

fn film(section: &Section<'_>) -> Film {
    let resolution = section.resolution("resolution").unwrap_or(Resolution {
        width: 1,
        height: 1,
    });
    let number = |name: &str, otherwise: f64| section.number(name).unwrap_or(otherwise);
    Film {
        resolution,
        window: if section.has("crop") {
            section.crop("crop").unwrap_or(Rect {
                x0: 0,
                y0: 0,
                x1: 1,
                y1: 1,
            })
        } else {
            resolution.rect()
        },
        images: section.count("images").unwrap_or(1),
        fps: number("fps", 25.0),
        shutter: number("shutter", 0.0),
        exposure: number("exposure", 0.0),
    }
}

fn sampling(section: &Section<'_>) -> Sampling {
    Sampling {
        rays: section.count("rays").unwrap_or(1),
        filter_order: section.count("filter_order").unwrap_or(0),
    }
}

fn curves(root: &Section<'_>) -> BTreeMap<String, (Curve, Place)> {
    let curves = root.curves("curves");
    for (name, (curve, place)) in &curves {
        let message = if is_taken(name) {
            format!("a curve cannot be called `{name}`: expressions give that name a meaning")
        } else if !is_name(name) {
            format!("expressions cannot use a curve called `{name}`")
        } else {
            String::new()
        };
        if !message.is_empty() {
            root.reader.add(Mistake {
                message,
                label: "this name".into(),
                help: Some("use a word of letters, digits and `_`".into()),
                place: place.clone(),
            });
        }
        if let Some(problem) = rules::named_curve(name, curve) {
            report(root.reader, problem);
        }
    }
    curves
}

/// What stands for the bound until it is derived.
const ANYWHERE: Bound = Bound::Shell {
    inner: 0.0,
    outer: 1.0,
};

/// What stands for a field until all are read, or for good if it was refused.
const NOWHERE: NodeId = NodeId(0);

/// Takes all fields out of a scene, in which the rest shall be looked at for more mistakes.
fn forget_fields(scene: &mut Description) {
    let mut graph = Graph::new();
    let surface = &mut scene.surface;
    surface.field = graph.constant(1.0).expect("1 is a constant");
    surface.graph = graph;
    surface.material.variation = None;
    for layer in &mut surface.material.layers {
        (layer.cover, layer.height_offset) = (None, None);
    }
    if let Sky::Air { clouds, .. } = &mut scene.sky {
        *clouds = None;
    }
}
