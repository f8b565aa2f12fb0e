//! The lenses, sensors and experiments that a request names, found by the schema of its job.

use std::path::Path;

use serde_json::Value;

use crate::context::Context;
use crate::error::{JobError, Result};
use crate::job::Row;
use crate::results::{NOWHERE, names_a_file};

/// What an input is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum InputKind {
    /// A lens.
    Lens,
    /// A sensor.
    Sensor,
    /// An experiment.
    Experiment,
    /// A file of another kind.
    File,
}

/// An input that a request names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedInput {
    /// Where the request names it: `start.new.lens`.
    pub key: String,
    /// What it is.
    pub kind: InputKind,
    /// A built-in name, or the path of a file.
    pub name: String,
}

impl NamedInput {
    /// Sees that the input is there, and that a lens or a sensor can be read. Whether a job can use it, the job says.
    pub fn check(&self, context: &Context) -> Result<()> {
        let assets = &context.assets;
        match self.kind {
            InputKind::Lens => assets.import_start(&self.name).map(drop)?,
            InputKind::Sensor => assets.sensor(&self.name).map(drop)?,
            // A lens stands for an experiment that is fitted to it.
            InputKind::Experiment => assets
                .text("experiment", "experiments", &self.name)
                .map(drop)
                .or_else(|error| assets.import_start(&self.name).map(drop).map_err(|_| error))?,
            InputKind::File => {
                let built_in = self.name.strip_prefix("data/").unwrap_or(&self.name);
                if !Path::new(&self.name).exists() && assets.bytes(built_in).is_err() {
                    let message = format!("{}: there is no such file", self.name);
                    return Err(JobError::input(message, "name a file that exists"));
                }
            }
        }
        Ok(())
    }
}

impl Row {
    /// The inputs that a complete request of [`Row::filled_in`] names. A text is a file of another kind if it ends as the names of files do, and if it
    /// is no place of results.
    pub fn named_inputs(&self, request: &Value) -> Result<Vec<NamedInput>> {
        let schema = self.kept_schema();
        let mut found = Vec::new();
        by_schema(&schema, &schema, request, "", &mut found);
        let placed = self.kept_in(request.clone(), Path::new(NOWHERE))?;
        other_files(request, &placed, "", &mut found);
        Ok(found)
    }
}

/// The key of a value below another.
fn below(key: &str, part: &str) -> String {
    if key.is_empty() { part.to_owned() } else { format!("{key}.{part}") }
}

/// The kind of a schema that takes a name or the thing itself.
fn kind_of(schema: &Value) -> Option<InputKind> {
    let choices = schema.get("anyOf")?.as_array()?;
    let names = choices.iter().any(|choice| choice.get("type").is_some_and(|of| of == "string"));
    let kinds = [
        ("LensText", InputKind::Lens),
        ("TomlText", InputKind::Sensor),
        ("ExperimentText", InputKind::Experiment),
    ];
    let refers = |to: &str| {
        let to = format!("#/$defs/{to}");
        choices.iter().any(|choice| choice.get("$ref").is_some_and(|of| *of == *to))
    };
    kinds.into_iter().find(|(text, _)| names && refers(text)).map(|(_, kind)| kind)
}

/// Finds texts where the schema has an input.
fn by_schema(schema: &Value, root: &Value, value: &Value, key: &str, found: &mut Vec<NamedInput>) {
    if let (Some(kind), Value::String(name)) = (kind_of(schema), value) {
        found.push(NamedInput { key: key.to_owned(), kind, name: name.clone() });
        return;
    }
    let referred =
        schema.get("$ref").and_then(Value::as_str).and_then(|to| root.pointer(to.strip_prefix('#')?));
    if let Some(referred) = referred {
        by_schema(referred, root, value, key, found);
    }
    for choices in ["anyOf", "oneOf", "allOf"] {
        let choices = schema.get(choices).and_then(Value::as_array).into_iter().flatten();
        choices.for_each(|choice| by_schema(choice, root, value, key, found));
    }
    match value {
        Value::Object(keys) => {
            for (name, value) in keys {
                if let Some(schema) = schema.get("properties").and_then(|of| of.get(name)) {
                    by_schema(schema, root, value, &below(key, name), found);
                }
            }
        }
        Value::Array(items) => {
            if let Some(schema) = schema.get("items") {
                let items = items.iter().enumerate();
                items.for_each(|(i, item)| by_schema(schema, root, item, &below(key, &i.to_string()), found));
            }
        }
        _ => {}
    }
}

/// Finds texts that end as names of files do. Those that differ in `placed`, the request whose results are written elsewhere, are results.
fn other_files(value: &Value, placed: &Value, key: &str, found: &mut Vec<NamedInput>) {
    match (value, placed) {
        (Value::String(text), Value::String(other)) if text == other => {
            // Patterns stand for several files, settings for a key and its value, and a whole text for itself.
            let is_name = !text.contains(['*', '?', '{', '=', '\n']);
            if is_name && names_a_file(Path::new(text)) && !found.iter().any(|known| known.key == key) {
                found.push(NamedInput { key: key.to_owned(), kind: InputKind::File, name: text.clone() });
            }
        }
        (Value::Object(keys), Value::Object(others)) => {
            for (name, value) in keys {
                let other = others.get(name).unwrap_or(&Value::Null);
                other_files(value, other, &below(key, name), found);
            }
        }
        (Value::Array(items), Value::Array(others)) => {
            let items = items.iter().zip(others).enumerate();
            items.for_each(|(i, (item, other))| other_files(item, other, &below(key, &i.to_string()), found));
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::row;

    #[test]
    fn inputs_are_found_wherever_a_request_names_them_and_results_are_none() {
        let found = |job: &str, request: Value| {
            let row = row(job).unwrap();
            let inputs = row.named_inputs(&row.filled_in(request).unwrap()).unwrap();
            inputs.into_iter().map(|input| (input.key, input.kind, input.name)).collect::<Vec<_>>()
        };
        let of = |key: &str, kind: InputKind, name: &str| (key.to_owned(), kind, name.to_owned());
        assert_eq!(
            found("lens-optimize", json!({"start": {"new": {"lens": "a.toml", "out": "b.toml"}}})),
            [of("start.new.lens", InputKind::Lens, "a.toml")]
        );
        assert_eq!(
            found("lens-convert", json!({"from": "a.zmx", "to": "b.toml"})),
            [of("from", InputKind::Lens, "a.zmx")]
        );
        let raws = json!({"raws": ["a.tif", "b*.tif"], "frame": {"sensor": "s.toml"}, "set": ["a=b.csv"], "out": "developed.png"});
        assert_eq!(
            found("isp-develop", raws),
            [of("frame.sensor", InputKind::Sensor, "s.toml"), of("raws.0", InputKind::File, "a.tif")]
        );
        assert_eq!(
            found("design", json!({"run": {"new": {"experiment": "e.toml"}}})),
            [of("run.new.experiment", InputKind::Experiment, "e.toml")]
        );
    }
}
