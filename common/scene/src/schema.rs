//! The JSON Schema of scene files, made from the table of keys that the reader follows.

use serde_json::{Map, Value, json};

use crate::file::{Dimension, Key, Presence, SCENE, Shape};

/// A JSON Schema (2020-12) of scene files: every key with its meaning, unit and default.
///
/// Editors that know TOML schemas complete and check scene files by it.
pub fn schema() -> Value {
    let mut schema = table(SCENE);
    let entries = schema
        .as_object_mut()
        .expect("a table's schema is an object");
    entries.insert(
        "$schema".into(),
        json!("https://json-schema.org/draft/2020-12/schema"),
    );
    entries.insert("title".into(), json!("Flyby scene"));
    // These are no keywords of the standard: validators pass over them, people and editors can read them.
    entries.insert("x-noises".into(), crate::expression::noises::described());
    entries.insert(
        "x-hypertextures".into(),
        crate::expression::library::described(),
    );
    schema
}

fn table(keys: &[Key]) -> Value {
    let properties: Map<String, Value> = keys
        .iter()
        .map(|key| (key.name.to_owned(), property(key)))
        .collect();
    let required: Vec<_> = keys
        .iter()
        .filter(|key| key.presence == Presence::Required)
        .map(|key| key.name)
        .collect();
    json!({
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    })
}

fn property(key: &Key) -> Value {
    let mut schema = shape(key.shape);
    let entries = schema
        .as_object_mut()
        .expect("a shape's schema is an object");
    let mut about = key.about.to_owned();
    if let Some(dimension) = dimension(key.shape) {
        let units = dimension.units();
        if !units.is_empty() {
            about.push_str(&format!(" Units: {}.", units.join(", ")));
        }
    }
    entries.insert("description".into(), json!(about));
    if let Presence::Default(text) = key.presence {
        // A default is TOML; all of ours are JSON too.
        let default = serde_json::from_str(text).unwrap_or_else(|_| json!(text));
        entries.insert("default".into(), default);
    }
    schema
}

fn dimension(shape: Shape) -> Option<Dimension> {
    match shape {
        Shape::Number(dimension) | Shape::Curve(dimension) | Shape::Range(dimension) => {
            Some(dimension)
        }
        Shape::Place => Some(Dimension::Length),
        _ => None,
    }
}

fn shape(shape: Shape) -> Value {
    match shape {
        Shape::Text => json!({ "type": "string" }),
        Shape::Flag => json!({ "type": "boolean" }),
        Shape::Count => json!({ "type": "integer", "minimum": 0, "maximum": u32::MAX }),
        Shape::Number(dimension) => quantity(dimension),
        Shape::Curve(dimension) => curve(dimension),
        Shape::Range(dimension) => list(&quantity(dimension), 2),
        Shape::Place => list(&quantity(Dimension::Length), 3),
        Shape::Colour => json!({ "anyOf": [
            list(&json!({ "type": "number" }), 3),
            { "type": "string", "pattern": "^#[0-9A-Fa-f]{6}$" },
        ]}),
        Shape::Resolution => json!({ "anyOf": [
            { "type": "string", "pattern": "^ *[0-9]+ *x *[0-9]+ *$" },
            list(&json!({ "type": "integer" }), 2),
        ]}),
        Shape::Crop => list(&json!({ "type": "integer", "minimum": 0 }), 4),
        Shape::Field => json!({ "type": ["string", "number"] }),
        Shape::File => json!({ "type": "string" }),
        Shape::Table(keys) => table(keys),
        Shape::List(keys) => json!({ "type": "array", "items": table(keys) }),
        Shape::Curves => json!({
            "type": "object",
            "additionalProperties": curve(Dimension::Any),
        }),
    }
}

fn quantity(dimension: Dimension) -> Value {
    json!({ "type": ["number", "string"], "examples": [dimension.example().trim_matches('"')] })
}

fn curve(dimension: Dimension) -> Value {
    let pair = json!({
        "type": "array",
        "prefixItems": [quantity(Dimension::Time), quantity(dimension)],
        "minItems": 2,
        "maxItems": 2,
    });
    let keys = json!({ "type": "array", "items": pair, "minItems": 1 });
    let kind = |name: &str, about: &str| {
        let mut keys = keys.clone();
        keys["description"] = json!(about);
        json!({
            "type": "object",
            "properties": { name: keys },
            "required": [name],
            "additionalProperties": false,
        })
    };
    json!({ "anyOf": [
        quantity(dimension),
        kind("linear", "Straight lines between [time, value] keys, constant outside."),
        kind("smooth", "A monotone cubic through [time, value] keys, constant outside."),
    ]})
}

fn list(item: &Value, count: usize) -> Value {
    json!({ "type": "array", "items": item, "minItems": count, "maxItems": count })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn each_key(schema: &Value, check: &mut impl FnMut(&str, &Value)) {
        for (name, property) in schema["properties"].as_object().into_iter().flatten() {
            check(name, property);
            each_key(property, check);
            each_key(&property["items"], check);
        }
    }

    #[test]
    fn every_key_is_described_with_its_units() {
        let mut names = Vec::new();
        let schema = schema();
        each_key(&schema, &mut |name, property| {
            let about = property["description"].as_str().unwrap_or_default();
            assert!(about.len() > 8 && about.contains('.'), "{name}");
            names.push(name.to_owned());
        });
        for name in [
            "shutter",
            "great_circle",
            "heights",
            "visibility",
            "filter_order",
        ] {
            assert!(names.iter().any(|known| known == name), "{name}");
        }
        let altitude =
            &schema["properties"]["camera"]["properties"]["great_circle"]["properties"]["altitude"];
        assert!(
            altitude["description"]
                .as_str()
                .unwrap()
                .ends_with("Units: m, km, cm, mm.")
        );
        assert_eq!(
            schema["properties"]["film"]["properties"]["fps"]["default"],
            25
        );
        assert_eq!(schema["required"], json!(["camera", "surface"]));
        assert_eq!(
            schema["x-noises"]["cellular"]["options"]["density"]["default"],
            "2"
        );
    }
}
