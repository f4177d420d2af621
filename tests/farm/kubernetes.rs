//! The manifests of `deploy/kubernetes`, held against the types that Kubernetes' own description of its interface gives.
//!
//! Who reads a document ignores what it does not know: so each is read, written again and compared. What is misspelt or in
//! the wrong place is not written, and what must be there and is not is written empty.

use k8s_openapi::api::apps::v1::{Deployment, StatefulSet};
use k8s_openapi::api::batch::v1::Job;
use k8s_openapi::api::core::v1::Service;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use yaml_rust2::{Yaml, YamlLoader};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/kubernetes");

/// The documents of a manifest.
fn documents(text: &str) -> Vec<Value> {
    let documents = YamlLoader::load_from_str(text).unwrap();
    documents.iter().map(value).collect()
}

fn value(yaml: &Yaml) -> Value {
    match yaml {
        Yaml::Hash(pairs) => {
            let pairs = pairs.iter().map(|(key, of)| {
                let key = key.as_str().expect("keys are words");
                (key.to_owned(), value(of))
            });
            Value::Object(pairs.collect::<Map<_, _>>())
        }
        Yaml::Array(entries) => entries.iter().map(value).collect(),
        Yaml::String(text) => text.as_str().into(),
        Yaml::Integer(number) => (*number).into(),
        Yaml::Boolean(is) => (*is).into(),
        other => panic!("{other:?} has no place in a manifest"),
    }
}

/// What is wrong with a document, with its path; nothing where all is well.
fn mistakes(document: &Value) -> Vec<String> {
    let kind = (&document["apiVersion"], &document["kind"]);
    match (kind.0.as_str(), kind.1.as_str()) {
        (Some("v1"), Some("Service")) => mistakes_of::<Service>(document),
        (Some("apps/v1"), Some("StatefulSet")) => mistakes_of::<StatefulSet>(document),
        (Some("apps/v1"), Some("Deployment")) => mistakes_of::<Deployment>(document),
        (Some("batch/v1"), Some("Job")) => mistakes_of::<Job>(document),
        _ => vec![format!("{kind:?} is nothing that is known here")],
    }
}

fn mistakes_of<T: Serialize + DeserializeOwned>(document: &Value) -> Vec<String> {
    let read: T = match serde_json::from_value(document.clone()) {
        Ok(read) => read,
        Err(error) => return vec![error.to_string()],
    };
    let mut mistakes = Vec::new();
    compare(
        "",
        document,
        &serde_json::to_value(read).unwrap(),
        &mut mistakes,
    );
    mistakes
}

/// Compares what stands in a document with what was understood of it.
fn compare(path: &str, stands: &Value, understood: &Value, mistakes: &mut Vec<String>) {
    match (stands, understood) {
        (Value::Object(stands), Value::Object(understood)) => {
            for (key, value) in stands {
                let path = format!("{path}.{key}");
                match understood.get(key) {
                    Some(understood) => compare(&path, value, understood, mistakes),
                    None => mistakes.push(format!("{path} is not known")),
                }
            }
            // What is inside another need not say what it is: a claim's template.
            let need = |key: &&String| !["apiVersion", "kind"].contains(&key.as_str());
            let missing = understood.keys().filter(|key| !stands.contains_key(*key));
            let missing = missing.filter(need);
            mistakes.extend(missing.map(|key| format!("{path}.{key} is missing")));
        }
        (Value::Array(stands), Value::Array(understood)) if stands.len() == understood.len() => {
            for (place, (stands, understood)) in stands.iter().zip(understood).enumerate() {
                compare(&format!("{path}[{place}]"), stands, understood, mistakes);
            }
        }
        _ if stands == understood => {}
        _ => mistakes.push(format!("{path} is {stands}, understood as {understood}")),
    }
}

#[test]
fn manifests_are_what_kubernetes_understands() {
    let mut count = 0;
    for entry in std::fs::read_dir(FOLDER).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "yaml") {
            continue;
        }
        for document in documents(&std::fs::read_to_string(&path).unwrap()) {
            assert_eq!(
                mistakes(&document),
                Vec::<String>::new(),
                "{}",
                path.display()
            );
            count += 1;
        }
    }
    assert_eq!(
        count, 4,
        "a service, a stateful set, a deployment and a job"
    );
}

#[test]
fn what_is_misspelt_misplaced_missing_or_of_the_wrong_type_is_found_with_its_path() {
    let text = std::fs::read_to_string(format!("{FOLDER}/workers.yaml")).unwrap();
    for (right, wrong, mistake) in [
        (
            "readOnly: true",
            "readonly: true",
            ".spec.template.spec.containers[0].volumeMounts[1].readonly is not known",
        ),
        (
            "  replicas: 2\n",
            "  replicas: 2\n  terminationGracePeriodSeconds: 30\n",
            ".spec.terminationGracePeriodSeconds is not known",
        ),
        (
            "              mountPath: /token\n",
            "",
            ".spec.template.spec.containers[0].volumeMounts[1].mountPath is missing",
        ),
        (
            "replicas: 2",
            "replicas: \"2\"",
            "invalid type: string \"2\", expected i32",
        ),
        (
            "kind: Deployment",
            "kind: Deploiment",
            "is nothing that is known here",
        ),
    ] {
        assert!(text.contains(right), "{right}");
        let found = mistakes(&documents(&text.replace(right, wrong))[0]);
        assert!(
            found.len() == 1 && found[0].contains(mistake),
            "{mistake}: {found:?}"
        );
    }
}
